"""Distance of subjects that touch no ground in the picture: those that its lower border cuts off."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest

from addon.core.base.arrays import Bytes, Floats, Mask
from addon.core.frame.highlights import HighlightSettings
from addon.core.subjects.standing import Standing

from ..scenes import texture
from . import walls
from .street import CAMERA, EYE, Street, person


def walker(distance: float, speed: float) -> tuple[Callable[[int], Mask], Callable[[int], Bytes]]:
    """A textured upright card at a distance before the walls of `walls`, cut off by the lower border.

    It moves by `speed` scene units a frame, and the camera by its own way. Its mask and pictures by frame.
    """
    own = cv2.GaussianBlur(texture(walls.WIDTH, walls.HEIGHT, 7), (0, 0), 1.0)
    times = walls.LENS.fx / distance

    def left(frame: int) -> float:
        return walls.LENS.cx + (speed * (frame - 16) - walls.camera(frame) - 0.15) * times

    def mask(frame: int) -> Mask:
        column = np.arange(walls.WIDTH)[None] - left(frame)
        row = np.arange(walls.HEIGHT)[:, None]
        return np.asarray((column >= 0) & (column < 0.5 * times) & (row >= 50))

    def picture(frame: int) -> Bytes:
        shift = np.array([[1, 0, left(frame)], [0, 1, 0.0]])
        moved = cv2.warpAffine(own, shift, (walls.WIDTH, walls.HEIGHT), borderMode=cv2.BORDER_REFLECT)
        return np.where(mask(frame)[..., None], moved, walls.still(frame)).astype(np.uint8)

    return mask, picture


@pytest.mark.parametrize(("distance", "speed"), [(2.0, 0.0), pytest.param(3.0, 0.09, marks=pytest.mark.long)])
def test_one_that_the_lower_border_cuts_off_is_nearer_than_all_that_it_hides(
    distance: float, speed: float
) -> None:
    mask, picture = walker(distance, speed)
    clip = replace(walls.filmed(picture), masks=lambda frame: mask(frame).astype(np.float32))
    found = clip.depth(16, clip.canvas(16), clip.picture(16, HighlightSettings(gain=0)))
    away = 1 / float(np.median(found.inverse_depth[mask(16)]))
    assert walls.NEAR / 2 < away < walls.NEAR


def test_one_that_is_cut_off_is_nearer_than_the_ground_at_the_border() -> None:
    ground = CAMERA.fy * EYE / (CAMERA.height - CAMERA.cy)
    for blind in ((), (0, 1)):
        street = Street(frozenset(blind))
        standing = Standing(street, lambda frame: person(2.0, frame))  # type: ignore[arg-type]
        found = standing.bounds(lambda frame: person(2.0, frame), [0, 1])
        least = 0.05 if blind else 1 / ground
        assert all(least < value < 1.4 * least for value in found.values())
        assert set(found) == {0, 1}


@pytest.mark.parametrize("distance", [1.6, 2.2])
def test_a_person_cut_off_by_the_border_stands_on_the_ground_below_the_picture(distance: float) -> None:
    street = Street()

    def feet(frame: int, subject: Mask) -> Floats:
        return np.array([0.5 - 0.2 * frame * CAMERA.fx / distance / CAMERA.width,
                         (CAMERA.cy + CAMERA.fy * EYE / distance) / CAMERA.height])  # fmt: skip

    standing = Standing(street, lambda frame: person(distance, frame), feet)  # type: ignore[arg-type]
    assert person(distance, 0)[-1].any()
    found = standing.inverse_depths(lambda frame: person(distance, frame), [0, 1])
    assert found == {frame: pytest.approx(1 / distance, rel=0.03) for frame in (0, 1)}
