"""Clips and models dropped on the viewport, and presets of the lens: with mouse and keys, and undone."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from .. import planes
from ..foreign_models import write_clip, write_model
from .program import Program
from .screen import Screen
from .steps import drop, running

SETTINGS = "bpy.context.scene.virtual_aperture"
SCENE = (
    f"[{SETTINGS}.footage, {SETTINGS}.work_dir, {SETTINGS}.clip_identity, {SETTINGS}.focus_distance,"
    f" len({SETTINGS}.points.data.vertices), bpy.context.scene.frame_end, bpy.context.scene.render.filepath]"
)
"""What tells which clip the scene holds, and what was made of it."""
SOLVING = "any(w.modal_operators for w in bpy.context.window_manager.windows)"

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module")
def program(screen: Screen, resources: Path) -> Iterator[Program]:
    with running(screen, resources, "drop", tab=False) as made:
        yield made


@pytest.fixture(scope="module")
def clips(folder: Path) -> Path:
    """Two clips that can be solved, another one and a model of it."""
    made = folder / "drop"
    made.mkdir()
    planes.write_clip(made / "walk", planes.sideways(12))
    planes.write_clip(made / "stroll", planes.sideways(10))
    write_clip(made / "clip")
    write_model(made / "model")
    return made


def test_a_model_without_a_clip_is_refused(program: Program, clips: Path) -> None:
    drop(program, clips / "model" / "cameras.txt")
    assert "drop the clip first" in program.ask("messages()")[-1]
    program.screen.key("Escape")
    program.settle()


def test_blender_hands_no_add_on_a_folder(program: Program, clips: Path) -> None:
    # Else the panel and docs/first_clip.md need not send users to File > Import.
    heard = program.ask("len(messages())")
    drop(program, clips / "walk")
    assert program.ask(f"{SETTINGS}.footage") == "" and not program.ask(SOLVING)
    assert program.ask("len(messages())") == heard


@pytest.mark.smoke
def test_a_dropped_picture_brings_its_sequence(program: Program, clips: Path) -> None:
    drop(program, sorted((clips / "walk").iterdir())[3])
    # Blender's own handlers take pictures, too: it asks, and underlines a letter of each.
    program.screen.key("s")
    program.wait(f"{SETTINGS}.points is not None", 300)
    program.settle()
    assert "12 of 12 frames registered" in program.ask(f"{SETTINGS}.summary")
    assert "Solved" in program.ask("messages()")[-1]


def test_a_clip_that_loses_the_focus_is_asked_about(program: Program, clips: Path) -> None:
    drop(program, clips / "clip" / "shot_0001.png")
    program.screen.key("s")
    program.still()
    program.shot("asked")
    program.screen.key("Escape")
    program.settle()
    assert "walk" in program.ask(f"{SETTINGS}.footage")


def replace(program: Program, clip: Path) -> None:
    """Drop another clip, and answer the question whether what is in focus may be lost by yes."""
    drop(program, sorted(clip.iterdir())[0])
    program.screen.key("s")
    program.still()
    program.screen.key("Return")


def test_a_clip_that_cannot_be_solved_leaves_the_solved_one(program: Program, clips: Path) -> None:
    before, heard = program.ask(SCENE), program.ask("len(messages())")
    replace(program, clips / "clip")
    program.wait(f"not ({SOLVING}) and messages()[{heard}:]", 300)
    program.settle()
    program.shot("refused")
    assert program.ask(SCENE) == before
    # What is reported is a menu over the viewport, which takes the next key.
    program.screen.key("Escape")
    program.settle()


def test_a_clip_is_replaced_in_one_step_of_undo(program: Program, clips: Path) -> None:
    before = program.ask(SCENE)
    replace(program, clips / "stroll")
    program.wait(f"'stroll' in {SETTINGS}.footage and not ({SOLVING})", 300)
    program.settle()
    program.shot("replaced")
    after = program.ask(SCENE)
    assert "stroll" in after[0] and "stroll" in after[-1]
    program.screen.move(*program.middle("VIEW_3D"))
    for keys, expected in (("ctrl+z", before), ("ctrl+shift+z", after), ("ctrl+z", before)):
        now = program.ask(SCENE)
        program.screen.key(keys)
        program.wait(f"{SCENE} != {now!r}")
        program.settle()
        program.shot(f"replaced_{keys}")
        assert program.ask(SCENE) == expected


def test_a_model_is_imported_for_the_clip(program: Program, clips: Path) -> None:
    program.ask(f"{SETTINGS}.footage = {str(clips / 'clip')!r}; None")
    drop(program, clips / "model" / "cameras.txt")
    program.wait(f"len({SETTINGS}.points.data.vertices) == 12")
    program.settle()
    assert "Imported COLMAP text. Solved" in program.ask("messages()")[-1]
    assert "4 of 4 frames" in program.ask(f"{SETTINGS}.summary")
