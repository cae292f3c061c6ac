"""A clip of blobs that slide by a known step."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from addon.core.media.clip import Footage, open_footage

from . import planes

Floats = NDArray[np.float64]

STEP = np.array([1.5, -0.75])


def gaussians(places: Floats, sigma: Floats, height: Floats, size: tuple[int, int]) -> NDArray[np.uint8]:
    """Blobs at places (n, 2) of a picture, which may lie between pixels."""
    x = np.exp(-(((np.arange(size[0]) + 0.5)[:, None] - places[:, 0]) ** 2) / (2 * sigma**2))
    y = np.exp(-(((np.arange(size[1]) + 0.5)[:, None] - places[:, 1]) ** 2) / (2 * sigma**2))
    grey = np.clip(np.rint(110 + (y * height) @ x.T), 0, 255).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2)


def sliding_clip(folder: Path) -> Footage:
    """A crowd of blobs that slides by `STEP` pixels a frame."""
    rng = np.random.default_rng(8)
    places = rng.uniform((-20, -20), (180, 140), (700, 2))
    sigma, height = rng.uniform(1.3, 4.0, 700), rng.choice([-1, 1], 700) * rng.uniform(15, 70, 700)
    clip = [gaussians(places + i * STEP, sigma, height, (160, 120)) for i in range(5)]
    return open_footage(planes.write_clip(folder / "clip", clip))
