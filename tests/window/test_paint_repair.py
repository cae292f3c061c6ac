"""A mistake of the depth mended by brush, with mouse and keys: in this order, in one Blender."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from addon.core.camera.reconstruction import Reconstruction

from .clips import write_desk
from .program import EXTENSION, Program
from .screen import Screen
from .steps import MODAL, SETTINGS, over, running

PAINTING = f"'VIRTUAL_APERTURE_OT_paint_repair' in {MODAL}"
REPAIRS = f"[[r.kind, r.frame, len(r.places), r.reference[0] >= 0] for r in {SETTINGS}.repairs.items]"
PREVIEW = f"__import__('sys').modules['{EXTENSION}.addon.render.viewport.viewport'].PREVIEW"
START = (
    "with bpy.context.temp_override(**view('VIEW_3D')):\n"
    "    bpy.ops.virtual_aperture.paint_repair('INVOKE_DEFAULT')\n1"
)
"""As its button does: the panel that has it is closed to begin with."""
GLOBE, WALL = (0.53, 0.45), (0.2, 0.15)
"""Places in the sample clip's first frame, fractions of the picture."""
FINAL = 600
"""Seconds for a final picture of the preview, whose depth must be found first."""

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module")
def blend(folder: Path, registered: None, desk: Path, desk_work: Path) -> Path:
    """The sample clip, solved, with its wall in focus, in a .blend."""
    from addon.core.focus.focus import Focus
    from addon.scene.focus.focus_marks import set_focus

    def focus_on_wall(settings: Any, solve: Reconstruction) -> None:
        settings.blur, image = 0.05, solve.images[0]
        far = np.percentile(image.to_camera(solve.points.xyz[image.points])[:, 2], 90)
        set_focus(settings, Focus(distance=float(far)), image.frame)

    return write_desk(folder / "repair", desk, desk_work, focus_on_wall)


@pytest.fixture(scope="module")
def program(screen: Screen, resources: Path, blend: Path) -> Iterator[Program]:
    with running(screen, resources, "repair", blend) as made:
        yield made


def detail(program: Program, name: str) -> float:
    """Mean difference of neighbouring pixels round the globe's middle, in grey levels; a picture is kept."""
    x, y = (round(each) for each in over(program, GLOBE))
    part = program.shot(name)[y - 12 : y + 12, x - 12 : x + 12].astype(float).mean(axis=2)
    return float(np.abs(np.diff(part, axis=1)).mean())


def final(program: Program) -> None:
    """Wait for the best picture."""
    program.settle()
    program.wait(f"not {PREVIEW}.is_busy()", FINAL, 0.5)
    program.settle()


def paint(program: Program) -> None:
    """A stroke across the globe."""
    x, y = GLOBE
    program.screen.drag(*(over(program, (x + across, y)) for across in (-0.02, 0.0, 0.02)))
    program.wait(f"not ({PAINTING})")
    program.settle()


def test_what_is_painted_sharp_is_in_focus(program: Program) -> None:
    program.ask(
        "with bpy.context.temp_override(**view('VIEW_3D')):\n    bpy.ops.virtual_aperture.preview()\n1"
    )
    final(program)
    before = detail(program, "before")
    program.ask(f"{SETTINGS}.repairs.kind = 'SHARP'; {SETTINGS}.repairs.radius = 0.05; 1")
    began = time.monotonic()
    program.ask(START)
    program.wait(PAINTING)
    program.settle()
    program.screen.key("bracketright")
    program.settle()
    assert program.ask(f"{SETTINGS}.repairs.radius") == pytest.approx(0.05 / 0.85, rel=1e-3)
    paint(program)
    ((kind, frame, places, _),) = program.ask(REPAIRS)
    assert (kind, frame) == ("SHARP", 1) and places >= 2
    program.shot("updating")
    final(program)
    program.tell_time(time.monotonic() - began, "a mistake is mended")
    assert detail(program, "after") > 1.5 * before


def test_undo_takes_the_stroke_back_in_one_step(program: Program) -> None:
    program.screen.key("ctrl+z")
    program.wait(f"{REPAIRS} == []")


def test_same_as_here_asks_for_the_place_first(program: Program) -> None:
    program.ask(f"{SETTINGS}.repairs.kind = 'SAME'; 1")
    program.ask(START)
    program.wait(PAINTING)
    program.settle()
    program.shot("reference")
    program.screen.click(*over(program, WALL))
    program.settle()
    assert program.ask(PAINTING)
    paint(program)
    assert program.ask(REPAIRS)[0][::3] == ["SAME", True]


def test_a_stroke_of_same_as_here_may_come_first(program: Program) -> None:
    before = program.ask(REPAIRS)
    program.ask(START)
    program.wait(PAINTING)
    program.settle()
    x, y = GLOBE
    program.screen.drag(*(over(program, (x + across, y)) for across in (-0.02, 0.0, 0.02)))
    program.settle()
    program.shot("stroke_first")
    assert program.ask(PAINTING) and program.ask(REPAIRS) == before
    program.screen.click(*over(program, WALL))
    program.wait(f"not ({PAINTING})")
    assert len(program.ask(REPAIRS)) == len(before) + 1
    assert program.ask(REPAIRS)[-1][::3] == ["SAME", True]
    program.screen.key("ctrl+z")
    program.wait(f"{REPAIRS} == {before}")


def test_ctrl_z_while_painting_takes_the_reference_back_and_nothing_else(program: Program) -> None:
    before = program.ask(REPAIRS)
    program.ask(f"{SETTINGS}.repairs.radius = 0.25; bpy.ops.ed.undo_push(message='radius'); None")
    program.ask(START)
    program.wait(PAINTING)
    program.settle()
    program.screen.click(*over(program, WALL))
    program.settle()
    for _ in range(2):
        program.screen.key("ctrl+z")
        program.settle()
    # The reference is asked for again: a stroke waits for it.
    x, y = GLOBE
    program.screen.drag(*(over(program, (x + across, y)) for across in (-0.02, 0.02)))
    program.settle()
    program.shot("reference_again")
    assert program.ask(PAINTING) and program.ask(REPAIRS) == before
    assert program.ask(f"{SETTINGS}.repairs.radius") == 0.25
    program.screen.key("Escape")
    program.wait(f"not ({PAINTING})")
