"""Bodies that walk: their parts are where they are told to be, in Cycles, in the true masks and in motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import bpy
import cv2
import numpy as np
import pytest

from sample_scenes import figure, filming, staging, truth
from sample_scenes.shapes import box
from sample_scenes.stage import Cameras, Floats, Prop, Stage

GREY = np.full((4, 4, 3), 0.5, np.float32)
QUARTER = np.pi / 2


def level_cameras(frames: int, height: float = 1.0) -> Cameras:
    """64x36, at the world's origin, looking along +y: 1 m at 4 m is 16 pixels."""
    rotation = np.tile(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), (frames, 1, 1))
    translation = -rotation @ np.array([0, 0, height])
    return Cameras(64, 36, 64.0, rotation, translation)


def staged(*things: Prop, frames: int) -> Stage:
    wall = Prop("wall", box((20, 0.1, 10)).moved(0, 8, -4), GREY)
    return Stage("tiny", "a test", level_cameras(frames), (wall, *things), np.zeros((frames, 3)))


@pytest.fixture
def built() -> Iterator[list[bpy.types.Scene]]:
    """Scenes in here are removed."""
    before, scenes = bpy.context.window.scene, []
    yield scenes
    bpy.context.window.scene = before
    for scene in scenes:
        bpy.data.scenes.remove(scene)


def mask(stage: Stage, scene: bpy.types.Scene, frame: int) -> np.ndarray:
    parts = [i for i, thing in enumerate(stage.things) if thing.subject]
    return np.isin(truth.geometry(scene, frame).thing, parts)


def test_a_part_turns_about_its_joint_and_then_travels(built: list[bpy.types.Scene]) -> None:
    # A rod of 1 m that hangs from its joint, swings forwards to +x, then is moved.
    turn = figure.pitched([0.0, -QUARTER, -QUARTER])
    travel = np.array([[0, 4, 1.5], [0, 4, 1.5], [-1, 4, 1.0]])
    rod = Prop(
        "rod", box((0.25, 0.02, 1.0)).moved(0, 0, -1), GREY, travel=travel, turn=turn, subject="someone"
    )
    stage = staged(rod, frames=3)
    built.append(staging.build(stage))
    # Left, top, width and height in pixels; (0, 4, 1) is in the middle, 16 pixels are a metre.
    for frame, expected in ((1, (30, 10, 4, 16)), (2, (32, 8, 16, 4)), (3, (16, 16, 16, 4))):
        found = cv2.boundingRect(mask(stage, built[0], frame).astype(np.uint8))
        np.testing.assert_allclose(found, expected, atol=1, err_msg=f"frame {frame}")


def test_motion_follows_a_part_that_turns(built: list[bpy.types.Scene]) -> None:
    turn = figure.pitched([0.0, -0.3])
    travel = np.array([[0, 4, 1.5], [0.2, 4, 1.4]])
    rod = Prop(
        "rod", box((0.3, 0.02, 1.0)).moved(0, 0, -1), GREY, travel=travel, turn=turn, subject="someone"
    )
    stage = staged(rod, frames=2)
    built.append(staging.build(stage))
    here, after = (truth.geometry(built[0], frame) for frame in (1, 2))
    motion, seen = truth.motion(stage, 1, here, after)
    rows, columns = np.nonzero(mask(stage, built[0], 1) & seen)
    assert len(rows) > 40
    place = np.floor(np.stack([rows, columns], 1) + 0.5 + motion[rows, columns, ::-1]).astype(int)
    assert mask(stage, built[0], 2)[tuple(place.T)].mean() > 0.95
    # By hand: a point 0.5 m under the joint goes 0.2 + 0.5 sin 0.3 to the right at 16 pixels a metre.
    assert motion[18, 32, 0] == pytest.approx(16 * (0.2 + 0.5 * np.sin(0.3)), abs=0.35)
    np.testing.assert_allclose(motion[:, :20], 0, atol=1e-9)


def test_what_turns_in_place_moves() -> None:
    still = Prop("still", box((1, 1, 1)), GREY, travel=np.ones((2, 3)), turn=figure.pitched([0.2, 0.2]))
    assert not still.moves
    assert replace(still, turn=figure.pitched([0.2, 0.3])).moves
    assert replace(still, travel=np.array([[0.0, 0, 0], [0, 0, 1]])).moves


def world(prop: Prop, frame: int) -> Floats:
    turn, place = prop.pose(frame)
    return np.asarray(prop.shape.vertices @ turn.T + place)


@pytest.mark.parametrize("name", filming.SUBJECTS)
def test_feet_stand_on_the_ground_and_do_not_slide(name: str) -> None:
    stage = filming.load(name)
    feet = [thing for thing in stage.things if thing.name.endswith(("shoe", "paw"))]
    assert len(feet) == {"beast": 4, "crossing": 4}.get(name, 2)
    stood = np.zeros(len(stage.cameras), int)
    for foot in feet:
        assert foot.travel is not None
        places = [world(foot, frame) for frame in range(len(stage.cameras))]
        lowest = np.array([place[:, 2].min() for place in places])
        assert lowest.min() > -0.005, foot.name
        down = foot.travel[:, 2] < foot.travel[:, 2].min() + 1e-6
        assert 0.5 < down.mean() < 0.85, foot.name
        np.testing.assert_allclose(lowest[down], 0, atol=1e-3, err_msg=foot.name)
        step = np.linalg.norm(np.diff(foot.travel, axis=0), axis=1)
        assert step[down[1:] & down[:-1]].max() < 1e-3, foot.name
        stood += down
    assert stood.min() >= len(feet) // 2


@pytest.mark.parametrize("name", filming.SUBJECTS)
def test_parts_hang_together(name: str) -> None:
    stage = filming.load(name)
    for subject in stage.subjects:
        parts = [thing for thing in stage.things if thing.subject == subject]
        for frame in (0, len(stage.cameras) // 3, len(stage.cameras) - 1):
            points = [world(part, frame) for part in parts]
            low, high = (np.array([f(p, axis=0) for p in points]) for f in (np.min, np.max))
            touch = ((low[:, None] < high) & (low < high[:, None])).all(axis=-1)
            reached = np.linalg.matrix_power(touch.astype(float), len(parts)) > 0
            assert reached.all(), f"{subject}, frame {frame}"


def test_the_pause_is_one() -> None:
    stage = filming.load("pause")
    first, last = 25, 45
    for thing in (thing for thing in stage.things if thing.subject):
        assert thing.travel is not None and thing.turn is not None
        np.testing.assert_allclose(thing.travel[first : last + 1], thing.travel[[first]] * np.ones((21, 1)))
        np.testing.assert_allclose(thing.turn[first], thing.turn[last], atol=1e-9)
    hips = next(thing for thing in stage.things if thing.name == "walker's jacket").travel
    assert hips is not None
    assert np.linalg.norm(hips[first] - hips[0]) > 0.7
    assert np.linalg.norm(hips[-1] - hips[last]) > 0.7


def test_one_who_crosses_hides_the_other(built: list[bpy.types.Scene]) -> None:
    stage = filming.load("crossing")
    stage = replace(stage, cameras=stage.cameras.resized(64, 36))
    built.append(staging.build(stage))
    far = [i for i, thing in enumerate(stage.things) if thing.subject == "far"]
    seen = [
        np.isin(truth.geometry(built[0], frame).thing, far).sum() for frame in (1, 12, 20, 24, 28, 40, 55)
    ]
    assert min(seen[2:5]) < 0.5 * min(seen[0], seen[-2])


def test_bones_that_are_too_short_are_refused() -> None:
    with pytest.raises(ValueError, match="do not reach"):
        figure.knee(np.zeros((1, 2)), np.array([[0.0, -1.0]]), 0.4, 0.4, 1)
