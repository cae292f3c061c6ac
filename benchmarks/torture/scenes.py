"""Scene settings that must not change the clip's frames, and depth maps that are not one for each frame."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np

from addon.core.media.exr_file import write_exr

from . import changed_blend
from .bench import DENSE, FRAMES, Files, Try, contents
from .mutations import FEW


def settings(one: Try) -> None:
    """A setting of a saved scene: its frames are those of the reference, each in one file."""
    name = one.dice.choice(list(changed_blend.SETTINGS))
    shutil.copytree(one.bench.saved.parent, one.folder / "shot")
    blend, out = one.folder / "shot" / one.bench.saved.name, one.folder / "out" / "####.png"
    changed = one.end(one.start(blend, name, script=Path(changed_blend.__file__)))
    run = one.run("render", blend, "--frames", FEW, "--out", out)
    if changed.status or run.status:
        one.verdict.add("wrong", f"{name}: refused: {changed.said[-200:]} {run.said[-300:]}")
    expected = {frame: data for frame, data in one.bench.frames.items() if 3 <= int(frame[:4]) <= 6}
    if not _same(contents(out.parent), expected):
        one.verdict.add("wrong", f"{name}: other pictures are called written: {run.said[-300:]}")


def maps(one: Try) -> None:
    """Depth maps of another rate, shape or format: refused in one line, or the pictures of the same maps."""
    kind = one.dice.choice(["half", "more", "odd", "cropped", "layers"])
    given, out = one.folder / "maps", one.folder / "out" / "####.png"
    given.mkdir()
    # Their order is that of the frames, from 1.
    for frame, path in enumerate(sorted(one.bench.depth.iterdir()), 1):
        values = np.asarray(cv2.imread(str(path), cv2.IMREAD_UNCHANGED))
        numbers = {"more": (frame, frame + FRAMES), "half": ((frame + 1) // 2,)}.get(kind, (frame,))
        if kind in ("half", "odd") and frame % 2 == 0:
            continue
        values = values[:, : values.shape[1] // 2] if kind == "cropped" else values
        for number in numbers:
            _write(given / f"{number:04d}.png", values, has_layers=kind == "layers")
    words = ("render", one.bench.work, *DENSE, "--frames", FEW)
    run = one.run(*words, "--depth", given, "--out", out)
    lines = [line for line in run.said.splitlines() if line.startswith("error: ")]
    if kind in ("half", "more", "cropped"):
        if run.status == 0 or len(lines) != 1 or out.parent.exists():
            one.verdict.add("wrong", f"{kind}: not refused: {run.said[-300:]}")
    elif run.status:
        one.verdict.add("wrong", f"{kind}: refused: {run.said[-300:]}")
    elif kind == "layers":
        like = one.folder / "like" / "####.png"
        plain = one.run(*words, "--depth", one.bench.depth, "--out", like)
        if plain.status or not _same(contents(out.parent), contents(like.parent)):
            one.verdict.add("wrong", f"layers: other pictures than of the same maps: {plain.said[-300:]}")


def _write(path: Path, values: np.ndarray, has_layers: bool) -> None:
    if not has_layers:
        cv2.imwrite(str(path), values)
        return
    other = np.zeros(values.shape, np.float32)
    layers = {f"Layer.Combined.{name}": other for name in "RGBA"}
    write_exr(path.with_suffix(".exr"), {**layers, "Layer.Depth.Z": values.astype(np.float32)})


def _same(found: Files, expected: Files) -> bool:
    """Whether pictures have the same names and pixels: each holds a key of its own file or maps."""
    return list(found) == list(expected) and all(
        np.array_equal(_pixels(found[name]), _pixels(expected[name])) for name in found
    )


def _pixels(data: bytes) -> np.ndarray:
    return np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED))
