"""Files that were damaged: refused in one line, or rendered right; and never kept as another run's."""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from . import clip
from .bench import DENSE, FRAMES, LENS, Run, Try, contents

WORDS = (
    b"nan",
    b"inf",
    b"-1",
    b"0",
    b"1e308",
    b"-1e308",
    b"99999999999",
    b"",
    b"x",
    b"\xff\xfe",
    b"null",
    b"[]",
)
FEW = "3-6"
"""Frames that are rendered, of the clip's."""
NOISE = 12
"""Steps of 255 from which a pixel is seen to be another."""


def mutate(dice: random.Random, data: bytes) -> bytes:
    """Cut, flip, overwrite, put a strange word in a number's place, lose or repeat a line, or empty."""
    kind = dice.randrange(7)
    at = dice.randrange(max(1, len(data)))
    if kind == 0:
        return data[:at]
    if kind == 1:
        out = bytearray(data)
        for _ in range(dice.choice([1, 1, 2, 8, 64])):
            out[dice.randrange(len(out))] ^= 1 << dice.randrange(8)
        return bytes(out)
    if kind == 2:
        length = dice.choice([1, 4, 8, 50])
        return (
            data[:at]
            + dice.choice([bytes(length), b"\xff" * length, dice.randbytes(length)])
            + data[at + length :]
        )
    if kind == 3:
        words = data.split(b" ")
        words[dice.randrange(len(words))] = dice.choice(WORDS)
        return b" ".join(words)
    if kind == 4:
        lines = data.split(b"\n")
        at = dice.randrange(len(lines))
        return b"\n".join(lines[:at] + lines[at + 1 :])
    if kind == 5:
        lines = data.split(b"\n")
        at = dice.randrange(len(lines))
        return b"\n".join(lines[:at] + [lines[at]] * 3 + lines[at + 1 :])
    return b""


def solve(one: Try) -> None:
    """A file of the working folder: its state or its model."""
    work = one.bench.project(one.folder / "project")
    files = [work / "solve.json", *(work / "model").iterdir()]
    _judged(one, work, one.dice.choice(files))


def footage(one: Try) -> None:
    """The clip."""
    work = one.bench.project(one.folder / "project")
    _judged(one, work, one.folder / "project" / "clip" / "clip.mp4")


def output(one: Try) -> None:
    """Frames of an earlier run: what is damaged is made again, what is whole is kept."""
    out = one.folder / "out" / "####.png"
    out.parent.mkdir()
    for name, data in one.bench.frames.items():
        is_bad = one.dice.random() < 0.3
        (out.parent / name).write_bytes(mutate(one.dice, data) if is_bad else data)
    words = ("render", one.bench.work, *LENS, "--out", out)
    run = one.run(*words)
    if run.status == 0:
        one.expect(one.bench.frames, out, run)
    elif "overwrite" not in run.said:
        one.verdict.add("lost", run.said[-300:])
    one.expect(one.bench.frames, out, one.run(*words, "--overwrite"))


def masks(one: Try) -> None:
    """A picture of the masks, between two runs: the second is as if the first had never been."""
    _pictures(one, one.bench.masks, "--mask")


def depth(one: Try) -> None:
    """A depth map, between two runs."""
    _pictures(one, one.bench.depth, "--depth")


def kept_depth(one: Try) -> None:
    """Depth that an earlier run kept: what is damaged is found anew, and the pictures stay the same."""
    work = one.bench.project(one.folder / "project")
    first, again = one.folder / "first", one.folder / "again"
    words = ("render", work, *DENSE, "--frames", FEW, "--out")
    if (run := one.run(*words, first / "####.png")).status:
        one.verdict.add("lost", run.said[-300:])
        return
    kept = sorted((work / "depth").rglob("*.npz"))
    for path in one.dice.sample(kept, one.dice.randint(1, len(kept))):
        path.write_bytes(mutate(one.dice, path.read_bytes()))
    one.expect(contents(first), again / "####.png", one.run(*words, again / "####.png"))


def not_finite(one: Try) -> None:
    """NaN and infinities in the pixels of a float clip: only what is beside them may differ."""
    spoilt = one.folder / "clip"
    shutil.copytree(one.bench.floats, spoilt)
    bad = one.dice.choice([1, 3, 20])
    frame = one.dice.randint(2, 5)
    path = spoilt / f"{frame:04d}.tif"
    picture = _read(path)
    for _ in range(bad):
        y, x = one.dice.randrange(picture.shape[0]), one.dice.randrange(picture.shape[1])
        picture[y, x, one.dice.randrange(3)] = one.dice.choice([np.nan, np.inf, -np.inf, -1e30])
    cv2.imwrite(str(path), picture)
    work = clip.solve(spoilt, one.folder / "work")
    out = one.folder / "out" / "####.png"
    run = one.run("render", work, *LENS, "--frames", frame, "--out", out)
    if run.status:
        return
    found = _read(out.parent / f"{frame:04d}.png") / 257.0
    whole = _read(one.bench.floats_rendered / f"{frame:04d}.png") / 257.0
    share = float((np.abs(found - whole).max(axis=2) > NOISE).mean())
    if share > 0.01 + 0.012 * bad:
        one.verdict.add("wrong", f"{bad} pixels spoilt {100 * share:.0f} % of the frame")


def _judged(one: Try, work: Path, file: Path) -> None:
    """Damage a file after some frames are there; rendered again, they are right or the file is refused."""
    out = one.folder / "out" / "####.png"
    words = ("render", work, *LENS, "--frames", FEW, "--out", out)
    expected = {name: data for name, data in one.bench.frames.items() if 3 <= int(name[:4]) <= 6}
    before = file.read_bytes()
    file.write_bytes(mutate(one.dice, before))
    if file.read_bytes() == before:
        return
    run = one.run(*words)
    _right_or_refused(one, run, out, expected, file)
    # Put back, it is as if nothing had been.
    file.write_bytes(before)
    one.expect(expected, out, one.run(*words, *(("--overwrite",) if contents(out.parent) else ())))


def _right_or_refused(one: Try, run: Run, out: Path, expected: dict[str, bytes], file: Path) -> None:
    if run.status == 0 and contents(out.parent) != expected:
        one.verdict.add("wrong", f"{file.name} is damaged, and other pictures are called written")


def _pictures(one: Try, source: Path, option: str) -> None:
    """The user's pictures may change: then no old frame is kept as the new run's."""
    folder, out = one.folder / "pictures", one.folder / "out" / "####.png"
    shutil.copytree(source, folder)
    words = ("render", one.bench.work, *DENSE, option, folder, "--frames", FEW)
    one.run(*words, "--out", out)
    file = folder / f"{one.dice.randint(1, FRAMES):04d}.png"
    changed: Callable[[bytes], bytes] = (
        (lambda data: mutate(one.dice, data)) if one.dice.random() < 0.5 else _repainted
    )
    file.write_bytes(changed(file.read_bytes()))
    again = one.run(*words, "--out", out, "--overwrite")
    fresh = one.folder / "fresh" / "####.png"
    alone = one.run(*words, "--out", fresh)
    if again.status != alone.status:
        one.verdict.add("wrong", f"status {again.status} over old frames, {alone.status} without")
    elif again.status == 0 and contents(out.parent) != contents(fresh.parent):
        one.verdict.add("wrong", f"{file.name} changed and old pictures are kept")


def _read(path: Path) -> NDArray[Any]:
    return np.asarray(cv2.imread(str(path), cv2.IMREAD_UNCHANGED))


def _repainted(data: bytes) -> bytes:
    picture = np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED))
    picture[10:30, 20:60] = picture.max() - picture[10:30, 20:60]
    return bytes(cv2.imencode(".png", picture)[1])
