"""Options that mean nothing, and places that cannot be written: refused in one line, and nothing is left."""

from __future__ import annotations

import json
import os
import random
from pathlib import Path

import numpy as np

from . import clip
from .bench import FRAMES, LENS, Try, contents

NUMBERS = (
    "nan", "-nan", "inf", "-inf", "1e400", "1e39", "-1", "", " ", "1_0", "\u0661", "\u00b2", "9" * 20,
    "9" * 5000, "1e-300", "0x10", "1,5", "--", "x\ny",
)  # fmt: skip
"""Some mean something to some options: then what is rendered must be frames."""
OPTIONS = (
    "--frames", "--views", "--seed", "--focus-distance", "--focus-point", "--focus-at", "--tilt", "--swing",
    "--blur", "--aperture-radius", "--highlights", "--highlight-threshold", "--jobs",
)  # fmt: skip
SHAPE = (
    "blades", "rotation", "roundness", "ratio", "obstruction", "apodisation", "spherical_aberration",
    "vignetting", "axial_colour", "swirl", "field_curvature", "coma", "anamorphic_focus", "lateral_colour",
    "matte_box_sides", "matte_box_top", "breathing", "image",
)  # fmt: skip


def numbers(one: Try) -> None:
    """An option with a word that is no number of its."""
    value = one.dice.choice(NUMBERS)
    name = one.dice.choice([*OPTIONS, *SHAPE])
    words = ["--aperture", f"{name}={value}"] if name in SHAPE else [f"{name}={value}"]
    focus = LENS[2:] if name.startswith("--focus") else LENS
    _run(one, *focus, *(() if name == "--frames" else ("--frames", "3-4")), *words)


def models(one: Try) -> None:
    """What is no solve of the clip is given to `import`: refused in one line, which names what to do."""
    path = one.folder / one.dice.choice(["depth.npz", "depth", "half.json", "network.onnx"])
    cameras = clip.truth(range(1, FRAMES + 1, 2), clip.LENS)
    if path.suffix == ".npz":
        np.savez(path, depths=np.ones((FRAMES, 4, 6), np.float32))
    elif path.suffix == ".json":
        rows = [{"file_path": "", "transform_matrix": np.eye(4).tolist()} for _ in range(len(cameras.images))]
        lens = {"w": clip.LENS.width, "h": clip.LENS.height, "fl_x": clip.LENS.fx, "fl_y": clip.LENS.fy}
        path.write_text(json.dumps(lens | {"frames": rows}))
    elif path.suffix:
        path.write_bytes(b"network")
    else:
        clip.write_depth(path, 3)
    run = one.run("import", path, "--footage", one.bench.clip, "--work", one.folder / "work")
    lines = [line for line in run.said.splitlines() if line.startswith("error: ")]
    wanted = "--frames A-B:STEP" if path.suffix == ".json" else "--depth PATH"
    if run.status == 0 or len(lines) != 1 or wanted not in lines[0]:
        one.verdict.add("wrong", f"{path.name}: {run.said[-300:]}")
    if (one.folder / "work").exists():
        one.verdict.add("leftover", "work")


def places(one: Try) -> None:
    """Something that is no file where output is to go, or no folder where its folder is to be."""
    out = one.dice.choice(["out.mp4", "out/####.png", "out/####.exr"])
    place = one.dice.choice(["out.mp4", "out.mp4.frames"] if out == "out.mp4" else ["out", "out/0003.png"])
    path = one.folder / place
    path.parent.mkdir(exist_ok=True)
    _make(one.dice, path)
    words = (*LENS, "--frames", "3-4", "--out", one.folder / out, "--overwrite")
    before = _look(one.folder)
    run = one.run("render", one.bench.work, *words)
    if run.status and (made := _look(one.folder) ^ before):
        one.verdict.add("leftover", f"{place} was refused, and there is, or no longer, {made}")


def _run(one: Try, *words: object) -> None:
    out = one.folder / "out" / "####.png"
    run = one.run("render", one.bench.work, *words, "--out", out)
    lines = [line for line in run.said.splitlines() if line.startswith("error: ")]
    if run.status and len(lines) != 1:
        one.verdict.add("crash", f"{len(lines)} lines of error: {run.said[-300:]}")
    if bool(run.status) == bool(contents(out.parent)):
        one.verdict.add("wrong", f"status {run.status}: {words[-1]!r}: {run.said[-300:]}")


def _make(dice: random.Random, path: Path) -> None:
    kind = dice.choice(["folder", "loop", "nowhere", "pipe"])
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    else:
        path.symlink_to(path.name if kind == "loop" else "is/not/there")


def _look(folder: Path) -> set[str]:
    """Names of all that lies below a folder, without what is for temporary files and caches of libraries."""
    names = (p.relative_to(folder) for p in folder.rglob("*"))
    return {str(name) for name in names if name.parts[0] not in ("tmp", "cache")}
