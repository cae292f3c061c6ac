"""The plane sweep on Blender's GPU against the processor's, on either backend: without a window, and in one
where a thread asks and the main thread sweeps in slices."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from .program import BACKEND, EXTENSION, Program, headless
from .screen import Screen
from .steps import running

MATCHER = f"{EXTENSION}.addon.scene.gpu.gpu_matcher"
ALONE = f"""
import bpy, gpu, importlib
gpu.init()
matcher = importlib.import_module({MATCHER!r})
print("backend:", gpu.platform.backend_type_get(), "real:", matcher.is_real())
print("difference:", repr(matcher.difference()))
"""
IN_A_THREAD = f"""
import importlib, threading
matcher, told = importlib.import_module({MATCHER!r}), []
def compare():
    try:
        told.append(matcher.difference())
    except BaseException as error:
        told.append(repr(error))
threading.Thread(target=compare).start()
None
"""


@pytest.fixture
def program(small_screen: Screen, resources: Path) -> Iterator[Program]:
    with running(small_screen, resources, "gpu_sweep", tab=False) as made:
        yield made


def test_it_is_right_without_a_window(resources: Path) -> None:
    said = headless(resources, "-b", "--python-exit-code", "1", "--python-expr", ALONE)
    assert "difference: ''" in said, said[-3000:]
    # What draws here is software, and is told from a GPU whatever the backend is.
    assert f"backend: {BACKEND.upper() or 'OPENGL'} real: False" in said, said[-3000:]


def test_it_is_right_where_a_thread_asks_for_it(program: Program) -> None:
    program.ask(IN_A_THREAD)
    assert program.wait("told") == [""]
