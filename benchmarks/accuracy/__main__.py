"""Speed against error: every method on every scene against a real lens's picture.

`python -m benchmarks.accuracy` runs the quick subset, `--full` everything, for hours; rows whose inputs have
not changed are kept, so that a run resumes where it was stopped.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import time
from dataclasses import dataclass, replace
from pathlib import Path

from sample_scenes import filming

from . import methods, report
from .judge import Judge, Row, as_dict, given_by
from .methods import METHODS
from .scenes import Scene, Staged
from .shop import FOCUS, Shop

type Rows = dict[tuple[object, ...], Row]

RESULTS = Path(__file__).parents[1] / "results"
SCENES = (*filming.STAGES, *FOCUS)


@dataclass(frozen=True)
class Plan:
    """What to run."""

    kind: str
    parts: tuple[tuple[str, str], ...]
    """Scenes and tracks."""
    blurs: tuple[int, ...]
    noise: float
    """Of the truth: Cycles samples every pixel until its error is about this."""
    quick: bool
    methods: tuple[str, ...] = tuple(METHODS)


QUICK = Plan("quick", (("bars", "T1"), ("bars", "T2"), ("slope", "T1")), (16,), 0.02, True)
# People who walk are judged where they are asked for: `--scenes`, and `benchmarks.accuracy.subjects`.
STILL = tuple(scene for scene in SCENES if scene not in filming.SUBJECTS)
FULL = Plan("full", tuple((s, t) for s in STILL for t in ("T1", "T2")), (16, 32, 8, 64), 0.01, False)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--full", action="store_true", help="everything, resumed where it was stopped")
    parser.add_argument("--scenes", nargs="*", default=[], choices=SCENES, help="only these")
    parser.add_argument(
        "--track", choices=report.TRACKS, help="only true geometry, video, or that with mattes"
    )
    parser.add_argument("--methods", nargs="*", default=list(METHODS), choices=METHODS, help="only these")
    parser.add_argument("--blurs", nargs="*", default=[], type=int, help="only these largest discs, in px")
    parser.add_argument("--report", action="store_true", help="write tables and plots again, run nothing")
    arguments = parser.parse_args()
    plan = replace(FULL if arguments.full else QUICK, methods=tuple(arguments.methods))
    parts = plan.parts
    if arguments.scenes:
        parts = tuple((s, t) for s in arguments.scenes for t in tracks_of(s))
    parts = tuple(part for part in parts if arguments.track in (None, part[1]))
    rows = load(plan)
    if not arguments.report:
        # A run that is stopped has then judged every scene at the most telling blur.
        for blur in arguments.blurs or plan.blurs:
            for name in dict.fromkeys(scene for scene, _ in parts):
                run_scene(plan, name, tuple(t for s, t in parts if s == name), blur, rows)
    print(report.write(RESULTS, plan.kind, list(rows.values())))


def tracks_of(scene: str) -> tuple[str, ...]:
    """Those that a scene is judged on: with mattes where it has subjects."""
    return tuple(report.TRACKS) if scene in filming.SUBJECTS else ("T1", "T2")


def run_scene(plan: Plan, name: str, tracks: tuple[str, ...], wanted: int, rows: Rows) -> None:
    scene = open_scene(name, plan.noise)
    if isinstance(scene, str):
        print(f"{name}: skipped: {scene}", flush=True)
        return
    # A scene with apertures of its own is judged at the nearest of them.
    blur = min(scene.blurs, key=lambda own: abs(own - wanted))
    judge = Judge(scene, blur)
    for track in tracks:
        run_track(plan, judge, track, rows)


def run_track(plan: Plan, judge: Judge, track: str, rows: Rows) -> None:
    wanted = [
        (name, views)
        for name, method in METHODS.items()
        if name in plan.methods and track in method.tracks
        for views in (method.quick if plan.quick else method.views)
    ]
    stale = [
        (name, views) for name, views in wanted
        if (row := rows.get((judge.scene.name, track, name, views, judge.blur))) is None
        or row.inputs != judge.inputs(track, name)
    ]  # fmt: skip
    if not stale:
        return
    start = time.perf_counter()
    given = given_by(track, judge.scene)
    if not isinstance(given, str):
        # The first drawing compiles shaders, and finds what the frames around share: no frame's cost.
        methods.by_mesher("layers", given.case(judge.frames[0], judge.blur), 1)
    for name, views in stale:
        if isinstance(given, str):
            row = judge.refused(track, name, views, given)
        else:
            row = judge.row(track, given, name, views)
        rows[row.key] = row
        save(plan, rows)
        print(f"[{time.perf_counter() - start:6.0f} s] {report.line(row)}", flush=True)


def open_scene(name: str, noise: float) -> Scene | str:
    """The scene, or why it is not there."""
    if name in FOCUS:
        return Shop.open(name)
    return Staged(name, noise)


def load(plan: Plan) -> Rows:
    with contextlib.suppress(FileNotFoundError):
        stored = json.loads((RESULTS / f"{plan.kind}.json").read_text())
        rows = [Row(**each) for each in stored]
        return {row.key: row for row in rows}
    return {}


def save(plan: Plan, rows: Rows) -> None:
    RESULTS.mkdir(exist_ok=True)
    part = RESULTS / f"{plan.kind}.part"
    order = sorted(rows.values(), key=lambda row: (row.scene, row.track, row.blur_px, row.method, row.views))
    part.write_text(json.dumps([as_dict(row) for row in order], indent=1))
    part.rename(RESULTS / f"{plan.kind}.json")


if __name__ == "__main__":
    main()
