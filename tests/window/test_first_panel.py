"""The first panel on a screen of 1920 x 1080, and what a first film takes.

Actions and seconds from a dropped clip to the first blurred picture and to rendered frames are told beside
the pictures; what is judged is that no step needs a scroll, and how many actions there are.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from .program import EXTENSION, Program
from .screen import Screen
from .steps import (
    CLIP,
    DEPTH,
    LEFT,
    MODAL,
    OPENS,
    RIGHT,
    SETTINGS,
    drop,
    ended,
    first_window,
    look,
    make_wide,
    over,
    running,
)  # fmt: skip

PREVIEW = f"__import__('sys').modules['{EXTENSION}.addon.render.viewport.viewport'].PREVIEW"
SCALING = f"'VIRTUAL_APERTURE_OT_set_scale' in {MODAL}"
SOLVING = f"'VIRTUAL_APERTURE_OT_import_clip' in {MODAL}"
MUG, GLOBE, PLANT = (0.2, 0.85), (0.53, 0.45), (0.9, 0.45)
"""Places of the sample clip, fractions of the picture."""

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module")
def project(folder: Path) -> Path:
    made = folder / "first"
    made.mkdir()
    shutil.copy(CLIP, made)
    return made


@pytest.fixture(scope="module")
def program(hd_screen: Screen, resources: Path) -> Iterator[Program]:
    with running(hd_screen, resources, "first_panel") as made:
        yield made


def in_sight(program: Program, *wanted: str) -> None:
    """What is wanted is on the sidebar without a scroll."""
    found = [b.does for across in (0.25, 0.6, 0.75) for b in program.buttons("VIEW_3D", "UI", across)]
    assert not [each for each in wanted if not any(each in does for does in found)], found


def test_no_clip(program: Program) -> None:
    look(program, "1_no_clip")
    in_sight(program, "choose_clip")


def test_a_clip_is_chosen(program: Program, project: Path) -> None:
    program.ask(f"{SETTINGS}.footage = {str(project / CLIP.name)!r}; None")
    look(program, "2_chosen")
    in_sight(program, "virtual_aperture.solve(again=False)")
    program.ask(f"{SETTINGS}.footage = ''; None")


def test_drop_to_the_first_blurred_picture(program: Program, project: Path) -> None:
    actions = ["drop the clip"]
    began = time.monotonic()
    drop(program, project / CLIP.name)
    actions.append("choose Virtual Aperture")
    program.screen.key("s")
    program.wait(SOLVING)
    time.sleep(6)
    look(program, "3_solving")
    program.wait(f"{SETTINGS}.points is not None", 200)
    program.tell_time(time.monotonic() - began, "from drop to solved")
    actions.append("press Preview")
    program.press("virtual_aperture.preview", across=LEFT)
    program.wait(f"len({PREVIEW}._kept)", 200)
    program.tell_time(time.monotonic() - began, f"drop to a blurred picture, {len(actions)} actions")
    look(program, "4_preview_and_depth")
    assert len(actions) <= 3, actions


def test_all_of_the_daily_work_is_in_sight(program: Program) -> None:
    program.wait(f"not {DEPTH}.is_running", 240)
    program.wait(f"not {PREVIEW}.is_busy()", 200)
    look(program, "5_solved")
    in_sight(
        program, "choose_clip", "virtual_aperture.preview", "pick_focus()", ".blur_percent",
        "set_scale", "render_frame", "render_clip",
    )  # fmt: skip
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
    program.shot("6_scale_second_click")
    program.screen.click(*over(program, GLOBE))
    program.wait(f"not ({SCALING})")
    time.sleep(0.6)
    program.settle()
    program.shot("6_scale_length")
    program.screen.key("Return")
    program.wait(f"{SETTINGS}.metres_per_unit > 0")
    program.settle()
    look(program, "7_scale_given")
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


def test_two_marks(program: Program) -> None:
    program.press("pick_focus()", across=0.8)
    program.screen.click(*over(program, GLOBE))
    ended(program)
    look(program, "8_one_mark")
    program.ask("bpy.context.scene.frame_set(30)")
    program.settle()
    make_wide(program, OPENS)
    program.press("pick_focus(add=True)", across=RIGHT)
    program.screen.click(*over(program, PLANT))
    ended(program)
    program.wait(f"not {PREVIEW}.is_busy()", 200)
    look(program, "9_two_marks")
