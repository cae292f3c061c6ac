"""The gallery of real clips: `make real`, or `python -m benchmarks.gallery`.

Writes `benchmarks/results/real.md`, and contact sheets and full-size pictures into `build/real`. What is done
is kept by digests of code, clip and options, and a stopped run goes on where it was.
"""

from __future__ import annotations

import argparse
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from .. import store
from . import clips, sheet, table
from .commands import HEADLESS
from .scores import Row, taken
from .stages import BUILD, Program, Steps

RESULTS = store.ROOT / "benchmarks" / "results"
SIDE_BY_SIDE = 2
"""Clips at a time, each in one thread."""


def main() -> int:
    """Run clips, write the table of all and the pictures; the exit status."""
    options = _options()
    missing = _missing()
    program = Program(options.program.absolute(), options.segmenter and options.segmenter.absolute())
    every = [Steps(clip, program) for clip in clips.CLIPS if clip.name not in missing]
    wanted = [steps for steps in every if steps.clip.name in options.clips]
    rows: dict[str, Row] = {}
    with ThreadPoolExecutor(options.jobs) as pool:
        for row in pool.map(lambda steps: taken(steps, options.rows), wanted):
            rows[row.clip.name] = row
            first, following = table.frame_costs(row)
            print(f"{row.clip.name}: {row.failure or 'done'}; {table.cpu_seconds(row):.0f} CPU s in all,"
                  f" first frame {first}, next {following}, {row.detail}, {row.noise}, flicker {row.flicker},"
                  f" IoU {row.overlap}", flush=True)  # fmt: skip
    # The others as they are kept.
    known = [(steps, rows.get(steps.clip.name) or taken(steps, True, run=False)) for steps in every]
    absent = [Row(clip, None, None, None, None) for clip in clips.CLIPS if clip.name in missing]
    out = RESULTS / f"{options.name}.md"
    out.write_text(table.table([row for _, row in known] + absent, program))
    written = sheet.write(known, BUILD / options.name)
    print(f"wrote {out} and {len(written)} sheets into {BUILD / options.name}")
    for name, file in missing.items():
        print(f"error: {file} is missing: {name} was not run", file=sys.stderr)
    return 1 if missing else 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="make real", description=__doc__)
    parser.add_argument("--clips", nargs="+", default=clips.NAMES, choices=clips.NAMES, metavar="NAME")
    parser.add_argument(
        "--rows", action=argparse.BooleanOptionalAction, default=True, help="frames spread over four clips"
    )
    parser.add_argument(
        "--program", type=Path, default=HEADLESS, metavar="PATH", help="headless.py of another checkout"
    )
    parser.add_argument(
        "--segmenter", type=Path, metavar="FILE.onnx", help="of all pictures, as of the command line"
    )
    parser.add_argument("--name", default="real", help="of the table and of the folder of pictures")
    parser.add_argument("--jobs", type=int, default=SIDE_BY_SIDE, metavar="N", help="clips side by side")
    options = parser.parse_args()
    if not options.program.is_file():
        parser.error(f"{options.program} is not there; name the addon/headless.py of a checkout")
    return options


def _missing() -> dict[str, Path]:
    """Clips whose file is not there; SystemExit where there is no data at all."""
    if not clips.DATA.is_dir():
        raise SystemExit(
            f"error: no real clips: {clips.DATA} is missing; set VA_DATA to the folder that holds them"
        )
    return {clip.name: clip.file for clip in clips.CLIPS if not clip.file.exists()}


if __name__ == "__main__":
    sys.exit(main())
