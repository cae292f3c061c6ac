"""Kept frames that are played and scrubbed in the preview are shown at once; rates are told, not judged."""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from .clips import write_scene
from .program import EXTENSION, Program
from .screen import Screen
from .steps import SETTINGS, running

FRAMES = tuple(range(1, 25))
"""A second at the 24 frames a second of a new scene."""
SECONDS = 6.0
"""How long is played."""
RENDER = f"__import__('sys').modules['{EXTENSION}.addon.render"
PREVIEW = f"{RENDER}.viewport.viewport'].PREVIEW"
WATCH = f"""
drawn, spent = [], []
viewport, engine = {RENDER}.viewport.viewport'], {RENDER}.engine']
inner = engine.draw
def timed(*given):
    began = time.perf_counter()
    inner(*given)
    spent.append(time.perf_counter() - began)
engine.draw = timed
def note():
    shown = viewport._in_regions.get(bpy.context.region.as_pointer())
    picture = shown.picture if shown and bpy.context.space_data.shading.type == 'RENDERED' else None
    drawn.append([time.monotonic(), bpy.context.scene.frame_current, picture.wanted.frame if picture else 0])
bpy.types.SpaceView3D.draw_handler_add(note, (), 'WINDOW', 'POST_PIXEL')
None
"""
SHADING = "view('VIEW_3D')['area'].spaces.active.shading.type"

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module")
def program(screen: Screen, resources: Path, folder: Path, registered: None) -> Iterator[Program]:
    blend = write_scene(folder / "playback", (640, 360), 16, FRAMES)
    with running(screen, resources, "playback", blend) as made:
        made.ask(
            "bpy.data.objects.remove(bpy.data.objects['Cube'])\n"
            f"{SETTINGS}.method, {SETTINGS}.blur = 'features', 0.02\n"
            f"bpy.context.scene.frame_end = {FRAMES[-1]}\n"
            "view('VIEW_3D')['area'].spaces.active.region_3d.view_perspective = 'CAMERA'\n"
            f"{SHADING} = 'RENDERED'\n"
        )
        made.ask(WATCH)
        yield made


def show(program: Program, frame: int) -> list[list[float]]:
    """What was drawn once a frame was gone to: times, frames of the scene and of the picture."""
    program.ask(f"drawn.clear(); bpy.context.scene.frame_set({frame})")
    program.wait(f"[each for each in drawn if each[1] == {frame}]")
    shown: list[list[float]] = program.ask("drawn")
    return [each for each in shown if each[1] == frame]


def played(program: Program) -> list[list[float]]:
    """What was drawn while the clip was played for some seconds."""
    program.screen.move(*program.middle("VIEW_3D"))
    program.settle()
    program.ask("drawn.clear(); spent.clear(); None")
    program.screen.key("space")
    time.sleep(SECONDS)
    shown: list[list[float]] = program.ask("drawn")
    program.screen.key("space")
    program.settle()
    return shown


def rate(drawn: list[list[float]]) -> float:
    """Frames a second that were drawn."""
    changes = sum(one[1] != other[1] for one, other in pairwise(drawn))
    return changes / (drawn[-1][0] - drawn[0][0])


def test_kept_frames_are_played(program: Program) -> None:
    for frame in FRAMES:
        program.ask(f"bpy.context.scene.frame_set({frame})")
        program.settle()
        program.wait(f"not {PREVIEW}.is_busy()", 60)
    assert program.ask(f"len({PREVIEW}._kept)") == len(FRAMES)
    shown = played(program)
    spent = program.ask("sum(spent) / len(spent)")
    program.shot("playing")
    program.tell(f"{rate(shown):.1f} of 24 frames a second, {1000 * spent:.1f} ms of each draw are ours")
    # None is that of another frame, and none is made anew.
    assert [each for each in shown if each[1] != each[2]] == []
    assert program.ask(f"len({PREVIEW}._kept)") == len(FRAMES)
    program.ask(f"{SHADING} = 'SOLID'")
    program.tell(f"{rate(played(program)):.1f} frames a second in Solid shading")
    program.ask(f"{SHADING} = 'RENDERED'")
    program.settle()


def test_a_kept_frame_is_shown_at_once(program: Program) -> None:
    for frame in (20, 3, 11, 24, 1):
        assert show(program, frame)[0][2] == frame


def test_other_frames_show_the_last_finished_picture_at_once(program: Program) -> None:
    show(program, 10)
    program.wait(f"not {PREVIEW}.is_busy()", 60)
    # Pictures of another lens: none of them is kept.
    program.ask(f"{SETTINGS}.blur = 0.03")
    program.settle()
    program.wait(f"not {PREVIEW}.is_busy()", 60)
    first = show(program, 21)[0]
    assert first[2] in (10, 21)
