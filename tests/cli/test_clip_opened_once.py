"""A video is decoded to its end to count its frames once a run, in whichever of its processes."""

from __future__ import annotations

import json
import os
from pathlib import Path

import cv2
import pytest

from addon.core.media import video
from addon.core.media.clip import open_footage
from addon.core.sfm.workspace import load_solve

from .. import planes
from ..command_line import headless

COUNTER = f"""
import sys, pathlib

def begun(code, _offset):
    if code.co_name != {video._decode_all.__name__!r}:
        return sys.monitoring.DISABLE
    with pathlib.Path(__file__).with_name("counted.txt").open("a") as file:
        print(*sys.argv, file=file)

events = sys.monitoring.events.PY_START
sys.monitoring.use_tool_id(4, "counter")
sys.monitoring.register_callback(4, events, begun)
sys.monitoring.set_events(4, events)
"""
"""Python runs a `sitecustomize` at its start, and the worker inherits the path on which it lies."""
FRAMES, SIZE = 8, (160, 120)
LENS = ("--focus-at", "0.5,0.5", "--method", "features", "--views", 2)


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    path = tmp_path / "walk.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 24, SIZE)
    for picture in planes.halved(planes.sideways(2 * FRAMES)[:FRAMES]):
        writer.write(picture)
    writer.release()
    return path


def counted(tmp_path: Path, *arguments: object) -> int:
    """How often a command line's processes decode a video to its end."""
    hook = tmp_path / "hook"
    hook.mkdir(exist_ok=True)
    (hook / "sitecustomize.py").write_text(COUNTER)
    (hook / "counted.txt").write_text("")
    done = headless(*arguments, environment={"PYTHONPATH": f"{hook}{os.pathsep}{Path.cwd()}"})
    assert done.returncode == 0, done.stderr
    return len((hook / "counted.txt").read_text().splitlines())


@pytest.mark.long
def test_a_video_is_decoded_once_to_count_its_frames(clip: Path, tmp_path: Path) -> None:
    work, out = tmp_path / "work", tmp_path / "out"
    camera = ("--work", work, "--focal", planes.FOCAL / 2)
    assert counted(tmp_path, "run", clip, *camera, *LENS, "--out", out / "a.mp4") == 2, "clip, movie"
    assert counted(tmp_path, "render", work, *LENS, "--frames", 4, "--out", out / "####.png") == 0
    kept = json.loads((work / "solve.json").read_text())
    video = kept["video"]
    assert (len(video["times"]), video["width"], video["height"], video["fps"]) == (FRAMES, *SIZE, 24.0)
    # As older versions wrote it, and damaged.
    for others in ({}, {"video": None}, {"video": {"times": [-1]}}, {"video": [FRAMES]}):
        state = {name: value for name, value in kept.items() if name not in ("video", "digest")} | others
        (work / "solve.json").write_text(json.dumps(state))
        solved = load_solve(work)
        assert solved.video is None
        assert solved.open_clip().frames == tuple(range(1, FRAMES + 1))


def test_a_video_that_was_changed_is_counted_anew(clip: Path) -> None:
    assert open_footage(clip).frames == tuple(range(1, FRAMES + 1))
    writer = cv2.VideoWriter(str(clip), cv2.VideoWriter.fourcc(*"mp4v"), 24, planes.SIZE)
    for picture in planes.sideways(5):
        writer.write(picture)
    writer.release()
    assert open_footage(clip).frames == (1, 2, 3, 4, 5)
