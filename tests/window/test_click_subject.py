"""A click of *Pick Focus* on a moving object that nobody has marked: with mouse and keys, in this order."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from .. import planes
from ..subjects import walls
from .clips import saved, solved_scene
from .program import Program
from .screen import Screen
from .steps import MARKS, PICKING, SETTINGS, begin, over, running

FRAMES, FRAME = tuple(range(11, 22)), 16
SUBJECTS = f"[each.name for each in {SETTINGS}.subjects.items]"
FOLLOWED = f"list({SETTINGS}.marks.items[0].places[0].followed)"

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module")
def blend(folder: Path, registered: None) -> Path:
    """A disc that moves by itself before two walls, with the true cameras."""
    import bpy

    from addon.core.media.clip import open_footage

    made = folder / "disc"
    made.mkdir()
    pictures = [walls.with_disc(frame)[..., ::-1] for frame in FRAMES]
    footage = open_footage(planes.write_clip(made / "clip", pictures, FRAMES[0]))
    solved_scene(footage, walls.filmed(walls.with_disc, FRAMES).reconstruction)
    bpy.context.scene.frame_set(FRAME)
    return saved(made)


@pytest.fixture(scope="module")
def program(screen: Screen, resources: Path, blend: Path) -> Iterator[Program]:
    with running(screen, resources, "click_subject", blend) as made:
        yield made


def test_a_click_focuses_on_all_of_a_moving_object(program: Program) -> None:
    begin(program)
    x, y = walls.place(FRAME)
    program.screen.click(*over(program, (x / walls.WIDTH, y / walls.HEIGHT)))
    began = time.monotonic()
    while program.ask(PICKING):
        program.shot("finding")
    program.tell_time(time.monotonic() - began, "a click finds a moving object and focuses on it")
    program.settle()
    program.shot("clicked")
    assert program.ask(SUBJECTS) == [] and program.ask(FOLLOWED) == list(FRAMES)
    assert program.ask(f"{SETTINGS}.marks.items[0].name") == "Object"


def test_one_step_of_undo_takes_it_back(program: Program) -> None:
    program.screen.key("ctrl+z")
    program.wait(f"{MARKS} == []")
    program.screen.key("ctrl+shift+z")
    program.wait(f"len({MARKS}) == 1")
