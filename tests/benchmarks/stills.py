"""Stages, edges and pictures of no scene, for the thesis's figures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sample_scenes.stage import Cameras, Edge, Stage


def edge(name: str, *ends: tuple[float, float, float]) -> Edge:
    """An edge between two ends."""
    return Edge(name, np.array(ends, dtype=np.float64))


def still(width: int, height: int, focal: float, frames: int = 1) -> Stage:
    """Cameras that all stand at the origin and look along z, and nothing to see."""
    cameras = Cameras(width, height, focal, np.tile(np.eye(3), (frames, 1, 1)), np.zeros((frames, 3)))
    return Stage("still", "", cameras, (), np.tile([0.0, 0.0, 2.0], (frames, 1)))


def noise(height: int, width: int, seed: int = 0) -> NDArray[np.uint8]:
    """(height, width, 3), another for each seed."""
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)
