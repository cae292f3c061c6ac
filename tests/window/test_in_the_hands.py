"""From a dropped clip to a pulled focus, with mouse and keys: what a person does who has never read a manual.

With real data the clip is a phone's, else the sample clip. Times are told, beside the pictures, and not
judged.
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from .clips import read_exr
from .program import EXTENSION, ROOT, Program
from .screen import Screen
from .steps import LEFT, MARKS, PICKING, begin, drop, ended, over, running

SETTINGS = "bpy.context.scene.virtual_aperture"
SPACE = "view('VIEW_3D')['area'].spaces.active"
PREVIEW = f"__import__('sys').modules['{EXTENSION}.addon.render.viewport.viewport'].PREVIEW"
PHONE = Path(os.environ.get("VA_DATA", ROOT.parent / "shared" / "data")) / "duck" / "demo.mp4"
SAMPLE = ROOT / "sample_scenes" / "desk.mp4"
FEWEST_ACTIONS = 5
"""From the drop to the first blurred picture, at most."""
SUBJECT, WALL, LAST = ((0.5, 0.71), (0.2, 0.12), 60) if PHONE.exists() else ((0.53, 0.45), (0.62, 0.1), 30)
"""Places of the first frame in fractions of the picture, and the frame that focus is pulled to."""

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module")
def project(folder: Path) -> Path:
    made = folder / "hands"
    made.mkdir()
    shutil.copy(PHONE if PHONE.exists() else SAMPLE, made / "clip.mp4")
    return made


@pytest.fixture(scope="module")
def program(screen: Screen, resources: Path) -> Iterator[Program]:
    with running(screen, resources, "hands") as made:
        yield made


def watch(program: Program) -> None:
    """Note when another picture is wanted of the preview, and when it has which frame how good."""
    program.ask(
        "import time\nif not hasattr(bpy, 'seen'):\n"
        f"  bpy.seen, bpy.wanted, keep, want = [], [], {PREVIEW}._keep, {PREVIEW}.want\n"
        "  def noted(picture):\n"
        "    keep(picture); bpy.seen.append([time.monotonic(), picture.wanted.frame, picture.level])\n"
        "  def wished(wanted):\n"
        "    if not bpy.wanted or bpy.wanted[-1][1] != wanted.key:\n"
        "      bpy.wanted.append([time.monotonic(), wanted.key]); bpy.seen.clear()\n"
        "    want(wanted)\n"
        f"  {PREVIEW}._keep, {PREVIEW}.want = noted, wished\n"
        "None"
    )


def shown(program: Program, what: str, seconds: float = 120.0) -> None:
    """Wait for the best picture; tell after how many seconds there was a first and the best one."""
    program.wait(f"bpy.seen and not {PREVIEW}.is_busy()", seconds)
    pictures, began = program.ask("bpy.seen"), program.ask("bpy.wanted[-1][0]")
    program.tell_time(pictures[0][0] - began, f"{what}, first picture")
    program.tell_time(pictures[-1][0] - began, f"{what}, best picture")
    program.settle()
    assert program.ask(f"list({PREVIEW}._problems.values())") == []


def frame_seen(program: Program) -> np.ndarray:
    """What the window shows within the camera's frame, but for a border."""
    (left, top), (right, bottom) = over(program, (0.05, 0.05)), over(program, (0.95, 0.95))
    picture: Any = program.shot("frame")
    return np.asarray(picture[round(top) : round(bottom), round(left) : round(right)]).astype(float)


def detail(picture: np.ndarray) -> float:
    """How sharp it is."""
    return float(np.abs(np.diff(picture, axis=1)).mean())


def test_drop_to_the_first_blurred_picture(program: Program, project: Path) -> None:
    actions = ["drop the clip"]
    began = time.monotonic()
    drop(program, project / "clip.mp4")
    # Blender's own handlers take videos, too: it asks, and underlines a letter of each.
    actions.append("choose Virtual Aperture")
    program.screen.key("s")
    program.wait(f"{SETTINGS}.points is not None", 400)
    program.settle()
    program.tell_time(time.monotonic() - began, "from drop to solved")
    program.shot("solved")
    # The nearest large thing is in focus already.
    assert len(program.ask(MARKS)) == 1
    watch(program)
    actions.append("press Preview")
    program.press("virtual_aperture.preview", across=LEFT)
    # Its depth may have to be found: the clip is seen meanwhile.
    program.wait("bpy.seen", 200)
    program.tell_time(time.monotonic() - began, f"from drop to a blurred picture, {len(actions)} actions")
    program.settle()
    program.shot("first_blurred")
    assert len(actions) <= FEWEST_ACTIONS, actions
    rough = detail(frame_seen(program))
    shown(program, "preview")
    program.shot("blurred")
    blurred = detail(frame_seen(program))
    # The wipe shows the clip as it was shot.
    program.ask(f"{SETTINGS}.viewport_wipe = 1.0; None")
    program.wait(f"not {PREVIEW}.is_busy()", 200)
    program.settle()
    program.shot("as_shot")
    assert max(rough, blurred) < 0.8 * detail(frame_seen(program))
    program.ask(f"{SETTINGS}.viewport_wipe = 0.0; None")
    program.wait(f"not {PREVIEW}.is_busy()", 200)


def test_click_on_the_subject(program: Program) -> None:
    before = frame_seen(program)
    watch(program)
    begin(program)
    program.screen.move(*over(program, SUBJECT))
    program.settle()
    program.shot("picking")
    program.screen.click(*over(program, SUBJECT))
    ended(program)
    program.wait(f"not ({PICKING}) and not {PREVIEW}.is_busy()", 200)
    program.settle()
    program.shot("subject")
    assert len(program.ask(MARKS)) == 1
    assert not np.array_equal(frame_seen(program), before) or program.ask("not bpy.seen")


def test_the_f_stop_changes_the_picture(program: Program) -> None:
    program.ask(f"s = {SETTINGS}; s.metres_per_unit = 0.2; None")
    program.settle()
    before = detail(frame_seen(program))
    stop = program.ask(f"{SETTINGS}.f_stop")
    program.press("set_amount_by(kind='F_STOP')", across=0.45)
    button = program.find("virtual_aperture.f_stop", "VIEW_3D", "UI", 0.6)
    watch(program)
    program.fill(button, f"{stop / 2:.4f}")
    shown(program, "f-stop")
    program.shot("wider")
    assert program.ask(f"{SETTINGS}.f_stop") == pytest.approx(stop / 2, rel=1e-3)
    assert detail(frame_seen(program)) < before


def test_a_pull_to_the_wall(program: Program) -> None:
    program.ask(f"bpy.context.scene.frame_set({LAST})")
    program.wait(f"not {PREVIEW}.is_busy()", 200)
    watch(program)
    begin(program, add=True)
    program.screen.click(*over(program, WALL))
    program.wait(f"not ({PICKING})", 200)
    program.wait(f"not {PREVIEW}.is_busy()", 200)
    program.settle()
    program.shot("pulled")
    (first, near), (second, far) = program.ask(MARKS)
    assert (first, second) == (1, LAST) and far > near


def test_scrubbing_shows_the_pull(program: Program) -> None:
    program.ask("bpy.context.scene.frame_set(1)")
    program.wait(f"not {PREVIEW}.is_busy()", 200)
    x, y = program.middle("VIEW_3D")
    program.screen.move(x - 100, y)
    watch(program)
    shown = f"len([p for p in {PREVIEW}._kept.values() if p.level])"
    kept = program.ask(shown)
    began = time.monotonic()
    for _ in range(10):
        program.screen.key("Right")
        time.sleep(0.25)
    spent = time.monotonic() - began
    frames = program.ask(shown) - kept
    program.tell_time(spent, f"scrubbing 10 frames, {frames} of them seen, {frames / spent:.1f} a second")
    # On a busy machine it may be none on the way.
    program.wait(f"not {PREVIEW}.is_busy()", 200)
    assert program.ask(shown) > kept, "not even the frame at which it ended is seen"


def test_rendered_saved_and_opened_again(program: Program, project: Path) -> None:
    program.ask(
        "s = bpy.context.scene.render.image_settings\n"
        "s.file_format, s.color_mode, s.color_depth = 'OPEN_EXR', 'RGBA', '32'\n"
        f"bpy.context.scene.frame_set({LAST // 2})"
    )
    pictures = []
    for name in ("before", "after"):
        assert "complete" in program.render(seconds=300)
        file = program.pictures / f"{name}.exr"
        assert program.ask(f"save_result({str(file)!r})") == ""
        pictures.append(read_exr(file))
        while program.ask("len(bpy.context.window_manager.windows)") > 1:
            program.close_window()
        program.screen.move(*program.middle("VIEW_3D"))
        if name == "before":
            program.screen.key("ctrl+s")
            program.choose_file(project / "pull.blend", new=True)
            program.wait("bpy.data.filepath")
            program.screen.key("ctrl+o")
            program.choose_file(project / "pull.blend")
            program.wait("not bpy.data.is_dirty")
            program.settle()
            assert len(program.ask(MARKS)) == 2
    assert np.array_equal(*pictures)
