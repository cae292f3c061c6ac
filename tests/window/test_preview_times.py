"""How soon the live preview shows its first and its best picture; times are printed, not judged."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from .clips import write_scene
from .program import EXTENSION, Program
from .screen import Screen
from .steps import SETTINGS, running

VIEWPORT = f"__import__('sys').modules['{EXTENSION}.addon.render.viewport.viewport']"
PREVIEW = f"{VIEWPORT}.PREVIEW"
SPACE = "view('VIEW_3D')['area'].spaces.active"
FRAMES = tuple(range(1, 13))

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module")
def blend(folder: Path, registered: None) -> Path:
    return write_scene(folder / "times", (640, 360), 16, FRAMES)


@pytest.fixture(scope="module")
def program(small_screen: Screen, resources: Path, blend: Path) -> Iterator[Program]:
    with running(small_screen, resources, "times", blend, tab=False) as made:
        yield made


def watch(program: Program) -> None:
    """Note when each picture of the wanted content is drawn."""
    program.ask(
        "import time\n"
        "if not hasattr(bpy, 'seen'):\n"
        "  bpy.seen = []\n"
        "  def note():\n"
        f"    for shown in list({VIEWPORT}._in_regions.values()):\n"
        f"      picture, wanted = shown.picture, {VIEWPORT}.PREVIEW._wanted\n"
        "      if picture and wanted and picture.wanted.key == wanted.key:\n"
        "        if not bpy.seen or bpy.seen[-1][1:] != [picture.level, id(picture)]:\n"
        "          bpy.seen.append([time.monotonic(), picture.level, id(picture)])\n"
        "  bpy.types.SpaceView3D.draw_handler_add(note, (), 'WINDOW', 'POST_PIXEL')\n"
        "None"
    )


def preview(program: Program) -> float:
    """Press Preview; the time of that."""
    watch(program)
    return float(
        program.ask(
            f"{SPACE}.region_3d.view_perspective = 'CAMERA'\nbpy.seen.clear()\nt = time.monotonic()\n"
            "with bpy.context.temp_override(**view('VIEW_3D')): bpy.ops.virtual_aperture.preview()\nt"
        )
    )


def report(program: Program, began: float, what: str) -> None:
    program.wait(f"bpy.seen and not {PREVIEW}.is_busy()", 200)
    program.settle()
    seen = program.ask("bpy.seen")
    assert program.ask(f"list({PREVIEW}._problems.values())") == []
    program.tell_time(seen[0][0] - began, f"{what}, first picture")
    program.tell_time(seen[-1][0] - began, f"{what}, best picture (levels {[level for _, level, _ in seen]})")
    program.settle()


def test_depth_is_unknown(program: Program) -> None:
    report(program, preview(program), "Preview, depth unknown")
    program.shot("unknown")


def test_the_focus_is_changed(program: Program) -> None:
    for number in range(3):
        change = f"{SETTINGS}.blur = {0.021 + 0.013 * number}"
        began = program.ask(f"bpy.seen.clear()\nt = time.monotonic()\n{change}\nt")
        report(program, began, "a change of the lens")
    program.shot("changed")


def test_preview_again(program: Program) -> None:
    program.ask("with bpy.context.temp_override(**view('VIEW_3D')): bpy.ops.virtual_aperture.preview()\nNone")
    program.settle()
    report(program, preview(program), "Preview again")


def test_preview_of_a_file_opened_again(program: Program, blend: Path) -> None:
    program.ask(f"bpy.ops.wm.open_mainfile(filepath={str(blend)!r}); None")
    program.settle()
    report(program, preview(program), "Preview of a file opened again")
    program.shot("again")
