"""Focus pulled from place to place: what is sharp at each frame between them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.focus.focus import Focus
from addon.core.focus.place import Place
from addon.core.focus.pull import EASINGS, FocusMark, smoothstep, unseen
from addon.core.focus.pull import pull as pull_marks
from sample_scenes import rack
from sample_scenes.filming import true_cameras

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
FRAMES = tuple(range(1, 12))
POINTS = np.array([[0.0, 0.0, 4.0], [0.2, 0.1, 4.0], [0.0, 0.0, 12.0], [0.3, 0.2, 12.0], [0.0, 0.0, 1.15]])


def walk(speed: float = 0.0, unregistered: tuple[int, ...] = ()) -> Reconstruction:
    """A camera that goes ahead by `speed` a frame, and the points at 4, at 12 and at 1.15 from its start."""
    seen = np.zeros(0, np.int32)
    images = [
        Image(frame, np.eye(3), np.array([0, 0, -speed * (frame - 1)]), np.zeros((0, 2)), seen)
        for frame in FRAMES
        if frame not in unregistered
    ]
    points = Points(POINTS, np.zeros((len(POINTS), 3), np.uint8), np.zeros(len(POINTS)))
    return Reconstruction((LENS,), tuple(images), points)


def at_points(frame: int, *points: int) -> Place:
    return Place(Focus(points), frame, float(POINTS[points[0], 2]), "points")


def at_distance(frame: int, distance: float) -> Place:
    return Place(Focus(distance=distance), frame, distance, "a mover")


def pull(places: list[Place], cameras: Reconstruction, frames: Sequence[int]) -> dict[int, float]:
    """Each place as a mark at its own frame."""
    return pull_marks([FocusMark.of(place) for place in places], cameras, frames)


NEAR, FAR = at_points(3, 0, 1), at_points(9, 2, 3)


def test_it_holds_before_and_after_and_is_eased_in_inverse_depth() -> None:
    distances = pull([FAR, NEAR], walk(), FRAMES)
    assert list(distances) == list(FRAMES)
    assert [distances[frame] for frame in (1, 2, 3)] == pytest.approx([4.0] * 3)
    assert [distances[frame] for frame in (9, 10, 11)] == pytest.approx([12.0] * 3)
    # Half way in time it is half way in inverse depth.
    assert distances[6] == pytest.approx(6.0)
    inverse = np.array([1 / distances[frame] for frame in range(3, 10)])
    steps = -np.diff(inverse)
    assert (steps > 0).all() and steps == pytest.approx(steps[::-1])
    # It starts and stops without a jolt.
    assert steps[0] < 0.4 * steps[2]


def test_both_places_are_followed_while_the_camera_moves() -> None:
    speed = 0.1
    distances = pull([NEAR, FAR], walk(speed, unregistered=(2, 7)), FRAMES)
    near, far = (np.array([depth - speed * (frame - 1) for frame in FRAMES]) for depth in (4.0, 12.0))
    share = smoothstep((np.array(FRAMES) - 3) / 6)
    assert list(distances.values()) == pytest.approx(1 / ((1 - share) / near + share / far))


def test_a_place_in_the_world_is_followed_as_points_are() -> None:
    place = Place(Focus(distance=4.0), 3, 4.0, "dense depth", np.array([0.0, 0.0, 4.0]))
    assert pull([place, FAR], walk(0.1), FRAMES) == pytest.approx(pull([NEAR, FAR], walk(0.1), FRAMES))


def test_behind_the_camera_a_place_keeps_its_last_distance() -> None:
    # The point is passed after frame 2.
    distances = pull([at_points(1, 4), at_distance(11, 5.0)], walk(1.0), FRAMES)
    assert distances[1] == pytest.approx(1.15) and distances[2] == pytest.approx(0.15 / (1 - smoothstep(
        np.array(0.1)) * (1 - 0.15 / 5)))  # fmt: skip
    share = float(smoothstep(np.array(0.5)))
    assert 1 / distances[6] == pytest.approx((1 - share) / 0.15 + share / 5)


def test_points_that_no_frame_shows_for_a_while_are_carried() -> None:
    # No frame of this walk observed them at all.
    clip = walk(0.1)
    assert all(not len(image.points) for image in clip.images)
    assert [Focus((0, 1)).inverse_depth(clip, frame) for frame in FRAMES] == pytest.approx(
        [1 / (4 - 0.1 * (frame - 1)) for frame in FRAMES]
    )


def test_easings_start_and_arrive_as_they_are_named() -> None:
    first, last = 0.05, 0.95
    speeds = {name: (ease(first) / first, (1 - ease(last)) / (1 - last)) for name, ease in EASINGS.items()}
    assert max(speeds["SMOOTH"]) < 0.3 and speeds["LINEAR"] == pytest.approx((1, 1))
    assert speeds["EASE_IN"][0] < 0.1 and speeds["EASE_IN"][1] > 1.9
    assert speeds["EASE_OUT"][0] > 1.9 and speeds["EASE_OUT"][1] < 0.1


def test_a_pull_of_its_own_length_arrives_on_the_mark() -> None:
    marks = [FocusMark.of(NEAR), FocusMark(9, (FAR,), pull=2)]
    distances = pull_marks(marks, walk(), FRAMES)
    assert [distances[frame] for frame in range(1, 8)] == pytest.approx([4.0] * 7)
    assert distances[8] == pytest.approx(6.0) and distances[9] == pytest.approx(12.0)
    # One that is longer than the time between the marks takes all of it.
    longer = pull_marks([FocusMark.of(NEAR), FocusMark(9, (FAR,), pull=100)], walk(), FRAMES)
    assert longer == pull_marks([FocusMark.of(NEAR), FocusMark.of(FAR)], walk(), FRAMES)


def test_frames_that_do_not_show_a_mark_are_told() -> None:
    # No frame observed the points; the place in the world lies ahead, in the middle of the picture.
    middle = Place(Focus(distance=1.15), 1, 1.15, "dense depth", np.array([0.0, 0.0, 1.15]))
    clip = walk(0.3)
    assert unseen([FocusMark.of(middle)], clip, FRAMES) == [5, 6, 7, 8, 9, 10, 11]
    assert unseen([FocusMark.of(at_distance(1, 5.0))], clip, FRAMES) == []
    # From the next mark on it is not followed.
    marks = [FocusMark.of(middle), FocusMark(7, (at_distance(7, 5.0),))]
    assert unseen(marks, clip, FRAMES) == [5, 6]
    assert unseen([FocusMark(1, (middle, NEAR))], clip, (4, 5)) == [5]


def test_three_marks_make_the_pull_of_the_scene_rack() -> None:
    stage = rack.stage()
    cameras = true_cameras(stage.cameras)
    marks = []
    for number in (rack.LEAVES, rack.PASSES, rack.ARRIVES):
        place = stage.focus[number]
        distance = float(stage.focus_depth[number])
        marks.append(Place(Focus(distance=distance), int(cameras.frames[number]), distance, "", place))
    distances = pull(marks, cameras, cameras.frames.tolist())
    # Its path is eased in the middle camera, not in each: that is 0.02 px of discs of 32.
    assert list(distances.values()) == pytest.approx(stage.focus_depth.tolist(), rel=1e-3)
