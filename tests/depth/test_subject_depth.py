"""Subjects stand upright: cards on a level ground before a pinhole camera, whose depth is known."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import pytest

from addon.core.base.arrays import Floats, Map, Mask
from addon.core.camera.intrinsics import Intrinsics
from addon.core.depth.ground_contact import Plane, ground_below
from addon.core.depth.multi_view_stereo import DenseDepth
from addon.core.depth.source import SURE
from addon.core.depth.subject_depth import with_subjects

CAMERA = Intrinsics(480, 360, 240.0, 240.0, 240.0, 180.0)
EYE = 1.5
"""Metres from the ground to the camera."""
WALL = 9.0
"""Metres to what stands behind everything."""


def turned(pitch: float) -> Floats:
    """(3, 3) from a level camera's space to that of one that looks down by so many degrees."""
    cosine, sine = np.cos(np.radians(pitch)), np.sin(np.radians(pitch))
    return np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])


def rays() -> Floats:
    across, down = np.meshgrid(np.arange(CAMERA.width) + 0.5, np.arange(CAMERA.height) + 0.5)
    return CAMERA.rays(np.stack([across, down], axis=-1))


def street(pitch: float = 0.0) -> Map:
    """(h, w) inverse depth of the ground and the wall."""
    ground = Plane(turned(pitch) @ [0, 1 / EYE, 0]).inverse_depth(rays())
    wall = Plane(turned(pitch) @ [0, 0, 1 / WALL]).inverse_depth(rays())
    return np.maximum(ground, wall).astype(np.float32)


def card(
    corners: Sequence[tuple[float, float]], lifted: float = 0.0, height: float = 1.0, pitch: float = 0.0
) -> tuple[Mask, Floats]:
    """(h, w) an upright card between two places (right, forward) of the ground, in metres, and its inverse
    depth everywhere."""
    (left, near), (right, far) = corners
    feet = np.array([[left, EYE - lifted, near], [right, EYE - lifted, far]])
    quad = np.concatenate([feet, feet[::-1] - [0, height, 0]]) @ turned(pitch).T
    mask = np.zeros((CAMERA.height, CAMERA.width), np.uint8)
    at = np.rint((CAMERA.project(quad) - 0.5) * 16).astype(np.int32)
    cv2.fillConvexPoly(mask, at, 1, shift=4)
    normal = np.cross(quad[1] - quad[0], quad[3] - quad[0])
    return mask > 0, Plane(normal / (normal @ quad[0])).inverse_depth(rays())


def placed(
    inverse: Map,
    moving: Mask,
    subjects: Sequence[tuple[Mask, float | None]] = (),
    confidence: Map | None = None,
    pinhole: Intrinsics = CAMERA,
) -> tuple[Map, Map]:
    """Inverse depth and confidence (h, w) of all pixels, over a grey picture."""
    sure = np.ones_like(inverse) if confidence is None else confidence
    static = DenseDepth(1, inverse, np.where(moving, np.float32(0), sure), moving, pinhole)
    picture = np.full((*inverse.shape, 3), 90, np.uint8)
    found = with_subjects(static, picture, subjects)
    np.testing.assert_array_equal(found.moving, moving)
    np.testing.assert_array_equal(found.inverse_depth[~moving], inverse[~moving])
    return found.inverse_depth, found.confidence


def off(depth: Map, true: Floats, mask: Mask) -> float:
    """The largest error of an inverse depth, as share of the true one."""
    return float(np.abs(depth / true - 1)[mask].max())


@pytest.mark.parametrize("pitch", [0, 15], ids=["level", "from above"])
@pytest.mark.parametrize("far", [3.0, 3.6, 2.4], ids=["facing", "right side farther", "right side nearer"])
def test_a_subject_is_upright_on_its_line_of_contact(far: float, pitch: float) -> None:
    """Cars at an angle and animals from the side have no single depth."""
    mask, true = card([(-0.8, 3.0), (0.8, far)], pitch=pitch)
    depth, _ = placed(street(pitch), mask)
    assert off(depth, true, mask) < 0.05


def test_a_wall_that_hides_the_feet_is_no_ground() -> None:
    inverse = street()
    low, wall = card([(-2.0, 2.2), (2.0, 2.2)], height=0.7)
    inverse[low] = wall[low]
    body = card([(-0.3, 4.0), (0.3, 4.0)], height=1.7)[0] & ~low
    known = ~cv2.dilate(body.astype(np.uint8), np.ones((7, 7), np.uint8)).astype(bool) & low
    assert ground_below(body, inverse, known, CAMERA) is None


def test_a_rail_before_a_subject_is_no_ground() -> None:
    """So low a plane leans by its noise, as much as ground does; below the feet one looks past it."""
    mask, true = card([(-0.6, 4.0), (0.6, 4.0)], height=1.0)
    inverse, bottom = street(), int(np.flatnonzero(mask.any(axis=1))[-1])
    rail = np.s_[bottom + 9 : bottom + 35]
    leaning = Plane(0.7 * np.array([0.0, 0.55, 0.8])).inverse_depth(rays())
    inverse[rail] = leaning[rail]
    apart = cv2.dilate(mask.astype(np.uint8), np.ones((7, 7), np.uint8)) == 0
    found = ground_below(mask, inverse, apart, CAMERA)
    assert found is None or abs(found.normal[1] - 1 / EYE) < 0.01
    depth, _ = placed(inverse, mask)
    assert off(depth, true, mask) < 0.05


def test_a_subject_of_known_distance_is_upright_there() -> None:
    """In the air, the ground below it is behind it."""
    mask, true = card([(-0.4, 3.0), (0.4, 3.0)], lifted=0.3, height=1.4)
    depth, _ = placed(street(), mask, [(mask, 1 / 3)])
    assert np.median(depth[mask]) == pytest.approx(1 / 3) and off(depth, true, mask) < 0.02
    alone, _ = placed(street(), mask, [(mask, None)])
    assert off(alone, true, mask) > 0.15


def test_subjects_that_touch_have_their_own_distances() -> None:
    near, far = card([(-0.6, 2.5), (0.0, 2.5)], height=1.6), card([(-0.1, 4.0), (0.8, 4.0)], height=1.9)
    # The first subject has the pixels of both.
    subjects = [(near[0], None), (far[0], None)]
    depth, _ = placed(street(), near[0] | far[0], subjects)
    behind = far[0] & ~near[0]
    assert off(depth, near[1], near[0]) < 0.03 and off(depth, far[1], behind) < 0.03


@pytest.mark.parametrize("known", [None, 0.3])
def test_confidence_is_that_of_the_subjects_distance(known: float | None) -> None:
    """What stereo matches within a moving subject has no influence."""
    inverse = np.tile(np.linspace(0.1, 0.4, 100, dtype=np.float32)[:, None], (1, 120))
    moving = np.zeros((100, 120), bool)
    moving[20:80, 20:60] = True
    pinhole = Intrinsics(120, 100, 2000.0, 2000.0, 60.0, 50.0)
    _, confidence = placed(inverse, moving, [(moving, known)], pinhole=pinhole)
    assert np.ptp(confidence[moving]) == 0 and SURE < confidence[moving].max() <= 0.25
    unsure = np.zeros_like(inverse)
    _, confidence = placed(inverse, moving, [(moving, None)], unsure, pinhole)
    assert not confidence.any()
