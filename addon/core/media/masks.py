"""The user's masks of moving pixels, read and scaled to the clip."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from ..base.arrays import Map
from ..base.errors import UserError
from .clip import Footage
from .picture_file import PICTURES, Pixels
from .sequence import pattern_of
from .side_files import SideFiles


@dataclass(frozen=True)
class Masks(SideFiles):
    """The masks of a clip."""

    KIND = "mask"
    WITHOUT = "; moving objects are found automatically there"

    def at(self, frame: int) -> Map | None:
        """Return the opacity (H, W) in [0, 1] of moving pixels over the clip's picture; None without a mask.

        Raises:
            UserError: The file, which is named, cannot be read.
        """
        if frame not in self.numbers:
            return None
        picture = self.stored(frame)
        shrinks = picture.shape[1] > self.footage.width
        how = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
        size = (self.footage.width, self.footage.height)
        return np.asarray(np.clip(cv2.resize(_opacity(picture), size, interpolation=how), 0, 1), np.float32)


def open_masks(path: Path, footage: Footage) -> Masks:
    """Open the masks of a clip: a folder, a pattern such as `mask_####.png`, or one picture of a sequence.

    White moves, black is static, and gray is a share. The alpha of a picture with any transparency is its
    mask, whatever its colours are: a cut-out. `side_files.match_frames` assigns files to frames.

    Raises:
        UserError: There is no mask, or none fits a frame.
    """
    return Masks.of(_pattern(path), footage)


def _pattern(path: Path) -> Path:
    """For one picture of a sequence the pattern of all of them; else the path itself."""
    if path.suffix.lower() not in PICTURES or not path.is_file():
        return path
    pattern = pattern_of(path)
    if pattern is None:
        raise UserError(
            f"masks: {path.name} has no frame number; name masks like mask_0001.png, one for each frame"
        )
    return pattern


def _opacity(picture: Pixels) -> Map:
    """(h, w) opacity in [0, 1] of a picture (h, w, 3 or 4): its alpha, or its brightness if alpha is 1."""
    top = {"uint8": 255, "uint16": 65535}.get(picture.dtype.name, 1)
    share = np.nan_to_num(np.asarray(picture, np.float32) / np.float32(top))
    has_alpha = picture.shape[2] == 4 and share[..., 3].min(initial=1) < 1
    return np.asarray(share[..., 3] if has_alpha else share[..., :3].mean(axis=2), np.float32)
