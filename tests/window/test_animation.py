"""A clip that is long enough for several processes: the headless frames, to the bit, and a first look."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
import pytest

from ..in_blender import LIGHT, place_lamp
from .clips import SMALL, read_exr, write_scene
from .program import EXTENSION, Program, headless
from .screen import Screen
from .steps import running

FRAMES = tuple(range(1, 17))
MODULE = f"__import__('sys').modules['{EXTENSION}.addon.render.processes.frames_ahead']"
AHEAD = f"next(iter({MODULE}._prepared), None)"


@pytest.fixture(scope="module")
def blend(folder: Path, registered: None) -> Path:
    """With a CG object that moves, which each process that draws has drawn by one of its own."""
    made = write_scene(folder / "animation", SMALL, 64, FRAMES)
    bpy.ops.wm.open_mainfile(filepath=str(made))
    scene = bpy.context.scene
    lamp, right = place_lamp(scene, 4.0, 20), scene.camera.matrix_world.normalized().col[0].xyz
    for frame, side in ((FRAMES[0], -1), (FRAMES[-1], 1)):
        lamp.location = side * right
        lamp.keyframe_insert("location", frame=frame)
    scene.cycles.samples = 4
    bpy.ops.wm.save_mainfile()
    return made


@pytest.fixture(scope="module")
def program(small_screen: Screen, resources: Path, blend: Path) -> Iterator[Program]:
    with running(small_screen, resources, "animation", blend, tab=False) as made:
        # However few the machine has.
        made.ask("sys.modules['os'].process_cpu_count = lambda: 2; None")
        made.settle()
        yield made


def started(program: Program) -> None:
    """Ctrl F12, until other processes draw, too."""
    program.screen.move(*program.middle("VIEW_3D"))
    program.settle()
    program.screen.key("ctrl+F12")
    program.wait(f"{AHEAD} is not None", 60)


def test_the_frames_are_the_headless_ones(program: Program, blend: Path, resources: Path) -> None:
    # With a range of fewer frames no others are worth their start.
    for first, last in ((1, 7), (8, 14), (15, 16)):
        one = blend.parent / "headless"
        headless(resources, "-b", str(blend), "-o", f"{one}/####", "-s", str(first), "-e", str(last), "-a")
    before = program.ask("len(log)")
    began = time.monotonic()
    started(program)
    program.shot("started")
    program.wait(f"[w for w, _ in log[{before}:] if w == 'idle']", 300)
    program.tell_time(time.monotonic() - began, "16 frames")
    program.shot("ended")
    program.close_window()
    assert program.ask(f"{AHEAD} is None")
    out, columns = blend.parent / "frames", list[float]()
    for frame in FRAMES:
        seen, expected = (read_exr(folder / f"{frame:04d}.exr") for folder in (out, one))
        assert expected[..., :3].std() > 0.05
        assert np.array_equal(seen, expected), frame
        columns.append(np.nonzero(seen[..., :3].min(axis=2) > LIGHT / 2)[1].mean())
    assert np.ptp(columns) > 20


def test_esc_ends_all_processes(program: Program, blend: Path) -> None:
    shutil.rmtree(blend.parent / "frames")
    before = program.ask("len(log)")
    started(program)
    program.ask(f"globals().update(workers=[*{AHEAD}.workers], folder={AHEAD}.workers[0].folder); None")
    program.wait(f"[w for w, _ in log[{before}:] if w == 'write']", 120)
    sent = program.screen.key("Escape")
    program.wait(f"[w for w, _ in log[{before}:] if w == 'idle']", 60)
    ended = program.ask(f"next(at for what, at in log[{before}:] if what == 'idle')")
    program.tell_time(ended - sent, "ESC in an animation of several processes")
    program.wait("all(worker.process.poll() is not None for worker in workers)", 15)
    program.wait("not folder.exists()", 5)
    program.close_window()


def test_a_first_look_is_seen_while_depth_is_found(program: Program, folder: Path) -> None:
    # Depth takes some seconds.
    blend = write_scene(folder / "look", (640, 360), 32, FRAMES)
    program.ask(f"bpy.ops.wm.open_mainfile(filepath={str(blend)!r}); None")
    program.screen.move(*program.middle("VIEW_3D"))
    program.settle()
    before = program.ask("len(log)")
    began = program.screen.key("F12")
    while not is_colourful(program.shot("first_look")):
        assert not program.ask(f"[w for w, _ in log[{before}:] if w == 'idle']"), "nothing was seen before"
    program.tell_time(time.time() - began, "first look")
    assert program.ask("bpy.app.is_job_running('RENDER')")
    program.screen.key("Escape")
    program.wait(f"[w for w, _ in log[{before}:] if w == 'idle']", 60)
    program.close_window()


def is_colourful(shot: np.ndarray) -> bool:
    """Whether something is seen in the middle of the screen but Blender's own grays."""
    height, width = shot.shape[:2]
    middle = shot[height // 3 : 2 * height // 3, width // 3 : 2 * width // 3].astype(int)
    return float(np.ptp(middle, axis=2).mean()) > 10
