"""A clip whose pictures an anamorphic lens squeezed to half their width."""

from __future__ import annotations

import struct
from pathlib import Path

import cv2
import numpy as np

from .. import planes
from ..pictures import with_chunks


def rolling(folder: Path, tagged: bool) -> Path:
    """A camera that walks, pans and rolls, in pictures of half their width, with or without their ratio."""
    folder.mkdir()
    for number, s in enumerate(np.linspace(-0.5, 0.5, 16), 1):
        turn = np.array([0.05 * np.sin(6 * s), 0.2 * s, 0.6 * s])
        picture = planes.view(np.array([1.5 * s, 0.3 * s * s, 0.3 * s]), turn)
        width, height = planes.SIZE
        half = cv2.resize(picture, (width // 2, height), interpolation=cv2.INTER_AREA)
        png = cv2.imencode(".png", half)[1].tobytes()
        png = with_chunks(png, pHYs=struct.pack(">IIB", 1, 2, 0)) if tagged else png
        (folder / f"s_{number:04d}.png").write_bytes(png)
    return folder
