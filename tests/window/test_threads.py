"""The threads of ours in Blender's process: few while something is shown or looked for, none otherwise."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from .program import EXTENSION, Program
from .screen import Screen
from .steps import CLIP, DEPTH, SETTINGS, SOLVING, running

MODULES = f"__import__('sys').modules['{EXTENSION}.addon."
PREVIEW = f"{MODULES}render.viewport.viewport'].PREVIEW"
SEARCH = f"{MODULES}ui.jobs.first_person']._search"
MOVIE = f"{MODULES}ui.jobs.movie']._movie"
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

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module")
def program(screen: Screen, resources: Path) -> Iterator[Program]:
    with running(screen, resources, "threads") as made:
        yield made


def threads(program: Program, when: str) -> list[str]:
    found: list[str] = program.ask(THREADS)
    print(f"{when}: {', '.join(found) or 'none'}")
    return found


def test_a_solve_has_none(program: Program, folder: Path) -> None:
    clip = Path(shutil.copy(CLIP, folder))
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


def test_the_preview_has_one(program: Program) -> None:
    program.ask(f"{IN_VIEW}.preview()\nNone")
    program.wait(f"len({PREVIEW}._kept)", 300)
    assert threads(program, "the preview") == ["render/viewport/preview.py"]


def test_nothing_is_left_without_the_extension(program: Program) -> None:
    program.ask(OFF)
    program.settle()
    assert threads(program, "disabled") == []
