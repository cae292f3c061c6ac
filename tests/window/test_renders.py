"""F12 beside a second window and without a window: each picture is the headless one, to the bit.

In a window of its own, as Blender begins, it is rendered in `test_journey`.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.media.light import encode_srgb

from .clips import FRAMES, read_exr, write_scene
from .program import EXTENSION, Program, headless
from .screen import Screen
from .steps import running

MODES = ("SCREEN", "NONE")
COUNT = 6
"""Renders in each mode."""
REDRAWS = 8
"""Drawings of a window that the test adds to each render, a tenth of a second apart: in six renders an eighth
of what a program survives on lavapipe, where Blender's own count, too."""


@pytest.fixture(scope="module")
def blend(folder: Path, registered: None) -> Path:
    return write_scene(folder / "small")


@pytest.fixture(scope="module")
def expected(blend: Path, resources: Path) -> dict[int, np.ndarray]:
    """The frames as Blender renders them without a window."""
    out = blend.parent / "headless"
    headless(resources, "-b", str(blend), "-o", f"{out}/####", "-a")
    frames = {frame: read_exr(out / f"{frame:04d}.exr") for frame in FRAMES}
    assert all(picture[..., :3].std() > 0.05 for picture in frames.values()), "the frames show nothing"
    return frames


@pytest.fixture
def program(small_screen: Screen, resources: Path, blend: Path) -> Iterator[Program]:
    """Blender with the small scene open; each mode has its own.

    So the layout of windows is the file's. And on lavapipe a program crashes after some 400 drawings of a
    window (docs/known_defects.md): all modes together take more.
    """
    with running(small_screen, resources, "renders", tab=False) as made:
        # Timers run in the order in which they began: ours before the extension's, so that each of its turns
        # finds the context of another window.
        made.ask("bpy.app.timers.register(redraw, persistent=True)")
        made.ask(f"bpy.ops.preferences.addon_disable(module={EXTENSION!r})")
        made.ask(f"bpy.ops.preferences.addon_enable(module={EXTENSION!r})")
        made.ask(f"bpy.ops.wm.open_mainfile(filepath={str(blend)!r}); None")
        made.settle()
        yield made


def similarity(shot: np.ndarray, picture: np.ndarray) -> float:
    """Correlation, at most 1, of a rendered picture (linear light) with the best place on the screen, 1:1."""
    display = np.clip(encode_srgb(picture[..., :3]) * 255, 0, 255).astype(np.uint8)
    return float(cv2.matchTemplate(shot, display, cv2.TM_CCOEFF_NORMED).max())


@pytest.mark.parametrize("mode", MODES)
def test_renders_are_the_headless_ones(program: Program, mode: str, expected: dict[int, np.ndarray]) -> None:
    program.ask(f"bpy.context.preferences.view.render_display_type = {mode!r}")
    wrong = []
    for n in range(COUNT):
        frame = FRAMES[n % len(FRAMES)]
        if n == COUNT // 2:
            # A second one, as "New Window" makes it.
            program.ask("bpy.ops.wm.window_new()")
            program.settle()
        program.ask(f"bpy.context.scene.frame_set({frame})")
        program.ask(f"_state.update(redraws={REDRAWS})")
        report = program.render()
        file = program.pictures / f"{mode}_{n}.exr"
        file.unlink(missing_ok=True)
        if problem := program.ask(f"save_result({str(file)!r})"):
            wrong.append(f"render {n}, frame {frame}: {problem}")
        elif not np.array_equal(picture := read_exr(file), expected[frame]):
            away = float(np.abs(picture - expected[frame]).max())
            wrong.append(f"render {n}, frame {frame}: differs by up to {away:g}, {report}")
        if n in (0, COUNT - 1):
            program.settle()
            seen = similarity(program.shot(f"{mode}_{n}"), expected[frame])
            if mode != "NONE" and seen < 0.98:
                wrong.append(f"render {n}, frame {frame}: the screen shows nothing like it: {seen:.2f}")
    assert not wrong, "\n".join(wrong)
