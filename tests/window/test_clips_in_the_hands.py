"""Clips of the gallery as a new user takes them, from drop to movie. No number in the panel moves by itself.

Every step is photographed with the sidebar as Blender opens it and with a narrow one. Seconds are printed
and kept beside the pictures, and not judged: look at the pictures, too. A clip takes minutes, so this is run
alone:

    make test-window WINDOW_TESTS="-m long tests/window/test_clips_in_the_hands.py"
"""

from __future__ import annotations

import shutil
import time
from pathlib import Path

import av
import numpy as np
import pytest

from .program import EXTENSION, Program
from .screen import Screen
from .steps import DEPTH, LEFT, OPENS, PICKING, SETTINGS, drop, look, make_wide, over, running

PREVIEW = f"__import__('sys').modules['{EXTENSION}.addon.render.viewport.viewport'].PREVIEW"
MOVIE = f"__import__('sys').modules['{EXTENSION}.addon.ui.jobs.movie'].MovieJob.last"
FRAMES = 12
"""Frames of the movie."""
BLUR = 3.0
"""Per cent of the width, by default."""
IN_FOCUS = f"[[mark.name, mark.frame, mark.distance] for mark in {SETTINGS}.marks.items]"
LONG = 1200
"""Seconds within which any step ends."""
SOLVE = f"__import__('sys').modules['{EXTENSION}.addon.ui.base.solving'].Solving.running"

pytestmark = pytest.mark.long

CLIPS = {
    "people_two_talk_street_1.mp4": (0.65, 0.8),
    "person_dance_davis_1.mp4": (0.49, 0.37),
    "vehicle_car_roundabout_davis_1.mp4": (0.55, 0.55),
    "dog.mp4": (0.53, 0.2),
    "animal_cow_davis_1.mp4": (0.46, 0.41),
}
"""Files, and where the subject is in the first frame, shares of the picture from the top left."""


def final(program: Program) -> None:
    """Wait for the best picture of the preview."""
    program.settle()
    program.wait(f"not {PREVIEW}.is_busy()", LONG, 0.2)
    program.settle()


def step(program: Program, began: float, what: str, name: str) -> None:
    """Keep the seconds of a step and its pictures; the blur is as it was to begin with."""
    program.tell_time(time.monotonic() - began, what)
    assert program.ask(f"round({SETTINGS}.blur_percent, 3)") == BLUR
    look(program, name)
    make_wide(program, OPENS)


def promised(program: Program, what: str, work: str, is_running: str) -> None:
    """Wait for the end of work, and keep how wrong its times left were, but in the first 10 and last 5 s."""
    began, seen = time.monotonic(), []
    while program.ask(is_running):
        assert time.monotonic() - began < LONG
        seen.append((time.monotonic(), program.ask(f"{work}.left")))
        time.sleep(1.0)
    ended = time.monotonic()
    judged = [(ended - at, left) for at, left in seen if at - began > 10 and ended - at > 5]
    wrong = [max(left, true) / min(left, true) for true, left in judged if left]
    none = f"none in {sum(not left for _, left in judged)} of {len(judged)} looks"
    worst = f"wrong by {max(wrong):.1f} times at most, {np.median(wrong):.1f} in the median" if wrong else ""
    program.tell(f"{what}, {ended - began:.0f} s: time left {worst}, {none}")


def played(program: Program) -> float:
    """Play for 4 s; returns frames a second."""
    toggle = "with bpy.context.temp_override(**view('VIEW_3D')):\n    bpy.ops.screen.animation_play()\n"
    program.ask(
        "import time\nseen = bpy.app.driver_namespace['seen'] = []\n"
        "bpy.app.handlers.frame_change_post.append(lambda *_: seen.append(time.monotonic()))\n" + toggle
    )
    time.sleep(4.0)
    program.ask(f"{toggle}bpy.app.handlers.frame_change_post.pop(); None")
    program.settle()
    number, seconds = program.ask("(lambda s: [len(s), s[-1] - s[0]])(bpy.app.driver_namespace['seen'])")
    return (number - 1) / seconds


@pytest.mark.parametrize("file", CLIPS)
def test_from_drop_to_movie(hd_screen: Screen, resources: Path, folder: Path, data: Path, file: str) -> None:
    name = Path(file).stem
    project = folder / name
    project.mkdir()
    shutil.copy(data / "clips" / file, project)
    with running(hd_screen, resources, f"clips/{name}") as program:
        actions, whole = ["drop the clip"], time.monotonic()
        began = whole
        drop(program, project / file)
        actions.append("choose Virtual Aperture")
        program.screen.key("s")
        program.wait(f"{SOLVE} is not None", LONG)
        promised(program, "solve", f"{SOLVE}.step", f"{SETTINGS}.points is None")
        program.settle()
        step(program, began, "drop to solved", "1_solved")

        actions.append("press Preview")
        began = time.monotonic()
        program.press("virtual_aperture.preview", across=LEFT)
        program.wait(f"len({PREVIEW}._kept)", LONG)
        step(program, began, "Preview to the first picture", "2_first_picture")
        final(program)
        step(program, began, "Preview to the final picture", "3_final_picture")

        program.screen.move(*over(program, CLIPS[file]))
        program.settle()
        program.shot("3_brackets")
        boxes = f"sum(len(each.boxes) for each in {PREVIEW}._kept.values())"
        program.tell(f"subjects and faces: {program.ask(boxes)}")
        actions.append("click the subject")
        where, before = over(program, CLIPS[file]), program.ask(IN_FOCUS)
        began = time.monotonic()
        program.screen.click(*where)
        program.wait(f"{IN_FOCUS} != {before} and not ({PICKING})", LONG)
        program.tell_time(time.monotonic() - began, "click to the focus")
        program.wait(f"{PREVIEW}.best({PREVIEW}._wanted) is not None", LONG)
        program.tell_time(time.monotonic() - began, "click to a picture")
        final(program)
        step(program, began, "click to the final picture", "5_focus")
        assert len(program.ask(IN_FOCUS)) == 1
        program.tell(f"in focus: {program.ask(f'{SETTINGS}.marks.items[0].name')}")

        program.ask(f"bpy.context.scene.frame_end = {FRAMES}; None")
        for frame in (*range(2, FRAMES + 1), 1):
            program.ask(f"bpy.context.scene.frame_set({frame}); None")
            final(program)
        rate = program.ask("bpy.context.scene.render.fps / bpy.context.scene.render.fps_base")
        program.tell(f"playback of finished frames: {played(program):.1f} a second of {rate:.1f}")
        program.ask("bpy.context.scene.frame_set(1); None")
        final(program)
        for shows in ("FOCUS", "DEPTH"):
            program.ask(f"{SETTINGS}.viewport_shows = {shows!r}; None")
            final(program)
            program.shot(f"5_overlay_{shows.lower()}")
        program.ask(f"{SETTINGS}.viewport_shows = 'LENS'; None")

        actions.append("press Render Clip")
        began = time.monotonic()
        program.press("virtual_aperture.render_clip")
        program.wait(f"{MOVIE}.is_running")
        program.wait(f"not {MOVIE}.is_running or {MOVIE}.done > 2", LONG)
        look(program, "6_movie_under_way")
        promised(program, "movie", MOVIE, f"{MOVIE}.is_running")
        program.screen.nudge()
        step(program, began, f"Render Clip to a movie of {FRAMES} frames", "7_movie")
        program.tell_time(time.monotonic() - whole, f"drop to movie, {len(actions)} actions")
        program.tell("messages: " + " | ".join(program.ask("messages()")))
        if program.ask(f"{DEPTH} is not None"):
            promised(program, "rest of the depth", DEPTH, f"{DEPTH}.is_running")
        depth = program.ask(f"[{DEPTH}.done, {DEPTH}.is_running, {DEPTH}.problem] if {DEPTH} else None")
        program.tell(f"depth ahead: {depth}")
    (movie,) = project.glob(f"{name}_render.mp4")
    shutil.copy(movie, program.pictures)
    with av.open(str(movie)) as made:
        pictures = [frame.to_ndarray(format="rgb24") for frame in made.decode(video=0)]
    assert len(pictures) == FRAMES and np.std(pictures[0]) > 0
