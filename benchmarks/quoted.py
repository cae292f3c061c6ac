"""Figures that documents quote, written from the files of results: `python -m benchmarks.quoted`.

A document has them between `<!-- quoted NAME -->` and `<!-- end -->`; a test fails where it has others.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from . import store
from .accuracy import rows

DOCUMENTS = ("README.md", "docs/measured.md")
BLOCK = re.compile(r"(<!-- quoted ([\w-]+) -->)(.*?)(<!-- end -->)", re.S)


def speed_against_error() -> str:
    """By how much ours is above the thesis's method and Defocus, from the video alone."""
    book = rows.load()
    ours, thesis, defocus = (book.scored("T2", name, book.blur) for name in ("layers", "thesis", "Defocus"))
    common = ours.keys() & thesis.keys() & defocus.keys()
    above = [
        _span([(ours[scene].psnr or 0) - (other[scene].psnr or 0) for scene in common])
        for other in (thesis, defocus)
    ]
    pairs = [(ours[scene].unclipped_psnr, defocus[scene].unclipped_psnr) for scene in common]
    unclipped = _span([own - other for own, other in pairs if own is not None and other is not None])
    disc = f"{100 * book.blur / book.width:.0f} % of the width"
    return f"""
From the video alone, with 256 views and discs of up to {disc}, ours is
{above[0]} dB above the thesis's method and {above[1]} dB above Defocus; where no clipped highlight reaches,
{unclipped} dB above Defocus ({len(common)} scenes, `make bench`, {book.measured()}).
"""


def scenes() -> str:
    """The summary of all scenes."""
    book = rows.load()
    return f"""
{rows.summary(book.rows.values())}
*PSNR in dB against the real lens, 256 views, pictures {book.width} pixels wide; `make bench`,
{book.measured()}.*
"""


def trackers() -> str:
    """How many solves each tracker has right, of those that all of them did, and ours of all."""
    stored = json.loads((rows.RESULTS / "motions.json").read_text())
    found, names = stored["rows"], {"harris": "Harris corners", "corners": "smallest eigenvalue",
                                    "sift-klt": "SIFT by flow", "sift": "SIFT"}  # fmt: skip
    done = Counter((row["motion"], row["focal"]) for row in found)
    right = Counter(
        row["tracker"]
        for row in found
        if row["verdict"] == "right" and done[row["motion"], row["focal"]] == len(names)
    )
    count = sum(number == len(names) for number in done.values())
    told = ", ".join(f"{name} {right[key]}" for key, name in names.items())
    ours = [row["verdict"] == "right" for row in found if row["tracker"] == "harris"]
    today = store.digest(store.sources(*store.SOLVER, "benchmarks/solving"))
    when = store.measured_at((row["measured"] for row in found), stored["code"], today)
    return f"of {count} solves right: {told}; of all {len(ours)} by Harris corners, {sum(ours)} ({when})"


QUOTED: dict[str, Callable[[], str]] = {
    "speed-against-error": speed_against_error, "scenes": scenes, "trackers": trackers,
}  # fmt: skip


def up_to_date(text: str) -> str:
    """A document with its figures as the files of results give them; KeyError for an unknown name."""
    return BLOCK.sub(lambda found: found[1] + QUOTED[found[2]]() + found[4], text)


def write(root: Path = store.ROOT) -> list[str]:
    """Bring the documents up to date; returns the names of those that changed."""
    changed = []
    for name in DOCUMENTS:
        text = (root / name).read_text()
        if (new := up_to_date(text)) != text:
            (root / name).write_text(new)
            changed.append(name)
    return changed


def _span(values: list[float]) -> str:
    return f"{min(values):.1f} to {max(values):.1f}"


if __name__ == "__main__":
    print("changed:", ", ".join(write()) or "nothing")
