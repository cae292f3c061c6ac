"""Reading picture files: PNG, JPEG, TIFF and EXR, and the arrays that depth networks write."""

import io
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.errors import UserError
from ..base.npz import ArrayFile
from ..base.regular_file import open_regular, read_regular, regular_stat
from . import exr_parts
from .picture_tags import PictureTags, exr_tags, tags_of, turned

Pixels = NDArray[np.uint8] | NDArray[np.uint16] | NDArray[np.float32]
exr_decoder: Callable[[Path | bytes], NDArray[np.float32]] | None = None
"""Reads an EXR, a file or its bytes, as (H, W, 3 or 4) float32 RGB or RGBA, raising OSError, ValueError or
RuntimeError.

OpenCV's wheel has no OpenEXR. Blender's own decoder is set when the add-on is registered, pycolmap's when the
solving worker starts. OpenEXR's own wheel (3.5.3, 1.8 MB) reads all that Blender does a fifth faster, but on
Linux its C symbols are bound to the library that Blender has loaded already, which is of another version:
beside 3.4 two compressions were refused, beside 3.1 the process was aborted.
"""
PICTURES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".exr")
"""Endings of the files that are read."""
ARRAY = ".npz"
"""Ending of a file that holds a map as an array."""
ARRAYS = ("depths", "depth")
"""Names of this array: the first of Video-Depth-Anything and MegaSaM, the second of DepthCrafter, Depth-
Anything-3 and Depth Pro."""


class Picture(NamedTuple):
    """A picture file, upright."""

    pixels: Pixels
    """(H, W, 3 or 4) RGB or RGBA with square pixels: uint8, uint16, or float32 for EXR."""
    tags: PictureTags
    size: tuple[int, int]
    """Width and height in stored pixels."""


def read_picture(path: Path) -> Pixels:
    """Read a picture file, as `Picture.pixels`; errors as of `open_picture`."""
    return open_picture(path).pixels


def open_picture(path: Path, is_depth: bool = False, pixel_aspect: float = 0.0) -> Picture:
    """Read a picture file, with the values that it stores.

    Args:
        path: The file.
        is_depth: True for a depth map: among several layers of an EXR the one with depth counts.
        pixel_aspect: Width of a stored pixel by its height; 0 for the file's own.

    Raises:
        UserError: It cannot be read or decoded.
    """
    try:
        if regular_stat(path).st_size == 0:
            raise UserError(f"{path.name} is empty (0 bytes); export the sequence again")
        if path.suffix.lower() == ARRAY:
            return _shown(_read_array(path), PictureTags())
        if path.suffix.lower() == ".exr":
            return _read_exr(path, path.name, is_depth, pixel_aspect)
        return _decoded(read_regular(path), path.name, pixel_aspect)
    except OSError as error:
        raise UserError(
            f"{path} cannot be read: {error.strerror or error}; restore it or leave the frame out"
        ) from error


def decode_picture(data: bytes, name: str, is_depth: bool = False) -> Pixels:
    """Decode the bytes of a picture file, whose name gives its kind, like `read_picture`.

    Raises:
        UserError: It cannot be decoded.
    """
    if name.lower().endswith(".exr"):
        return _read_exr(data, name, is_depth).pixels
    return _decoded(data, name).pixels


def _decoded(data: bytes, name: str, pixel_aspect: float = 0.0) -> Picture:
    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED | cv2.IMREAD_ANYCOLOR)
    except cv2.error:
        picture = None
    finally:
        cv2.utils.logging.setLogLevel(level)
    if picture is None or (picture.ndim == 3 and picture.shape[2] > 4):
        raise UserError(f"{name} cannot be decoded; export this frame again or leave it out")
    if picture.dtype not in (np.uint8, np.uint16, np.float32):
        picture = picture.astype(np.float32)
    # OpenCV turns TIFF files alone, whichever way they are read, and others only without their alpha.
    tags = tags_of(data, picture.dtype == np.float32)
    return _shown(to_rgb(picture), tags, pixel_aspect, is_turned=data[:2] in (b"II", b"MM"))


def _shown(stored: Pixels, tags: PictureTags, pixel_aspect: float = 0.0, is_turned: bool = False) -> Picture:
    """A picture of stored pixels, which a decoder may have turned upright already."""
    upright: Pixels = stored if is_turned else turned(stored, tags.orientation)
    pixels = squared(upright, pixel_aspect or tags.pixel_aspect, tags.orientation > 4)
    return Picture(pixels, tags, (upright.shape[1], upright.shape[0]))


def squared(picture: Pixels, pixel_aspect: float, on_its_side: bool) -> Pixels:
    """Return a picture (H, W, 3 or 4) with square pixels; one that was turned keeps its stored width upright.

    `pixel_aspect` is the width of a stored pixel by its height, before the picture was turned.
    """
    height, width = picture.shape[:2]
    size = (width, round(height * pixel_aspect)) if on_its_side else (round(width * pixel_aspect), height)
    return picture if size == (width, height) else resized(picture, (max(size[0], 1), max(size[1], 1)))


def full_range(picture: Pixels) -> Pixels:
    """Return a picture (H, W, 3 or 4) of integers of the narrow range as uint16 of the full one."""
    if picture.dtype == np.float32:
        return picture
    step = picture.dtype.itemsize * 8 - 8
    colour = (picture[..., :3] - np.float32(16 << step)) * np.float32(65535 / (219 << step))
    alpha = picture[..., 3:].astype(np.float32) * np.float32(257 if step == 0 else 1)
    return np.concatenate([np.clip(colour, 0, 65535) + 0.5, alpha], axis=2).astype(np.uint16)


def resized(picture: Pixels, size: tuple[int, int]) -> Pixels:
    """Resample a picture (H, W, 3 or 4) to a size (width, height) in pixels."""
    shrinks = size[0] * size[1] < picture.shape[0] * picture.shape[1]
    # Around lights far beyond white, cubic curves would be far below black.
    enlarged = cv2.INTER_LINEAR if picture.dtype == np.float32 else cv2.INTER_CUBIC
    made: Pixels = cv2.resize(  # type: ignore[assignment]
        picture, size, interpolation=cv2.INTER_AREA if shrinks else enlarged
    )
    return made


def grey(values: NDArray[np.generic]) -> Pixels:
    """Return (h, w, 3) float32 of numbers (h, w)."""
    with np.errstate(over="ignore"):
        return np.repeat(values.astype(np.float32)[..., None], 3, axis=2)


def _read_exr(picture: Path | bytes, name: str, is_depth: bool, pixel_aspect: float = 0.0) -> Picture:
    if exr_decoder is None:
        raise UserError(f"{name} is an EXR, which can only be read inside Blender; convert it to 16-bit PNG")
    header = None
    try:
        with io.BytesIO(picture) if isinstance(picture, bytes) else open_regular(picture) as file:
            header = exr_parts.read_header(file)
        channel = exr_parts.depth_channel(header) if is_depth else None
        part = header.parts[channel.part if channel is not None else 0]
        if channel is not None and len(header.channels) > 1:
            data = picture if isinstance(picture, bytes) else read_regular(picture)
            picture = exr_parts.alone(data, header, channel)
        return _shown(exr_parts.placed(exr_decoder(picture), part), exr_tags(part), pixel_aspect)
    except exr_parts.LayerError as error:
        raise UserError(f"{name} cannot be used: {error}") from error
    except (OSError, ValueError, RuntimeError) as error:
        if not is_depth and header is not None and header.has_layers:
            raise UserError(
                f"{name} has layers, {exr_parts.listed(header.channels)}; frames and masks have one: save"
                " them as OpenEXR, not as Multi-Layer EXR"
            ) from error
        raise UserError(f"{name} cannot be decoded; export this frame again or leave it out") from error


def _read_array(path: Path) -> Pixels:
    try:
        array = ArrayFile(path, ARRAYS)
        if array.count == 1:
            return grey(array.read(0))
        problem = f"it has {array.count} maps, but each file in a folder should have one; choose the file"
        " itself"
    except ValueError as error:
        problem = str(error)
    raise UserError(f"{path.name} cannot be read: {problem}")


def to_rgb(picture: NDArray[np.generic]) -> Pixels:
    """Convert OpenCV's picture (H, W) or (H, W, 1 to 4), gray, BGR or BGRA, to RGB or RGBA."""
    channels = 1 if picture.ndim == 2 else picture.shape[2]
    if channels == 2:  # gray and alpha
        picture, channels = picture[..., [0, 0, 0, 1]], 4
    code = {1: cv2.COLOR_GRAY2RGB, 3: cv2.COLOR_BGR2RGB, 4: cv2.COLOR_BGRA2RGBA}[channels]
    return cv2.cvtColor(picture, code)  # type: ignore[no-any-return, call-overload]
