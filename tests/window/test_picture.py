"""The picture in the viewport: colours, points, the line that is dragged, words, and how soon it follows."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from .clips import write_scene
from .program import EXTENSION, Program
from .screen import Screen
from .steps import PICKING, over, running

SETTINGS = "bpy.context.scene.virtual_aperture"
SPACE = "view('VIEW_3D')['area'].spaces.active"
VIEWPORT = f"__import__('sys').modules['{EXTENSION}.addon.render.viewport.viewport']"
PREVIEW = f"{VIEWPORT}.PREVIEW"
BUSY = f"{PREVIEW}.is_busy()"
RING = f"{EXTENSION}.addon.ui.panels.live_preview"
STOPS = 2
"""Stops by which the ring is dragged."""
FRAMES = tuple(range(1, 13))
SCRUBBED, APART = 20, 0.1
"""Steps of a held arrow key, and seconds from one to the next."""

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module")
def program(small_screen: Screen, resources: Path, folder: Path, registered: None) -> Iterator[Program]:
    blend = write_scene(folder / "picture", (640, 360), 4, FRAMES)
    with running(small_screen, resources, "picture", blend, tab=False) as made:
        # Depth is not what is looked at here.
        made.ask(
            "bpy.data.objects.remove(bpy.data.objects['Cube'])\n"
            f"{SETTINGS}.method, {SETTINGS}.blur = 'features', 0.06\n"
            f"{SPACE}.region_3d.view_perspective = 'CAMERA'\n"
        )
        made.settle()
        yield made


def call(program: Program, name: str) -> None:
    """As its button does it."""
    program.ask(
        "with bpy.context.temp_override(**view('VIEW_3D')):\n"
        f"    bpy.ops.virtual_aperture.{name}('INVOKE_DEFAULT')\n"
    )
    program.settle()


def seen(program: Program, name: str, left: float = 0.1, right: float = 0.9) -> np.ndarray:
    """What the screen shows of the camera's frame between two shares of its width, once it is the best."""
    program.wait(f"not {BUSY}", 200)
    program.screen.move(*program.middle("VIEW_3D", "HEADER"))
    program.settle()
    (x, top), (end, bottom) = over(program, (left, 0.2)), over(program, (right, 0.8))
    return program.shot(name)[round(top) : round(bottom), round(x) : round(end)].astype(int)


def manage_colours(program: Program, transform: str, exposure: float) -> None:
    program.ask(
        "colours = bpy.context.scene.view_settings\n"
        f"colours.view_transform, colours.exposure = {transform!r}, {exposure}\nNone"
    )


def detail(picture: np.ndarray) -> float:
    """How sharp it is."""
    return float(np.abs(np.diff(picture, axis=1)).mean())


@pytest.mark.smoke
def test_points_lie_over_the_clip_only_where_they_are_asked_for(program: Program) -> None:
    clip = seen(program, "clip")
    program.ask(f"{SETTINGS}.show_points = True")
    shown = seen(program, "points")
    assert (np.abs(shown - clip).max(axis=2) > 30).mean() > 0.02
    program.ask(f"{SETTINGS}.show_points = False")
    assert np.array_equal(seen(program, "no_points"), clip)


@pytest.mark.smoke
def test_nothing_covers_the_picture_while_focus_is_picked(program: Program) -> None:
    call(program, "preview")
    plain = seen(program, "preview")
    call(program, "pick_focus")
    picking = seen(program, "picking")
    # The mouse and what it points at have circles and a line of text.
    assert (np.abs(picking - plain).max(axis=2) > 30).mean() < 0.01
    program.screen.key("Escape")
    program.wait(f"not ({PICKING})")
    assert np.array_equal(seen(program, "picked"), plain)


@pytest.mark.smoke
def test_colours_are_the_renders_with_overlays_and_without(program: Program) -> None:
    standard = seen(program, "standard")
    manage_colours(program, "AgX", 1.0)
    with_overlays = seen(program, "agx")
    assert np.abs(with_overlays.mean() - standard.mean()) > 5, "another view transform changes nothing"
    program.ask(f"{SPACE}.overlay.show_overlays = False")
    assert np.array_equal(seen(program, "agx_without"), with_overlays)
    program.ask(f"{SPACE}.overlay.show_overlays = True")
    program.ask("bpy.context.scene.render.image_settings.file_format = 'PNG'")
    assert "complete" in program.render(seconds=120)
    file = program.pictures / "render.png"
    assert program.ask(f"save_result({str(file)!r})") == ""
    while program.ask("len(bpy.context.window_manager.windows)") > 1:
        program.close_window()
    rendered = cv2.imread(str(file))
    assert rendered is not None
    part = rendered[72:288, 64:576, ::-1].astype(float)
    assert np.allclose(part.mean(axis=(0, 1)), with_overlays.mean(axis=(0, 1)), atol=2.0)
    manage_colours(program, "Standard", 0.0)


def test_the_line_is_dragged(program: Program) -> None:
    blurred = seen(program, "blurred", 0.1, 0.5)
    program.screen.drag(over(program, (0.002, 0.5)), over(program, (0.3, 0.5)), over(program, (0.6, 0.5)))
    program.settle()
    assert program.ask(f"{SETTINGS}.viewport_wipe") == pytest.approx(0.6, abs=0.02)
    compared = seen(program, "compared", 0.1, 0.5)
    assert detail(compared) > 1.2 * detail(blurred), "the clip as it was shot is not sharper"
    # Anywhere on the line, and back.
    program.screen.drag(over(program, (0.6, 0.3)), over(program, (0.3, 0.3)), over(program, (-0.05, 0.3)))
    program.settle()
    assert program.ask(f"{SETTINGS}.viewport_wipe") == 0
    assert np.array_equal(seen(program, "back", 0.1, 0.5), blurred)


def test_the_ring_is_dragged_for_more_blur_and_less(program: Program) -> None:
    x, low = program.ask(
        "with bpy.context.temp_override(**view('VIEW_3D')):\n"
        f"    place = __import__('sys').modules['{RING}']._ring_place(bpy.context)\n"
        "left, bottom, _, _ = rectangle('VIEW_3D', 'WINDOW')\n"
        "[left + place[0], bottom + place[1]]"
    )
    y = program.screen.size[1] - low
    # What a script has set is no step.
    before = program.ask(f"bpy.ops.ed.undo_push(message='Blur')\n{SETTINGS}.blur_percent")
    program.screen.move(x, y)
    program.settle()
    program.shot("ring")
    program.screen.drag((x, y), (x, y - STOPS * 60))
    program.settle()
    assert program.ask(f"{SETTINGS}.blur_percent") == pytest.approx(before * 2 ** (STOPS / 2), rel=0.05)
    program.screen.move(*over(program, (0.5, 0.5)))
    program.screen.key("ctrl+z")
    program.wait(f"abs({SETTINGS}.blur_percent - {before}) < 1e-3")
    program.ask(f"{SETTINGS}.f_stop = 2.0")
    program.screen.drag((x, y), (x, y + STOPS * 60))
    program.settle()
    assert program.ask(f"{SETTINGS}.f_stop") == pytest.approx(2.0 * 2 ** (STOPS / 2), rel=0.05)
