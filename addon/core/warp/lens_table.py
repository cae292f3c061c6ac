"""A table of a lens with a rolling shutter, for pictures: its exact model is iterated for every point."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..base.arrays import Floats, Map
from ..camera.intrinsics import Intrinsics

NODES = 257
"""Nodes of the table in each direction. At 1280x720 the error is below 0.02 pixels for a k1 of -0.3
(tests/warp/test_lens_table.py)."""
BEYOND = 0.05
"""Share of the picture's rays by which the table reaches past them."""
KEPT = 64
"""Remembered tables, 530 kB each: those of the source frames around some frames."""


@dataclass(frozen=True)
class LensTable:
    """Offsets of pixels by the lens over a grid of rays."""

    first: Map
    """(2,) ray of the first node."""
    step: Map
    """(2,) from one node to the next."""
    offsets: Map
    """(NODES * NODES, 2) pixels between the lens's picture and a pinhole's, row by row."""
    focal: Map
    """(2,) pixels."""
    middle: Map
    """(2,) principal point in pixels."""

    @classmethod
    def of(cls, camera: Intrinsics) -> LensTable:
        """Tabulate a camera's lens."""
        along = np.linspace(0, 1, NODES)
        size = np.array([camera.width, camera.height])
        border = np.concatenate([
            np.stack(np.broadcast_arrays(*pair), axis=-1)
            for pair in ((along, 0.0), (along, 1.0), (0.0, along), (1.0, along))
        ])  # fmt: skip
        rays = camera.undistort((border * size - camera.principal_point) / camera.focal)
        low, high = np.nanmin(rays, axis=0), np.nanmax(rays, axis=0)
        low, high = low - BEYOND * (high - low), high + BEYOND * (high - low)
        axes = (np.linspace(*ends, NODES) for ends in zip(low, high, strict=True))
        nodes = np.stack(np.meshgrid(*axes), axis=-1)
        offsets = (camera.distort(nodes) - nodes) * camera.focal
        return cls(
            low.astype(np.float32), ((high - low) / (NODES - 1)).astype(np.float32),
            offsets.reshape(-1, 2).astype(np.float32),
            camera.focal.astype(np.float32), camera.principal_point.astype(np.float32),
        )  # fmt: skip

    def __call__(self, x: Map, y: Map) -> tuple[Map, Map]:
        """Return pixels x and y (n,) of rays x and y (n,); NaN past the table."""
        across, down = (x - self.first[0]) / self.step[0], (y - self.first[1]) / self.step[1]
        last = np.float32(NODES - 1)
        inside = (across >= 0) & (across < last) & (down >= 0) & (down < last)
        across, down = (np.where(inside, each, np.float32(0)) for each in (across, down))
        column, row = across.astype(np.int32), down.astype(np.int32)
        u, v = ((each - np.floor(each))[:, None] for each in (across, down))
        at = row * NODES + column
        upper = self.offsets[at] * (1 - u) + self.offsets[at + 1] * u
        lower = self.offsets[at + NODES] * (1 - u) + self.offsets[at + NODES + 1] * u
        offset = upper * (1 - v) + lower * v
        offset[~inside] = np.nan
        return (
            x * self.focal[0] + self.middle[0] + offset[:, 0],
            y * self.focal[1] + self.middle[1] + offset[:, 1],
        )


@lru_cache(maxsize=KEPT)
def lens_table(camera: Intrinsics) -> LensTable:
    """Return the table of a camera's lens, remembered."""
    return LensTable.of(camera)


def pixels(camera: Intrinsics, x: Map, y: Map) -> tuple[Map, Map]:
    """Return pixels x and y (n,) of a distorted camera for rays x and y (n,), float32.

    A rolling shutter is read from a table. NaN where the lens sees nothing.
    """
    if any(camera.readout) and camera.largest_turn:
        return lens_table(camera)(x, y)
    rays: Floats = camera.distort(np.stack([x, y], axis=-1).astype(np.float64))
    x, y = (rays * camera.focal + camera.principal_point).astype(np.float32).T
    return x, y
