"""The user's masks of what moves by itself: found, read, and brought to the size of the clip."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Mask
from ..base.errors import UserError
from .clip import Footage
from .picture_file import PICTURES, Pixels
from .side_files import SideFiles


@dataclass(frozen=True)
class Masks(SideFiles):
    """The masks of a clip."""

    KIND = "mask"
    WITHOUT = "; there, what moves is only found"

    def at(self, frame: int) -> Mask | None:
        """(H, W) over the clip's picture, True where it moves by itself; None for a frame without a mask.

        UserError naming the file if it cannot be read.
        """
        if frame not in self.numbers:
            return None
        picture = self.stored(frame)
        shrinks = picture.shape[1] > self.footage.width
        how = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
        size = (self.footage.width, self.footage.height)
        return np.asarray(cv2.resize(_white(picture), size, interpolation=how) > 0.5)


def open_masks(path: Path, footage: Footage) -> Masks:
    """Find the masks of a clip: a folder, a pattern such as `mask_####.png`, or one picture of a sequence.

    White moves by itself, black stands still; a transparent pixel is black. `side_files.match_frames` tells
    whose they are. Raises UserError where there is no mask or none fits a frame.
    """
    return Masks.of(_pattern(path), footage)


def _pattern(path: Path) -> Path:
    """For one picture of a sequence the pattern of all of them; else the path itself."""
    if path.suffix.lower() not in PICTURES or not path.is_file():
        return path
    found = re.fullmatch(r"(.*?)(\d+)(\D*)", path.stem)
    if found is None:
        raise UserError(
            f"masks: {path.name} has no frame number; name masks like mask_0001.png, one for each frame"
        )
    before, number, after = found.groups()
    return path.with_name(f"{before}{'#' * len(number)}{after}{path.suffix}")


def _white(picture: Pixels) -> NDArray[np.float32]:
    """(h, w) how white a picture (h, w, 3 or 4) as stored is, from 0 to 1."""
    top = {"uint8": 255, "uint16": 65535}.get(picture.dtype.name, 1)
    share = np.asarray(picture, np.float32) / np.float32(top)
    white = share[..., :3].mean(axis=2)
    if picture.shape[2] == 4 and top > 1:
        # EXR is premultiplied in the file.
        white *= share[..., 3]
    return np.asarray(np.nan_to_num(white), np.float32)
