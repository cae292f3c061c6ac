"""Apertures as pictures: icons are made where there is a window alone."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from addon.ui.focus.lens_presets import ROOT, VIRTUAL_APERTURE_PT_lens_presets

from .clips import write_scene
from .program import EXTENSION, Program
from .screen import Screen
from .steps import SETTINGS, running

BOKEH = f"__import__('sys').modules['{EXTENSION}.addon.ui.focus.bokeh']"
SHIPPED = sorted((ROOT / "presets" / VIRTUAL_APERTURE_PT_lens_presets.preset_subdir).glob("*.py"))
WHITE = 240
"""Of 255: nothing of Blender's panels is as bright but letters."""


@pytest.fixture(scope="module")
def program(screen: Screen, resources: Path, folder: Path, registered: None) -> Iterator[Program]:
    with running(screen, resources, "bokeh", write_scene(folder / "bokeh"), tab=False) as made:
        yield made


def opened(program: Program, panel: str, name: str) -> np.ndarray:
    """A panel opened under the mouse; the screen around it."""
    x, y = (round(place) for place in program.middle("VIEW_3D"))
    program.screen.move(x, y)
    program.settle()
    program.ask(
        f"with bpy.context.temp_override(**view('VIEW_3D')):\n"
        f"    bpy.ops.wm.call_panel('INVOKE_DEFAULT', name={panel!r}, keep_open=True)\nNone"
    )
    program.settle()
    time.sleep(0.5)
    shot: np.ndarray = program.shot(name)
    program.screen.key("Escape")
    program.settle()
    return shot[y - 400 : y + 400, x - 400 : x + 400]


def test_the_panel_shows_the_aperture(program: Program) -> None:
    seen = {}
    for obstruction in (0.0, 0.6):
        program.ask(f"{SETTINGS}.shape.obstruction = {obstruction}")
        shot = opened(program, "VIRTUAL_APERTURE_PT_shape", f"shape_{obstruction}")
        seen[obstruction] = int((shot.min(axis=2) > WHITE).sum())
    # A mirror of 0.6 radii takes 0.36 of a disc of some hundred pixels.
    assert seen[0.0] > 3000 and 0.55 * seen[0.0] < seen[0.6] < 0.75 * seen[0.0], seen


def test_presets_have_pictures(program: Program) -> None:
    opened(program, "VIRTUAL_APERTURE_PT_lens_presets", "presets")
    assert program.ask(f"len({BOKEH}.ICONS.kept)") >= len(SHIPPED)
    most = program.ask(f"{BOKEH}.MOST")
    program.ask(
        f"from {EXTENSION}.addon.core.optics.aperture import Aperture\n"
        f"for n in range({most} + 5): {BOKEH}.icon(Aperture(rotation=0.01 * n, blades=5))\nNone"
    )
    assert program.ask(f"len({BOKEH}.ICONS.kept)") == most
