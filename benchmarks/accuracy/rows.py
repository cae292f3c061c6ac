"""Rows of the benchmark and the file that keeps them, without Blender: documents are checked with it."""

from __future__ import annotations

import fcntl
import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from .. import store

RESULTS = Path(__file__).parents[1] / "results"
NAME = "bench"
"""Of the files of results."""
JUDGES = ("judge", "metrics", "mask_metrics", "cases", "methods", "scenes", "oracle", "defocus", "scatter")
CODE = (
    *("addon/core", "addon/render", "sample_scenes"),
    *(f"benchmarks/accuracy/{name}.py" for name in JUDGES),
)
"""All that a row may depend on."""

type Key = tuple[str, str, str, int, int]
"""Scene, track, method, views, largest disc."""


@dataclass(frozen=True)
class Row:
    """Scores are means over the judged frames; None where there is nothing to score."""

    scene: str
    track: str
    method: str
    views: int
    blur_px: int
    frames: int
    inputs: str
    """Hashes of the scene and of the code that the row depends on, with a dash between them."""
    noise_ceiling: float
    """PSNR of one seed of the truth against the other."""
    psnr: float | None = None
    edge_psnr: float | None = None
    in_focus_psnr: float | None = None
    unclipped_psnr: float | None = None
    """Of the pixels that no clipped highlight of the frame can reach."""
    ssim: float | None = None
    flip: float | None = None
    rm: float | None = None
    """Mean temporal difference against the truth's, frame to frame, of 0 to 1."""
    rm_floor: float | None = None
    """What the truth's own noise makes of that."""
    warped: float | None = None
    """The same along the true motion."""
    subject_psnr: float | None = None
    """Around the outlines of subjects that move: the pixels of `mask_metrics.outline_band`."""
    subject_rm: float | None = None
    triangles: int = 0
    cpu_s: float | None = None
    """Processor seconds a frame, all threads, with the depth of every pixel where a method needs it and it
    is not given; reading, solving and truth are not in it."""
    wall_s: float | None = None
    peak_mb: float | None = None
    note: str = ""
    """Why there is no score."""
    spent_s: float = 0.0
    """Processor seconds of the whole row, with its inputs and scores."""
    measured: str = ""
    """Commit and date."""

    @property
    def key(self) -> Key:
        """What a newer row replaces this one by."""
        return (self.scene, self.track, self.method, self.views, self.blur_px)


@dataclass
class Book:
    """The results file."""

    width: int = 0
    """Of the pictures, in pixels."""
    code: str = ""
    """Digest of the code with which every row was up to date; empty after a run of a part."""
    making_s: dict[str, float] = field(default_factory=dict)
    """Processor seconds that a scene's clip, solve and truth took, by scene."""
    rows: dict[Key, Row] = field(default_factory=dict)

    def measured(self) -> str:
        """When the rows were measured, for documents."""
        return store.measured_at((row.measured for row in self.rows.values()), self.code, code())

    def scored(self, track: str, method: str, blur: int) -> dict[str, Row]:
        """By scene, the row of a method with the most views."""
        found = [
            row for row in self.rows.values() if (row.track, row.method, row.blur_px) == (track, method, blur)
        ]
        return {row.scene: row for row in sorted(found, key=lambda row: row.views) if row.psnr is not None}

    @property
    def blur(self) -> int:
        """The largest disc, in pixels, that most rows are judged at."""
        blurs = [row.blur_px for row in self.rows.values()]
        return max(sorted(set(blurs)), key=blurs.count)


def code() -> str:
    """Digest of today's code."""
    return store.digest(store.sources(*CODE))


def load(folder: Path | None = None) -> Book:
    """The results file of a folder; an empty one where there is none."""
    file = (folder or RESULTS) / f"{NAME}.json"
    if not file.exists():
        return Book()
    stored = json.loads(file.read_text())
    rows = [Row(**each) for each in stored.pop("rows")]
    return Book(**stored, rows={row.key: row for row in rows})


def save(book: Book) -> None:
    """Replace the results file."""
    RESULTS.mkdir(exist_ok=True)
    order = sorted(
        book.rows.values(), key=lambda row: (row.scene, row.track, row.blur_px, row.method, row.views)
    )
    stored = asdict(replace(book, rows={})) | {"rows": [_plain(row) for row in order]}
    part = RESULTS / f"{NAME}.part"
    part.write_text(json.dumps(stored, indent=1) + "\n")
    part.rename(RESULTS / f"{NAME}.json")


@contextmanager
def changed() -> Iterator[Book]:
    """The results file, to be changed by one process at a time; written at the end."""
    store.FOLDER.mkdir(parents=True, exist_ok=True)
    with (store.FOLDER / f"{NAME}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        book = load()
        yield book
        save(book)


def _plain(row: Row) -> dict[str, Any]:
    return {name: round(v, 6) if isinstance(v, float) else v for name, v in asdict(row).items()}


def summary(rows: Iterable[Row]) -> str:
    """A table of our method between the thesis's, Blender's and the oracle, each with the most views."""
    heads = ("scene", "track", "disc", "thesis", "Defocus", "ours", "oracle", "gap closed",
             "at edges", "known fill", "unclipped over Defocus", "FLIP of thesis's", "RM of thesis's",
             "triangles")  # fmt: skip
    order = sorted(rows, key=lambda row: (row.scene, row.track, row.blur_px, row.views))
    best = {(row.scene, row.track, row.blur_px, row.method): row for row in order if row.psnr is not None}
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    for scene, track, blur in dict.fromkeys(key[:3] for key in best):
        thesis, defocus, ours, known_fill, oracle = (
            best.get((scene, track, blur, name))
            for name in ("thesis", "Defocus", "layers", "known fill", "oracle")
        )
        if thesis is None or defocus is None or ours is None:
            continue
        scores = ["-" if row is None else f"{row.psnr:.2f}" for row in (thesis, defocus, ours, oracle)]
        unclipped = (ours.unclipped_psnr or np.nan) - (defocus.unclipped_psnr or np.nan)
        cells = (
            scene, track, f"{blur} px", *scores, _gap_closed(thesis, ours, oracle, "psnr"),
            _gap_closed(thesis, ours, oracle, "edge_psnr"),
            " / ".join(_gap_closed(thesis, known_fill, oracle, name) for name in ("psnr", "edge_psnr")),
            f"{unclipped:+.2f}", f"{(ours.flip or np.nan) / (thesis.flip or np.nan):.2f}",
            f"{_flicker(ours) / _flicker(thesis):.2f}", str(ours.triangles),
        )  # fmt: skip
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join([*lines, ""])


def _gap_closed(thesis: Row, ours: Row | None, oracle: Row | None, name: str) -> str:
    low, own, high = (None if row is None else getattr(row, name) for row in (thesis, ours, oracle))
    if low is None or own is None or high is None:
        return "-"
    return f"{100 * (own - low) / (high - low):.0f} %"


def _flicker(row: Row) -> float:
    """RM without the truth's noise, which is independent of it; NaN where it is all of it."""
    left = (row.rm or 0.0) ** 2 - (row.rm_floor or 0.0) ** 2
    return float(np.sqrt(left)) if left > 0 else float("nan")
