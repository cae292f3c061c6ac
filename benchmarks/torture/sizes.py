"""Large pictures and long clips."""

from __future__ import annotations

import signal

import cv2
import numpy as np

from addon.core.camera.reconstruction import Intrinsics

from . import clip
from .bench import LENS, Try, contents
from .kills import SIGNALS, interrupt

WIDE = Intrinsics(16384, 96, 14000.0, 14000.0, 8192.0, 48.0)
LARGE = Intrinsics(16384, 9216, 14000.0, 14000.0, 8192.0, 4608.0)
LONG = 2000


def wide(one: Try) -> None:
    """Pictures of 16,384 pixels across."""
    _large(one, WIDE)


def large(one: Try) -> None:
    """Pictures of 16,384 by 9,216 pixels."""
    # Minutes on an idle machine: a picture of a quarter of that takes one and a half.
    one.patience = 1800
    _large(one, LARGE)


def _large(one: Try, camera: Intrinsics) -> None:
    pictures = clip.write_pictures(one.folder / "clip", 2, camera)
    work = clip.solve(pictures, one.folder / "work", camera)
    out = one.folder / "out" / "####.png"
    words = ("render", work, *LENS[:-1], "2", "--frames", "1", "--out", out)
    run = one.run(*words)
    path = out.parent / "0001.png"
    if run.status:
        if path.exists():
            one.verdict.add("wrong", "a frame that failed is there")
        return
    picture = np.asarray(cv2.imread(str(path)))
    if picture.shape != (camera.height, camera.width, 3) or picture.std() < 5:
        one.verdict.add("wrong", f"{path.name} is not the picture")


def long(one: Try) -> None:
    """Two thousand frames, interrupted many times."""
    one.patience = 1800
    pictures = clip.write_pictures(one.folder / "clip", LONG)
    work = clip.solve(pictures, one.folder / "work")
    whole = one.folder / "whole" / "####.png"
    words = ("render", work, *LENS, "--out")
    began = one.run(*words, whole)
    if began.status:
        one.verdict.add("lost", began.said[-300:])
        return
    out = one.folder / "out" / "####.png"
    for _ in range(6):
        number: signal.Signals = one.dice.choice(SIGNALS)
        interrupt(one, one.start(*words, out), one.dice.uniform(0.1, 0.3) * began.seconds, number)
    one.expect(contents(whole.parent), out, one.run(*words, out))
