"""Speed against error: every method on every scene against a real lens's picture, `make bench`.

Two processes work side by side, each on a scene of its own, with one thread. Rows whose inputs have not
changed are kept, and so are clips, solves and truths, so that a run goes on where it was stopped.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

from addon.core.base.limits import ONE_THREAD
from addon.core.frame.quality import NORMAL, Quality
from sample_scenes import filming

from .. import store
from ..cost import Cost, cpu_seconds
from . import methods, report, rows
from .cases import FromVideo, GroundTruth
from .judge import Judge, given_by
from .methods import METHODS
from .plan import ALL_BLURS, TRACKS, Part, Stale, Wanted, possible, stale, tracks_of
from .plan import report as status
from .scenes import SIZE, Short

SIDE_BY_SIDE = 2
ALONE = {**ONE_THREAD, "OPENBLAS_NUM_THREADS": "1"}
"""The environment of a job; OpenBLAS's threads would wait for each other."""


def main() -> None:
    options = _options()
    part = Part(options.scenes, options.track, options.blurs, options.methods)
    scenes = [name for name in filming.STAGES if name in (part.scenes or filming.STAGES)]
    if options.job:
        run_scene(scenes[0], part)
        return
    if not options.report:
        book = rows.load()
        todo = sorted((stale(name, part, book) for name in scenes), key=lambda each: -each.seconds)
        code = rows.code()
        print(status(todo, SIDE_BY_SIDE), flush=True)
        if options.status:
            return
        failed = run(todo, part)
        if failed:
            sys.exit(f"these scenes ended with an error, the others are measured: {', '.join(failed)}")
        if part == Part():
            with rows.changed() as book:
                # Only now: until then the documents quote what an earlier plan has measured.
                book.rows = {key: row for key, row in book.rows.items() if possible(key)}
                book.code, book.width = code, SIZE[0]
    print(report.write(rows.RESULTS, rows.load()))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="*", default=(), choices=filming.STAGES, help="only these")
    parser.add_argument("--track", nargs="*", default=(), choices=TRACKS, help="only these tracks")
    parser.add_argument("--methods", nargs="*", default=(), choices=METHODS, help="only these")
    parser.add_argument(
        "--blurs", nargs="*", default=(), type=int, choices=ALL_BLURS,
        help=f"only these largest discs, in pixels of a picture {SIZE[0]} wide",
    )  # fmt: skip
    parser.add_argument("--status", action="store_true", help="print what is stale, run nothing")
    parser.add_argument("--report", action="store_true", help="write tables and plot again, run nothing")
    parser.add_argument("--job", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    for name in ("scenes", "track", "methods", "blurs"):
        setattr(options, name, tuple(getattr(options, name)))
    return options


def run(todo: list[Stale], part: Part) -> list[str]:
    """Measure every scene that has stale rows, in their order; returns those that failed."""
    options = {"--track": part.tracks, "--methods": part.methods, "--blurs": map(str, part.blurs)}
    words = [word for name, values in options.items() for word in (name, *values)]
    if any(each.reasons for each in todo):
        with rows.changed() as book:
            book.code = ""
    begin = time.perf_counter()

    def job(each: Stale) -> bool:
        command = [sys.executable, "-m", "benchmarks.accuracy", "--job", *words, "--scenes", each.scene]
        done = subprocess.run(command, cwd=store.ROOT, env={**os.environ, **ALONE}, check=False)
        print(f"[{time.perf_counter() - begin:6.0f} s] {each.scene} ended with {done.returncode}", flush=True)
        return done.returncode == 0

    jobs = [each for each in todo if each.reasons]
    pool = ThreadPoolExecutor(SIDE_BY_SIDE)
    try:
        fine = list(pool.map(job, jobs))
    finally:
        # Ctrl-C ends the two jobs that run; no other begins.
        pool.shutdown(cancel_futures=True)
    return [each.scene for each, good in zip(jobs, fine, strict=True) if not good]


def run_scene(name: str, part: Part) -> None:
    """Measure the stale rows of a scene in this process."""
    scene, began, spent = Short(name), cpu_seconds(), 0.0
    was_filmed = scene.is_filmed
    todo = stale(name, part, rows.load()).reasons
    for blur in dict.fromkeys(each.blur for each in todo):
        judge = Judge(scene, blur)
        for track in tracks_of(name):
            spent += run_track(
                judge, track, [each for each in todo if (each.blur, each.track) == (blur, track)]
            )
    if not was_filmed:
        with rows.changed() as book:
            book.making_s[name] = round(cpu_seconds() - began - spent, 1)


def run_track(judge: Judge, track: str, todo: list[Wanted]) -> float:
    """Measure rows of one track at one blur; returns their processor seconds, without what is kept."""
    if not todo:
        return 0.0
    given = given_by(track, judge.scene)
    # Before the clock: what is made once and kept.
    truths, when, spent = judge.truths, store.commit(), 0.0
    assert truths
    with tempfile.TemporaryDirectory() as folder:
        found = dict[str, tuple[GroundTruth | FromVideo, Cost]]()
        for each in todo:
            if isinstance(given, str):
                began, row = cpu_seconds(), judge.refused(track, each.method, each.views, given)
            else:
                depth = METHODS[each.method].depth
                quality = depth or NORMAL
                if quality.name not in found:
                    found[quality.name] = _with_depth(judge, given, quality, Path(folder))
                own, cost = found[quality.name]
                began = cpu_seconds()
                row = judge.row(track, own, each.method, each.views)
                if row.cpu_s is not None and row.wall_s is not None and depth is not None:
                    row = replace(row, cpu_s=row.cpu_s + cost.cpu_s, wall_s=row.wall_s + cost.wall_s)
            spent += cpu_seconds() - began
            row = replace(row, spent_s=cpu_seconds() - began, measured=when)
            with rows.changed() as book:
                book.rows[row.key] = row
            print(report.line(row), flush=True)
    return spent


def _with_depth(
    judge: Judge, given: GroundTruth | FromVideo, quality: Quality, folder: Path
) -> tuple[GroundTruth | FromVideo, Cost]:
    """The track with the depth of the judged frames kept in a quality, and what that costs a frame."""
    cost = Cost(0.0, 0.0, 0.0)
    if isinstance(given, FromVideo):
        given, cost = given.with_depth(quality, folder, judge.frames[-1])
    # The first drawing compiles shaders, and finds what the frames around share: no frame's cost.
    methods.by_mesher("layers", given.case(judge.frames[0], judge.blur), 1)
    return given, cost


if __name__ == "__main__":
    main()
