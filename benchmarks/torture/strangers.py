"""What a stranger's project may hold: pipes and devices in place of files, numbers that no file bears out,
and a large clip that is another one in its middle."""

from __future__ import annotations

import json
import os
import zipfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from addon.core.sfm.state import DIGEST, STATE, write_state

from . import clip
from .bench import DENSE, FRAMES, LENS, Try, contents
from .mutations import FEW

LARGE = 80 << 20
"""Bytes of a clip that is too large to be read whole at a glance."""
HUGE = (10**6, 10**9, 2**31, 10**18)
BOMB = 1 << 28
"""Bytes that a file of a fourth of a megabyte unpacks to."""


def not_files(one: Try) -> None:
    """A pipe or a device where a file is expected: told, or done without, and never waited for."""
    work = one.bench.project(one.folder / "project")
    out, report = one.folder / "out" / "####.png", one.folder / "report.json"
    masks, frame = one.folder / "masks" / "0004.png", one.folder / "out" / "0004.png"
    kept = work / "depth" / "0123456789abcdef" / "depth-000004.npz"
    theirs = one.folder / "project" / "their.mp4"
    places = [
        work / STATE, work / "model" / "images.txt", work / "model" / "visible.npz", work / ".solving.lock",
        kept, one.folder / "project" / "clip" / "clip.mp4", masks, report, frame, theirs,
    ]  # fmt: skip
    place = one.dice.choice(places)
    for each in masks, frame, kept:
        each.parent.mkdir(parents=True)
    if place == masks:
        masks.parent.rmdir()
        clip.write_masks(masks.parent, FRAMES)
    if place == theirs:
        _say(work, footage=str(theirs), relative="")
    place.unlink(missing_ok=True)
    if one.dice.random() < 0.5:
        os.mkfifo(place)
    else:
        place.symlink_to(one.dice.choice(["/dev/zero", "/dev/random", "/dev/full"]))
    options = ("--mask", masks.parent) if place == masks else ()
    lens = DENSE if place in (masks, kept) else LENS
    run = one.run("render", work, *lens, *options, "--frames", FEW, "--out", out, "--report", report)
    is_needless = place in (work / ".solving.lock", work / "model" / "visible.npz", kept)
    if run.status == 0 and not is_needless:
        one.verdict.add("wrong", f"status 0 with no file at {place.name}")
    if place.is_file():
        one.verdict.add("lost", f"{place.name} was replaced")


def lies(one: Try) -> None:
    """Counts and sizes that are larger than any file: refused, or the clip's own are taken."""
    work = one.bench.project(one.folder / "project")
    out = one.folder / "out" / "####.png"
    state = json.loads((work / STATE).read_text())
    huge = one.dice.choice(HUGE)
    if one.dice.random() < 0.3:
        _bomb(work / "model" / "visible.npz")
        _say(work, model={})
    elif one.dice.random() < 0.3:
        _say(work, frames=[*state["frames"], huge])
    else:
        changed = one.dice.choice(
            [
                {"times": list(range(HUGE[0]))},
                {"missing": huge},
                {"width": huge},
                {"height": huge},
                {"fps": huge},
            ]
        )
        _say(work, video=state["video"] | changed)
    run = one.run("render", work, *LENS, "--frames", FEW, "--out", out)
    expected = {name: data for name, data in one.bench.frames.items() if 3 <= int(name[:4]) <= 6}
    if run.status == 0 and contents(out.parent) != expected:
        one.verdict.add("wrong", f"other pictures are called written: {run.said[-300:]}")


def middle(one: Try) -> None:
    """A large clip of which a byte is changed, its time put back: refused until it is as it was."""
    video = one.bench.project(one.folder / "project").parent / "clip" / "clip.mp4"
    with video.open("r+b") as file:
        # An MP4 may have a box of nothing (ISO/IEC 14496-12).
        size = LARGE - file.seek(0, os.SEEK_END)
        file.write(size.to_bytes(4) + b"free")
        file.truncate(LARGE)
    work = clip.solve(video, one.folder / "work")
    out = one.folder / "out" / "####.png"
    words = ("render", work, *LENS, "--frames", FEW, "--out", out)
    state, at = video.stat(), one.dice.randrange(LARGE)
    for is_spoilt in (True, False):
        with video.open("r+b") as file:
            file.seek(at)
            byte = file.read(1)[0] ^ 0xFF
            file.seek(at)
            file.write(bytes([byte]))
        if one.dice.random() < 0.5:
            os.utime(video, ns=(state.st_atime_ns, state.st_mtime_ns))
        run = one.run(*words)
        if (run.status == 0) == is_spoilt:
            one.verdict.add("wrong" if is_spoilt else "lost", f"byte {at} of the clip: {run.said[-300:]}")
    for path in sorted(out.parent.iterdir()):
        # Frames carry the key of their clip: their pixels alone are those of the reference.
        wanted = np.frombuffer(one.bench.frames[path.name], np.uint8)
        if not np.array_equal(np.asarray(cv2.imread(str(path))), np.asarray(cv2.imdecode(wanted, 1))):
            one.verdict.add("wrong", f"{path.name} differs from the reference")


def _say(work: Path, **changed: Any) -> None:
    """Have a state tell something else, with a digest as if the solve had written it."""
    state = json.loads((work / STATE).read_text())
    del state[DIGEST]
    write_state(work / STATE, state | changed)


def _bomb(path: Path) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in ("frame", "point"):
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                header = {"descr": "<i8", "fortran_order": False, "shape": (BOMB // 8,)}
                np.lib.format.write_array_header_1_0(file, header)
                for _ in range(BOMB >> 20):
                    file.write(bytes(1 << 20))
