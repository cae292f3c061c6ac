"""The first panel on a screen of 1920 x 1080: daily work is in sight, and two clicks set the scale."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from .clips import write_desk
from .program import Program
from .screen import Screen
from .steps import MODAL, SETTINGS, first_window, look, over, running

SCALING = f"'VIRTUAL_APERTURE_OT_set_scale' in {MODAL}"
MUG, GLOBE = (0.2, 0.85), (0.53, 0.45)
"""Places of the sample clip, fractions of the picture."""

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module")
def program(
    hd_screen: Screen, resources: Path, folder: Path, registered: None, desk: Path, desk_work: Path
) -> Iterator[Program]:
    from addon.scene.focus.focus_marks import set_first

    blend = write_desk(folder / "first_panel", desk, desk_work, set_first)
    with running(hd_screen, resources, "first_panel", blend) as made:
        yield made


def test_all_of_the_daily_work_is_in_sight(program: Program) -> None:
    look(program, "solved")
    found = [b.does for across in (0.25, 0.6, 0.75) for b in program.buttons("VIEW_3D", "UI", across)]
    for wanted in (
        "choose_clip", "virtual_aperture.preview", "pick_focus()", ".blur_percent", "set_scale",
        "render_frame", "render_clip",
    ):  # fmt: skip
        assert any(wanted in does for does in found), found
    assert program.ask(f"{SETTINGS}.metres_per_unit") == 0


def test_the_scale_is_set_by_two_clicks(program: Program) -> None:
    before = program.ask(f"{SETTINGS}.f_stop")
    program.press("virtual_aperture.set_scale")
    program.wait(SCALING)
    program.screen.click(*over(program, MUG))
    program.settle()
    time.sleep(0.5)
    program.screen.move(*over(program, GLOBE))
    program.settle()
    program.shot("scale_second_click")
    program.screen.click(*over(program, GLOBE))
    program.wait(f"not ({SCALING})")
    time.sleep(0.6)
    program.settle()
    program.shot("scale_length")
    program.screen.key("Return")
    program.wait(f"{SETTINGS}.metres_per_unit > 0")
    program.settle()
    look(program, "scale_given")
    assert program.ask(f"{SETTINGS}.f_stop") == pytest.approx(before, rel=1e-2)
    first_window(program)
    program.screen.key("ctrl+z")
    program.wait(f"{SETTINGS}.metres_per_unit == 0")
    program.settle()


def test_escape_gives_no_scale(program: Program) -> None:
    program.press("virtual_aperture.set_scale")
    program.wait(SCALING)
    program.screen.click(*over(program, MUG))
    program.settle()
    program.screen.key("Escape")
    program.wait(f"not ({SCALING})")
    assert program.ask(f"{SETTINGS}.metres_per_unit") == 0
