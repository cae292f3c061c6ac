"""What a first frame costs by the length of its clip: `python -m benchmarks.special first_frames`.

Real clips are played forwards and backwards until they are as long as each length, so that all lengths
show the same subjects. Each is solved; then one frame is rendered twice by the command line, each time with
nothing kept: with a click, and with focus on the nearest person of each frame. Clips that are not there are
left out, and named. Writes `first_frames.md` and `first_frames.png` of results.
"""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from addon.core.media.clip import open_footage

from .. import store
from ..accuracy.rows import RESULTS
from ..coded import encode
from .real_costs import BLUR, RealClip, print_rows
from .whole_runs import HEADLESS, Run

CLIPS = {
    "clips/still_garden_shaky_1.mp4": (0.5, 0.5),
    "clips/person_walk_away_1.mp4": (0.47, 0.62),
    "clips/people_two_portrait_1.mp4@540": (0.22, 0.35),
}
"""Clips without a subject, with one and with two, and a place on the subject in frame `FRAME`."""
PEOPLE = "person", "people"
"""How the names of clips with people begin."""
LENGTHS = (30, 60, 180, 360, 600)
FRAME = 20
HEADS = "| clip | frames | solve, CPU s | first frame, a click: CPU s | first frame, nearest person: CPU s |"
Points = dict[str, list[tuple[int, float]]]
"""Lengths in frames and CPU seconds of a first frame, by clip and focus."""


def lengthened(clip: RealClip, frames: int) -> RealClip:
    """The clip, played forwards and backwards for so many frames."""
    footage = open_footage(clip.file)
    there = [*footage.frames, *footage.frames[-2:0:-1]]
    numbers = (there[number % len(there)] for number in range(frames))
    shown = (np.asarray(footage.read(number)[..., :3], np.uint8) for number in numbers)
    folder = clip.folder / str(frames)
    return replace(clip, file=encode(shown, folder / "clip.mp4", crf=16), folder=folder, frames=frames)


def first_frame(clip: RealClip, *words: object) -> Run:
    """Render frame `FRAME` with nothing kept but the solve."""
    clip.forget()
    out = clip.folder / "out"
    shutil.rmtree(out, ignore_errors=True)
    frame = ("--frames", f"{FRAME}-{FRAME}")
    return clip.run("render", None, clip.work, *words, "--blur", BLUR, *frame, "--out", out / "####.png")


def rows(
    clip: RealClip, focus: tuple[float, float], lengths: tuple[int, ...], points: Points
) -> Iterator[str]:
    """Rows of a clip by its length, whose points are added to others."""
    for frames in lengths:
        longer = lengthened(clip, frames)
        solved = longer.solve()
        clicked = first_frame(longer, "--focus-at", f"{focus[0]},{focus[1]}@{FRAME}")
        points.setdefault(f"{clip.name}, a click", []).append((frames, clicked.cpu_s))
        said = ""
        if clip.file.stem.startswith(PEOPLE):
            nearest = first_frame(longer, "--focus-subject", "nearest").cpu_s
            points.setdefault(f"{clip.name}, nearest person", []).append((frames, nearest))
            said = f"{nearest:.1f}"
        yield f"| {clip.name} | {frames} | {solved.cpu_s:.1f} | {clicked.cpu_s:.1f} | {said} |"


def draw(path: Path, points: Points) -> None:
    """Draw the cost over the length, a curve for each clip and focus."""
    figure, ax = plt.subplots(figsize=(7, 4.2), layout="constrained")
    clips = list(dict.fromkeys(name.split(",")[0] for name in points))
    for name, curve in points.items():
        colour, line = f"C{clips.index(name.split(',')[0])}", "--" if "nearest" in name else "-"
        ax.plot(*zip(*curve, strict=True), color=colour, linestyle=line, marker="o", label=name)
    ax.set(xlabel="frames of the clip", ylabel="CPU seconds of the first frame", ylim=(0, None))
    ax.set_title("A first frame by the length of its clip, nothing kept", fontsize=11)
    ax.grid(color="0.92")
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(fontsize=8, frameon=False)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--clips", nargs="+", default=list(CLIPS), choices=list(CLIPS))
    parser.add_argument("--lengths", nargs="+", type=int, default=LENGTHS)
    parser.add_argument("--program", type=Path, default=HEADLESS, help="addon/headless.py of a checkout")
    options = parser.parse_args()
    print(store.provenance())
    lengths = tuple(options.lengths)
    points: Points = {}
    lines = [store.provenance(), "", HEADS, "|" + "---|" * (HEADS.count("|") - 1)]

    def kept(name: str, clip: RealClip) -> Iterator[str]:
        for line in rows(clip, CLIPS[name], lengths, points):
            lines.append(line)
            yield line

    print_rows(HEADS, options.clips, options.program, kept)
    (RESULTS / "first_frames.md").write_text("\n".join(["# First frames", "", *lines, ""]))
    draw(RESULTS / "first_frames.png", points)


if __name__ == "__main__":
    main()
