"""The user's own depth maps, read from files or made by a network. `map_fit` finds their kind and unit."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import UserError
from ..base.progress import checkpoint
from ..base.side_by_side import Lock
from ..media.clip import DEPTH_MAP, Footage, describe
from ..media.onnx_network import IMAGENET, NETWORK, PictureNetwork
from ..media.packed_pictures import PackedPictures
from ..media.picture_file import Pixels, grey
from ..media.side_files import SideFiles

SIZES = ((518, 14), (384, 32))
"""Pixels of the long side, and those that both sides are multiples of, for networks that take any size: Depth
Anything's, then MiDaS's, as their authors run them."""
GREY_TOLERANCE = 0.01
"""Relative difference between the channels of a gray picture. Chosen by inspection, for lossy files."""
GREY_STEPS = 2
"""Steps of whole numbers by which channels of a grey picture may differ besides. Chosen by inspection, for
lossy files."""


@dataclass(frozen=True)
class DepthMap:
    """One map as its file has it."""

    frame: int
    name: str
    """Name of its file, for messages."""
    values: Floats
    """(h, w) as stored, NaN where nothing is known; 0 is infinitely far, or nothing in maps of depth."""
    width: int
    """Pixels of the clip's picture across; a map of any size covers all of it."""
    height: int
    """Pixels of the clip's picture down."""

    def at(self, xy: Floats) -> Floats:
        """Return (n,) values at (n, 2) pixels of the clip's picture, from the nearest pixel of the map."""
        rows, columns = self.values.shape
        place = np.floor(xy * [columns / self.width, rows / self.height]).astype(int)
        return np.asarray(
            self.values[np.clip(place[:, 1], 0, rows - 1), np.clip(place[:, 0], 0, columns - 1)]
        )


@dataclass(frozen=True)
class DepthMaps(SideFiles):
    """The depth maps of a clip."""

    KIND = DEPTH_MAP

    def __reduce__(self) -> tuple[object, ...]:
        return open_depth, (self.pictures.path, self.footage)

    def read(self, frame: int) -> DepthMap:
        """Return the map of one of the clip's frames; UserError where there is none or it holds no depth."""
        if frame not in self.numbers:
            raise UserError(
                f"frame {frame} has no depth map in {self.pictures.path.name}; there are maps for"
                f" {describe(self.frames)}"
            )
        number = self.numbers[frame]
        maps = self.pictures
        name = maps.file(number).name if maps.files else f"frame {number} of {maps.path.name}"
        values = _values(self.stored(frame), name)
        return DepthMap(frame, name, values, self.footage.width, self.footage.height)


def open_depth(path: Path, footage: Footage) -> DepthMaps:
    """Open the depth maps of a clip, which `side_files.match_frames` assigns to frames.

    Args:
        path: A folder, or a pattern such as `depth_####.exr`, of EXR, 16-bit PNG or .npz; one .npz or .zip of
            all; or a network (.onnx) that makes them from the clip's pictures.
        footage: The clip.

    Raises:
        UserError: There are no maps, none fits a frame, or the network cannot be read or run.
    """
    if path.suffix.lower() == NETWORK:
        maps = DepthMaps(footage, open_network(path, footage), {each: each for each in footage.frames})
    else:
        maps = DepthMaps.of(path, footage)
    if maps.stored(maps.frames[0]).dtype != np.uint8:
        return maps
    note = "the depth maps have 8 bits, only 256 steps from near to far; 16-bit PNG or EXR is smoother"
    return replace(maps, notes=(*maps.notes, note))


def open_network(path: Path, clip: Footage) -> PackedPictures:
    """Open a network as the source of a clip's maps, (h, w, 3) gray float32 a frame, made on demand.

    Raises:
        UserError: The network cannot be read.
    """
    try:
        network = PictureNetwork(path, lambda sides: IMAGENET, SIZES)
    except UserError as error:
        raise UserError(f"depth maps: {error}") from error
    # A second reader: reading frames around one would make the clip's own reader seek.
    own, lock = replace(clip), Lock()

    def decode(frame: int) -> Pixels:
        with lock:
            picture = own.read(frame)
        checkpoint()
        return grey(network.run(picture))

    return PackedPictures(path, clip.frames, clip.width, clip.height, clip.fps, decode=decode)


def _values(picture: NDArray[np.generic], name: str) -> Floats:
    """(h, w) values of a gray picture (h, w, 3 or 4) as stored, NaN in unknown pixels.

    Unknown are values that are 0, not finite or transparent. Floats may be 0 if none is negative: networks of
    inverse depth clip far things.
    """
    colour = np.asarray(picture[..., :3], dtype=np.float64)
    values = colour[..., 0]
    known = np.isfinite(values) & (values != 0)
    if picture.dtype == np.float32 and known.any() and values[known].min() > 0:
        known |= values == 0
    if picture.shape[2] == 4:
        known &= np.asarray(picture[..., 3] != 0)
    if not (known & (values != 0)).any():
        raise UserError(f"{name} has no depth: every pixel is 0, infinite, NaN or transparent")
    steps = 0 if picture.dtype == np.float32 else GREY_STEPS
    apart = np.abs(colour[known] - values[known, None]).max(axis=-1)
    if np.median(apart - GREY_TOLERANCE * np.abs(values[known])) > steps:
        raise UserError(f"{name} is a color picture, not a depth map; depth maps are gray")
    return np.where(known, values, np.nan)
