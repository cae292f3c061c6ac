"""The process that computes with a clip for a window: what it makes, and which shots it remembers."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.core.base.progress import Cancelled
from addon.core.camera.reconstruction import Intrinsics
from addon.core.focus.focus import Focus
from addon.core.frame.plan import FrameOptions
from addon.render.processes import clip_process
from addon.render.processes.clip_process import ClipProcess
from addon.render.viewport.pictures import FINE, Wanted, make_picture
from addon.render.viewport.preview import Preview
from addon.scene.build import build
from addon.scene.focus.clicks import place_at
from addon.scene.sources.shot import Shot, shot_of

from ..scenes import slanted_shot
from ..waiting import until

PLAIN = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
LENS = FrameOptions(Focus(distance=8.0), radius=0.4, method="features")


@pytest.fixture
def shot(scene: bpy.types.Scene, tmp_path: Path) -> Shot:
    made = slanted_shot(tmp_path / "clip", PLAIN)
    build(scene, made.footage, made.reconstruction)
    return shot_of(scene)


def test_it_makes_pictures_and_picks_as_this_process_does(shot: Shot, scene: bpy.types.Scene) -> None:
    process = ClipProcess()
    shown = Preview(process)
    wanted = Wanted(shot, 2, LENS, (PLAIN.width, PLAIN.height))
    try:
        shown.want(wanted)
        until(lambda: shown.poll() is None and not shown.is_busy())
        best = shown.best(wanted)
        assert best is not None and best.level == FINE and not shown.problem(wanted)
        assert np.array_equal(best.linear, make_picture(wanted, FINE).linear)
        pick = place_at(scene, 2, 0.5, 0.5)
        call = process.call(pick)
        until(lambda: process.poll() is None and call.ended)
        assert repr(call.result()) == repr(pick())
        # The process ends; the preview goes on with another one, and says so.
        worker = process.worker
        assert worker is not None and worker.process is not None
        other = replace(wanted, frame=3)
        shown.want(other)
        shown.poll()
        worker.process.kill()
        until(lambda: shown.poll() is None and shown.note)
        assert shown.note == "The preview is begun again: the preview's process was ended by SIGKILL"
        until(lambda: shown.poll() is None and not shown.is_busy())
        best = shown.best(other)
        assert best is not None and best.level == FINE and not shown.note
        assert process.worker is not worker
    finally:
        process.end()


def test_it_ends_once_it_is_idle(shot: Shot, monkeypatch: pytest.MonkeyPatch) -> None:
    process = ClipProcess()
    process.begin()
    monkeypatch.setattr(clip_process, "IDLE", -1.0)
    assert process._look() == clip_process.LOOK and process.worker is not None, "nothing was called yet"
    call = process.call(place_at(bpy.context.scene, 2, 0.5, 0.5))
    assert process._look() == clip_process.LOOK and not call.ended
    process._used = time.monotonic()
    worker = process.worker
    process.end()
    assert process.worker is None and worker is not None
    with pytest.raises(Cancelled):
        call.result()
