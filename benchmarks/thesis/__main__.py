"""The thesis's figures again, from our own scenes alone: python -m benchmarks.thesis

Chapter 4 of Sorensen, "Software Simulation of Depth of Field Effects in Video from Small Aperture Cameras"
(MIT, 2010), figure for figure, and the blocks of its chapter 5. Writes PNG files and a README.md with what
they show and the numbers. Films and solves the scenes first, below build/figures, where that was not done
before.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

from addon.render.views import gpu_views
from sample_scenes import blocks
from sample_scenes.stage import Floats, Stage

from .. import store
from . import edges, marks, plots, points, views
from .clips import Clip
from .marks import Figure

FOLDER = store.ROOT / "docs" / "figures"
INTRODUCTION = """# The thesis's figures, again

Made by `make figures` from the sample scenes `walk`, `boxes` and `blocks`, which stand in for the thesis's
three videos. Cameras and points are solved from the clips alone. The thesis's method is `--method thesis` on
our features; ours is what the add-on does otherwise.
"""


def makers() -> dict[str, Callable[[], Figure]]:
    """What makes each figure, by file name without its ending."""
    walk, boxes, three = Clip("walk"), Clip("boxes"), Clip("blocks")
    return {
        "feature_counts_walk": lambda: plots.counts(walk, "Figures 4-2, 4-5 and 4-6", 320),
        "feature_counts_boxes": lambda: plots.counts(boxes, "Figures 4-9 and 4-10"),
        "edge_lengths_boxes": lambda: edges.edge_lengths(boxes),
        "reprojections_walk": lambda: points.reprojections(walk, "Figure 4-16"),
        "reprojections_boxes": lambda: points.reprojections(boxes, "Figure 4-17"),
        "virtual_cameras_walk": lambda: points.virtual_cameras(walk, 0.08, "Figure 4-18"),
        "virtual_cameras_boxes": lambda: points.virtual_cameras(boxes, 0.02, "Figure 4-19"),
        "triangulation_walk": lambda: views.triangulations(walk, "Figure 4-20"),
        "triangulation_boxes": lambda: views.triangulations(boxes, "Figure 4-22"),
        "novel_views_walk": lambda: views.novel_views(walk, (0.3, 0.6), "Figure 4-21"),
        "novel_views_boxes": lambda: views.novel_views(boxes, (0.03, 0.08), "Figure 4-23"),
        "apertures_walk": lambda: views.apertures(
            walk, walk.stage.focus[walk.middle - 1], middle_of(walk.stage, "white poster"),
            ("gray chair", "white poster"), "Figure 4-24",
        ),
        "focus_blocks": lambda: views.racked(
            three, blocks.focus_points(), ("first block", "second block", "third block"), 0.04,
            "The three blocks of chapter 5 (figures 5-1 to 5-3)",
        ),
    }  # fmt: skip


def middle_of(stage: Stage, name: str) -> Floats:
    """(3,) the middle of a thing of the stage, in the world."""
    thing = next(thing for thing in stage.things if thing.name == name)
    low, high = thing.shape.vertices.min(axis=0), thing.shape.vertices.max(axis=0)
    middle: Floats = (low + high) / 2
    return middle


def readme(figures: list[Figure]) -> str:
    """Every figure with its one line, and its table where it has one."""
    parts = [INTRODUCTION]
    for figure in figures:
        parts.append(f"![{figure.name}]({figure.name})\n")
        parts.append(f"**{figure.answers}.** {figure.shows} {figure.numbers}\n")
        if figure.table:
            parts.append(figure.table)
    return "\n".join(parts)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, default=FOLDER, help="folder for pictures and README.md")
    parser.add_argument(
        "--only", nargs="*", default=[], choices=makers(), help="only these, and no README.md"
    )
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    start = time.perf_counter()
    gpu_views.check_gpu()
    figures = []
    for name, make in makers().items():
        if arguments.only and name not in arguments.only:
            continue
        figure = make()
        marks.save(arguments.out / figure.name, figure.picture)
        figures.append(figure)
        print(f"[{time.perf_counter() - start:4.0f} s] {figure.name}: {figure.numbers}", flush=True)
        if figure.table:
            print(figure.table, flush=True)
    if not arguments.only:
        (arguments.out / "README.md").write_text(readme(figures), encoding="utf-8")
    print(f"see {arguments.out}")


if __name__ == "__main__":
    main()
