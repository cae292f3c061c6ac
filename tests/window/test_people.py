"""A clip with a person, from the drop to a movie: the person is in focus, then what is clicked; real data.

The pictures are kept; look at them, too.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from .program import EXTENSION, Program
from .screen import Screen
from .steps import LEFT, MARKS, PICKING, SETTINGS, begin, drop, over, running

PREVIEW = f"__import__('sys').modules['{EXTENSION}.addon.render.viewport.viewport'].PREVIEW"
SEARCH = f"__import__('sys').modules['{EXTENSION}.addon.ui.jobs.first_person']._search"
MOVIE = f"__import__('sys').modules['{EXTENSION}.addon.ui.jobs.movie'].MovieJob.last"
FOLLOWED = f"len({SETTINGS}.marks.items[0].places[0].followed)"
HALF = 0.035
"""Half of the side of the squares that are compared, of the picture's width."""
KEPT, LOST = 0.6, 0.5
"""Shares of the detail that a person in focus keeps at least, and that the background keeps at most."""


@dataclass(frozen=True)
class Case:
    """A clip, and places in it, fractions of the picture."""

    name: str
    person: tuple[float, float]
    """In the first frame."""
    behind: tuple[float, float]
    """A place with detail in the background of the first frame."""
    frame: int
    """Where another thing is clicked."""
    thing: tuple[float, float]
    again: int
    """The frame in which the person is clicked, and"""
    there: tuple[float, float]
    """where."""


CASES = (Case("person_dance_davis_1", (0.49, 0.35), (0.2, 0.35), 30, (0.9, 0.35), 50, (0.46, 0.45)),)

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module", params=CASES, ids=lambda case: case.name)
def case(request: pytest.FixtureRequest) -> Case:
    made: Case = request.param
    return made


@pytest.fixture(scope="module")
def project(folder: Path, data: Path, case: Case) -> Path:
    made = folder / case.name
    made.mkdir()
    shutil.copy(data / "clips" / f"{case.name}.mp4", made)
    return made


@pytest.fixture(scope="module")
def program(screen: Screen, resources: Path, project: Path, case: Case) -> Iterator[Program]:
    with running(screen, resources, case.name) as made:
        yield made


def idle(program: Program) -> None:
    program.wait(f"not {PREVIEW}.is_busy()", 300)
    program.settle()


def detail(picture: np.ndarray, x: float, y: float, half: float) -> float:
    """How much fine structure there is around pixels of a picture."""
    part = picture[round(y - half) : round(y + half), round(x - half) : round(x + half)].astype(np.float32)
    return float(np.abs(part - cv2.GaussianBlur(part, (0, 0), 1.5)).mean())


def kept(program: Program, before: np.ndarray, after: np.ndarray, place: tuple[float, float]) -> float:
    """The share of the detail at a place of the picture that the preview keeps."""
    (left, _), (right, _) = (over(program, (x, 0.5)) for x in (0.0, 1.0))
    half = max(HALF * (right - left), 6)
    x, y = over(program, place)
    return detail(after, x, y, half) / detail(before, x, y, half)


def test_the_person_is_in_focus_and_nothing_was_picked(program: Program, project: Path, case: Case) -> None:
    drop(program, project / f"{case.name}.mp4")
    program.screen.key("s")
    began = time.monotonic()
    program.wait(f"{SETTINGS}.points is not None", 300)
    program.tell_time(time.monotonic() - began, "solved")
    program.settle()
    before = program.shot("solved")
    began = time.monotonic()
    program.wait(f"{SEARCH} is None", 300)
    program.tell_time(time.monotonic() - began, "the person is found")
    assert program.ask(f"{SETTINGS}.marks.is_first")
    assert program.ask(f"{SETTINGS}.marks.items[0].places[0].source") == "the nearest person"
    assert program.ask(FOLLOWED) == program.ask("bpy.context.scene.frame_end")
    program.press("virtual_aperture.preview", across=LEFT)
    idle(program)
    after = program.shot("person")
    assert kept(program, before, after, case.person) > KEPT
    assert kept(program, before, after, case.behind) < LOST


def test_a_click_puts_another_thing_in_focus(program: Program, case: Case) -> None:
    program.ask(f"bpy.context.scene.frame_set({case.frame})")
    idle(program)
    program.shot("before_click")
    first = program.ask(MARKS)
    begin(program)
    program.screen.click(*over(program, case.thing))
    began = time.monotonic()
    program.settle()
    time.sleep(1)
    program.shot("finding")
    program.wait(f"not ({PICKING})", 300)
    program.tell_time(time.monotonic() - began, "a click is in focus")
    idle(program)
    program.shot("clicked")
    ((frame, _),) = picked = program.ask(MARKS)
    assert frame == case.frame and not program.ask(f"{SETTINGS}.marks.is_first")
    program.screen.key("ctrl+z")
    program.wait(f"{MARKS} == {first}")
    assert program.ask(f"{SETTINGS}.marks.is_first")
    program.screen.key("ctrl+shift+z")
    program.wait(f"{MARKS} == {picked}")


def test_focus_is_pulled_to_the_person(program: Program, case: Case) -> None:
    program.ask(f"bpy.context.scene.frame_set({case.again})")
    idle(program)
    begin(program, add=True)
    program.screen.click(*over(program, case.there))
    began = time.monotonic()
    program.wait(f"not ({PICKING})", 300)
    program.tell_time(time.monotonic() - began, "the person is in focus again")
    idle(program)
    program.shot("pulled")
    assert [frame for frame, _ in program.ask(MARKS)] == [case.frame, case.again]
    assert program.ask(f"{SETTINGS}.marks.items[1].name") == "Person"


def test_the_pull_is_rendered(program: Program, project: Path, case: Case) -> None:
    program.ask(f"s = bpy.context.scene\ns.frame_start, s.frame_end = {case.frame}, {case.again}\nNone")
    began = time.monotonic()
    program.press("virtual_aperture.render_clip")
    program.wait(f"{MOVIE} is not None and not {MOVIE}.is_running", 900)
    program.tell_time(time.monotonic() - began, "the movie")
    program.settle()
    program.shot("rendered")
    with av.open(str(project / f"{case.name}_render.mp4")) as movie:
        frames = [frame.to_ndarray(format="bgr24") for frame in movie.decode(video=0)]
    assert len(frames) == case.again - case.frame + 1
    for number, frame in enumerate(frames, case.frame):
        cv2.imwrite(str(program.pictures / f"movie_{number:03d}.jpg"), frame)
