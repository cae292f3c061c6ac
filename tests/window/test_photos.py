"""Photos in no order from the panel: the toggle, the solve, and the one that is shown, by its name."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from .. import planes
from .program import Program
from .screen import Screen
from .steps import RIGHT, SETTINGS, running

PLACES = {"DSC_0009": (0.0, 0.0), "DSC_0003": (0.6, 0.1), "DSC_0007": (-0.6, 0.2), "DSC_0001": (0.1, -0.6)}
POPUP = 1.0
"""Seconds until Blender has drawn the list that is searched."""

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module")
def program(screen: Screen, resources: Path, folder: Path) -> Iterator[Program]:
    photos = folder / "photos"
    photos.mkdir()
    for name, (x, y) in PLACES.items():
        picture = planes.view(np.array([x, y, 0.0]), np.array([-y / 7, x / 7, 0.0]))
        cv2.imwrite(str(photos / f"{name}.png"), picture)
    with running(screen, resources, "photos") as made:
        made.ask(f"{SETTINGS}.footage = {str(photos)!r}; None")
        made.settle()
        yield made


def test_photos_are_solved(program: Program) -> None:
    program.shot("folder")
    program.press("stills")
    program.wait(f"{SETTINGS}.stills")
    program.press("solve(again=False)")
    program.wait(f"{SETTINGS}.points is not None", 120)
    program.settle()
    program.shot("solved")


def test_one_is_shown_by_its_name(program: Program) -> None:
    program.press("show_photo(", across=RIGHT)
    time.sleep(POPUP)
    program.shot("list")
    program.screen.type("0007")
    time.sleep(POPUP)
    program.screen.key("Return")
    program.wait("bpy.context.scene.frame_current == 3")
    program.shot("shown")
