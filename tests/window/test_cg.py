"""A CG object in a clip with sound: the preview shows it, and F12 shows the clip meanwhile."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from .clips import write_desk
from .program import EXTENSION, Program
from .screen import Screen
from .steps import LEFT, SETTINGS, over, running

PREVIEW = f"__import__('sys').modules['{EXTENSION}.addon.render.viewport.viewport'].PREVIEW"
BEFORE_CAMERA = "bpy.context.scene.camera.matrix_world @ __import__('mathutils').Vector((0.5, -0.5, -5))"
CUBE = (0.6, 0.75)
"""A place of the picture that the cube covers."""
GREY = 12
"""Levels of 255 between the colours of a pixel of the cube at most; the table behind it is brown."""
SEEN = 10
"""Levels of 255 by which the picture spreads at least; an empty render shows squares of two alike."""

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module")
def program(
    screen: Screen, resources: Path, folder: Path, registered: None, desk: Path, desk_work: Path
) -> Iterator[Program]:
    """The sample clip, solved, with kept depth, and something in focus."""

    def in_focus(settings: Any, _solve: object) -> None:
        settings.work_dir = str(shutil.copytree(desk_work, folder / "cg" / "work"))
        settings.focus_distance = 5.0

    blend = write_desk(folder / "cg", desk, desk_work, in_focus)
    with running(screen, resources, "cg", blend) as made:
        yield made


def colours(program: Program, name: str) -> float:
    """Levels between the colours of the screen where the cube is, or will be."""
    x, y = over(program, CUBE)
    return float(np.ptp(program.shot(name)[round(y), round(x), :3].astype(int)))


def test_the_preview_shows_it(program: Program) -> None:
    program.press("virtual_aperture.preview", across=LEFT)
    program.wait(f"bool({PREVIEW}._wanted) and not {PREVIEW}.is_busy()", 60.0)
    assert colours(program, "without") > GREY
    program.ask("bpy.ops.mesh.primitive_cube_add(size=1); None")
    program.ask(f"setattr(bpy.context.object, 'location', {BEFORE_CAMERA})")
    # It begins with the window's next turn.
    program.wait(f"{PREVIEW}._wanted.cg is not None", 10.0)
    program.wait(f"not {PREVIEW}.is_busy()", 120.0)
    program.settle()
    assert colours(program, "with") <= GREY
    assert not program.ask(f"{PREVIEW}.problem({PREVIEW}._wanted)")


def test_a_render_shows_the_clip_until_it_is_there(program: Program) -> None:
    program.ask("setattr(bpy.context.scene.cycles, 'samples', 256)")
    program.ask(f"setattr({SETTINGS}, 'render_as', 'FRAMES')")
    program.screen.key("F12")
    program.wait("[w for w, _ in log if w == 'busy']", 30.0)
    shown = 0
    while program.ask("bpy.app.is_job_running('RENDER')"):
        middle = program.shot("rendering")[400:600, 640:960, :3]
        shown += middle.std() > SEEN
    # More than the last one, which may be taken between the picture and the end of its render.
    assert shown > 1
    program.shot("rendered")
