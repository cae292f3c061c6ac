"""A squeezed clip in the window: the field of its pixel aspect is in the Solve panel."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from ..sfm.squeezed_clip import rolling
from .program import Program
from .screen import Screen
from .steps import SETTINGS, opened, running

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module")
def program(hd_screen: Screen, resources: Path, folder: Path) -> Iterator[Program]:
    clip = rolling(folder / "squeezed", False)
    with running(hd_screen, resources, "pixel_aspect") as made:
        made.ask(f"{SETTINGS}.footage = {str(clip)!r}; None")
        made.settle()
        yield made


def test_the_field_is_in_the_solve_panel(program: Program) -> None:
    with opened(program, "Solve"):
        program.shot("solve_panel")
        button = program.find("pixel_aspect", "VIEW_3D", "UI")
        program.fill(button, "2")
        program.wait(f"{SETTINGS}.pixel_aspect == 2")
        program.shot("set")
