"""What tests in the window ask of Blender's state, and steps that several of them take."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from . import file_drop
from .program import EXTENSION, ROOT, Program
from .screen import Screen

CLIP = ROOT / "sample_scenes" / "desk.mp4"
PICTURES = ROOT / "build" / "window"
UP, DOWN = 4, 5
"""Buttons of the mouse: its wheel."""
SETTINGS = "bpy.context.scene.virtual_aperture"
MODAL = "[o.bl_idname for w in bpy.context.window_manager.windows for o in w.modal_operators]"
SOLVING = f"'VIRTUAL_APERTURE_OT_solve' in {MODAL}"
DEPTH = f"__import__('sys').modules['{EXTENSION}.addon.ui.jobs.depth_ahead']._ahead"
MARKS = f"[[mark.frame, mark.distance] for mark in {SETTINGS}.marks.items]"
PICKING = f"'VIRTUAL_APERTURE_OT_pick_focus' in {MODAL}"
LEFT, PRESETS, RIGHT = 0.3, 0.83, 0.83
"""Shares of the sidebar's width where the left one of two buttons is, the presets of lenses are, and a small
button at the panel's end."""
PANELS = ("Virtual Aperture", "Clip", "Solve", "Focus", "Lens", "Preview", "Render")
FIRST, HEADER = 14, 28
"""Pixels from the sidebar's top to the middle of the first panel's header, and from one to the next of panels
that are closed."""
FOLDED = 0.5
"""Seconds until a panel has folded or unfolded, which is animated."""
OPENS, NARROW = 292, 200
"""Pixels across of the sidebar as Blender opens it, and of a narrow one."""

POPOVER = 10_000
"""Pixels, fewer than a popover has, and more than a button that lights up under the mouse."""


@contextmanager
def running(
    screen: Screen, resources: Path, name: str, blend: Path | None = None, tab: bool = True
) -> Iterator[Program]:
    """A Blender without its splash screen, with a .blend open and our tab in the sidebar; its pictures go
    into the folder `name`."""
    made = Program(screen, resources, PICTURES / name)
    try:
        made.screen.move(*made.middle("VIEW_3D"))
        made.screen.key("Escape")
        if blend is not None:
            made.ask(f"bpy.ops.wm.open_mainfile(filepath={str(blend)!r}); None")
        made.settle()
        if tab:
            made.show_sidebar("Virtual Aperture")
        yield made
        assert "Traceback" not in made.said(), made.said()[-3000:]
    finally:
        made.close()


def first_window(program: Program) -> None:
    """Close all windows but the first; the mouse is over its viewport."""
    while program.ask("len(bpy.context.window_manager.windows)") > 1:
        program.close_window()
    left, top, width, height = program.rectangle("VIEW_3D")
    program.screen.move(left + 0.2 * width, top + 0.8 * height)
    program.settle()


def make_wide(program: Program, width: int) -> None:
    """Drag the sidebar's border until it is so wide, to a few pixels: a drag of fewer is a click."""
    for _ in range(5):
        program.settle()
        left, top, now, _ = program.rectangle("VIEW_3D", "UI")
        if abs(now - width) > 4:
            # Beside the first header: below the panels clicks are the view's. Slowly off the border: Blender
            # takes it where the mouse is after a few pixels.
            goal, y = left + now - width, top + 14
            program.screen.drag((left, y), (left + (3 if goal > left else -3), y), (goal, y))
            program.settle()


def look(program: Program, name: str) -> None:
    """A picture of the screen with the sidebar as it opens, and one with a narrow one, which stays so."""
    first_window(program)
    make_wide(program, OPENS)
    program.shot(name)
    make_wide(program, NARROW)
    assert abs(program.rectangle("VIEW_3D", "UI")[2] - NARROW) <= 4
    program.shot(f"{name}_{NARROW}")


def show_preferences(program: Program, section: str) -> None:
    """Ctrl comma, and a click on a section."""
    program.screen.move(*program.middle("VIEW_3D"))
    program.screen.key("ctrl+comma")
    program.wait("len(bpy.context.window_manager.windows) == 2")
    program.settle()
    left, top, width, height = program.rectangle("PREFERENCES", "UI", 1)
    for y in range(top + 20, top + height // 2, 12):
        program.screen.click(left + width / 2, y)
        program.settle()
        if program.ask("bpy.context.preferences.active_section") == section:
            return
    raise AssertionError(f"no section {section}")


def over(program: Program, place: tuple[float, float]) -> tuple[float, float]:
    """Pixels on the screen of a place of the picture, as the viewport through the camera shows it."""
    corners = (
        "[bpy.context.scene.camera.matrix_world @ c for c in"
        " bpy.context.scene.camera.data.view_frame(scene=bpy.context.scene)]"
    )
    at: list[list[float]] = program.ask(f"project({corners})")
    xs, ys = [x for x, _ in at], [program.screen.size[1] - y for _, y in at]
    return min(xs) + place[0] * (max(xs) - min(xs)), min(ys) + place[1] * (max(ys) - min(ys))


def begin(program: Program, add: bool = False) -> None:
    """Start picking with the mouse, for another mark with `add`."""
    program.press("pick_focus(add=True)" if add else "pick_focus()", across=RIGHT if add else 0.6)
    program.wait(PICKING)


@contextmanager
def opened(program: Program, name: str) -> Iterator[None]:
    """With a panel of the sidebar open, and the first one closed, which is open else."""
    _click_header(program, "Virtual Aperture")
    _click_header(program, name)
    yield
    _click_header(program, name)
    _click_header(program, "Virtual Aperture")


def open_below(program: Program, does: str) -> None:
    """Open the first closed sub-panel below a button: clicks on labels between change nothing."""
    button = program.find(does, "VIEW_3D", "UI")
    left, top, width, height = program.rectangle("VIEW_3D", "UI")
    before = _seen(program)
    for y in range(round(button.y) + 16, top + height, 12):
        program.screen.click(left + width / 3, y)
        time.sleep(FOLDED)
        if np.abs(_seen(program) - before).max() > 50:
            return
    raise AssertionError(f"no sub-panel below {does}")


def open_details(program: Program, above: str) -> tuple[float, float]:
    """Open the details of the warnings, whose button is below a named one; its place. A popover cannot be
    asked for by name."""
    button = program.find(above, "VIEW_3D", "UI")
    before: Any = program.screen.picture()
    _, top, _, height = program.rectangle("VIEW_3D", "UI")
    # Past the named button: its tooltip is as large as a popover.
    for y in range(round(button.y) + 32, top + height, 10):
        program.screen.click(button.x, y)
        program.still()
        now: Any = program.screen.picture()
        if (np.abs(now.astype(int) - before).max(axis=2) > 20).sum() > POPOVER:
            return button.x, float(y)
    raise AssertionError(f"no details below {above}")


def press_in_details(program: Program, above: str, done: str) -> None:
    """Open the details of the warnings, and press down them until `done` is true."""
    x, top = open_details(program, above)
    program.shot("details")
    # Below the button itself, which closes them.
    for y in range(round(top) + 40, round(top) + 250, 10):
        program.screen.click(x, y)
        program.settle()
        if program.ask(done):
            program.screen.key("Escape")
            return
    raise AssertionError(f"no button in the details makes {done}")


def _seen(program: Program) -> np.ndarray:
    """The sidebar, the mouse beside it."""
    left, top, width, height = program.rectangle("VIEW_3D", "UI")
    program.screen.move(left - 100, top + height - 20)
    program.settle()
    picture: Any = program.screen.picture()
    return np.asarray(picture[top : top + height, left : left + width]).astype(int)


def _click_header(program: Program, name: str) -> None:
    """Open or close a panel before which all are closed."""
    left, top, width, _ = program.rectangle("VIEW_3D", "UI")
    for _ in range(30):
        program.screen.click(left + width / 2, top + 200, UP)
    program.settle()
    program.screen.click(left + width / 3, top + FIRST + HEADER * PANELS.index(name))
    time.sleep(FOLDED)
    program.settle()


def ended(program: Program) -> None:
    """Wait until picking has ended."""
    program.wait(f"not ({PICKING})")
    program.settle()


def drop(program: Program, file: Path) -> None:
    """Drop a file on the viewport as a file manager does."""
    x, y = (str(round(place)) for place in program.middle("VIEW_3D"))
    subprocess.run(
        [sys.executable, file_drop.__file__, x, y, str(file)], env=program.screen.environment, check=True
    )
    program.still()
    program.shot(f"drop_{file.stem}")
