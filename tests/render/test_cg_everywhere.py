"""CG objects that move, through all that renders a clip in other processes: the same pictures."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import av
import bpy
import cv2
import numpy as np
import pytest

from addon.core.base import limits
from addon.core.base.worker import Worker
from addon.render.engine import draw_alone
from addon.render.processes import launcher
from addon.render.processes.frames_ahead import DrawnFrame, FramesAhead
from addon.scene.cg_objects import STAYS_SHARP
from benchmarks.torture import clip
from benchmarks.torture.bench import contents

from ..command_line import HEADLESS, done
from ..in_blender import place_lamp
from ..movies import assert_same
from ..waiting import PATIENCE, until

COUNT = 9
"""Frames: one more than are worth other processes."""
SIDE, ACROSS = 8, 0.3
"""Of the lamp: pixels of its side, and how far it goes to either side of the middle, times its distance."""
TITLE, GREY = 0.15, 0.3
"""Of a square that stays sharp: how far it is below the middle, times its distance, and its radiance."""

pytestmark = pytest.mark.usefixtures("registered")


@pytest.fixture(scope="module")
def blend(registered: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tiny clip, in whose scene a lamp goes from left to right."""
    folder = tmp_path_factory.mktemp("cg")
    clip.solve(clip.write_video(folder / "clip", COUNT), folder / "work")
    lens = "--focus-distance", "7", "--blur", "0.02", "--method", "features", "--views", "4"
    done("save", folder / "work", *lens, "--no-copy", "--blend", folder / "cg.blend")
    add_lamp(folder / "cg.blend")
    done("render", folder / "cg.blend", "--out", folder / "one" / "####.png", "--jobs", 1)
    return folder / "cg.blend"


def add_lamp(blend: Path) -> None:
    """Put a lamp that moves into a saved scene."""
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.context.scene
    lamp = place_lamp(scene, 4.0, SIDE)
    right = scene.camera.matrix_world.normalized().col[0].xyz
    for frame, side in ((1, -1), (COUNT, 1)):
        lamp.location = 4.0 * ACROSS * side * right
        lamp.keyframe_insert("location", frame=frame)
    title = place_lamp(scene, 4.0, SIDE, down=TITLE)
    title.name, title[STAYS_SHARP] = "title", True
    title.data.materials[0].node_tree.nodes["Emission"].inputs["Strength"].default_value = GREY
    scene.cycles.samples, scene.cycles.use_denoising = 4, False
    bpy.ops.wm.save_mainfile()
    Path(f"{blend}1").unlink()


def test_it_moves_as_it_is_keyed(blend: Path) -> None:
    scene_at = [place_of(path) for path in sorted((blend.parent / "one").iterdir())]
    assert len(scene_at) == COUNT
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.context.scene
    lamp = next(thing for thing in scene.objects if thing.name.startswith("lamp"))
    for frame, seen in enumerate(scene_at, 1):
        scene.frame_set(frame)
        middle = sum((np.array(lamp.matrix_world @ v.co) for v in lamp.data.vertices), np.zeros(3)) / 4
        local = np.array(scene.camera.matrix_world.normalized().inverted()) @ [*middle, 1]
        expected = clip.LENS.project(local[:3] * [1, -1, -1])
        assert seen == pytest.approx(expected.tolist(), abs=0.5)
    assert scene_at[-1][0] - scene_at[0][0] > 2 * ACROSS * clip.LENS.fx - 5


def place_of(picture: Path) -> list[float]:
    """Column and row of what is whiter than the clip ever is."""
    shown = cv2.imread(str(picture))
    assert shown is not None
    row, column = np.nonzero(shown.min(axis=2) > 250)
    return [float(column.mean()) + 0.5, float(row.mean()) + 0.5]


@pytest.mark.long
def test_by_processes_side_by_side(blend: Path, tmp_path: Path) -> None:
    done("render", blend, "--out", tmp_path / "two" / "####.png", "--jobs", 2)
    assert contents(tmp_path / "two") == contents(blend.parent / "one")


@pytest.mark.long
def test_by_processes_that_draw_ahead(blend: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    taken = list[int]()
    take = FramesAhead.frame

    def counted(ahead: FramesAhead, frame: int) -> DrawnFrame | None:
        drawn = take(ahead, frame)
        taken.extend([frame] * (drawn is not None))
        return drawn

    monkeypatch.setattr(FramesAhead, "frame", counted)
    pictures, before = {}, limits.chosen_threads()
    for threads in (1, 2):
        bpy.ops.wm.open_mainfile(filepath=str(blend))
        render = bpy.context.scene.render
        render.engine, render.filepath = "VIRTUAL_APERTURE", f"{tmp_path}/{threads}/####"
        limits.limit_threads(threads)
        try:
            bpy.ops.render.render(animation=True)
        finally:
            limits.limit_threads(before)
        pictures[threads] = pixels(tmp_path / str(threads))
        assert bool(taken) == (threads > 1)
    assert len(pictures[1]) == COUNT
    one = pixels(blend.parent / "one")
    for frame, picture in pictures[1].items():
        assert np.array_equal(picture, one[frame]) and np.array_equal(picture, pictures[2][frame]), frame


def pixels(folder: Path) -> dict[int, np.ndarray]:
    return {int(path.stem): np.asarray(cv2.imread(str(path))) for path in folder.iterdir()}


def test_by_render_clip(blend: Path, tmp_path: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.context.scene
    scene.render.filepath = str(tmp_path / "clip.mp4")
    assert bpy.ops.virtual_aperture.render_clip() == {"FINISHED"}
    done("render", blend, "--out", tmp_path / "command.mp4")
    assert_same(tmp_path / "clip.mp4", tmp_path / "command.mp4")
    # Both are of these frames, less what H.264 takes.
    one = pixels(blend.parent / "one")
    with av.open(str(tmp_path / "clip.mp4")) as held:
        for frame, shown in enumerate(held.decode(video=0), 1):
            assert np.abs(shown.to_ndarray(format="bgr24").astype(float) - one[frame]).mean() < 6, frame


@pytest.mark.long
@pytest.mark.skipif(not Path("/proc/self/cmdline").exists(), reason="processes are found in /proc")
@pytest.mark.parametrize("ended", ["SIGTERM", "SIGKILL"])
def test_no_process_stays_behind(blend: Path, tmp_path: Path, ended: str) -> None:
    temporary, out = tmp_path / "tmp", tmp_path / "o"
    process = rendering(blend, temporary, out, jobs=2)
    # The other process, and Cycles' of this one.
    until(lambda: len(running(temporary)) > 1 and any(out.glob("0*.png")))
    assert process.poll() is None
    process.send_signal(getattr(signal, ended))
    process.communicate()
    until(lambda: not running(temporary))
    if ended == "SIGTERM":
        assert process.returncode == 143
        assert not list(temporary.glob("virtual-aperture-*"))


@pytest.mark.parametrize("ended", ["SIGTERM", "alone"])
def test_who_draws_ahead_ends_while_it_waits(blend: Path, ended: str) -> None:
    """For Blender, which has not come to its next frame yet; also where it is killed."""
    worker = Worker()
    launcher.start(worker, ["frames"], "Scene", blend=blend)
    call = worker.call(partial(draw_alone, "Scene", COUNT))
    process = worker.process
    assert process is not None and process.stdin is not None
    try:
        until(lambda: worker.poll() is not None and call.ended)
        assert call.result().pictures["Combined"].any()
        if ended == "SIGTERM":
            process.terminate()
        else:
            process.stdin.close()
        assert process.wait(PATIENCE) == 128 + signal.SIGTERM
    finally:
        process.kill()
        process.wait()


@pytest.mark.long
def test_the_frame_is_named_where_cycles_fails(blend: Path, tmp_path: Path) -> None:
    temporary, out = tmp_path / "tmp", tmp_path / "o"
    process = rendering(blend, temporary, out, jobs=1)
    until(lambda: any(out.glob("0*.png")))
    for each in running(temporary):
        os.kill(each, signal.SIGKILL)
    _, said = process.communicate()
    assert process.returncode == 1
    assert re.search(r"the CG objects of frame \d could not be rendered: .* SIGKILL", said), said
    assert "Traceback" not in said and not running(temporary)
    done("render", blend, "--out", tmp_path / "o" / "####.png", "--jobs", 1)
    assert contents(out) == contents(blend.parent / "one")


def rendering(blend: Path, temporary: Path, out: Path, jobs: int) -> subprocess.Popen[str]:
    """A command that renders a scene, with a folder of its own for temporary files."""
    temporary.mkdir()
    return subprocess.Popen(
        [sys.executable, HEADLESS, "render", blend, "--out", f"{out}/####.png", "--jobs", str(jobs)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=os.environ | {"TMPDIR": str(temporary)},
        text=True, start_new_session=True,
    )  # fmt: skip


def running(temporary: Path) -> list[int]:
    """Other processes of a command with this folder for temporary files."""
    found = []
    for path in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            words, variables = ((path / name).read_bytes().split(b"\0") for name in ("cmdline", "environ"))
            if launcher.JOB.encode() in words and f"TMPDIR={temporary}".encode() in variables:
                found.append(int(path.name))
    return found
