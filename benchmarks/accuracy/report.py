"""Rows become a table for each scene and plots of error over cost."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullLocator

from . import metrics
from .plan import TRACKS
from .rows import NAME, Book, Row, summary

matplotlib.use("Agg")

type Column = tuple[str, str, str]
"""Its head, the field of `Row`, and how that is written."""

COLUMNS: tuple[Column, ...] = (
    ("PSNR", "psnr", "{:.2f}"),
    ("edges", "edge_psnr", "{:.2f}"),
    ("in focus", "in_focus_psnr", "{:.2f}"),
    ("unclipped", "unclipped_psnr", "{:.2f}"),
    ("SSIM", "ssim", "{:.4f}"),
    ("FLIP", "flip", "{:.4f}"),
    ("RM", "rm", "{:.4f}"),
    ("warped", "warped", "{:.4f}"),
    ("subject", "subject_psnr", "{:.2f}"),
    ("subject RM", "subject_rm", "{:.4f}"),
    ("triangles", "triangles", "{:d}"),
    ("CPU s", "cpu_s", "{:.2f}"),
    ("wall s", "wall_s", "{:.2f}"),
    ("MB", "peak_mb", "{:.0f}"),
)
STILL_COLUMNS = tuple(column for column in COLUMNS if not column[1].startswith("subject"))
"""Of scenes without a subject that moves."""
OURS, VARIANTS, BLENDER = "#D55E00", "#B07800", "#0072B2"
STYLES = {
    "no blur": ("0.4", "x"), "thesis": ("black", "v"), "layers": (OURS, "o"), "draft": (OURS, "*"),
    "normal": (OURS, "*"), "final": (OURS, "*"), "known fill": (OURS, "."),
    "features": (VARIANTS, "v"),
    "dense mesh": (VARIANTS, "s"), "Cycles": (BLENDER, "D"),
    "Cycles, our mesh": (BLENDER, "d"), "Defocus": (BLENDER, "P"),
    "scatter": ("#A0508A", "X"), "oracle": ("#00775A", "^"),
}  # fmt: skip
"""Colours and markers, after Okabe and Ito (2008), whose lighter ones are darkened to be read as text."""
PLACES = ((1, 0), (0, 1), (0, -1), (-1, 0), (1, 1), (-1, 1), (1, -1), (-1, -1))

HEAD = """# Our method against the others

`make bench`, {measured}; code {code}; pictures {width} pixels wide.

PSNR in dB against a real lens, without the truth's own noise, each method with the most views.
*Gap closed*: ours less the thesis's over the oracle's less the thesis's.
*Known fill*: the same, of ours with the true colours of what the frame hides, at the depth that we guess for
it, which may be another surface's. *RM of thesis's*: squares without that of the truth's own noise, root of
their ratio. A star: the truth's noise is as large as the error.
"""

type Label = tuple[float, float, str, str, float]
"""CPU seconds, dB, text, colour, size in points."""


def write(folder: Path, book: Book) -> str:
    """Write the overview plot, and bench.md with the summary and a table for each scene; returns its text."""
    order = [*STYLES]
    rows = sorted(book.rows.values(), key=lambda row: (row.scene, order.index(row.method), row.views))
    parts = [
        HEAD.format(measured=book.measured(), code=book.code or "mixed", width=book.width),
        summary(rows),
    ]
    scenes = dict.fromkeys(row.scene for row in rows)
    parts += [table(scene, [row for row in rows if row.scene == scene]) for scene in scenes]
    text = "\n".join(parts)
    (folder / f"{NAME}.md").write_text(text)
    overview(folder / f"{NAME}.png", book)
    return text


def line(row: Row) -> str:
    """One row on one line, for watching a run."""
    name = f"{row.scene} {row.track} {row.blur_px} px {row.method} {row.views or ''}".ljust(40)
    if row.psnr is None:
        return f"{name} {row.note}"
    return f"{name} {row.psnr:6.2f} dB{_mark(row)} (ceiling {row.noise_ceiling:.1f})  {row.cpu_s:.2f} CPU s"


def table(scene: str, rows: list[Row]) -> str:
    """The rows of one scene as Markdown, the best PSNR of each track and blur in bold."""
    columns = COLUMNS if any(row.subject_psnr is not None for row in rows) else STILL_COLUMNS
    heads = ["method", "views", *(head for head, _, _ in columns)]
    lines = [f"## {scene}", ""]
    for track in sorted({row.track for row in rows}):
        for blur in sorted({row.blur_px for row in rows if row.track == track}):
            own = [row for row in rows if (row.track, row.blur_px) == (track, blur)]
            ceiling = np.mean([row.noise_ceiling for row in own])
            floors = [row.rm_floor for row in own if row.rm_floor is not None]
            flicker = f", {np.mean(floors):.4f} of RM" if floors else ""
            lines += [
                f"### {track}, largest disc {blur} px, {own[0].frames} frames;"
                f" the truth's noise: {ceiling:.1f} dB seed against seed{flicker}", "",
                "| " + " | ".join(heads) + " |", "|" + "---|" * len(heads),
                *(_line(row, max((r.psnr or 0) for r in own), columns) for row in own), "",
            ]  # fmt: skip
    return "\n".join(lines)


def _line(row: Row, best: float, columns: tuple[Column, ...]) -> str:
    cells = [row.method, str(row.views or "")]
    if row.psnr is None:
        return "| " + " | ".join([*cells, row.note, *[""] * (len(columns) - 1)]) + " |"
    for _, name, form in columns:
        value = getattr(row, name)
        cell = "" if value is None else form.format(value)
        if name == "psnr":
            cell = (f"**{cell}**" if value == best else cell) + _mark(row)
        cells.append(cell)
    return "| " + " | ".join(cells) + " |"


def _mark(row: Row) -> str:
    """A star where the truth's own noise has a part in the score."""
    return "*" if metrics.within_noise(row.psnr or 0.0, row.noise_ceiling) else ""


def overview(path: Path, book: Book) -> None:
    """The mean of tracks T1 and T2 over the scenes that have every method, at the main blur."""
    scored = [row for row in book.rows.values() if row.psnr is not None and row.track in ("T1", "T2")]
    if not scored:
        return
    panels = {}
    for track in sorted({row.track for row in scored}):
        own = [row for row in scored if row.track == track and row.blur_px == book.blur]
        count = Counter(row.scene for row in own)
        # A scene half judged would take methods out of the mean.
        scenes = {scene for scene in count if count[scene] == max(count.values())}
        panels[f"{TRACKS[track]}, mean of {len(scenes)} scenes"] = [row for row in own if row.scene in scenes]
    draw(path, f"Error over cost, largest blur disc {book.blur} px (small numbers: views)", panels)


def draw(path: Path, title: str, panels: dict[str, list[Row]]) -> None:
    """Panels two abreast, as wide as a README; every curve carries its name."""
    across = min(len(panels), 2)
    down = -(-len(panels) // across)
    figure, axes = plt.subplots(
        down, across, figsize=(4.5 * across, 0.3 + 4.2 * down), squeeze=False, layout="constrained",
        sharey=True,
    )  # fmt: skip
    figure.suptitle(title, fontsize=11)
    for ax in axes.ravel()[len(panels) :]:
        ax.set_visible(False)
    for ax in axes[:, 0]:
        ax.set_ylabel("PSNR against a real lens, dB")
    labels = []
    for ax, (name, rows) in zip(axes.ravel(), panels.items(), strict=False):
        ax.set_title(name, fontsize=10)
        ax.set_xlabel("CPU seconds a frame")
        ax.set_xscale("log")
        labels.append((ax, _curves(ax, rows)))
        ax.xaxis.set(
            major_locator=LogLocator(subs=(1, 2, 5)), major_formatter="{x:g}", minor_locator=NullLocator()
        )
        ax.grid(color="0.92")
        ax.margins(x=0.12, y=0.06)
        ax.spines[["top", "right"]].set_visible(False)
    figure.draw_without_rendering()
    # Places of labels are found in pixels, which may not move any more.
    figure.set_layout_engine("none")
    for ax, wanted in labels:
        _label(ax, wanted)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def _curves(ax: Axes, rows: Iterable[Row]) -> list[Label]:
    """PSNR over CPU seconds, the views of a method joined; several scenes are averaged. Returns what is to be
    written beside the points, the names first.
    """
    found = [row for row in rows if row.psnr is not None and row.cpu_s is not None]
    scenes = {row.scene for row in found}
    names, numbers = [], []
    for method, (colour, marker) in STYLES.items():
        points = []
        for views in sorted({row.views for row in found if row.method == method}):
            own = [row for row in found if (row.method, row.views) == (method, views)]
            if {row.scene for row in own} == scenes:
                points.append((np.mean([r.cpu_s for r in own]), np.mean([r.psnr for r in own]), views))
        if not points:
            continue
        cost, score, _ = zip(*points, strict=True)
        if method == "no blur":
            ax.axhline(score[0], color=colour, linestyle="--", linewidth=1)
            ax.annotate(method, (0.99, score[0]), (0, 3), ("axes fraction", "data"), "offset points",
                        ha="right", fontsize=8, color=colour)  # fmt: skip
            continue
        ours = method == "layers"
        ax.plot(cost, score, color=colour, marker=marker, markersize=6, linewidth=2.2 if ours else 1.2)
        best = int(np.argmax(score))
        names.append((cost[best], score[best], "ours" if ours else method, colour, 9))
        numbers += [(x, y, f"{n}", colour, 6.5) for x, y, n in points if len(points) > 1]
    return names + numbers


def _label(ax: Axes, labels: list[Label]) -> None:
    """Write each label where, of eight places around its point, it covers the least of what is there."""
    taken = [ax.transData.transform((x, y)) + offset for x, y, *_ in labels for offset in (-4, 4)]
    for line in ax.lines:
        ends = np.atleast_2d(ax.transData.transform(line.get_xydata()))
        taken += [a + t * (b - a) for a, b in pairwise(ends) for t in np.linspace(0, 1, 25)]
    renderer = ax.figure.canvas.get_renderer()  # type: ignore[attr-defined]
    frame = ax.get_window_extent(renderer)
    for x, y, text, colour, size in labels:
        notes = [
            ax.annotate(text, (x, y), (6 * dx, 6 * dy), "data", "offset points", color=colour, fontsize=size,
                        ha=("right", "center", "left")[dx + 1], va=("top", "center", "bottom")[dy + 1])
            for dx, dy in PLACES
        ]  # fmt: skip
        boxes = [note.get_window_extent(renderer) for note in notes]
        covered = [
            sum(box.contains(*point) for point in taken) + 99 * (box.x1 > frame.x1 or box.x0 < frame.x0)
            for box in boxes
        ]
        best = boxes[int(np.argmin(covered))]
        for note in (note for note, box in zip(notes, boxes, strict=True) if box is not best):
            note.remove()
        taken += [np.multiply(best.size, (u, v)) + best.p0 for u in np.linspace(0, 1, 8) for v in (0, 0.5, 1)]
