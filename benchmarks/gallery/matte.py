"""The matte of moving subjects that a program drew a frame with, as it keeps it beside the solve."""

from __future__ import annotations

import zipfile
from pathlib import Path

import cv2
import numpy as np

from addon.core.base.store import LONGEST_SIDE, decoded

from .metrics import Mask

PART = "moving"
"""What the kept files' names begin with, and the name of the mask in them."""
SHARE, HALF = "share", 127
"""The name of a probability instead, and its value from which on a pixel is the subject's."""


def used(work: Path, frame: int, shape: tuple[int, ...]) -> Mask | None:
    """(H, W) the union of the mattes kept for a frame, of all subjects, at size `shape`.

    None where none is kept: the frame was drawn without one.
    """
    found: Mask | None = None
    for file in sorted(work.glob(f"depth/*/{PART}-*{frame:06d}.npz")):
        mask = _read(file)
        if mask is None:
            raise SystemExit(f"{file} is damaged, or kept in another way than this checkout reads")
        wide = cv2.resize(mask.astype(np.uint8), shape[1::-1], interpolation=cv2.INTER_NEAREST) > 0
        found = wide if found is None else found | wide
    return found


def _read(file: Path) -> Mask | None:
    try:
        with np.load(file) as held:
            kept = next(held[part] for part in (PART, SHARE) if part in held)
            plane, least = decoded(kept, LONGEST_SIDE), 0 if PART in held else HALF
    except (OSError, ValueError, StopIteration, zipfile.BadZipFile):
        return None
    return None if plane is None else np.asarray(np.asarray(plane, np.float32) > least)
