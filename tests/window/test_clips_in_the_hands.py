"""Clips of the gallery as a new user takes them, from drop to movie, and mistakes mended by brush.

Every step is photographed with the sidebar as Blender opens it and with a narrow one. Seconds are printed
and kept beside the pictures, and not judged: look at the pictures, too. A clip takes minutes, so this is run
alone:

    make test-window WINDOW_TESTS="-m long tests/window/test_clips_in_the_hands.py"
"""

from __future__ import annotations

import shutil
import time
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np
import pytest

from .program import EXTENSION, Program
from .screen import Screen
from .steps import DEPTH, LEFT, MARKS, MODAL, OPENS, PICKING, SETTINGS, drop, look, make_wide, over, running

PREVIEW = f"__import__('sys').modules['{EXTENSION}.addon.render.viewport.viewport'].PREVIEW"
MOVIE = f"__import__('sys').modules['{EXTENSION}.addon.ui.jobs.movie'].MovieJob.last"
PAINTING = f"'VIRTUAL_APERTURE_OT_paint_repair' in {MODAL}"
PAINT = (
    "with bpy.context.temp_override(**view('VIEW_3D')):\n"
    "    bpy.ops.virtual_aperture.paint_repair('INVOKE_DEFAULT')\n1"
)
"""As its button does."""
FRAMES, LATER = 12, 10
"""Frames of the movie, and from a stroke to the frame that shows how it is carried."""
LONG = 1200
"""Seconds within which any step ends."""

pytestmark = pytest.mark.long

XY = tuple[float, float]


@dataclass(frozen=True)
class Mistake:
    """A mistake of the depth, and the stroke of *Same as Here* that mends it."""

    frame: int
    reference: XY
    """Where the depth is right."""
    stroke: tuple[XY, XY]
    radius: float


@dataclass(frozen=True)
class Clip:
    """A clip, where its subject is in the first frame, and what is mended in it."""

    file: str
    subject: XY
    mistake: Mistake | None = None


CLIPS = (
    Clip(
        "person_walk_away_1.mp4", (0.478, 0.6),
        Mistake(40, (0.478, 0.66), ((0.478, 0.84), (0.477, 0.9)), 0.014),
    ),
    Clip("people_two_portrait_1.mp4", (0.85, 0.4)),
    Clip("animal_kitten_1.mp4", (0.5, 0.68), Mistake(60, (0.42, 0.5), ((0.3, 0.7), (0.345, 0.93)), 0.03)),
    Clip("plant_on_desk.mp4", (0.48, 0.62)),
    Clip("night_hall_lights_1.mov", (0.5, 0.35)),
)  # fmt: skip


def final(program: Program) -> None:
    """Wait for the best picture of the preview."""
    program.settle()
    program.wait(f"not {PREVIEW}.is_busy()", LONG, 0.2)
    program.settle()


def step(program: Program, began: float, what: str, name: str) -> None:
    """Keep the seconds of a step and its pictures."""
    program.tell_time(time.monotonic() - began, what)
    look(program, name)
    make_wide(program, OPENS)


def mend(program: Program, mistake: Mistake) -> None:
    """Paint over a mistake, and look at it before, after and some frames later."""
    program.ask(f"bpy.context.scene.frame_set({mistake.frame}); None")
    final(program)
    program.shot("repair_1_before")
    program.ask(f"bpy.context.scene.frame_set({mistake.frame + LATER}); None")
    final(program)
    program.shot("repair_2_later_before")
    program.ask(f"bpy.context.scene.frame_set({mistake.frame}); None")
    final(program)
    program.ask(f"r = {SETTINGS}.repairs; r.kind, r.radius = 'SAME', {mistake.radius}; None")
    began = time.monotonic()
    program.ask(PAINT)
    program.wait(PAINTING)
    program.settle()
    program.screen.click(*over(program, mistake.reference))
    program.settle()
    program.screen.drag(*(over(program, place) for place in mistake.stroke))
    program.wait(f"not ({PAINTING})")
    program.shot("repair_3_stroke")
    final(program)
    program.tell_time(time.monotonic() - began, "a mistake is mended")
    program.shot("repair_4_after")
    began = time.monotonic()
    program.ask(f"bpy.context.scene.frame_set({mistake.frame + LATER}); None")
    final(program)
    program.tell_time(time.monotonic() - began, f"{LATER} frames later")
    program.shot("repair_5_later_after")
    assert program.ask(f"len({SETTINGS}.repairs.items)") == 1
    program.ask("bpy.context.scene.frame_set(1); None")


@pytest.mark.parametrize("clip", CLIPS, ids=lambda clip: Path(clip.file).stem)
def test_from_drop_to_movie(hd_screen: Screen, resources: Path, folder: Path, data: Path, clip: Clip) -> None:
    name = Path(clip.file).stem
    project = folder / name
    project.mkdir()
    shutil.copy(data / "clips" / clip.file, project)
    with running(hd_screen, resources, f"clips/{name}") as program:
        actions, whole = ["drop the clip"], time.monotonic()
        began = whole
        drop(program, project / clip.file)
        actions.append("choose Virtual Aperture")
        program.screen.key("s")
        program.wait(f"{SETTINGS}.points is not None", LONG)
        program.settle()
        step(program, began, "drop to solved", "1_solved")

        actions.append("press Preview")
        began = time.monotonic()
        program.press("virtual_aperture.preview", across=LEFT)
        program.wait(f"len({PREVIEW}._kept)", LONG)
        step(program, began, "Preview to the first picture", "2_first_picture")
        final(program)
        step(program, began, "Preview to the final picture", "3_final_picture")

        actions += ["press Pick Focus", "click"]
        began = time.monotonic()
        program.press("virtual_aperture.pick_focus()", across=0.75)
        program.wait(PICKING)
        program.screen.move(*over(program, clip.subject))
        program.settle()
        program.shot("4_picking")
        program.screen.click(*over(program, clip.subject))
        time.sleep(1)
        program.shot("4_picked")
        program.wait(f"not ({PICKING})", LONG)
        final(program)
        step(program, began, "Pick Focus to the final picture", "5_focus")
        assert len(program.ask(MARKS)) == 1
        program.tell(f"in focus: {program.ask(f'{SETTINGS}.marks.items[0].name')}")

        for shows in ("FOCUS", "DEPTH"):
            program.ask(f"{SETTINGS}.viewport_shows = {shows!r}; None")
            final(program)
            program.shot(f"5_overlay_{shows.lower()}")
        program.ask(f"{SETTINGS}.viewport_shows = 'LENS'; None")
        if clip.mistake is not None:
            mend(program, clip.mistake)

        program.ask(f"bpy.context.scene.frame_end = {FRAMES}; None")
        actions.append("press Render Clip")
        began = time.monotonic()
        program.press("virtual_aperture.render_clip")
        program.wait(f"{MOVIE}.is_running")
        program.wait(f"not {MOVIE}.is_running or {MOVIE}.done > 2", LONG)
        look(program, "6_movie_under_way")
        program.wait(f"not {MOVIE}.is_running", LONG)
        program.screen.nudge()
        step(program, began, f"Render Clip to a movie of {FRAMES} frames", "7_movie")
        program.tell_time(time.monotonic() - whole, f"drop to movie, {len(actions)} actions")
        program.tell("messages: " + " | ".join(program.ask("messages()")))
        depth = program.ask(f"[{DEPTH}.done, {DEPTH}.is_running, {DEPTH}.problem] if {DEPTH} else None")
        program.tell(f"depth ahead: {depth}")
    (movie,) = project.glob(f"{name}_render.mp4")
    shutil.copy(movie, program.pictures)
    with av.open(str(movie)) as made:
        pictures = [frame.to_ndarray(format="rgb24") for frame in made.decode(video=0)]
    assert len(pictures) == FRAMES and np.std(pictures[0]) > 0
