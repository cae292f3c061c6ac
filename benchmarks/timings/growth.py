"""How the cost of a frame grows: parts of `python -m benchmarks.timings.speed`.

Whole commands on the bars scene with its true cameras, each in a process of its own; a frame costs what more
frames cost more (`whole_runs`). One thing grows at a time: pixels, blur, frames, feature points, processors.
Largest disc 0.05 of the width, 640x360 and normal quality where nothing else is said.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from addon.core.camera.reconstruction import Reconstruction

from .whole_runs import JUDGED, Clip, Run, a_frame, filmed

SIZE = (640, 360)
PIXELS = ((320, 180), (640, 360), (1280, 720), (1920, 1080))
BLURS = (8, 16, 32, 64, 128)
FRAMES = (2, 8, 32)
POINTS = (50, 200, 800)
"""In each of the judged frames, at most."""
COUNT = 3
"""Judged frames, of which alone features are known: too few to tell one's cost from that of starting."""
CORES = (1, 2)
JOBS = (1, 2, 4, 8)
"""Processes on all processors: what it costs that they overlap."""
LONG = 24
"""Frames that are worth several processes."""
SCENE = "bars"
FEW, MANY = 1, 4
"""Frames of the two runs that a frame's cost is found by."""


def table(name: str) -> str:
    """Markdown of what grows by name."""
    return "\n".join([*PARTS[name](), ""])


def pixels() -> Iterator[str]:
    yield (
        "| size | depth to find: a frame, CPU s | us a pixel | depth kept: a frame, CPU s | us a pixel |"
        " peak, MB |"
    )
    yield "|---|---|---|---|---|---|"
    for size in PIXELS:
        with filmed(SCENE, size) as clip:
            found, kept = _both(clip, clip.lens())
        costs = [a_frame(pair, MANY - FEW)[1] for pair in (found, kept)]
        each = " | ".join(f"{cost:.2f} | {1e6 * cost / (size[0] * size[1]):.1f}" for cost in costs)
        yield f"| {size[0]}x{size[1]} | {each} | {max(run.peak_mb for run in (*found, *kept)):.0f} |"


def blur() -> Iterator[str]:
    yield "| largest disc, px | depth kept: a frame, CPU s | peak, MB |"
    yield "|---|---|---|"
    with filmed(SCENE, SIZE) as clip:
        clip.run(clip.lens(), MANY)
        for disc in BLURS:
            runs = [clip.run(clip.lens(disc / SIZE[0]), count) for count in (FEW, MANY)]
            yield f"| {disc} | {a_frame(runs, MANY - FEW)[1]:.2f} | {runs[-1].peak_mb:.0f} |"


def frames() -> Iterator[str]:
    yield "| frames | depth to find: CPU s | more a frame | peak, MB |"
    yield "|---|---|---|---|"
    before: tuple[int, Run] | None = None
    with filmed(SCENE, SIZE) as clip:
        for count in FRAMES:
            clip.forget()
            run = clip.run((*clip.lens(), "--jobs", 1), count, 1)
            more = "-" if before is None else f"{a_frame((before[1], run), count - before[0])[1]:.2f}"
            yield f"| {count} | {run.cpu_s:.1f} | {more} | {run.peak_mb:.0f} |"
            before = count, run


def points() -> Iterator[str]:
    yield f"| points a frame, at most | {COUNT} frames, depth to find: CPU s | method features: CPU s |"
    yield "|---|---|---|"
    for most in POINTS:
        with filmed(SCENE, SIZE) as clip:
            clip.__dict__["reconstruction"] = thinned(clip.reconstruction, most)
            words = (*clip.lens(), "--method", "features")
            runs = [clip.run(each, COUNT, JUDGED) for each in (clip.lens(), words)]
        yield f"| {most} | {runs[0].cpu_s:.1f} | {runs[1].cpu_s:.1f} |"


def thinned(reconstruction: Reconstruction, most: int) -> Reconstruction:
    """A reconstruction whose frames show at most so many points, evenly left out."""
    images = []
    for image in reconstruction.images:
        kept = np.linspace(0, len(image.xy) - 1, min(most, len(image.xy))).astype(int)
        images.append(replace(image, xy=image.xy[kept], points=image.points[kept]))
    return replace(reconstruction, images=tuple(images))


def cores() -> Iterator[str]:
    """Wall times, which are right on an idle machine alone."""
    yield "| 24 frames on | depth to find, s | CPU s | times as fast | kept, s | CPU s | times as fast |"
    yield "|---|---|---|---|---|---|---|"
    with filmed(SCENE, SIZE) as clip:
        words = [(f"{count} processors", count, tuple[object, ...]()) for count in CORES]
        words += [(f"all processors, `--jobs {jobs}`", 0, ("--jobs", jobs)) for jobs in JOBS]
        first: list[Run] = []
        for name, count, jobs in words:
            clip.forget()
            runs = [clip.run((*clip.lens(), *jobs), LONG, cores=count) for _ in ("found", "kept")]
            first = first or runs
            cells = [
                f"{run.wall_s:.1f} | {run.cpu_s:.1f} | {one.wall_s / run.wall_s:.2f}"
                for run, one in zip(runs, first, strict=True)
            ]
            yield f"| {name} | {' | '.join(cells)} |"


def _both(clip: Clip, lens: tuple[object, ...]) -> tuple[tuple[Run, Run], tuple[Run, Run]]:
    """Runs of a few and of more frames, with the depth to find and with it kept."""
    found = []
    for count in (FEW, MANY):
        clip.forget()
        found.append(clip.run(lens, count))
    kept = [clip.run(lens, count) for count in (FEW, MANY)]
    return (found[0], found[1]), (kept[0], kept[1])


PARTS: dict[str, Callable[[], Iterator[str]]] = {
    "pixels": pixels, "blur": blur, "frames": frames, "points": points, "cores": cores,
}  # fmt: skip
