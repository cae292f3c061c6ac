"""Blender's process has no thread of ours, and goes on when the preview's process is killed."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from .program import EXTENSION, Program
from .screen import Screen
from .steps import CLIP as DESK
from .steps import DEPTH, PICKING, SETTINGS, SOLVING, over, running

MODULES = f"__import__('sys').modules['{EXTENSION}.addon."
PREVIEW = f"{MODULES}render.viewport.viewport'].PREVIEW"
SEARCH = f"{MODULES}ui.jobs.first_person']._search"
CLIP = f"{MODULES}render.processes.clip_process'].CLIP"
PROCESS = f"{CLIP}.worker.process.pid"
SPACE = "view('VIEW_3D')['area'].spaces.active"
MOVIE = f"{MODULES}ui.jobs.movie'].MovieJob.last"
IN_VIEW = "with bpy.context.temp_override(**view('VIEW_3D')): bpy.ops.virtual_aperture"
OFF = f"bpy.ops.preferences.addon_disable(module={EXTENSION!r}); None"
THREADS = """
import sys, threading, traceback
found = []
for thread in threading.enumerate():
    if thread is not threading.main_thread():
        frames = traceback.walk_stack(sys._current_frames().get(thread.ident))
        files = [frame.f_code.co_filename for frame, _ in frames]
        own = [file.split('/addon/')[-1] for file in files if '/virtual_aperture/' in file]
        found += own[-1:]
sorted(found)
"""
"""The outermost file of ours of each thread but the main one that runs code of ours."""

WATCH = """
import sys, threading, traceback
bpy.started, start = [], threading.Thread.start
def noted(thread):
    files = [frame.f_code.co_filename for frame, _ in traceback.walk_stack(None)]
    bpy.started += [file.split('/addon/')[-1] for file in files if '/virtual_aperture/' in file][:1]
    start(thread)
threading.Thread.start = noted
None
"""
"""Note the innermost file of ours that starts a thread."""
IMPORTED = f"""
import sys, types
found, names = [], {{'threading', 'queue', 'multiprocessing', 'asyncio', 'concurrent.futures'}}
for name, module in list(sys.modules.items()):
    if name.startswith('{EXTENSION}.addon'):
        held = [each for each in vars(module).values() if isinstance(each, (type, types.ModuleType))]
        of = {{each.__name__ if isinstance(each, types.ModuleType) else each.__module__ for each in held}}
        found += [name] if of & names else []
found
"""
"""Modules of ours that hold a module, or a class, of those that start threads."""

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module")
def program(screen: Screen, resources: Path) -> Iterator[Program]:
    with running(screen, resources, "threads") as made:
        yield made


def threads(program: Program, when: str) -> list[str]:
    found: list[str] = program.ask(THREADS)
    assert program.ask(IMPORTED) == []
    program.tell(f"threads of ours, {when}: {len(found)}")
    return found


def test_a_solve_has_none(program: Program, folder: Path) -> None:
    clip = Path(shutil.copy(DESK, folder))
    program.ask(WATCH)
    assert threads(program, "at first") == []
    program.ask(f"{SETTINGS}.footage = {str(clip)!r}; None")
    program.ask(f"{IN_VIEW}.solve('INVOKE_DEFAULT')\nNone")
    program.wait(f"{MODULES}ui.base.solving'].Solving.running.process is not None")
    assert threads(program, "solving") == []
    program.wait(f"not {SOLVING}", 180)


def test_finding_depth_has_none(program: Program) -> None:
    # The nearest person is looked for first.
    program.wait(f"{SEARCH} is None", 180)
    program.wait(f"{DEPTH} is not None and {DEPTH}.done")
    assert threads(program, "finding depth") == []
    program.wait(f"not {DEPTH}.is_running", 300)


def test_a_movie_has_none(program: Program) -> None:
    program.ask(f"{IN_VIEW}.render_clip('INVOKE_DEFAULT')\nNone")
    program.wait(f"{MOVIE} is not None and {MOVIE}.done")
    assert threads(program, "a movie") == []
    program.ask(f"{IN_VIEW}.cancel_movie()\nNone")


def test_the_preview_has_none(program: Program) -> None:
    program.ask(f"{IN_VIEW}.preview()\nNone")
    program.wait(f"len({PREVIEW}._kept)", 300)
    assert threads(program, "the preview") == []
    program.wait(f"not {PREVIEW}.is_busy()", 300)
    program.settle()
    program.shot("preview")


def test_a_pick_has_none(program: Program) -> None:
    program.ask(f"{IN_VIEW}.pick_focus('INVOKE_DEFAULT')\nNone")
    program.settle()
    program.screen.click(*over(program, (0.5, 0.6)))
    assert threads(program, "a pick") == []
    program.wait(f"not ({PICKING})", 100)
    program.wait(f"not {PREVIEW}.is_busy()", 300)
    program.settle()
    program.shot("picked")


def test_the_preview_goes_on_when_its_process_is_killed(program: Program) -> None:
    killed = program.ask(PROCESS)
    began = program.ask(f"import time\n{SETTINGS}.blur += 0.01\ntime.monotonic()")
    # Only a process that makes a picture is missed.
    kill = f"(os.kill({PROCESS}, signal.SIGKILL), True)[1]"
    program.wait(f"import os, signal\n{PREVIEW}._step is not None and {kill}")
    program.wait(f"{PREVIEW}.note", 60)
    note = program.ask(f"{PREVIEW}.note")
    assert note.startswith("The preview is begun again") and "SIGKILL" in note
    program.shot("killed")
    program.wait(f"not {PREVIEW}.is_busy()", 300)
    assert program.ask(f"[{PREVIEW}.note, list({PREVIEW}._problems.values())]") == ["", []]
    assert program.ask(PROCESS) != killed
    program.tell_time(program.ask("time.monotonic()") - began, "killed, until the best picture")
    program.settle()
    program.shot("goes_on")
    assert [line for line in program.said().splitlines() if "begun again" in line] == [f"note: {note}"]


def test_a_render_leaves_none(program: Program) -> None:
    assert "complete" in program.render(seconds=200)
    assert threads(program, "rendered") == []
    while program.ask("len(bpy.context.window_manager.windows)") > 1:
        program.close_window()
    program.tell(
        f"files of ours that started threads, joined within a call: {set(program.ask('bpy.started'))}"
    )
    assert set(program.ask("bpy.started")) <= {"core/base/side_by_side.py"}


def test_nothing_is_left_without_the_extension(program: Program) -> None:
    process = program.ask(PROCESS)
    program.ask(OFF)
    program.settle()
    assert threads(program, "disabled") == []
    assert not Path(f"/proc/{process}").exists()
