"""Distance of subjects that touch no ground in the picture: those that its lower border cuts off."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest

from addon.core.base.arrays import Bytes, Mask
from addon.core.depth.ground_contact import Plane
from addon.core.depth.multi_view_stereo import DenseDepth
from addon.core.depth.subject_depth import with_subjects
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


@pytest.mark.parametrize(("distance", "speed"), [(2.0, 0.0), (3.0, 0.09)])
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


def test_in_one_picture_one_that_is_cut_off_is_nearer_than_what_is_beside_it() -> None:
    rows = np.arange(CAMERA.height) + 0.5 - CAMERA.cy
    inverse = np.repeat(np.maximum(rows / CAMERA.fy / EYE, 0.05)[:, None], CAMERA.width, 1).astype(np.float32)
    mask = person(2.0, 0)
    sure = np.where(mask, 0, 1).astype(np.float32)
    static = DenseDepth(1, inverse, sure, mask, CAMERA)
    found = with_subjects(static, np.full((*mask.shape, 3), 90, np.uint8), [])
    border = float(Plane(np.array([0, 1 / EYE, 0])).inverse_depth(CAMERA.rays(np.array([[160.0, 180]])))[0])
    assert border < found.inverse_depth[mask].min() <= found.inverse_depth[mask].max() < 1.4 * border
