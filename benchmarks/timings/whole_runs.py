"""What a clip costs from command to written file: `python -m benchmarks.special whole_runs`.

The bars scene with its true cameras, as it is and enlarged, is rendered by the command line in a process of
its own, as a user would: with the depth to find, and then through another lens with the depth kept, in every
quality and by the thesis's method. What a frame costs is what more frames cost more: starting up and what the
first frame finds for others are in the column of one frame. Largest disc 32 pixels at 640x360, 96 at
1920x1080. `make bench-speed` keeps it in `results/speed.md`.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from addon.core.camera.reconstruction import Reconstruction
from addon.core.frame.quality import QUALITIES
from addon.core.readers.matching import Imported
from addon.core.sfm.workspace import keep_import

from .. import store
from ..accuracy.scenes import Staged
from .frame_costs import DISC, NOISE, SIZES, enlarged, featured

HEADLESS = store.ROOT / "addon" / "headless.py"
FIRST, COUNTS = 9, (4, 16)
"""The first frame rendered, and how many: a frame costs the difference by that of their numbers."""


JUDGED, JUDGED_COUNTS = 18, (1, 3)
"""The same of the thesis's method: feature points are found in the judged frames alone."""
PICKED = 8
"""Feature points nearest to the focal plane that the thesis's method is given to focus on."""
HEADS = (
    "| size | run | one frame, s | CPU s | frame, s | CPU s | of the first row | kept, MB a frame |"
    " peak, MB |"
)


@dataclass(frozen=True)
class Run:
    """What a process of the command line took, start included."""

    wall_s: float
    cpu_s: float
    """Processor seconds, of all threads and of its own processes."""
    peak_mb: float
    """Memory at its peak."""


def timed_process(
    command: Iterable[object], log: Path, cores: int = 0, environment: Mapping[str, str] | None = None
) -> Run:
    """Run a command on so many processors if not 0. SystemExit with the end of its output if it fails."""
    allowed = sorted(os.sched_getaffinity(0))[: cores or None]
    began = time.perf_counter()
    with log.open("w+") as written:
        process = subprocess.Popen(
            [str(word) for word in command], stdout=written, stderr=written, env=environment,
            preexec_fn=partial(os.sched_setaffinity, 0, allowed),
        )  # fmt: skip
        _, status, used = os.wait4(process.pid, 0)
        wall = time.perf_counter() - began
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            written.seek(0)
            raise SystemExit(written.read()[-1000:])
    return Run(wall, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)


@dataclass(frozen=True)
class Clip:
    """A scene's clip, imported with its true cameras into a working folder of its own."""

    scene: Staged
    size: tuple[int, int]
    folder: Path
    program: Path = HEADLESS
    """`addon/headless.py`."""

    @cached_property
    def reconstruction(self) -> Reconstruction:
        return featured(self.scene, self.size)

    @property
    def work(self) -> Path:
        """The working folder, made where it is not there."""
        work = self.folder / "work"
        if not work.exists():
            keep_import(
                Imported(self.reconstruction, "true cameras", ()), enlarged(self.scene, self.size), work
            )
        return work

    def lens(self, disc: float = DISC, focus: float = 1.0) -> tuple[object, ...]:
        """Options of a lens whose largest disc is that share of the width, focused at so many times the
        scene's own distance, which does not change the aperture."""
        middle = self.scene.judged(0)[0]
        depth, own = self.scene.depth(middle), self.scene.focus_depth(middle, 0)
        contrast = np.abs(1 / depth - 1 / own).max()
        radius = disc * self.size[0] / (2 * self.reconstruction.cameras[0].fx * contrast)
        return "--aperture-radius", radius, "--focus-distance", focus * own

    def picked(self, focus: float = 1.0) -> tuple[object, ...]:
        """The same by feature points."""
        middle = self.scene.judged(0)[0]
        image, _ = self.reconstruction.image_at(middle)
        depth = image.to_camera(self.reconstruction.points.xyz[image.points])[:, 2]
        off = np.abs(1 / depth - 1 / (focus * self.scene.focus_depth(middle, 0)))
        return *self.lens()[:2], "--focus-point", *image.points[np.argsort(off)[:PICKED]]

    def forget(self) -> None:
        """Remove the kept depth."""
        shutil.rmtree(self.folder / "work" / "depth", ignore_errors=True)

    def run(self, words: Iterable[object], count: int, first: int = FIRST, cores: int = 0) -> Run:
        """Render so many frames into a new folder, on so many processors if not 0. SystemExit if it fails."""
        out = self.folder / "out"
        shutil.rmtree(out, ignore_errors=True)
        frames = ("--frames", f"{first}-{first + count - 1}", "--out", out / "####.png")
        command = [sys.executable, self.program, "render", self.work, *words, *frames]
        return timed_process(command, self.folder / "log.txt", cores)

    def kept_mb(self) -> float:
        """What a frame's kept depth takes; 0 of none."""
        kept = [path.stat().st_size for path in self.folder.rglob("depth-*.npz")]
        return sum(kept) / len(kept) / 1e6 if kept else 0.0


@contextmanager
def filmed(scene: str, size: tuple[int, int], program: Path = HEADLESS) -> Iterator[Clip]:
    """A clip in a folder that is removed after."""
    with tempfile.TemporaryDirectory(prefix="virtual-aperture-bench-") as folder:
        yield Clip(Staged(scene, NOISE), size, Path(folder), program.absolute())


def a_frame(runs: Sequence[Run], more: int) -> tuple[float, float]:
    """Wall and processor seconds of one of the frames that the second of two runs has more."""
    few, many = runs
    return (many.wall_s - few.wall_s) / more, (many.cpu_s - few.cpu_s) / more


def parsed(size: str) -> tuple[int, int]:
    """From "640x360"."""
    width, height = map(int, size.split("x"))
    return width, height


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", nargs="+", default=SIZES, choices=SIZES)
    parser.add_argument("--scene", default="bars")
    parser.add_argument("--counts", nargs=2, type=int, default=COUNTS, metavar="N", help="of frames")
    parser.add_argument("--qualities", nargs="*", default=[], choices=QUALITIES, help="more than normal's")
    parser.add_argument("--thesis", action="store_true", help="the thesis's method, too")
    parser.add_argument(
        "--programs", nargs="+", type=Path, default=[HEADLESS], metavar="PATH",
        help="addon/headless.py, of other checkouts too: compared in the same run",
    )  # fmt: skip
    options = parser.parse_args()
    print(f"{options.scene}, largest disc {DISC:g} of the width, {store.provenance()}")
    print(HEADS, "|" + "---|" * (HEADS.count("|") - 1), sep="\n")
    for size in options.sizes:
        baseline = 0.0
        for program in options.programs:
            with filmed(options.scene, parsed(size), program) as clip:
                requested = options.qualities, options.thesis
                for line, cpu in rows(clip, options.counts, *requested, baseline):
                    baseline = baseline or cpu
                    print(line, flush=True)


def rows(
    clip: Clip, counts: tuple[int, int], qualities: Sequence[str], thesis: bool, baseline: float = 0.0
) -> Iterator[tuple[str, float]]:
    """Rows of a size, and the CPU seconds of a frame in each; they are given as a share of `baseline`, or of
    the first row's if that is 0. Normal quality comes first, without its name: older programs have no
    other."""
    requested = [("normal", ())] + [(name, ("--quality", name)) for name in qualities if name != "normal"]
    for name, words in requested:
        # What normal keeps would serve a draft.
        clip.forget()
        for run, focus in (("depth to find", 1.0), ("depth kept, another focus", 0.9)):
            words_of_run = (*clip.lens(focus=focus), *words)
            runs = []
            for count in dict.fromkeys((1, *counts)):
                if focus == 1.0:
                    clip.forget()
                runs.append(clip.run(words_of_run, count))
            line, cpu = _row(clip, f"{name}, {run}", runs, counts, baseline)
            baseline = baseline or cpu
            yield line, cpu
    if thesis:
        for run, focus in (("first", 1.0), ("another focus", 0.9)):
            words_of_run = (*clip.picked(focus), "--method", "thesis")
            runs = [clip.run(words_of_run, count, JUDGED) for count in JUDGED_COUNTS]
            yield _row(clip, f"thesis, {run}", runs, JUDGED_COUNTS, baseline)


def _row(
    clip: Clip, name: str, runs: list[Run], counts: tuple[int, int], baseline: float
) -> tuple[str, float]:
    one, few, many = runs[0], runs[-2], runs[-1]
    wall, cpu = a_frame((few, many), counts[1] - counts[0])
    line = (
        f"| {clip.size[0]}x{clip.size[1]} | {name} | {one.wall_s:.1f} | {one.cpu_s:.1f} | {wall:.2f} |"
        f" {cpu:.2f} | {cpu / (baseline or cpu):.2f} | {clip.kept_mb():.2f} | {many.peak_mb:.0f} |"
    )
    return line, cpu


if __name__ == "__main__":
    main()
