"""Frames of an animation that other processes draw ahead: the same pictures, whoever draws them."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.core.base import limits
from addon.core.base.progress import Cancelled, reporting
from addon.render.processes import frames_ahead
from addon.render.processes.frames_ahead import DrawnFrame, FramesAhead, SharedFrames, draw_ahead
from addon.scene.passes import DEPTH

from ..command_line import done

DRAWN = DrawnFrame({"Combined": np.full((3, 5, 4), 0.1, np.float32)}, ("Frame 4 is dark",))
HOLD = """
import sys, time
from pathlib import Path
from addon.render.processes.frames_ahead import SharedFrames
with SharedFrames(Path(sys.argv[1])).claimed(4) as is_mine:
    print(is_mine, flush=True)
    sys.stdin.read()
"""


@pytest.fixture(autouse=True)
def _threads_as_before() -> Iterator[None]:
    before = limits.chosen_threads()
    yield
    limits.limit_threads(before)


def test_a_frame_that_waits_is_taken_once(tmp_path: Path) -> None:
    shared = SharedFrames(tmp_path)
    shared.put(4, DRAWN)
    assert shared.is_there(4)
    taken = shared.take(4)
    assert taken.notes == DRAWN.notes and not shared.is_there(4)
    assert np.array_equal(taken.pictures["Combined"], DRAWN.pictures["Combined"])


def test_frames_are_drawn_within_reach_of_the_one_under_way(tmp_path: Path) -> None:
    shared = SharedFrames(tmp_path)
    shared.go_on_to(2)
    drawing = draw_ahead(tmp_path, range(0, 20, 2), 3, lambda frame: DRAWN)
    assert [next(drawing) for _ in range(3)] == [4, 6, 8]
    shared.take(4)
    shared.go_on_to(4)
    assert next(drawing) == 10
    # What Blender has passed is drawn by nobody.
    shared.go_on_to(16)
    assert next(drawing) == 18
    shared.go_on_to(18)
    assert list(drawing) == []


def test_one_draws_here_what_nobody_is_at_and_waits_for_what_somebody_is(tmp_path: Path) -> None:
    ahead = FramesAhead(SharedFrames(tmp_path), ExitStack(), 0)
    assert ahead.frame(3) is None
    held = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        cwd=Path(__file__).resolve().parents[2],
    )  # fmt: skip
    assert held.stdin is not None and held.stdout is not None
    try:
        # Blender may have something to say first.
        assert "True\n" in held.stdout
        looks = 0

        def look(_stage: str, _share: float) -> None:
            nonlocal looks
            looks += 1
            if looks > 5:
                raise Cancelled

        with pytest.raises(Cancelled), reporting(look):
            ahead.frame(4)
        held.kill()
        held.wait()
        assert ahead.frame(4) is None
    finally:
        held.kill()
        held.communicate()
    ahead.shared.put(5, DRAWN)
    # As each view layer asks.
    assert ahead.frame(5) is ahead.frame(5) is not None


@pytest.mark.long
def test_an_animation_is_the_same_with_any_number_of_processes(
    scene: bpy.types.Scene, desk_work: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    work = shutil.copytree(desk_work, tmp_path / "work")
    blend = tmp_path / "desk.blend"
    lens = ("--focus-at", "0.5,0.5@2", "--focus-at", "0.2,0.3@12", "--blur", 0.03, "--views", 8)
    done("save", work, *lens, "--no-copy", "--blend", blend)
    taken = list[int]()
    take = SharedFrames.take

    def counted(shared: SharedFrames, frame: int) -> DrawnFrame:
        taken.append(frame)
        return take(shared, frame)

    monkeypatch.setattr(SharedFrames, "take", counted)
    pictures = {}
    for threads in (1, 2):
        bpy.ops.wm.open_mainfile(filepath=str(blend))
        render = bpy.context.scene.render
        bpy.context.view_layer.use_pass_z = True
        render.engine, render.filepath = "VIRTUAL_APERTURE", f"{tmp_path}/{threads}/"
        render.image_settings.media_type = "MULTI_LAYER_IMAGE"
        bpy.context.scene.frame_start, bpy.context.scene.frame_end = 2, 13
        limits.limit_threads(threads)
        bpy.ops.render.render(animation=True)
        assert frames_ahead._ahead is None and limits.chosen_threads() == threads
        pictures[threads] = {path.name: path.read_bytes() for path in (tmp_path / str(threads)).iterdir()}
        assert bool(taken) == (threads > 1)
    assert len(pictures[1]) == 12
    for name, one in pictures[1].items():
        assert DEPTH.encode() in one and len(one) == len(pictures[2][name])
    assert [name for name in pictures[1] if pictures[1][name] != pictures[2][name]] == []
    assert len(set(taken)) == len(taken) and min(taken) > 2
