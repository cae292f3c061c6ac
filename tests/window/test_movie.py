"""Render Clip as a first-time user presses it: a movie with sound lies beside the clip."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import av
import bpy
import numpy as np
import pytest

from addon.core.media.clip import open_footage
from addon.scene.build import build
from benchmarks.torture import clip as solved

from ..in_blender import place_lamp
from .program import EXTENSION, Program
from .screen import Screen
from .steps import running

COUNT = 40
MOVIE = f"__import__('sys').modules['{EXTENSION}.addon.ui.jobs.movie'].MovieJob.last"
RENDER = "bpy.context.scene.render"
KEPT = (
    f"[{RENDER}.filepath, {RENDER}.engine, {RENDER}.use_border, {RENDER}.image_settings.media_type,"
    f" {RENDER}.image_settings.file_format, {RENDER}.ffmpeg.codec, {RENDER}.ffmpeg.audio_codec]"
)

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module")
def blend(folder: Path, registered: None) -> Path:
    """A solved clip with sound, in focus, and a lamp that goes through it from left to right; its output is
    what a solve sets."""
    made = folder / "movie"
    clip = solved.write_video(made, COUNT)
    bpy.ops.wm.read_homefile(app_template="", use_factory_startup=True)
    # The camera stands in it.
    bpy.data.objects["Cube"].hide_render = True
    bpy.ops.wm.save_as_mainfile(filepath=str(made / "scene.blend"))
    settings = build(bpy.context.scene, open_footage(clip), solved.truth(range(1, COUNT + 1)))
    settings.focus_distance, settings.views, settings.blur = 8.0, 32, 0.03
    scene = bpy.context.scene
    lamp, right = place_lamp(scene, 4.0, 10), scene.camera.matrix_world.normalized().col[0].xyz
    for frame, side in ((1, -1), (COUNT, 1)):
        lamp.location = side * right
        lamp.keyframe_insert("location", frame=frame)
    scene.cycles.samples = 4
    bpy.ops.wm.save_mainfile()
    return made / "scene.blend"


@pytest.fixture(scope="module")
def program(screen: Screen, resources: Path, blend: Path) -> Iterator[Program]:
    with running(screen, resources, "movie", blend) as made:
        yield made


def pressed(program: Program) -> None:
    program.press("virtual_aperture.render_clip")
    program.settle()


def files(blend: Path) -> set[str]:
    return {path.name for path in blend.parent.iterdir()}


@pytest.mark.smoke
def test_one_press_gives_a_movie_with_sound(program: Program, blend: Path) -> None:
    before, others = program.ask(KEPT), files(blend)
    began = time.monotonic()
    pressed(program)
    program.wait(f"{MOVIE}.done > 5", 120)
    program.settle()
    program.shot("rendering")
    # The window is alive: the frame can be changed meanwhile.
    program.ask("bpy.context.scene.frame_set(7)")
    program.wait(f"not {MOVIE}.is_running", 240)
    program.tell_time(time.monotonic() - began, f"{COUNT} frames as a movie")
    program.screen.nudge()
    program.settle()
    program.shot("rendered")
    assert program.ask(KEPT) == before
    assert program.ask("len(bpy.data.scenes)") == 1
    assert files(blend) == others | {"clip_render.mp4"}
    with av.open(str(blend.parent / "clip_render.mp4")) as made:
        picture, heard = made.streams.video[0], made.streams.audio[0]
        assert (picture.codec_context.name, picture.frames) == ("h264", COUNT)
        assert picture.average_rate == solved.RATE
        assert heard.duration * heard.time_base == pytest.approx(COUNT / solved.RATE, abs=0.05)
    # It is in each frame, where it is keyed, though Blender showed another one meanwhile.
    with av.open(str(blend.parent / "clip_render.mp4")) as made:
        across = [middle_of_lamp(frame.to_ndarray(format="rgb24")) for frame in made.decode(video=0)]
    assert across[-1] - across[0] == pytest.approx(2 * solved.LENS.fx / 4.0, rel=0.15)
    assert np.diff(across).min() > -0.5
    assert any("clip_render.mp4" in line for line in program.ask("messages()"))


def middle_of_lamp(shown: np.ndarray) -> float:
    """Column of what is whiter than the clip."""
    return float(np.nonzero(shown.min(axis=2) > 225)[1].mean())


def test_a_movie_that_is_there_is_replaced_only_when_asked(program: Program, blend: Path) -> None:
    out = blend.parent / "clip_render.mp4"
    written, others = out.stat().st_mtime_ns, files(blend)
    pressed(program)
    time.sleep(0.5)
    program.shot("question")
    program.screen.key("Escape")
    program.settle()
    assert program.ask(f"not {MOVIE}.is_running") and out.stat().st_mtime_ns == written
    # So that it is not over before the button is found.
    program.ask("bpy.context.scene.virtual_aperture.views = 2000")
    pressed(program)
    time.sleep(0.5)
    program.screen.key("Return")
    program.wait(f"{MOVIE}.is_running")
    program.wait(f"{MOVIE}.done > 0", 120)
    program.press("virtual_aperture.cancel_movie", across=0.87)
    program.wait(f"{MOVIE} is None")
    until = time.monotonic() + 20
    while files(blend) != others:
        assert time.monotonic() < until, files(blend)
        time.sleep(0.1)
    program.shot("cancelled")
    assert out.stat().st_mtime_ns == written


def test_closing_blender_asks_first_and_keeps_finished_frames(
    program: Program, screen: Screen, resources: Path, blend: Path
) -> None:
    out = blend.parent / "clip_render.mp4"
    out.unlink()
    program.ask(
        "for thing in bpy.data.objects:\n"
        "    # With CG objects in the picture another run begins anew.\n"
        "    thing.hide_render |= thing.type == 'MESH'\n"
        # The mouse takes seconds to the button that cancels.
        "bpy.context.scene.virtual_aperture.views = 1600\n"
        "bpy.ops.wm.save_mainfile()\n"
        "None"
    )
    pressed(program)
    program.wait(f"{MOVIE}.done > 1", 120)
    # Blender itself asks only about unsaved changes.
    assert not program.ask("bpy.data.is_dirty")
    program.screen.move(*program.middle("VIEW_3D"))
    for key in ("Escape", "Return"):
        program.screen.key("ctrl+q")
        time.sleep(1)
        program.shot(f"closing_{key}")
        if key == "Escape":
            program.screen.key(key)
            program.settle()
            assert program.ask(f"{MOVIE}.is_running")
    program.screen.key("Return")
    program.wait_end()
    kept = {path: path.stat().st_mtime_ns for path in (blend.parent / f"{out.name}.frames").glob("*.png")}
    assert kept and not out.exists()
    with running(screen, resources, "movie", blend) as again:
        pressed(again)
        again.wait(f"{MOVIE}.done > {len(kept)}", 120)
        assert {path: path.stat().st_mtime_ns for path in kept} == kept
        again.press("virtual_aperture.cancel_movie", across=0.87)
