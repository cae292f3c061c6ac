"""Networks of the user's own, ONNX files that OpenCV runs: a picture in, a map out."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.errors import UserError
from ..base.regular_file import read_regular
from ..base.side_by_side import Lock
from .light import encode_srgb, finite
from .picture_file import Pixels

NETWORK = ".onnx"
"""Ending of the files that are run."""
LARGEST = 4096
"""Pixels of a side that a network may ask for: such a picture takes 200 MB."""


@dataclass(frozen=True)
class Normal:
    """The pictures that a network was trained with."""

    mean: float | tuple[float, ...]
    """Mean of red, green and blue in [0, 1], which is subtracted."""
    deviation: float | tuple[float, ...]
    """Standard deviation, by which they are divided."""


IMAGENET = Normal((0.485, 0.456, 0.406), (0.229, 0.224, 0.225))
"""Those of MiDaS, Depth Anything and U2-Net."""

_PATH = (7, 11, 2, 1, 2)
"""Numbers of the fields of ONNX's protobuf from the model to its first input's shape: the graph, its inputs,
an input's type, as a tensor, its shape."""
_OUTPUT = (7, 12, 1)
"""Those to the name of its first output."""


class PictureNetwork:
    """A network that is ready to run; several threads may."""

    def __init__(
        self,
        path: Path,
        normal: Callable[[tuple[int, ...]], Normal],
        sizes: Sequence[tuple[int, int]],
        square: bool = False,
    ) -> None:
        """Load a network.

        Args:
            path: The file.
            normal: Returns the normalisation for the height and width that the file asks for, 0 for any;
                raises ValueError for those of another kind of network.
            sizes: Pixels of the long side, and those that both sides are multiples of, to try where the file
                takes any size.
            square: True to stretch pictures to a square there.

        Raises:
            UserError: There is no such file, OpenCV refuses it, or it takes no picture.
        """
        self.name = path.name
        self._lock, self._square = Lock(), square
        try:
            data = read_regular(path)
            with _refusals():
                self._net = cv2.dnn.readNetFromONNX(np.frombuffer(data, np.uint8))
            shape = _input_shape(data)
            if shape and (len(shape) != 4 or shape[1] not in (0, 3) or max(shape) > LARGEST):
                raise ValueError(f"its input is {_sides(shape)}, not a picture: 1 x 3 x height x width")
            self._sides = shape[2:] or (0, 0)
            self._normal = normal(self._sides)
            # Networks with several outputs give the finest one first.
            name = _at_path(data, _OUTPUT)
            self._output = "" if isinstance(name, int) else bytes(name).decode("utf-8", "replace")
        except (OSError, ValueError) as error:
            reason = (error.strerror if isinstance(error, OSError) else None) or error
            raise UserError(f"{path.name} cannot be read: {reason}") from error
        self._sizes = list(sizes if 0 in self._sides else sizes[:1])

    def run(self, picture: Pixels) -> NDArray[np.generic]:
        """Return the network's map (h, w) of a picture (H, W, 3 or 4) as stored.

        The map covers the picture at any size.

        Raises:
            ValueError: OpenCV cannot run the network, or its output is not a map.
        """
        with self._lock, _refusals():
            while True:
                try:
                    found = self._at(picture, *self._sizes[0])
                except cv2.error:
                    if len(self._sizes) == 1:
                        raise
                    self._sizes = self._sizes[1:]
                else:
                    # All maps of a clip are made alike.
                    self._sizes = self._sizes[:1]
                    return found

    def _at(self, picture: Pixels, long: int, step: int) -> NDArray[np.generic]:
        own = (1, 1) if self._square else picture.shape[:2]
        scale = long / max(own)
        height, width = (
            asked or max(round(side * scale / step), 1) * step
            for asked, side in zip(self._sides, own, strict=True)
        )
        colour = np.ascontiguousarray(finite(picture)[0][..., :3])
        how = cv2.INTER_AREA if max(colour.shape) > max(height, width) else cv2.INTER_LINEAR
        shown = _displayed(cv2.resize(colour, (width, height), interpolation=how))
        mean, deviation = (
            np.asarray(each, np.float32) for each in (self._normal.mean, self._normal.deviation)
        )
        normal = np.asarray((shown - mean) / deviation, np.float32)
        self._net.setInput(np.ascontiguousarray(normal.transpose(2, 0, 1)[None]))
        # OpenCV's own memory, which the next picture overwrites.
        found = np.array(self._net.forward(self._output))
        sides = [side for side in found.shape if side != 1]
        if len(sides) != 2:
            raise ValueError(f"its output is {_sides(found.shape)}, not one map: height x width")
        return found.reshape(sides)


@contextmanager
def _refusals() -> Iterator[None]:
    """OpenCV's errors as ValueError of one line, which has the layer that OpenCV names; no log."""
    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    except cv2.error as error:
        said = " ".join(re.sub(r"OpenCV\(\S*\) \S+ error: |\n>", " ", str(error)).split())
        raise ValueError(
            f"OpenCV {cv2.__version__} does not run it ({said}); run it elsewhere and use its depth"
            " maps or masks"
        ) from None
    finally:
        cv2.utils.logging.setLogLevel(level)


def _displayed(picture: Pixels) -> NDArray[np.floating]:
    """Display values in [0, 1] of a picture as stored: integers have them, floats are linear."""
    if picture.dtype == np.float32:
        return encode_srgb(np.clip(picture, 0, 1))
    return picture / np.float32(255 if picture.dtype == np.uint8 else 65535)


def _sides(shape: tuple[int, ...]) -> str:
    return " x ".join(str(side or "any") for side in shape)


def _input_shape(data: bytes) -> tuple[int, ...]:
    """The shape of the first input of an ONNX model, 0 for free sizes; empty if it has none.

    OpenCV does not report it. ValueError for bytes that are not a protobuf.
    """
    message = _at_path(data, _PATH)
    sides = [
        next((value for number, value in _fields(side) if number == 1), 0)
        for field, side in _fields(message) if field == 1
    ]  # fmt: skip
    # Some exporters write -1 for free sizes.
    return tuple(side if isinstance(side, int) and side < 1 << 63 else 0 for side in sides)


def _at_path(data: bytes, path: Sequence[int]) -> int | memoryview:
    """The first value of nested fields of a protobuf message; 0 if there is none."""
    message: int | memoryview = memoryview(data)
    for field in path:
        message = next((value for number, value in _fields(message) if number == field), 0)
    return message


def _fields(message: int | memoryview) -> Iterator[tuple[int, int | memoryview]]:
    """The numbers and values, whole numbers or bytes, of the fields of a protobuf message; none of a number.

    ValueError where it is none.
    """
    at = 0
    while not isinstance(message, int) and at < len(message):
        key, at = _varint(message, at)
        kind = key & 7
        if kind not in (0, 1, 2, 5):
            raise ValueError("it is damaged")
        value: int | memoryview
        if kind == 0:
            value, at = _varint(message, at)
        else:
            size, at = _varint(message, at) if kind == 2 else ({1: 8, 5: 4}[kind], at)
            value, at = message[at : at + size], at + size
        yield key >> 3, value


def _varint(message: memoryview, at: int) -> tuple[int, int]:
    """A whole number at a place of a protobuf message, seven bits a byte, and the place after it."""
    for end in range(at, min(at + 10, len(message))):
        if message[end] < 128:
            return sum((message[i] & 127) << 7 * (i - at) for i in range(at, end + 1)), end + 1
    raise ValueError("it is damaged")
