"""What moves is put where it stands: upright cards on a level ground before a pinhole camera, whose depth is
known."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cv2
import numpy as np
import pytest

from addon.core.base.arrays import Floats, Map, Mask
from addon.core.camera.intrinsics import Intrinsics
from addon.core.depth.completion import CompletionOptions
from addon.core.depth.ground_contact import Plane, ground_below, rays_of
from addon.core.depth.moving_objects import MovingObjectOptions, place_moving_objects
from addon.core.depth.object_tracks import MovingObject, OverlapTrack, Sighting, separated
from addon.core.depth.source import SURE

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
    return rays_of(CAMERA, np.stack([across, down], axis=-1))


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
    inverse: Map, objects: Sequence[MovingObject], confidence: Map | None = None, pinhole: Intrinsics = CAMERA
) -> tuple[Map, Map, Mask]:
    guide, nothing = np.full(inverse.shape, 90, np.float32), np.zeros(inverse.shape, bool)
    sure = np.ones_like(inverse) if confidence is None else confidence
    return place_moving_objects(
        guide, inverse, sure, objects, nothing, pinhole, CompletionOptions(), MovingObjectOptions()
    )


def around(seen: dict[int, Mask]) -> Callable[[int], Sighting | None]:
    """Masks by steps, of a camera that stands still."""

    def sighting(steps: int) -> Sighting | None:
        mask = seen.get(steps)
        return None if mask is None else Sighting(3 * steps, mask, CAMERA, np.eye(3), np.zeros(3))

    return sighting


def off(depth: Map, true: Floats, mask: Mask) -> float:
    """The largest error of an inverse depth, as share of the true one."""
    return float(np.abs(depth / true - 1)[mask].max())


@pytest.mark.parametrize("pitch", [0, 15], ids=["level", "from above"])
@pytest.mark.parametrize("far", [3.0, 3.6, 2.4], ids=["facing", "right side farther", "right side nearer"])
def test_a_thing_is_upright_on_the_line_along_which_it_touches_the_ground(far: float, pitch: float) -> None:
    """A car at an angle, an animal from the side: no single depth. Seen from above, its head is no farther
    than its feet."""
    mask, true = card([(-0.8, 3.0), (0.8, far)], pitch=pitch)
    depth, _, found = placed(street(pitch), [MovingObject(mask)])
    assert off(depth, true, mask) < 0.05
    np.testing.assert_array_equal(found, mask)


def test_a_thing_that_jumps_stays_where_it_was() -> None:
    """In the air, the ground that is seen below it is that far behind it."""
    ground, lifted = card([(-0.3, 3.0), (0.3, 3.0)]), card([(-0.3, 3.0), (0.3, 3.0)], lifted=0.3)
    alone, _, _ = placed(street(), [MovingObject(lifted[0])])
    assert off(alone, lifted[1], lifted[0]) > 0.15
    seen = around(dict.fromkeys((-2, -1, 1, 2), ground[0]))
    followed, _, _ = placed(street(), [MovingObject(lifted[0], seen)])
    assert off(followed, lifted[1], lifted[0]) < 0.03


def test_a_thing_whose_feet_leave_the_picture_comes_nearer_as_it_grows() -> None:
    cards = {}
    for steps in range(-9, 1):
        away = 2.0 - 0.12 * steps
        cards[steps] = card([(-0.25, away), (0.25, away)], height=1.7)
    mask, true = cards[0]
    assert mask[-1].any()
    seen = around({steps: other[0] for steps, other in cards.items() if steps})
    depth, _, _ = placed(street(), [MovingObject(mask, seen)])
    # Sizes are tried 3 % apart, and pixels are 1 % of a distance.
    assert off(depth, true, mask) < 0.07
    alone, _, _ = placed(street(), [MovingObject(mask)])
    assert off(alone, true, mask) > 0.3


def test_a_wall_that_hides_the_feet_is_no_ground() -> None:
    inverse = street()
    low, wall = card([(-2.0, 2.2), (2.0, 2.2)], height=0.7)
    inverse[low] = wall[low]
    body = card([(-0.3, 4.0), (0.3, 4.0)], height=1.7)[0] & ~low
    known = ~cv2.dilate(body.astype(np.uint8), np.ones((7, 7), np.uint8)).astype(bool) & low
    assert ground_below(body, inverse, known, CAMERA) is None


def test_a_rail_before_a_thing_is_no_ground() -> None:
    """So low a plane leans by what noise there is, here as much as ground does; below the feet one looks past
    it."""
    mask, true = card([(-0.6, 4.0), (0.6, 4.0)], height=1.0)
    inverse, bottom = street(), int(np.flatnonzero(mask.any(axis=1))[-1])
    rail = np.s_[bottom + 9 : bottom + 35]
    leaning = Plane(0.7 * np.array([0.0, 0.55, 0.8])).inverse_depth(rays())
    inverse[rail] = leaning[rail]
    apart = cv2.dilate(mask.astype(np.uint8), np.ones((7, 7), np.uint8)) == 0
    found = ground_below(mask, inverse, apart, CAMERA)
    assert found is None or abs(found.normal[1] - 1 / EYE) < 0.01
    depth, _, _ = placed(inverse, separated_as_one(mask))
    assert off(depth, true, mask) < 0.05


def test_a_thing_whose_depth_is_known_is_upright_there() -> None:
    """As focus follows it, whatever one frame tells."""
    mask, true = card([(-0.4, 3.0), (0.4, 3.0)], lifted=0.3, height=1.4)
    depth, _, _ = placed(street(), [MovingObject(mask, inverse_depth=1 / 3)])
    assert np.median(depth[mask]) == pytest.approx(1 / 3) and off(depth, true, mask) < 0.02


def test_two_feet_tell_nothing_of_the_sides_of_who_is_tall() -> None:
    left, right = card([(-0.3, 3.0), (-0.1, 3.0)], height=1.6), card([(0.1, 3.25), (0.3, 3.25)], height=1.6)
    mask = left[0] | right[0]
    depth, _, _ = placed(street(), separated_as_one(mask))
    assert np.ptp(depth[mask]) < 0.02


def test_subjects_that_touch_stand_each_where_it_does() -> None:
    near, far = card([(-0.6, 2.5), (0.0, 2.5)], height=1.6), card([(-0.1, 4.0), (0.8, 4.0)], height=1.9)
    behind = far[0] & ~near[0]
    told, rest = separated(near[0] | far[0], [near[0], behind])
    assert not rest
    depth, _, _ = placed(street(), [MovingObject(mask) for mask in told])
    assert off(depth, near[1], near[0]) < 0.03 and off(depth, far[1], behind) < 0.03


def test_what_stands_before_a_subject_does_not_part_it() -> None:
    """Its upper part alone would hover."""
    mask, true = card([(-0.4, 3.5), (0.4, 3.5)], height=1.7)
    pole = np.zeros_like(mask)
    pole[210:246] = True
    told, _ = separated(mask & ~pole, [mask])
    inverse = street()
    inverse[pole] = 0.6
    depth, _, _ = placed(inverse, [MovingObject(told[0])])
    assert off(depth, true, mask & ~pole) < 0.03
    parts = separated(mask & ~pole, [])[1]
    assert len(parts) == 2


def test_a_thing_is_followed_until_it_meets_another() -> None:
    def at(x: float) -> Mask:
        return card([(x, 3.0), (x + 0.5, 3.0)])[0]

    alone = [at(-1.5 + 0.2 * steps) for steps in range(6)]
    other = at(-0.2)
    track = OverlapTrack(alone[0], lambda steps: alone[steps] | other if 0 <= steps < 6 else None)
    np.testing.assert_array_equal(track.at(3), alone[3])
    assert track.at(5) is None and track.at(-1) is None


def separated_as_one(mask: Mask) -> list[MovingObject]:
    return [MovingObject(told) for told in separated(mask, [mask])[0]]


def ramp() -> Map:
    """(100, 120) inverse depth of ground that rises towards the camera."""
    return np.tile(np.linspace(0.1, 0.4, 100, dtype=np.float32)[:, None], (1, 120))


RAMP = Intrinsics(120, 100, 2000.0, 2000.0, 60.0, 50.0)


def parts(moving: Mask) -> list[MovingObject]:
    return [MovingObject(mask) for mask in separated(moving, [])[1]]


def test_one_depth_for_each_thing_and_holes_that_show_what_is_behind() -> None:
    sure = np.ones((100, 120), np.float32)
    inverse = ramp()
    moving = np.zeros((100, 120), bool)
    moving[20:80, 20:60] = True
    moving[40:50, 30:40] = False
    moving[60:65, 30:40] = False
    # The ground rises towards the camera: through the upper hole it is seen, the lower one seems nearer.
    inverse[60:65, 30:40] = 0.9
    moving[30:50, 80:110] = True
    depth, confidence, found = placed(inverse, parts(moving), sure, RAMP)
    for thing, ground in ((np.s_[20:80, 20:60], inverse[82, 0]), (np.s_[30:50, 80:110], inverse[52, 0])):
        own = depth[thing][found[thing]]
        np.testing.assert_allclose(own, own[0], rtol=0.02)
        assert abs(own[0] - ground) < 0.02
    assert not found[40:50, 30:40].any() and found[60:65, 30:40].all()
    np.testing.assert_array_equal(depth[~found], inverse[~found])
    assert confidence[found].max() <= 0.25


@pytest.mark.parametrize("stands", [True, False], ids=["stands on the ground", "hovers"])
def test_all_of_a_moving_object_is_as_sure_as_where_it_is(stands: bool) -> None:
    """Stereo matches nothing on it, or something else; either says nothing of where it is."""
    sure = np.ones((100, 120), np.float32)
    inverse = ramp()
    moving = np.zeros((100, 120), bool)
    moving[20:80, 20:60] = True
    sure[20:50, 20:60] = 0
    if not stands:
        sure[78:90, 15:65] = 0
    _, confidence, found = placed(inverse, parts(moving), sure, RAMP)
    assert np.ptp(confidence[found]) == 0 and SURE < confidence[found].max() <= 0.25
    # Nothing at all is sure.
    unsure = np.zeros_like(sure)
    _, confidence, _ = placed(inverse, parts(moving), unsure, RAMP)
    assert not confidence.any()


def test_what_stands_before_a_things_foot_is_not_what_it_stands_on() -> None:
    """A post before half of its foot, as pickets before a tram: the ground is seen beside the post."""
    sure = np.ones((100, 120), np.float32)
    inverse = ramp()
    moving = np.zeros((100, 120), bool)
    moving[20:80, 20:60] = True
    ground = inverse[80, 0]
    inverse[60:, 35:75] = 0.9
    moving[76:, 35:75] = False
    depth, _, found = placed(inverse, parts(moving), sure, RAMP)
    np.testing.assert_allclose(depth[found], ground, atol=0.03)
