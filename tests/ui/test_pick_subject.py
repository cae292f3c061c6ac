"""Operators that mark subjects by strokes, carry them, and put them in focus."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.core.camera.reconstruction import Intrinsics
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.repairs import Repair
from addon.core.media.clip import open_footage
from addon.core.subjects.clip_subjects import ClipSubjects
from addon.core.subjects.networks import Networks
from addon.core.subjects.strokes import Stroke
from addon.scene.build import build
from addon.scene.lens.repairs import add_repairs
from addon.scene.sources import subjects
from addon.scene.sources.shot import Shot, shot_of
from addon.ui import panels
from addon.ui.focus.subjects import VIRTUAL_APERTURE_UL_subjects
from addon.ui.picking.pick_subject import marked_person, people_of

from .. import planes
from ..recorder import Recorder, draw
from ..scenes import slanted_shot
from ..subjects import walls

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
OPERATORS = bpy.ops.virtual_aperture
FRAME = 16


@pytest.fixture
def settings(scene: bpy.types.Scene, tmp_path: Path) -> bpy.types.PropertyGroup:
    """A solved clip in which nothing moves."""
    shot = slanted_shot(tmp_path / "clip", LENS)
    return build(scene, shot.footage, shot.reconstruction)


def strokes(settings: bpy.types.PropertyGroup) -> dict[str, list[tuple[int, int, bool]]]:
    """By subject: frame, number of places and kind of each stroke."""
    return {
        each.name: [(stroke.frame, len(stroke.places), stroke.adds) for stroke in each.strokes]
        for each in settings.subjects.items
    }


def test_strokes_mark_a_subject(scene: bpy.types.Scene, settings: bpy.types.PropertyGroup) -> None:
    scene.frame_set(1)
    assert OPERATORS.pick_subject(places="0.2,0.3 0.4,0.5") == {"FINISHED"}
    assert OPERATORS.pick_subject(places="0.1,0.1", take_away=True) == {"FINISHED"}
    scene.frame_set(3)
    assert OPERATORS.pick_subject(places="0.25,0.75") == {"FINISHED"}
    assert strokes(settings) == {"Subject": [(1, 2, True), (1, 1, False), (3, 1, True)]}
    # One more takes the place of those in its frame, but where it extends them.
    assert OPERATORS.pick_subject(places="0.5,0.5", extend=True) == {"FINISHED"}
    assert len(strokes(settings)["Subject"]) == 4
    assert OPERATORS.pick_subject(places="0.75,0.5") == {"FINISHED"}
    assert strokes(settings)["Subject"] == [(1, 2, True), (1, 1, False), (3, 1, True)]
    assert OPERATORS.pick_subject(places="0.5,0.5", new=True) == {"FINISHED"}
    assert strokes(settings)["Subject 2"] == [(3, 1, True)] and settings.subjects.active == 1
    marked = shot_of(scene).context.marked
    assert [each.name for each in marked] == ["Subject", "Subject 2"]
    assert marked[0].strokes[2] == Stroke(3, ((0.75, 0.5),))


def test_a_stroke_is_refused(scene: bpy.types.Scene, tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="Solve the clip first"):
        OPERATORS.pick_subject(places="0.5,0.5")
    shot = slanted_shot(tmp_path / "clip", LENS)
    settings = build(scene, shot.footage, shot.reconstruction)
    scene.frame_set(1)
    for places in ("", "0.5", "0.5,x"):
        with pytest.raises(RuntimeError, match="is not valid; write places such as"):
            OPERATORS.pick_subject(places=places)
    with pytest.raises(RuntimeError, match="is outside the picture"):
        OPERATORS.pick_subject(places="0.5,1.5")
    with pytest.raises(RuntimeError, match="there is nothing to take away from yet"):
        OPERATORS.pick_subject(places="0.5,0.5", take_away=True)
    scene.frame_set(40)
    with pytest.raises(RuntimeError, match="frame 40 is after the end of the clip"):
        OPERATORS.pick_subject(places="0.5,0.5")
    assert not len(settings.subjects.items)
    with pytest.raises(RuntimeError, match="no person was found in the clip; pick what should be in focus"):
        OPERATORS.suggest_marks()
    for operator in (OPERATORS.focus_subject, OPERATORS.carry_subject, OPERATORS.remove_subject):
        with pytest.raises(RuntimeError, match="No subject is marked; Pick Subject marks one"):
            operator()


def test_subjects_are_saved(
    scene: bpy.types.Scene, settings: bpy.types.PropertyGroup, tmp_path: Path
) -> None:
    scene.frame_set(2)
    OPERATORS.pick_subject(places="0.25,0.5 0.5,0.75")
    OPERATORS.pick_subject(places="0.125,0.125", take_away=True)
    before = subjects.marked_of(settings)
    file = str(tmp_path / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=file)
    OPERATORS.remove_subject()
    bpy.ops.wm.open_mainfile(filepath=file)
    assert subjects.marked_of(bpy.context.scene.virtual_aperture) == before


def test_names_tell_subjects_from_each_other(
    scene: bpy.types.Scene, settings: bpy.types.PropertyGroup, capsys: pytest.CaptureFixture[str]
) -> None:
    scene.frame_set(1)
    for _ in range(3):
        OPERATORS.pick_subject(places="0.5,0.5", new=True)
    settings.subjects.items[2].name = "Subject"
    settings.subjects.items[1].name = ""
    assert list(strokes(settings)) == ["Subject", "Subject 2", "Subject 3"]
    assert OPERATORS.remove_subject() == {"FINISHED"}
    assert "Removed the subject Subject 3" in capsys.readouterr().out
    assert settings.subjects.active == 1 and subjects.free_name(settings) == "Subject 3"


def test_the_panel_lists_subjects(scene: bpy.types.Scene, settings: bpy.types.PropertyGroup) -> None:
    panel = panels.focus.VIRTUAL_APERTURE_PT_subjects
    assert draw(panel).operators == ["virtual_aperture.pick_subject", "virtual_aperture.suggest_marks"]
    OPERATORS.pick_subject(places="0.5,0.5 0.6,0.6")
    settings.subjects.items[0].unsure = "2 3"
    shown = draw(panel)
    assert "Uncertain in 2 frames" in shown.texts and "virtual_aperture.jump_to_frame" in shown.operators
    row = Recorder()
    VIRTUAL_APERTURE_UL_subjects.draw_item(
        None, bpy.context, row, settings.subjects, settings.subjects.items[0], 0, settings.subjects, "active"
    )
    assert row.texts == ["1 stroke"] and row.props == ["name"]
    # A stroke makes what was said of it stale.
    OPERATORS.pick_subject(places="0.5,0.5", extend=True)
    assert not settings.subjects.items[0].unsure


@pytest.mark.long
def test_a_subject_is_carried_and_in_focus(
    scene: bpy.types.Scene, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    clip = walls.filmed(walls.with_disc)
    pictures = [walls.with_disc(frame)[..., ::-1] for frame in walls.FRAMES]
    footage = open_footage(planes.write_clip(tmp_path / "walls", pictures))
    settings = build(scene, footage, clip.reconstruction)
    scene.frame_set(FRAME)
    x, y = walls.place(FRAME)
    places = " ".join(f"{(x + dx) / walls.WIDTH},{y / walls.HEIGHT}" for dx in (-8, 8))
    assert OPERATORS.pick_subject(places=places) == {"FINISHED"}
    assert OPERATORS.carry_subject() == {"FINISHED"}
    said = capsys.readouterr().out
    unsure = settings.subjects.items[0].unsure.split()
    assert "Subject is" in said and (f"uncertain in {len(unsure)} frame" in said) == bool(unsure)
    found = shot_of(scene).context.parts.named("Subject").mask(9)
    assert walls.overlap(found, walls.disc(9)) > 0.85
    assert OPERATORS.focus_subject() == {"FINISHED"}
    (mark,) = settings.marks.items
    assert mark.frame == FRAME and "Subject" in mark.places[0].source
    followed = [settings.marks.items[0].places[0].distance]
    assert np.isfinite(followed).all() and "In focus at frame 16" in capsys.readouterr().out
    # A repair takes it with it.
    add_repairs(settings, [Repair("nearer", FRAME, ((x / walls.WIDTH, y / walls.HEIGHT),), 0.1, 1.0)])
    assert OPERATORS.focus_subject() == {"FINISHED"}
    assert settings.marks.items[0].places[0].distance == pytest.approx(followed[0] / 2, rel=0.05)


def shot_with(clip: ClipContext) -> Shot:
    """A shot whose clip is in memory."""
    shot = object.__new__(Shot)
    shot.__dict__["context"] = clip
    return shot


def test_a_person_who_was_found_is_shown_and_taken_over_by_a_correction() -> None:
    if not Networks().exist:
        pytest.skip("the networks are not in addon/networks: run tools/networks.py")
    filmed = walls.filmed(walls.with_person, tuple(range(11, 17)))
    clip = replace(filmed, known_subjects=ClipSubjects(filmed.reconstruction, filmed.read))
    # While people would have to be looked for, a stroke waits for nothing.
    assert people_of(shot_with(clip), 14) == {}
    (person,) = clip.parts.people
    people = people_of(shot_with(clip), 14)
    assert np.array_equal(people[person.name], person.mask(14))
    y, x = np.argwhere(person.mask(14)).mean(axis=0) / person.mask(14).shape
    (stroke,) = marked_person(Stroke(14, ((x, y),), adds=False), 14, people)
    assert stroke.frame == 14 and stroke.adds and len(stroke.places) == 5
    for other in (Stroke(15, ((x, y),)), Stroke(14, ((0.01, 0.01),))):
        assert marked_person(other, 14, people) == ()


def test_a_stroke_leaves_what_is_known_of_the_clip(
    scene: bpy.types.Scene, settings: bpy.types.PropertyGroup, tmp_path: Path
) -> None:
    """The static scene, pictures that were read, and subjects whose strokes are the same."""
    scene.frame_set(1)
    OPERATORS.pick_subject(places="0.2,0.3 0.4,0.5")
    before = shot_of(scene)
    carried, picture = before.context.parts.subjects.carried(before.subjects[0]), before.clip.read(2)
    OPERATORS.pick_subject(places="0.7,0.7", new=True)
    after = shot_of(scene)
    assert len(after.context.marked) == 2 and after is not before
    assert after.context._subjects is before.context._subjects
    assert (
        after.context.parts.subjects.carried(after.subjects[0]) is carried and after.clip.read(2) is picture
    )
    # Masks are left out of the static scene.
    black = np.zeros((LENS.height, LENS.width, 3), np.uint8)
    settings.masks = str(planes.write_clip(tmp_path / "masks", [black] * len(after.footage.frames)))
    assert shot_of(scene).context._subjects is not after.context._subjects
