"""What a clip costs from command to written file: `make bench-speed`.

The bars scene with its true cameras, as it is and enlarged, is rendered by the command line in a process of
its own, as a user would: with the depth to find, and then through another lens with the depth kept. What a
frame costs is what more frames cost more: starting up and what the first frame finds for others are in the
column of one frame. Largest disc 32 pixels at 640x360, 96 at 1920x1080.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from addon.core.readers.matching import Imported
from addon.core.sfm.workspace import keep_import

from .. import store
from ..accuracy.scenes import Staged
from .frame_costs import DISC, NOISE, SIZES, enlarged, featured

HEADLESS = store.ROOT / "addon" / "headless.py"
FIRST, COUNTS = 9, (4, 16)
"""The first frame rendered, and how many: a frame costs the difference by that of their numbers."""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", nargs="+", default=SIZES, choices=SIZES)
    parser.add_argument("--scene", default="bars")
    parser.add_argument("--counts", nargs=2, type=int, default=COUNTS, metavar="N", help="of frames")
    parser.add_argument(
        "--programs", nargs="+", type=Path, default=[HEADLESS], metavar="PATH",
        help="addon/headless.py, of other checkouts too: compared in the same run",
    )  # fmt: skip
    options = parser.parse_args()
    print(f"{options.scene}, largest disc {DISC:g} of the width, {os.cpu_count()} processors")
    print("| size | run | one frame, s | CPU s | frame, s | CPU s | of the first row | kept, MB a frame |")
    print("|---|---|---|---|---|---|---|---|")
    for size in options.sizes:
        width, height = map(int, size.split("x"))
        usual = 0.0
        for program in options.programs:
            with tempfile.TemporaryDirectory(prefix="virtual-aperture-bench-") as folder:
                scene = Staged(options.scene, NOISE)
                usual = _rows(scene, (width, height), Path(folder), program.absolute(), options.counts, usual)


def _rows(
    scene: Staged, size: tuple[int, int], folder: Path, program: Path, counts: tuple[int, int], usual: float
) -> float:
    """Print a program's rows of a size; what a frame of the first of all rows costs, `usual` if not 0."""
    footage, reconstruction = enlarged(scene, size), featured(scene, size)
    work, middle = folder / "work", scene.judged(0)[0]
    keep_import(Imported(reconstruction, "true cameras", ()), footage, work)
    depth, focus = scene.depth(middle), scene.focus_depth(middle, 0)
    radius = DISC * size[0] / (2 * reconstruction.cameras[0].fx * np.abs(1 / depth - 1 / focus).max())
    lens = ("--aperture-radius", radius, "--focus-distance")
    for name, words, is_kept in (
        ("depth to find", (*lens, focus), False),
        ("depth kept, another focus", (*lens, 0.9 * focus), True),
    ):
        runs = []
        for count in (1, *counts):
            if not is_kept:
                shutil.rmtree(work / "depth", ignore_errors=True)
            runs.append(_run(program, work, folder, words, count))
        one, few, many = runs
        wall, cpu = ((b - a) / (counts[1] - counts[0]) for a, b in zip(few, many, strict=True))
        usual = usual or cpu
        kept = [path.stat().st_size for path in work.rglob("depth-*.npz")]
        print(
            f"| {size[0]}x{size[1]} | {name} | {one[0]:.1f} | {one[1]:.1f} | {wall:.2f} | {cpu:.2f} |"
            f" {cpu / usual:.2f} | {sum(kept) / len(kept) / 1e6 if kept else 0:.2f} |",
            flush=True,
        )
    return usual


def _run(
    program: Path, work: Path, folder: Path, words: tuple[object, ...], count: int
) -> tuple[float, float]:
    """Wall and processor seconds of rendering so many frames into a new folder, start included."""
    out = folder / "out"
    shutil.rmtree(out, ignore_errors=True)
    frames = f"{FIRST}-{FIRST + count - 1}"
    command = [sys.executable, program, "render", work, *words, "--frames", frames, "--out", out / "####.png"]
    before, began = os.times(), time.perf_counter()
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    wall, after = time.perf_counter() - began, os.times()
    if done.returncode:
        raise SystemExit(done.stdout[-500:] + done.stderr[-500:])
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return wall, cpu


if __name__ == "__main__":
    main()
