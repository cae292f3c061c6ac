"""The eyedropper and the focus pull, with mouse and keys: in this order, in one Blender."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from .clips import write_desk
from .program import EXTENSION, Program
from .screen import Screen
from .steps import LEFT, MARKS, PICKING, begin, ended, over, running

SETTINGS = "bpy.context.scene.virtual_aperture"
POINTS = f"list({SETTINGS}.marks.points)"
KEYS = f"__import__('sys').modules['{EXTENSION}.addon.scene.lens.lens'].keys_of({SETTINGS}, 'focus_distance')"
GLOBE, FLOOR = (0.53, 0.45), (0.35, 0.67)
"""Places of the sample clip's first frame, fractions of the picture: the globe is nearer."""
PICKED_IN = (1, 25)
"""Frames in which places are picked."""

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module")
def blend(folder: Path, registered: None, desk: Path, desk_work: Path) -> Path:
    """The sample clip, solved, in a .blend; the depth of two frames is kept, as after *Find Depth*."""
    import bpy

    from addon.core.depth.source import NO_PICTURE
    from addon.scene.sources.shot import shot_of

    def keep_depth(settings: Any, _solve: object) -> None:
        settings.work_dir = str(shutil.copytree(desk_work, folder / "pick" / "work"))

    file = write_desk(folder / "pick", desk, desk_work, keep_depth)
    context = shot_of(bpy.context.scene).context
    for frame in PICKED_IN:
        context.depth_source().at(frame, context.canvas(frame), NO_PICTURE)
    return file


@pytest.fixture(scope="module")
def program(screen: Screen, resources: Path, blend: Path) -> Iterator[Program]:
    with running(screen, resources, "pick", blend) as made:
        yield made


def edited(program: Program, question: str, *keys: str) -> Any:
    """The answer once keys were pressed over the timeline, and the marks have followed."""
    program.screen.move(*program.middle("DOPESHEET_EDITOR"))
    program.settle()
    program.screen.key(*keys)
    program.screen.nudge()
    program.settle()
    return program.ask(question)


@pytest.mark.smoke
def test_a_click_sets_the_focus(program: Program) -> None:
    assert program.ask(POINTS) == []
    begin(program)
    assert program.ask("view('VIEW_3D')['area'].spaces.active.region_3d.view_perspective") == "CAMERA"
    program.screen.move(*over(program, GLOBE))
    program.settle()
    program.shot("over_the_globe")
    program.screen.click(*over(program, GLOBE))
    ended(program)
    program.shot("globe")
    ((frame, away),) = program.ask(MARKS)
    assert frame == 1 and away > 0 and len(program.ask(POINTS)) == 4
    x, y = program.ask(f"list({SETTINGS}.marks.items[0].places[0].xy)")
    # Within two pixels of the screen.
    assert abs(x - GLOBE[0]) < 0.004 and abs(y - GLOBE[1]) < 0.006


@pytest.mark.smoke
def test_escape_leaves_it(program: Program) -> None:
    before = program.ask(POINTS)
    begin(program)
    program.screen.click(*over(program, FLOOR), held="shift")
    program.settle()
    program.shot("two_places")
    program.screen.key("Escape")
    ended(program)
    assert program.ask(POINTS) == before


@pytest.mark.smoke
def test_shift_adds_ctrl_removes_enter_confirms(program: Program) -> None:
    globe = program.ask(POINTS)
    begin(program)
    program.screen.click(*over(program, FLOOR), held="shift")
    program.settle()
    program.screen.key("Return")
    ended(program)
    both = program.ask(POINTS)
    assert len(both) == 8 and both[:4] == globe
    begin(program)
    program.screen.click(*over(program, GLOBE), held="ctrl")
    program.settle()
    program.screen.key("Return")
    ended(program)
    assert program.ask(POINTS) == both[4:]
    program.screen.move(*over(program, GLOBE))
    program.screen.key("ctrl+z")
    program.wait(f"{POINTS} == {both}")
    program.screen.key("ctrl+shift+z")
    program.wait(f"{POINTS} == {both[4:]}")


def test_ctrl_z_takes_the_last_place_back_and_nothing_else(program: Program) -> None:
    before, marks = program.ask(POINTS), program.ask(MARKS)
    begin(program)
    program.screen.click(*over(program, GLOBE), held="shift")
    program.settle()
    for _ in range(2):
        program.screen.key("ctrl+z")
        program.settle()
    assert program.ask(PICKING) and program.ask(MARKS) == marks
    program.screen.key("Return")
    ended(program)
    assert program.ask(POINTS) == before


def test_a_second_mark_pulls(program: Program) -> None:
    program.ask("bpy.context.scene.frame_set(25)")
    program.settle()
    begin(program, add=True)
    program.screen.click(*over(program, GLOBE))
    ended(program)
    program.shot("pull")
    (first, far), (second, near) = program.ask(MARKS)
    assert (first, second) == (1, 25) and near < far
    assert program.ask(f"{SETTINGS}.focus_distance") == near


def test_a_key_that_is_moved_in_the_timeline_is_the_users(program: Program) -> None:
    module = "type(bpy.context.scene.virtual_aperture).__module__"
    users = f"__import__('sys').modules[{module}].focus_marks.are_keys_users"
    program.ask(
        f"for k in {KEYS}.keyframe_points:"
        " k.select_control_point = k.select_left_handle = k.select_right_handle = k.co[0] == 25\nNone"
    )
    before = program.ask(MARKS)
    program.settle()
    edited(program, "1", "g", "minus", "5", "Return")
    program.wait(f"{users}({SETTINGS})")
    program.shot("moved")
    assert program.ask(MARKS) == before
    edited(program, "1", "ctrl+z")
    program.wait(f"not {users}({SETTINGS})")


def test_a_click_on_the_preview_focuses_there(program: Program) -> None:
    program.ask("bpy.context.scene.frame_set(1)")
    program.press("virtual_aperture.preview", across=LEFT)
    program.wait("view('VIEW_3D')['area'].spaces.active.shading.type == 'RENDERED'")
    program.screen.move(*over(program, GLOBE))
    program.settle()
    program.shot("before_the_tap")
    for place in (FLOOR, GLOBE):
        program.screen.click(*over(program, place))
        program.wait(f"abs({SETTINGS}.marks.items[0].places[0].xy[0] - {place[0]}) < 0.004")
        ended(program)
    program.shot("tapped")
    before = program.ask(MARKS)
    tool = "with bpy.context.temp_override(**view('VIEW_3D')):\n    bpy.ops.wm.tool_set_by_id(name='builtin."
    for off in (f"{tool}cursor')\nNone", f"{tool}select')\n{SETTINGS}.focus_by_click = False\nNone"):
        program.ask(off)
        program.screen.click(*over(program, FLOOR))
        program.settle()
        assert program.ask(MARKS) == before and not program.ask(PICKING)
