"""Error over CPU seconds, with and without depth: `python -m benchmarks.special envelope`.

The first judged frame of a few scenes at one blur. T1 has its depth given; in T2 it is found, and a method
that needs that of every pixel pays what it takes in the mean over consecutive frames after the first. What
all need, tracking and solving, is not counted. The error is that of the pixels which no clipped highlight
reaches: what a sensor clipped, no method here brings back. The cost of what is cheap is the least of a few
runs. Writes `results/envelope.md` and `envelope.png`.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from addon.core.base.store import Store
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.quality import NORMAL, QUALITIES, Quality

from .. import store
from ..cost import measured
from . import report
from .cases import FromVideo, GroundTruth
from .judge import Judge
from .methods import METHODS
from .rows import RESULTS, Row
from .scenes import Staged

NOISE = 0.02
OURS = ("layers", "draft", "normal", "final", "features")
COMPARED = (*OURS, "thesis", "scatter", "Defocus", "Cycles, our mesh")
WARMED = ("layers", "draft", "final")
"""The first ones of each quality."""
RUNS, CHEAP = 3, 2.0
"""Times that a point of at most so many CPU seconds is drawn: other work on the machine only adds."""
STEADY = 4
"""Consecutive frames after the first whose depth is timed, one of them a key frame."""


@dataclass(frozen=True)
class Curve:
    """What was found of a scene on a track."""

    title: str
    rows: tuple[Row, ...]
    """With what depth costs, where it is counted."""

    @property
    def envelope(self) -> str:
        """Where another method is above ours: by how much, and at which cost."""
        ours = sorted((r.cpu_s or 0.0, _error(r)) for r in self.rows if r.method in OURS)
        said = []
        for row in self.rows:
            if row.method in OURS or row.cpu_s is None:
                continue
            reached = max((error for cost, error in ours if cost <= row.cpu_s), default=None)
            name = f"{row.method} {row.views or ''}".strip()
            if reached is None:
                said.append(
                    f"{name}: {_error(row):.2f} dB for {row.cpu_s:.2f} s, less than any of ours takes"
                )
            elif reached < _error(row):
                said.append(f"{name}: {_error(row) - reached:.2f} dB above ours at {row.cpu_s:.2f} s")
        return "; ".join(said) or "ours is the upper one at every cost"


def _error(row: Row) -> float:
    value = row.psnr if row.unclipped_psnr is None else row.unclipped_psnr
    return float("nan") if value is None else value


def main() -> None:
    """Run, and write table and plot."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=["bars", "walk"])
    parser.add_argument("--blur", type=int, default=32, help="largest disc in px")
    parser.add_argument("--tracks", nargs="+", default=["T1", "T2"], choices=["T1", "T2"])
    options = parser.parse_args()
    curves = [curve(name, track, options.blur) for name in options.scenes for track in options.tracks]
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / "envelope.md").write_text(text(curves, options.blur))
    panels = {each.title: [replace(row, psnr=_error(row)) for row in each.rows] for each in curves}
    report.draw(
        RESULTS / "envelope.png", "Error without clipped highlights over cost (small numbers: views)", panels
    )
    print(text(curves, options.blur))


def curve(name: str, track: str, blur: int) -> Curve:
    """Every method on a scene's first judged frame."""
    scene = Staged(name, NOISE)
    judge = Judge(scene, blur, 1)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        given = GroundTruth(scene) if track == "T1" else FromVideo(scene)
        clips, depth = _found(given, Path(folder), judge.frames[0])
        for name in COMPARED:
            method = METHODS[name]
            if isinstance(given, FromVideo):
                given.clip = clips[(method.depth or NORMAL).name]
            if name in WARMED:
                # What is found of other frames once is no frame's cost, and shaders are compiled once.
                method.run(given.case(judge.frames[0], blur), 1)
            for views in method.views:
                row = judge.row(track, given, name, views)
                if (row.cpu_s or np.inf) <= CHEAP:
                    again = [judge.row(track, given, name, views) for _ in range(RUNS - 1)]
                    row = min([row, *again], key=lambda one: one.cpu_s or np.inf)
                if row.cpu_s is not None and method.depth is not None:
                    row = replace(row, cpu_s=row.cpu_s + depth.get(method.depth.name, 0.0))
                rows.append(row)
                print(report.line(row), flush=True)
    counted = "depth counted" if track == "T2" else "depth given"
    return Curve(f"{scene.name}, {track}, {counted}, disc {blur} px", tuple(rows))


def _found(
    given: GroundTruth | FromVideo, folder: Path, frame: int
) -> tuple[dict[str, ClipContext], dict[str, float]]:
    """The clip with a frame's depth found and kept, and the CPU seconds that it takes in the mean, by
    quality; nothing where depth is given."""
    if isinstance(given, GroundTruth):
        return {}, {}
    clips, costs = {}, {}
    for quality in QUALITIES.values():
        # A folder each: a draft is to find its own.
        keep = partial(_store, folder / quality.name)
        clip = ClipContext(given.reconstruction, given.clip.read, store=keep)
        stereo = clip.stereo_of(quality)
        stereo.at(frame - STEADY)
        frames = range(frame - STEADY + 1, frame + 1)
        _, cost = measured(partial(list, map(stereo.at, frames)))
        clips[quality.name], costs[quality.name] = clip, cost.cpu_s / STEADY
        print(f"{given.scene.name}: depth of {quality.name} quality, {costs[quality.name]:.2f} CPU s a frame")
    return clips, costs


def _store(folder: Path, quality: Quality) -> Store:
    return Store(folder, lambda: quality.name)


def text(curves: list[Curve], blur: int) -> str:
    """Markdown: a table a curve, and where ours is not the upper one."""
    lines = [
        f"# Error over cost, largest disc {blur} px", "",
        f"`python -m benchmarks.special envelope`, {store.provenance()}. PSNR in dB against a real lens, of"
        " one frame; unclipped: where no clipped highlight reaches. Draft, normal and final choose their"
        " number of views. Ours are " + ", ".join(OURS) + ".",
    ]  # fmt: skip
    for each in curves:
        lines += ["", f"## {each.title}", "| method | views | PSNR | edges | in focus | unclipped | CPU s |"]
        lines.append("|---|---|---|---|---|---|---|")
        for row in each.rows:
            scores = row.psnr, row.edge_psnr, row.in_focus_psnr, row.unclipped_psnr, row.cpu_s
            cells = ["-" if score is None else f"{score:.2f}" for score in scores]
            lines.append(f"| {row.method} | {row.views or ''} | {' | '.join(cells)} |")
        lines += ["", f"Upper envelope: {each.envelope}."]
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    main()
