"""Focus distance of a followed subject over time, of real clips that `make real` has solved (real data).

`python -m benchmarks.special focus_distances [--clips NAME ...]` prints a table and writes
`benchmarks/results/focus_distances.png`. The subject is the one that is clicked in the middle frame. Its own
change of size from frame to frame is the square root of its area, of frames in which no border cuts it.
"""

from __future__ import annotations

import argparse

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot

from addon.core.camera.reconstruction import Reconstruction
from addon.core.frame.clip_context import ClipContext
from addon.core.readers.colmap_export import read_model
from addon.core.subjects.strokes import MarkedSubject, Stroke

from . import clips
from .__main__ import RESULTS
from .clips import Mask, RealClip
from .commands import HEADLESS
from .stages import Program, Steps

SHOWN = (
    "person_walk_away_1", "dog", "paraglider", "person_dance_davis_1", "person_ball_portrait_1",
)  # fmt: skip
"""Clips whose subject changes its distance, flies, or turns."""


def main() -> None:
    """Print the table and draw the figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clips", nargs="+", default=SHOWN, metavar="NAME")
    chosen = [clip for clip in clips.CLIPS if clip.name in parser.parse_args().clips]
    program = Program(HEADLESS.absolute())
    columns = "clip", "frames", "nearest", "farthest", "largest step, %", "the same of its size, %"
    print(f"| {' | '.join(columns)} |\n{'|---' * len(columns)}|")
    figure, axes = pyplot.subplots(1, len(chosen), figsize=(3.2 * len(chosen), 3), squeeze=False)
    for clip, axis in zip(chosen, axes[0], strict=True):
        model = Steps(clip, program).solves / "work" / "model"
        if not model.is_dir():
            raise SystemExit(f"{model} is missing: run make real CLIPS={clip.name}")
        followed, sizes = _followed(clip, read_model(model))
        frames, distances = np.array(list(followed)), np.array(list(followed.values()))
        own = np.array([sizes.get(frame, np.nan) for frame in followed])
        print(
            f"| {clip.name} | {len(frames)} | {distances.min():.2f} | {distances.max():.2f}"
            f" | {_step(distances):.1f} | {_step(own):.1f} |", flush=True,
        )  # fmt: skip
        axis.plot(frames, distances)
        axis.set(title=clip.name, xlabel="frame", ylim=(0, 1.3 * distances.max()))
    axes[0, 0].set_ylabel("distance, scene units")
    figure.tight_layout()
    figure.savefig(RESULTS / "focus_distances.png", dpi=110)


def _followed(clip: RealClip, reconstruction: Reconstruction) -> tuple[dict[int, float], dict[int, float]]:
    """The clicked subject's distance by frame, and its size in pixels where no border cuts it."""
    mark = MarkedSubject("Subject", (Stroke(clip.middle, (clip.click,)),))
    context = ClipContext(reconstruction, clip.footage.read)
    subject = context.subject_at(clip.middle, *clip.click)
    if subject is None:
        context = ClipContext(reconstruction, clip.footage.read, marked=(mark,))
    name = mark.name if subject is None else subject.name
    followed = dict(context.subject_place(name, clip.middle).followed or {})
    masks = {frame: context.parts.named(name).mask(frame) for frame in followed}
    return followed, {
        frame: float(np.sqrt(np.count_nonzero(mask))) for frame, mask in masks.items() if not _is_cut(mask)
    }


def _is_cut(mask: Mask) -> bool:
    """Whether a border of the picture cuts a subject (h, w)."""
    return bool(mask[[0, -1]].any() or mask[:, [0, -1]].any())


def _step(values: np.ndarray) -> float:
    """The largest change from one value to the next, in per cent; 0 without two neighbours."""
    steps = np.abs(np.diff(np.log(values)))
    return float(100 * np.nanmax(steps)) if np.isfinite(steps).any() else 0.0


if __name__ == "__main__":
    main()
