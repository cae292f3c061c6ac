"""What our method costs, in one file: `make bench-speed`, `python -m benchmarks.timings.speed --parts ...`.

Each part is measured and put in its place in `results/speed.md`, with the commit and the number of
processors; those that are not asked for stay as they are.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path

from addon.core.frame.quality import QUALITIES

from .. import store
from . import equal_error, first_picture, growth, whole_runs
from .frame_costs import DISC, SIZES

FILE = Path(__file__).parents[1] / "results" / "speed.md"
COUNTS = {"640x360": (2, 8), "1920x1080": (1, 3)}
"""Frames of the two runs that a frame's cost is found by, at each size."""
TITLE = "# What it costs"


def whole(size: str) -> str:
    """Whole commands of every quality and of the thesis's method at a size."""
    with whole_runs.filmed("bars", whole_runs.parsed(size)) as clip:
        found = [line for line, _ in whole_runs.rows(clip, COUNTS[size], tuple(QUALITIES), True)]
    caption = f"`bars`, largest disc {DISC:g} of the width, frames of {COUNTS[size][0]} and {COUNTS[size][1]}"
    head = whole_runs.HEADS
    return "\n".join([caption, "", head, "|" + "---|" * (head.count("|") - 1), *found, ""])


def first(size: str) -> str:
    """How soon a first picture is seen at a size."""
    return first_picture.table(whole_runs.parsed(size))


PARTS: dict[str, Callable[[], str]] = {
    **{f"whole runs, {size}": partial(whole, size) for size in SIZES},
    **{f"first picture, {size}": partial(first, size) for size in SIZES},
    **{f"growth with {name}": partial(growth.table, name) for name in growth.PARTS},
    "equal error": partial(equal_error.table, ["bars", "walk"], 32, [4, 16, 64]),
}


def main() -> None:
    """Measure parts and put them into the file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--parts", nargs="+", default=list(PARTS), choices=PARTS, metavar="NAME")
    for name in parser.parse_args().parts:
        text = f"{store.provenance()}\n\n{PARTS[name]()}"
        print(f"## {name}\n{text}", flush=True)
        put(FILE, name, text)


def put(file: Path, name: str, text: str) -> None:
    """Replace a part of the file, or add it, in the order of `PARTS`."""
    held = file.read_text().split("\n## ")[1:] if file.exists() else []
    parts = {head: body for head, _, body in (one.partition("\n") for one in held)} | {name: f"\n{text}"}
    order = [one for one in PARTS if one in parts]
    sections = [f"## {one}\n{parts[one].rstrip()}\n" for one in order]
    file.write_text("\n".join([f"{TITLE}\n", *sections]))


if __name__ == "__main__":
    main()
