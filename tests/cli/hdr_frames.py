"""Frames of a plane that are brighter than white, and how they are rendered."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from addon.core.media.light import decode_srgb

from ..media.colour_curves import Array
from ..scenes import write_plane
from .tracked_plane import PLANE

LENS = ("--focus-point", 3, "--blur", 0.03)
SHOWN = 3


def filmed(folder: Path) -> list[Array]:
    """(90, 160, 3) linear light of the slanted plane's frames, up to six times white."""
    write_plane(folder, PLANE)
    pictures = [cv2.imread(str(file))[..., ::-1] / 255 for file in sorted(folder.iterdir())]
    return [decode_srgb(picture) * (1 + 5 * np.clip(4 * picture - 3, 0, 1)) for picture in pictures]
