"""The focus before anybody has picked one."""

from __future__ import annotations

import numpy as np

from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.focus.place import first_place

LENS = Intrinsics(320, 180, 280.0, 280.0, 160.0, 90.0)
RNG = np.random.default_rng(2)


def at(depth: float, left: float, top: float, right: float, bottom: float, count: int) -> np.ndarray:
    """(count, 3) points of this depth that the camera sees in a part of the picture, shares of it."""
    xy = RNG.uniform([left, top], [right, bottom], (count, 2)) * [LENS.width, LENS.height]
    return np.column_stack([(xy - LENS.principal_point) / LENS.focal, np.ones(count)]) * depth


def solve(*parts: np.ndarray) -> Reconstruction:
    xyz = np.concatenate(parts) if parts else np.zeros((0, 3))
    image = Image(1, np.eye(3), np.zeros(3), LENS.project(xyz), np.arange(len(xyz), dtype=np.int32))
    return Reconstruction(
        (LENS,), (image,), Points(xyz, np.zeros((len(xyz), 3), np.uint8), np.zeros(len(xyz)))
    )


WALL = at(20.0, 0, 0, 1, 1, 300)
FIGURE = at(5.0, 0.4, 0.25, 0.6, 0.8, 60)


def test_the_nearest_large_thing_round_the_middle() -> None:
    found = first_place(solve(WALL, FIGURE), 1)
    assert found is not None and abs(found.distance - 5.0) < 0.1
    assert len(found.focus.points) == 4 and min(found.focus.points) >= len(WALL)
    assert found.xy is not None and 0.4 <= found.xy[0] <= 0.6


def test_neither_strays_nor_the_border_nor_texture_count() -> None:
    stray = at(1.5, 0.4, 0.4, 0.6, 0.6, 3)
    # A fence post at the border, and a small thing full of features.
    post, label = at(2.0, 0.0, 0.0, 0.1, 1.0, 200), at(3.0, 0.3, 0.3, 0.33, 0.33, 300)
    found = first_place(solve(WALL, FIGURE, stray, post, label), 1)
    assert found is not None and abs(found.distance - 5.0) < 0.1


def test_without_a_large_thing_the_largest_is_taken() -> None:
    found = first_place(solve(WALL), 1)
    assert found is not None and abs(found.distance - 20.0) < 0.1
    assert first_place(solve(), 1) is None
    few = first_place(solve(at(4.0, 0.0, 0.0, 0.1, 0.1, 3)), 1)
    assert few is not None and abs(few.distance - 4.0) < 0.1
