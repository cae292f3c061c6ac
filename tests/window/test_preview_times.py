"""How soon the live preview shows its first and its best picture; times are printed, not judged."""

from __future__ import annotations

import re
import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from .clips import write_scene
from .program import BACKEND, EXTENSION, Program
from .screen import Screen
from .steps import CLIP, SETTINGS, SOLVING, running

ADDON = f"__import__('sys').modules['{EXTENSION}.addon"
VIEWPORT = f"{ADDON}.render.viewport.viewport']"
PREVIEW = f"{VIEWPORT}.PREVIEW"
PROCESS = f"{VIEWPORT}.CLIP"
IN_VIEW = "with bpy.context.temp_override(**view('VIEW_3D')): bpy.ops.virtual_aperture"
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
            f"{IN_VIEW}.preview()\nt"
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
    program.ask(f"{IN_VIEW}.preview()\nNone")
    program.settle()
    report(program, preview(program), "Preview again")


def test_preview_of_a_file_opened_again(program: Program, blend: Path) -> None:
    program.ask(f"bpy.ops.wm.open_mainfile(filepath={str(blend)!r}); None")
    program.settle()
    report(program, preview(program), "Preview of a file opened again")
    program.shot("again")


def test_the_process_has_this_gpu_backend(program: Program) -> None:
    launcher = f"{ADDON}.render.processes.launcher']"
    program.ask(f"bpy.call = {PROCESS}.call({launcher}._backend); None")
    program.wait(f"{PROCESS}.poll() or bpy.call.ended")
    said = program.ask(f"[bpy.call.result(), {launcher}._backend()]")
    assert said[0] == said[1] == ["--gpu-backend", BACKEND or "opengl"]


def tell_memory(program: Program) -> None:
    """Tell how much memory the preview's process takes alone."""
    process = program.ask(f"{PROCESS}.job.process.pid")
    rows = re.findall(r"^Private_\w+: +(\d+) kB", Path(f"/proc/{process}/smaps_rollup").read_text(), re.M)
    program.tell(f"memory of the preview's process: {sum(map(int, rows)) // 1000} MB")


def solve(program: Program, folder: Path) -> None:
    """Begin to solve a clip in a new file; return as the preview's process starts."""
    folder.mkdir()
    clip = shutil.copy(CLIP, folder)
    program.ask("bpy.ops.wm.read_homefile(app_template='', use_factory_startup=True); None")
    program.settle()
    assert program.ask(f"{PROCESS}.job is None"), "there is no clip"
    program.ask(f"{SETTINGS}.footage = {str(clip)!r}; None")
    program.ask(f"{IN_VIEW}.solve('INVOKE_DEFAULT')\nNone")
    program.wait(f"{PROCESS}.job is not None", 180)


@pytest.mark.parametrize("wait", [0.0, 3.0])
def test_preview_after_a_solve(program: Program, folder: Path, wait: float) -> None:
    solve(program, folder / f"after_{wait:g}")
    program.wait(f"{SETTINGS}.points is not None", 180)
    time.sleep(wait)
    tell_memory(program)
    report(program, preview(program), f"Preview {wait:g} s after a solve")
    program.shot(f"after_{wait:g}")


@pytest.mark.long
def test_a_cancelled_solve_ends_the_process(program: Program, folder: Path) -> None:
    solve(program, folder / "cancelled")
    assert program.ask(SOLVING)
    program.screen.move(*program.middle("VIEW_3D"))
    program.screen.key("Escape")
    program.wait(f"not {SOLVING}")
    assert program.ask(f"[{SETTINGS}.points is None, {PROCESS}.job is None]") == [True, True]
