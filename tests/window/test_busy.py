"""The interface while something works: how often it is drawn, and how soon ESC ends the work.

What is measured is told and not judged (`Program.tell_time`): the machine's other work is in it.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from addon.core.media.clip import open_footage
from addon.core.readers.matching import Imported
from addon.core.sfm.workspace import default_work_dir, keep_import

from ..scenes import slanted_plane
from .clips import FRAMES, write_scene
from .program import EXTENSION, ROOT, Program
from .screen import Screen
from .steps import running

SETTINGS = "bpy.context.scene.virtual_aperture"
MODULES = f"__import__('sys').modules['{EXTENSION}.addon"
SOLVING = f"{MODULES}.ui.base.solving'].running_solve()"
DEPTH = f"{MODULES}.ui.jobs.depth_ahead']._ahead"
PREVIEW = f"{MODULES}.render.viewport.viewport'].PREVIEW"
SECONDS = 4.0
"""How long each is watched."""
WATCH = """
drawn = []
def tag():
    for area in bpy.context.window_manager.windows[0].screen.areas:
        if area.type == 'VIEW_3D':
            area.tag_redraw()
    return 0.02
def drew():
    drawn.append(time.time())
bpy.app.timers.register(tag, persistent=True)
bpy.types.SpaceView3D.draw_handler_add(drew, (), 'WINDOW', 'POST_PIXEL')
None
"""

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module")
def blend(folder: Path, registered: None) -> Path:
    """A scene of 640x360 whose solve a working folder keeps."""
    from addon.core.camera.reconstruction import Intrinsics

    made = write_scene(folder / "busy", (640, 360))
    camera = Intrinsics(640, 360, 608.0, 608.0, 320.0, 180.0)
    footage = open_footage(made.parent / "clip")
    work = default_work_dir(footage.path, made.parent)
    keep_import(Imported(slanted_plane(camera, FRAMES), "true cameras", ()), footage, work)
    shutil.copy(ROOT / "sample_scenes" / "desk.mp4", made.parent)
    return made


@pytest.fixture(scope="module")
def program(small_screen: Screen, resources: Path, blend: Path) -> Iterator[Program]:
    with running(small_screen, resources, "busy", tab=False) as made:
        made.ask(WATCH)
        yield made


@contextmanager
def timed(program: Program, what: str) -> Iterator[None]:
    """Tell how often the viewport was drawn meanwhile, and its longest wait for that."""
    began = program.ask("time.time()")
    yield
    times = program.ask(f"[at for at in drawn if at > {began}] + [time.time()]")
    gaps = [later - before for before, later in zip([began, *times], times, strict=False)]
    rate = (len(times) - 1) / (times[-1] - began)
    program.tell_time(max(gaps), f"{what}: drawn {rate:.1f} times a second, longest wait")
    assert len(times) > 1, "the interface stood still"


def call(program: Program, name: str) -> None:
    """As its button does it."""
    program.ask(
        f"with bpy.context.temp_override(**view('VIEW_3D')):\n"
        f"    bpy.ops.virtual_aperture.{name}('INVOKE_DEFAULT')\n"
    )


def esc(program: Program, ended: str, what: str) -> None:
    """Press ESC over the viewport, and tell how long it takes until something is so."""
    program.screen.move(*program.middle("VIEW_3D"))
    program.settle()
    sent = program.screen.key("Escape")
    program.wait(ended, 60, every=0.01)
    program.tell_time(time.time() - sent, f"ESC in {what}")


def test_at_rest(program: Program) -> None:
    with timed(program, "at rest"):
        time.sleep(SECONDS)


def test_while_a_clip_is_solved(program: Program, blend: Path) -> None:
    program.show_sidebar("Virtual Aperture")
    program.ask(f"{SETTINGS}.footage = {str(blend.parent / 'desk.mp4')!r}")
    call(program, "solve")
    program.wait(f"{SOLVING} is not None")
    with timed(program, "solve"):
        time.sleep(SECONDS)
    program.shot("solving")
    assert program.ask(f"{SOLVING} is not None"), "over before ESC"
    esc(program, f"{SOLVING} is None", "a solve")


def test_while_depth_is_found(program: Program, blend: Path) -> None:
    program.ask(f"bpy.ops.wm.open_mainfile(filepath={str(blend)!r}); None")
    program.settle()
    program.show_sidebar("Virtual Aperture")
    call(program, "find_depth")
    program.wait(f"{DEPTH} is not None and {DEPTH}.is_running")
    with timed(program, "depth"):
        time.sleep(SECONDS)
    program.shot("depth")
    program.ask("bpy.ops.virtual_aperture.pause_depth()")


def test_while_the_preview_refines(program: Program) -> None:
    call(program, "preview")
    program.screen.move(*program.middle("VIEW_3D"))
    with timed(program, "preview, first picture and its depth"):
        time.sleep(SECONDS)
    program.wait(f"not {PREVIEW}.is_busy()", 120)
    with timed(program, "preview, focus pulled"):
        for step in range(20):
            program.ask(f"{SETTINGS}.focus_distance = {5.0 + 0.3 * step}")
            time.sleep(0.1)
    with timed(program, "preview, refined"):
        time.sleep(SECONDS)
    program.shot("preview")
    call(program, "preview")


def test_while_a_frame_is_rendered(program: Program) -> None:
    program.ask(f"{SETTINGS}.views = 2048; bpy.context.preferences.view.render_display_type = 'NONE'")
    program.screen.move(*program.middle("VIEW_3D"))
    program.settle()
    program.screen.key("F12")
    program.wait("bpy.app.is_job_running('RENDER')")
    with timed(program, "render"):
        time.sleep(SECONDS)
    program.shot("rendering")
    assert program.ask("bpy.app.is_job_running('RENDER')"), "over before ESC"
    esc(program, "not bpy.app.is_job_running('RENDER')", "a render")
