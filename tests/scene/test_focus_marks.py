"""Focus marks in a scene: the keys they write, and what becomes of them when those are edited."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.camera.reconstruction import Intrinsics
from addon.core.focus.focus import Focus
from addon.core.focus.place import Place
from addon.core.focus.pull import FocusMark
from addon.scene.build import build
from addon.scene.focus import focus_curve, focus_marks
from addon.scene.focus.focus_marks import marks_of
from addon.scene.focus.refocus import keep_focus, restore_focus
from addon.scene.lens import lens
from addon.scene.solve.camera import curves_of
from addon.scene.sources.shot import Shot

from ..scenes import slanted_shot

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
FRAMES = tuple(range(1, 13))


@pytest.fixture
def shot(scene: bpy.types.Scene, tmp_path: Path) -> Shot:
    made = slanted_shot(tmp_path / "clip", LENS, FRAMES)
    build(scene, made.footage, made.reconstruction)
    return made


def points(shot: Shot, frame: int, *ids: int) -> Place:
    focus = Focus(ids)
    return Place(focus, frame, 1 / focus.inverse_depth(shot.reconstruction, frame), "points", xy=(0.5, 0.5))


def at(frame: int, distance: float) -> Place:
    return Place(Focus(distance=distance), frame, distance, "a distance")


def marks(scene: bpy.types.Scene) -> list[tuple[int, float]]:
    return [(m.frame, pytest.approx(m.distance)) for m in scene.virtual_aperture.marks.items]


def keys(scene: bpy.types.Scene) -> bpy.types.FCurve | None:
    return lens.keys_of(scene.virtual_aperture, "focus_distance")


def key(scene: bpy.types.Scene, frame: int) -> bpy.types.Keyframe:
    return next(key for key in keys(scene).keyframe_points if key.co[0] == frame)


def update() -> None:
    """What Blender does between two events: its handlers are called."""
    bpy.context.view_layer.update()


def distance(scene: bpy.types.Scene, frame: int) -> float:
    scene.frame_set(frame)
    return float(scene.virtual_aperture.focus_distance)


def test_marks_are_keyframes_and_what_is_between_is_generated(scene: bpy.types.Scene, shot: Shot) -> None:
    settings = scene.virtual_aperture
    focus_marks.put(settings, 9, [at(9, 12.0)])
    focus_marks.put(settings, 3, [at(3, 4.0)], add=True)
    assert marks(scene) == [(3, 4.0), (9, 12.0)] and settings.marks.active == 0
    kinds = {int(key.co[0]): key.type for key in keys(scene).keyframe_points}
    assert list(kinds) == list(FRAMES)
    assert [frame for frame, kind in kinds.items() if kind == "KEYFRAME"] == [3, 9]
    assert not any(key.select_control_point or key.select_left_handle for key in keys(scene).keyframe_points)
    # Half way in time it is half way in inverse depth.
    assert [distance(scene, frame) for frame in (1, 3, 6, 9, 12)] == pytest.approx([4, 4, 6, 12, 12])
    settings.marks.items[1].easing = "LINEAR"
    assert 1 / distance(scene, 4) == pytest.approx(5 / 6 / 4 + 1 / 6 / 12)
    # With two, a pick is the mark at its frame.
    focus_marks.put(settings, 6, [at(6, 5.0)])
    assert [mark.frame for mark in settings.marks.items] == [3, 6, 9]
    assert distance(scene, 6) == pytest.approx(5.0)


def test_a_mark_has_a_pull_of_its_own_and_can_hold_its_distance(scene: bpy.types.Scene, shot: Shot) -> None:
    settings = scene.virtual_aperture
    world = np.array([0.2, -0.1, 7.0])
    focus_marks.put(settings, 2, [replace(at(2, 7.0), world=world)])
    held = distance(scene, 2)
    assert abs(distance(scene, 12) - held) > 0.01
    settings.marks.items[0].holds = True
    assert keys(scene) is None and distance(scene, 12) == distance(scene, 2) == pytest.approx(held, rel=1e-5)
    focus_marks.put(settings, 10, [at(10, 12.0)], add=True)
    settings.marks.items[1].pull = 2
    assert [distance(scene, frame) for frame in (2, 8, 10)] == pytest.approx([held, held, 12.0], rel=1e-5)
    assert held < distance(scene, 9) < 12
    settings.marks.items[1].easing = "CUT"
    assert distance(scene, 9) == pytest.approx(held, rel=1e-5)
    kept = marks_of(settings)
    focus_marks.replace_all(settings, kept)
    assert [(m.easing, m.pull, m.holds) for m in marks_of(settings)] == [
        ("SMOOTH", 0, True),
        ("CUT", 2, False),
    ]


def test_deleted_keys_leave_the_distance_and_do_not_come_back(scene: bpy.types.Scene, shot: Shot) -> None:
    settings = scene.virtual_aperture
    focus_marks.replace_all(settings, [FocusMark.of(at(3, 4.0)), FocusMark.of(at(9, 12.0))])
    scene.frame_set(9)
    curves_of(settings.id_data).remove(keys(scene))
    update()
    assert focus_curve.is_users(settings) and distance(scene, 3) == pytest.approx(12.0)
    focus_marks.put(settings, 6, [at(6, 5.0)])
    assert marks(scene) == [(6, 5.0)] and distance(scene, 3) == 5.0
    assert not focus_curve.is_users(settings)


@pytest.mark.parametrize("frames", [(3,), (5, 6)])
def test_a_curve_that_is_edited_is_the_users(
    scene: bpy.types.Scene, shot: Shot, frames: tuple[int, ...]
) -> None:
    settings = scene.virtual_aperture
    focus_marks.replace_all(settings, [FocusMark.of(at(3, 4.0)), FocusMark.of(at(9, 12.0))])
    before = key(scene, frames[0]).co[1]
    for frame in frames:
        key(scene, frame).co[1] = 9.0
    update()
    assert focus_marks.are_keys_users(settings)
    focus_marks.put(settings, 11, [at(11, 2.0)])
    assert distance(scene, frames[0]) == 9.0 and distance(scene, 11) != pytest.approx(2.0)
    focus_marks.take_keys_over(settings)
    assert not focus_marks.are_keys_users(settings)
    assert distance(scene, frames[0]) == pytest.approx(before) and distance(scene, 11) == pytest.approx(2.0)


def test_keys_of_the_users_are_not_touched(scene: bpy.types.Scene, shot: Shot) -> None:
    settings = scene.virtual_aperture
    for frame, away in ((2, 5.0), (10, 9.0)):
        settings.focus_distance = away
        scene.keyframe_insert(settings.path_from_id("focus_distance"), frame=frame)
    before = [tuple(key.co) for key in keys(scene).keyframe_points]
    update()
    focus_marks.put(settings, 5, [at(5, 4.0)])
    focus_marks.clear(settings)
    assert [tuple(key.co) for key in keys(scene).keyframe_points] == before


def test_a_distance_set_by_hand_takes_the_place_of_the_only_mark(scene: bpy.types.Scene, shot: Shot) -> None:
    settings = scene.virtual_aperture
    focus_marks.put(settings, 4, [points(shot, 4, 3, 9)])
    settings.focus_distance = 6.5
    update()
    assert marks(scene) == [(4, 6.5)] and settings.marks.items[0].name == "Distance"
    assert keys(scene) is None and not lens.focus_of(settings).points


def test_removing_and_moving(scene: bpy.types.Scene, shot: Shot) -> None:
    settings = scene.virtual_aperture
    focus_marks.replace_all(settings, [FocusMark.of(at(3, 4.0)), FocusMark.of(at(9, 12.0))])
    with pytest.raises(UserError, match="frame 9 already has a focus mark"):
        focus_marks.move(settings, 0, 9)
    focus_marks.move(settings, 0, 11)
    assert marks(scene) == [(9, 12.0), (11, 4.0)] and settings.marks.active == 1
    # Typed, it goes past the one that is there.
    settings.marks.items[1].frame = 9
    assert marks(scene) == [(9, 12.0), (10, 4.0)]
    focus_marks.remove(settings, 1)
    assert keys(scene) is None and settings.focus_distance == pytest.approx(12.0)
    focus_marks.remove(settings, 0)
    assert settings.focus_distance == pytest.approx(12.0) and lens.is_in_focus(settings)


def test_a_mark_is_named_by_what_was_picked(scene: bpy.types.Scene, shot: Shot) -> None:
    clicked, vertices = points(shot, 3, 4, 5, 6, 7), replace(points(shot, 3, 4, 5), xy=None)
    still = replace(at(3, 6.0), world=np.array([0.0, 0.0, 6.0]), xy=(0.5, 0.5))
    moving = replace(at(3, 6.0), followed={3: 6.0, 4: 7.0}, xy=(0.5, 0.5))
    named = {
        "Place": [clicked],
        "Point cloud": [vertices],
        "Subject": [replace(moving, subject="person")],
        "Dog": [replace(moving, subject="Dog")],
        "Places": [clicked, still],
        "Distance": [at(3, 6.0)],
    }
    for name, places in named.items():
        assert focus_marks.put(scene.virtual_aperture, 3, places).name == name
    for place in (still, moving):
        assert focus_marks.put(scene.virtual_aperture, 3, [place]).name == "Place"


def test_unseen_frames_are_told_and_have_keys_of_their_own(scene: bpy.types.Scene, shot: Shot) -> None:
    settings = scene.virtual_aperture
    left = points(shot, 3, 4)
    images = tuple(
        replace(image, points=image.points[10:], xy=image.xy[10:]) if image.frame in (5, 6) else image
        for image in shot.reconstruction.images
    )
    build(scene, shot.footage, replace(shot.reconstruction, images=images))
    focus_marks.replace_all(settings, [FocusMark.of(left), FocusMark.of(at(9, 12.0))])
    assert settings.marks.unseen == "5 6"
    kinds = {int(key.co[0]): key.type for key in keys(scene).keyframe_points}
    assert [frame for frame, kind in kinds.items() if kind == "JITTER"] == [5, 6]
    assert len(settings.marks.items) == 2 and not focus_curve.is_users(settings)


def test_marks_are_kept_over_a_new_solve(scene: bpy.types.Scene, shot: Shot) -> None:
    settings = scene.virtual_aperture
    world = np.array([0.2, -0.1, 7.0])
    focus_marks.replace_all(
        settings,
        [
            FocusMark.of(points(shot, 2, 5, 6, 7)),
            FocusMark(6, (replace(at(4, 7.0), world=world, xy=(0.52, 0.47)),), easing="LINEAR"),
            FocusMark.of(at(9, 12.0)),
        ],
    )
    before = [mark.distance for mark in settings.marks.items]
    kept = keep_focus(settings, shot.footage.path)
    # The same clip, solved in a unit of half the length.
    solve = shot.reconstruction
    images = tuple(replace(image, translation=2 * image.translation) for image in solve.images)
    new = replace(solve, images=images, points=replace(solve.points, xyz=2 * solve.points.xyz))
    build(scene, shot.footage, new)
    assert not len(settings.marks.items) and keys(scene) is None
    assert kept is not None and restore_focus(settings, kept, new) == ""
    assert [(mark.frame, mark.easing) for mark in settings.marks.items] == [
        (2, "SMOOTH"), (6, "LINEAR"), (9, "SMOOTH"),
    ]  # fmt: skip
    assert [mark.distance for mark in settings.marks.items] == pytest.approx(
        [2 * d for d in before], rel=0.03
    )
    assert settings.marks.items[0].places[0].focus.points == (5, 6, 7)
    assert distance(scene, 9) == pytest.approx(24.0, rel=1e-3)
