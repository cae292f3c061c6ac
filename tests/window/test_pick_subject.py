"""A subject marked by strokes, with mouse and keys: in this order, in one Blender."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from .clips import write_desk
from .program import Program
from .screen import Screen
from .steps import MARKS, MODAL, SETTINGS, over, running

PICKING = f"'VIRTUAL_APERTURE_OT_pick_subject' in {MODAL}"
FOCUSING = f"'VIRTUAL_APERTURE_OT_focus_subject' in {MODAL}"
STROKES = f"[[s.frame, s.adds, len(s.places)] for each in {SETTINGS}.subjects.items for s in each.strokes]"
START = (
    "with bpy.context.temp_override(**view('VIEW_3D')):\n    bpy.ops.virtual_aperture.{}('INVOKE_DEFAULT')\n1"
)
"""As its button does: the panel that has it is closed to begin with."""
GLOBE = (0.53, 0.45)
"""Place in the sample clip's first frame, fractions of the picture."""
BLUER = 25
"""Grey levels by which the tint makes blue stronger against red."""

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module")
def blend(folder: Path, registered: None, desk: Path, desk_work: Path) -> Path:
    """The sample clip, solved, in a .blend."""
    return write_desk(folder / "subject", desk, desk_work)


@pytest.fixture(scope="module")
def program(screen: Screen, resources: Path, blend: Path) -> Iterator[Program]:
    with running(screen, resources, "subject", blend) as made:
        yield made


def tint(program: Program, name: str) -> float:
    """How much stronger blue is than red round the globe's middle, in grey levels; a picture is kept."""
    x, y = (round(each) for each in over(program, GLOBE))
    part = program.shot(name)[y - 12 : y + 12, x - 12 : x + 12].astype(float)
    return float(np.median(part[..., 2] - part[..., 0]))


def start(program: Program) -> None:
    program.ask(START.format("pick_subject"))
    program.wait(PICKING)
    program.settle()


def drag(program: Program, held: str = "", down: float = 0.0) -> None:
    """A stroke across the globe, or so much further down."""
    x, y = GLOBE
    ends = [over(program, (x + across, y + down)) for across in (-0.03, 0.03)]
    if held:
        program.screen._xdotool("keydown", held)
    program.screen.drag(*ends)
    if held:
        program.screen._xdotool("keyup", held)
    program.settle()


def ended(program: Program) -> None:
    program.wait(f"not ({PICKING})")
    program.settle()


def test_a_stroke_lights_the_subject_up(program: Program) -> None:
    start(program)
    before = tint(program, "before")
    began = time.monotonic()
    drag(program)
    while (now := tint(program, "lit")) < before + BLUER:
        assert time.monotonic() < began + 60, f"{before} became {now}"
    program.tell_time(time.monotonic() - began, "a stroke lights the subject up")
    assert program.ask(STROKES) == []


def test_enter_confirms_and_undo_takes_a_stroke_back(program: Program) -> None:
    drag(program, "ctrl", down=0.15)
    program.shot("taken_away")
    program.screen.key("Return")
    ended(program)
    (frame, adds, places), (_, takes, _) = program.ask(STROKES)
    assert (frame, adds, takes) == (1, True, False) and places >= 2
    program.shot("confirmed")
    program.screen.key("ctrl+z")
    program.wait(f"len({STROKES}) == 1")
    program.screen.key("ctrl+z")
    program.wait(f"{STROKES} == []")
    program.screen.key("ctrl+shift+z")
    program.wait(f"len({STROKES}) == 1")


def test_escape_takes_strokes_back_and_then_leaves(program: Program) -> None:
    start(program)
    drag(program, "shift", down=0.05)
    program.screen.key("Escape")
    program.settle()
    assert program.ask(PICKING)
    program.screen.key("Escape")
    ended(program)
    assert len(program.ask(STROKES)) == 1


def test_the_subject_is_in_focus(program: Program) -> None:
    program.ask(START.format("focus_subject"))
    program.wait(f"not ({FOCUSING})", 400)
    ((frame, away),) = program.ask(MARKS)
    assert frame == 1 and away > 0
    assert program.ask(f"{SETTINGS}.marks.items[0].places[0].source").startswith("the subject Subject")
