"""The focus strip in the camera view, with the mouse: in this order, in one Blender."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from .clips import write_scene
from .program import EXTENSION, Program
from .screen import Screen
from .steps import SETTINGS, running

FRAMES = range(1, 25)
MARKS = f"[[mark.frame, mark.name] for mark in {SETTINGS}.marks.items]"
FRAME = "bpy.context.scene.frame_current"
STRIP = f"__import__('sys').modules['{EXTENSION}.addon.ui.focus.focus_strip']"
DRAGGING = (
    "'VIRTUAL_APERTURE_OT_drag_focus_mark' in"
    " [o.bl_idname for w in bpy.context.window_manager.windows for o in w.modal_operators]"
)

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module")
def blend(folder: Path, registered: None) -> Path:
    """A small solved clip with marks picked at frames 3 and 20."""
    import bpy

    made = folder / "strip"
    blend = write_scene(made, (480, 270), frames=FRAMES)
    scene = bpy.context.scene
    settings = scene.virtual_aperture
    settings.footage, settings.work_dir = str(made / "clip"), str(made / "work")
    scene.frame_set(3)
    assert bpy.ops.virtual_aperture.pick_focus(x=0.3, y=0.4) == {"FINISHED"}
    scene.frame_set(20)
    assert bpy.ops.virtual_aperture.pick_focus(x=0.7, y=0.6, add=True) == {"FINISHED"}
    settings.footage = "//clip"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    return blend


@pytest.fixture(scope="module")
def program(screen: Screen, resources: Path, blend: Path) -> Iterator[Program]:
    with running(screen, resources, "strip", blend) as made:
        made.ask("view('VIEW_3D')['area'].spaces.active.region_3d.view_perspective = 'CAMERA'; None")
        yield made


def strip(program: Program, part: str) -> list[float]:
    """Places across of what the strip shows, pixels on the screen: of a question to the `Strip`; the last
    number is how far down its thumbnails' middles are."""
    program.ask(
        "import bpy\n"
        "with bpy.context.temp_override(**view('VIEW_3D')):\n"
        f"    found = {STRIP}.strip_of(bpy.context)\n"
        "None"
    )
    across = program.ask(f"[float(x) for x in {part}]")
    up = program.ask("(found.thumbnails + found.top) / 2")
    left, top, _, height = program.rectangle("VIEW_3D")
    return [*(left + x for x in across), top + height - up]


def test_marks_are_shown_at_their_frames(program: Program) -> None:
    program.wait(f"len({STRIP}.thumbnails._pictures) == 2")
    program.settle()
    program.shot("strip")
    (first, _), (second, _) = program.ask(MARKS)
    assert (first, second) == (3, 20)
    one, other, _ = strip(program, "found.middles")
    start, end, _ = strip(program, "[found.left, found.right]")
    assert (one - start) / (end - start) == pytest.approx(2 / 23, abs=0.01)
    assert (other - start) / (end - start) == pytest.approx(19 / 23, abs=0.01)


def test_a_click_goes_to_the_frame(program: Program) -> None:
    assert program.ask(FRAME) == 20
    one, other, down = strip(program, "found.middles")
    program.screen.click(one, down)
    program.wait(f"{FRAME} == 3")
    assert program.ask(f"{SETTINGS}.marks.active") == 0
    program.screen.click(other, down)
    program.wait(f"{FRAME} == 20")
    assert [frame for frame, _ in program.ask(MARKS)] == [3, 20]


def test_a_drag_moves_the_mark_and_undo_takes_it_back(program: Program) -> None:
    _, other, down = strip(program, "found.middles")
    (goal, _) = strip(program, "[found.place_of(12)]")
    program.screen.drag((other, down), (goal, down))
    program.wait(f"{FRAME} == 12")
    program.settle()
    program.shot("dragged")
    assert [frame for frame, _ in program.ask(MARKS)] == [3, 12]
    program.screen.move(*program.middle("VIEW_3D"))
    program.screen.key("ctrl+z")
    program.wait(f"[m[0] for m in {MARKS}] == [3, 20]")


def test_escape_leaves_the_mark(program: Program) -> None:
    one, _, down = strip(program, "found.middles")
    (goal, _) = strip(program, "[found.place_of(15)]")
    screen = program.screen
    screen.move(one, down)
    program.settle()
    screen._xdotool("mousedown", "1")
    for share in (0.2, 0.5, 1.0):
        screen.move(one + share * (goal - one), down)
        program.settle()
    assert program.ask(DRAGGING)
    program.shot("dragging")
    screen.key("Escape")
    screen._xdotool("mouseup", "1")
    program.wait(f"not ({DRAGGING})")
    assert [frame for frame, _ in program.ask(MARKS)] == [3, 20]


def test_a_click_takes_a_suggestion_and_undo_gives_it_back(program: Program) -> None:
    program.ask(
        f"from dataclasses import replace\nimport sys\nsettings = {SETTINGS}\n"
        "made = replace(settings.marks.items[0].value, frame=12, name='Face enters')\n"
        f"sys.modules['{EXTENSION}.addon.scene.focus.focus_marks'].suggest(settings, [made])\n"
        "bpy.ops.ed.undo_push(message='Suggest')\n"
        "view('VIEW_3D')['area'].tag_redraw()\nNone"
    )
    program.settle()
    program.shot("suggested")
    *_, suggested, down = strip(program, "found.middles")
    assert [frame for frame, _ in program.ask(MARKS)] == [3, 20]
    program.screen.click(suggested, down)
    program.wait(f"[m[0] for m in {MARKS}] == [3, 12, 20]")
    assert program.ask(FRAME) == 12 and program.ask(f"len({SETTINGS}.marks.suggested)") == 0
    program.settle()
    program.shot("taken")
    program.screen.move(*program.middle("VIEW_3D"))
    program.screen.key("ctrl+z")
    program.wait(f"[m[0] for m in {MARKS}] == [3, 20]")
    assert program.ask(f"len({SETTINGS}.marks.suggested)") == 1
