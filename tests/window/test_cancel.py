"""ESC in renders, and a drawing that fails: soon over, said, and no half a file."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from .clips import read_exr, write_scene
from .program import EXTENSION, Program
from .screen import Screen
from .steps import running

SIZE = (640, 360)
FAILING = f"""
import sys
views = sys.modules["{EXTENSION}.addon.render.views.gpu_views"]
kept = views.view_rows
def failing(*_):
    raise RuntimeError("provoked while drawing")
views.view_rows = failing
"""


@pytest.fixture(scope="module")
def program(screen: Screen, resources: Path, folder: Path, registered: None) -> Iterator[Program]:
    # Views take several seconds.
    blend = write_scene(folder / "cancel", SIZE, views=512)
    with running(screen, resources, "cancel", blend, tab=False) as made:
        made.screen.move(*made.middle("VIEW_3D"))
        yield made


def seconds_to_idle(program: Program) -> float:
    """Press ESC in a render; seconds from the key to the end of the job."""
    before = program.ask("len(log)")
    sent = program.screen.key("Escape")
    program.wait(f"[w for w, _ in log[{before}:] if w == 'idle']", 60)
    ended: float = program.ask(f"next(at for what, at in log[{before}:] if what == 'idle')")
    return ended - sent


def back_to_viewport(program: Program) -> None:
    """Close the render's window."""
    while program.ask("len(bpy.context.window_manager.windows)") > 1:
        program.close_window()
    program.screen.move(*program.middle("VIEW_3D"))


def start(program: Program, key: str) -> None:
    program.settle()
    program.screen.key(key)
    program.wait("bpy.app.is_job_running('RENDER')")


DRAWN = f"__import__('sys').modules['{EXTENSION}.addon.scene.gpu.main_thread']._current"


@pytest.fixture(autouse=True)
def nothing_left_running(program: Program) -> Iterator[None]:
    """Each test begins with the first window alone, and nothing rendering."""
    yield
    if program.ask("bpy.app.is_job_running('RENDER')"):
        program.screen.key("Escape")
        program.wait("not bpy.app.is_job_running('RENDER')")
    back_to_viewport(program)


@pytest.mark.parametrize("after", [0.1, 1.5])
def test_esc_ends_a_frame_before_it_is_drawn(program: Program, after: float) -> None:
    start(program, "F12")
    time.sleep(after)
    program.shot(f"{after}_before")
    assert program.ask("bpy.app.is_job_running('RENDER')"), "over before ESC"
    took = seconds_to_idle(program)
    program.settle()
    program.shot(f"{after}_cancelled")
    back_to_viewport(program)
    program.tell_time(took, f"ESC {after} s after F12")


def test_esc_ends_a_frame_while_it_is_drawn(program: Program) -> None:
    start(program, "F12")
    program.wait(f"{DRAWN} is not None and {DRAWN}.done > 8", 120)
    took = seconds_to_idle(program)
    back_to_viewport(program)
    program.tell_time(took, "ESC while views are drawn")


def test_esc_ends_an_animation_and_leaves_whole_files(program: Program) -> None:
    out = Path(program.ask("bpy.path.abspath('//')")) / "frames"

    shutil.rmtree(out, ignore_errors=True)
    before = program.ask("len(log)")
    program.ask("bpy.context.scene.virtual_aperture.views = 32")
    start(program, "ctrl+F12")
    program.wait(f"[w for w, _ in log[{before}:] if w == 'write']", 120)
    time.sleep(0.3)
    took = seconds_to_idle(program)
    back_to_viewport(program)
    program.ask("bpy.context.scene.virtual_aperture.views = 512")
    files = sorted(out.iterdir())
    assert 1 <= len(files) < 5
    for file in files:
        assert file.suffix == ".exr"
        assert np.all(read_exr(file)[..., 3] == 1), f"{file.name} is not whole"
    program.tell_time(took, "ESC in an animation")


@pytest.mark.parametrize("key", ["F12", "ctrl+F12"])
def test_what_fails_while_drawing_is_said_and_written_nowhere(program: Program, key: str) -> None:
    out = Path(program.ask("bpy.path.abspath('//')")) / "frames"
    shutil.rmtree(out, ignore_errors=True)
    heard = program.ask("len(messages())")
    program.ask(FAILING)
    try:
        report = program.render(key, seconds=180)
    finally:
        program.ask("views.view_rows = kept; None")
    shot = f"{key.replace('+', '_')}_failed"
    program.shot(shot)
    said = [line for line in program.ask("messages()")[heard:] if "provoked while drawing" in line]
    back_to_viewport(program)
    program.shot(f"{shot}_viewport")
    program.forget_said()
    assert said, "nothing is said"
    assert not any("Traceback" in line for line in said)
    assert "write" not in report
    assert not out.exists() or not list(out.iterdir()), "a file was written"
    # The next one is right again.
    program.ask("bpy.context.scene.virtual_aperture.views = 16")
    assert "complete" in program.render("F12", seconds=180)
    program.ask("bpy.context.scene.virtual_aperture.views = 512")
