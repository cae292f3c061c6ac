"""Operators that pick the focus and edit the list of focus marks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy
import pytest

from addon.core.camera.reconstruction import Intrinsics
from addon.core.focus.focus import Focus
from addon.core.focus.place import Place
from addon.core.focus.pull import FocusMark
from addon.core.media.clip import open_footage
from addon.scene.build import build
from addon.scene.focus import focus_marks
from addon.scene.lens import lens
from addon.scene.sources.shot import Shot
from addon.ui import panels

from .. import planes
from ..recorder import draw
from ..scenes import slanted_plane, slanted_shot, write_plane

LENS = Intrinsics(320, 180, 280.0, 280.0, 160.0, 90.0)
FRAMES = tuple(range(1, 9))
OPERATORS = bpy.ops.virtual_aperture


@pytest.fixture
def shot(scene: bpy.types.Scene, tmp_path: Path) -> Shot:
    """The plane with so many points that four are near every place."""
    plane = slanted_plane(LENS, FRAMES, count=1500)
    made = Shot(open_footage(write_plane(tmp_path / "clip", plane)), plane)
    build(scene, made.footage, made.reconstruction)
    return made


def at(frame: int, distance: float) -> FocusMark:
    return FocusMark.of(Place(Focus(distance=distance), frame, distance, "a distance"))


def frames(scene: bpy.types.Scene) -> list[int]:
    return [mark.frame for mark in scene.virtual_aperture.marks.items]


def test_a_pick_is_in_focus(scene: bpy.types.Scene, shot: Shot, capsys: pytest.CaptureFixture[str]) -> None:
    settings = scene.virtual_aperture
    scene.frame_set(3)
    assert OPERATORS.pick_focus(x=0.2, y=0.5) == {"FINISHED"}
    # The plane's inverse depth is linear over the picture, from 5 to 12 away.
    assert 1 / settings.focus_distance == pytest.approx(0.8 / 5 + 0.2 / 12, rel=0.02)
    assert len(settings.marks.points) == 4 and settings.marks.items[0].frame == 3
    assert len(settings.aperture.data.vertices) > 0
    assert "In focus at frame 3: Place, 5." in capsys.readouterr().out
    scene.frame_set(7)
    assert OPERATORS.pick_focus(x=0.8, y=0.5, add=True) == {"FINISHED"}
    assert frames(scene) == [3, 7] and "mark 2 of 2" in capsys.readouterr().out
    assert 1 / settings.focus_distance == pytest.approx(0.2 / 5 + 0.8 / 12, rel=0.1)
    # With two marks a pick is the one at the playhead.
    scene.frame_set(5)
    assert OPERATORS.pick_focus(x=0.5, y=0.5) == {"FINISHED"}
    assert frames(scene) == [3, 5, 7]


def test_a_pick_is_refused(scene: bpy.types.Scene, tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="Solve the clip first"):
        OPERATORS.pick_focus()
    shot = slanted_shot(tmp_path, LENS, FRAMES)
    settings = build(scene, shot.footage, shot.reconstruction)
    scene.frame_set(40)
    with pytest.raises(RuntimeError, match="frame 40 is after the end of the clip"):
        OPERATORS.pick_focus()
    assert not len(settings.marks.items) and not lens.is_in_focus(settings)
    settings.footage = str(tmp_path / "gone")
    scene.frame_set(2)
    with pytest.raises(RuntimeError, match=r"the clip .* is missing from"):
        OPERATORS.pick_focus()


def test_in_a_pull_of_the_users_a_pick_is_the_next_key(
    scene: bpy.types.Scene, shot: Shot, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = scene.virtual_aperture
    settings.focus_distance = 7.0
    scene.keyframe_insert(settings.path_from_id("focus_distance"), frame=1)
    scene.frame_set(6)
    assert OPERATORS.pick_focus(x=0.2, y=0.5) == {"FINISHED"}
    keys = {int(key.co[0]): key.co[1] for key in lens.keys_of(settings, "focus_distance").keyframe_points}
    assert list(keys) == [1, 6] and keys[1] == 7.0 and 5 < keys[6] < 6
    assert "The focus distance is keyed at frame 6" in capsys.readouterr().out


def test_the_list_is_edited(scene: bpy.types.Scene, shot: Shot, capsys: pytest.CaptureFixture[str]) -> None:
    settings = scene.virtual_aperture
    for operator in (OPERATORS.remove_focus_mark, OPERATORS.move_focus_mark):
        with pytest.raises(RuntimeError, match="There are no focus marks; Pick Focus adds one"):
            operator()
    with pytest.raises(RuntimeError, match="Pick what should be sharp first"):
        OPERATORS.hold_focus()
    focus_marks.replace_all(settings, [at(3, 4.0)])
    scene.frame_set(3)
    with pytest.raises(RuntimeError, match="Frame 3 already has a mark"):
        OPERATORS.hold_focus()
    scene.frame_set(6)
    assert OPERATORS.hold_focus() == {"FINISHED"}
    assert [(mark.frame, mark.distance) for mark in settings.marks.items] == [(3, 4.0), (6, 4.0)]
    scene.frame_set(3)
    with pytest.raises(RuntimeError, match="frame 3 already has a focus mark; remove that one first"):
        OPERATORS.move_focus_mark()
    scene.frame_set(8)
    assert OPERATORS.move_focus_mark() == {"FINISHED"}
    assert frames(scene) == [3, 8] and settings.marks.active == 1
    assert OPERATORS.jump_to_frame(frame=3) == {"FINISHED"}
    assert scene.frame_current == 3 and settings.marks.active == 0
    assert "virtual_aperture.jump_to_frame" not in draw(panels.focus.VIRTUAL_APERTURE_PT_focus).operators
    settings.marks.unseen = "2 5 7"
    shown = draw(panels.focus.VIRTUAL_APERTURE_PT_focus)
    assert "Hidden in 3 frames" in shown.texts and "virtual_aperture.jump_to_frame" in shown.operators
    assert OPERATORS.remove_focus_mark() == {"FINISHED"}
    assert frames(scene) == [8] and "Removed the focus mark at frame 3" in capsys.readouterr().out
    assert OPERATORS.remove_focus_mark() == {"FINISHED"}
    assert not frames(scene) and settings.focus_distance == 4.0


def test_keys_are_given_back_to_the_marks(scene: bpy.types.Scene, shot: Shot) -> None:
    settings = scene.virtual_aperture
    focus_marks.replace_all(settings, [at(2, 4.0), at(7, 9.0)])
    with pytest.raises(RuntimeError, match="The keyframes are those of the focus marks"):
        OPERATORS.write_focus_marks()
    for key in lens.keys_of(settings, "focus_distance").keyframe_points:
        if key.type == "GENERATED":
            key.co[1] += 1.0
    bpy.context.view_layer.update()
    shown = draw(panels.focus.VIRTUAL_APERTURE_PT_focus)
    assert "Focus distance keyframes were edited" in shown.texts
    assert "virtual_aperture.write_focus_marks" in shown.operators
    assert OPERATORS.write_focus_marks() == {"FINISHED"}
    scene.frame_set(8)
    assert settings.focus_distance == pytest.approx(9.0)
    assert "virtual_aperture.write_focus_marks" not in draw(panels.focus.VIRTUAL_APERTURE_PT_focus).operators


def test_a_solve_puts_something_in_focus(
    scene: bpy.types.Scene, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    clip = planes.write_clip(tmp_path / "walk", planes.sideways(12))
    settings = scene.virtual_aperture
    settings.footage, settings.work_dir = str(clip), str(tmp_path / "work")
    settings.lens, settings.equivalent = "GIVEN", 29.42  # solved in half the time
    assert OPERATORS.solve() == {"FINISHED"}
    assert "Solved, and focused on the nearest large object near the centre" in capsys.readouterr().out
    assert settings.marks.is_first and len(settings.marks.points) == 4 and settings.aperture_radius > 0
    texts = " ".join(draw(panels.main.VIRTUAL_APERTURE_PT_main).texts)
    assert "Automatic focus" in texts
    assert OPERATORS.render_frame.poll()
    # It is nobody's pick: kept over a solve as it is, and told as long as nothing else is picked.
    assert OPERATORS.solve() == {"FINISHED"} and settings.marks.is_first
    assert OPERATORS.pick_focus(x=0.5, y=0.5) == {"FINISHED"}
    picked = settings.marks.points
    assert OPERATORS.solve() == {"FINISHED"}
    assert not settings.marks.is_first and settings.marks.points == picked


def test_suggestions_change_nothing_until_they_are_taken(scene: bpy.types.Scene, shot: Shot) -> None:
    settings = scene.virtual_aperture
    with pytest.raises(RuntimeError, match="There are no suggestions; Suggest Focus Marks makes some"):
        OPERATORS.dismiss_suggestions()
    focus_marks.put_first(settings, at(1, 6.0).places[0])
    distance, blur = settings.focus_distance, settings.blur
    focus_marks.suggest(settings, [replace(at(n, n + 2.0), pull=2, name="Face enters") for n in (2, 5, 8)])
    assert settings.marks.is_first and settings.focus_distance == distance
    panel = panels.focus.VIRTUAL_APERTURE_PT_subjects
    assert next(text for text in draw(panel).texts if "Face enters" in text).startswith("2: Face enters, 4")
    with pytest.raises(RuntimeError, match="nothing is suggested at frame 4"):
        OPERATORS.take_suggestion(frame=4)
    # The automatic focus gives way; a later one is added.
    assert OPERATORS.take_suggestion(frame=5) == {"FINISHED"}
    assert frames(scene) == [5] and scene.frame_current == 5 and settings.focus_distance == 7.0
    focus_marks.put(settings, 8, at(8, 3.0).places, add=True)
    assert OPERATORS.take_suggestion(every=True) == {"FINISHED"}
    # The user's mark at frame 8 stays.
    assert [(mark.frame, mark.distance) for mark in settings.marks.items] == [(2, 4.0), (5, 7.0), (8, 3.0)]
    assert [mark.pull for mark in settings.marks.items] == [2, 2, 0]
    assert settings.blur == blur and not len(settings.marks.suggested)
    focus_marks.suggest(settings, [at(4, 9.0)])
    assert OPERATORS.dismiss_suggestions() == {"FINISHED"} and frames(scene) == [2, 5, 8]
    assert not len(settings.marks.suggested)
