"""The table of the real clips as Markdown."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import mean

from .clips import DATA, RealClip
from .metrics import DITHER, LOST
from .scores import Row
from .seen import SEEN
from .stages import BLUR, BUILD, Program

HEADS = (
    "clip", "kind", "outcome", "solve, CPU s", "first frame", "next", "subject keeps", "by default",
    "tiles lost", "left elsewhere", "in the row", "noise", "flicker", "IoU", "seen",
)  # fmt: skip
EXPLAINED = f"""\
Every clip goes through the command line: *solve*; *render* of the middle frame and the two after it with
one click on the subject; *render* of the middle frame as the window has it with nothing picked; frames spread
over the clip for some. Blur {BLUR:g} of the width, quality normal, one thread. No clip here has a true
picture, so the figures are comparisons with the source, and the pictures
(`{BUILD.relative_to(BUILD.parents[1])}`) have to be looked at.

- **CPU s**: of the process and all of its own. *First frame*: from the command to the first written file,
  depth to find, start included. *Next*: mean of the two frames after it.
- **Subject keeps**: share of the source's detail (a band-pass of the brightness, regressed on the source's)
  on the subject, with the click; 1 is untouched. **By default**: the same with nothing picked. **Tiles
  lost**: share of the subject's tiles of 16 to 32 pixels with detail that kept less than {LOST:g} of it, with
  the click. **Left elsewhere**: share of the detail outside the subject's surroundings; things at the
  subject's distance are rightly sharp. **In the row**: detail that the subject keeps in six frames spread
  over the clip with the same click, mean / least.
- **Noise**: standard deviation in 255ths in the flattest blurred places, source -> result. Blender's dither
  alone is {DITHER:g}. A star: noisier than the source and the dither together by over a tenth.
- **Flicker**: change over time of blurred areas, aligned by the source's flow and smoothed, relative to the
  source's.
- **IoU**: overlap of the matte that the program drew with (its parts that touch the subject) with hand-drawn
  masks, mean over the rendered frames that have one; 0 where it had none. Empty: no hand-drawn masks.
- **Seen**: by a person, in the pictures of this very commit; empty: not looked at."""


def table(rows: Sequence[Row], program: Program) -> str:
    """The rows as Markdown, with what is to be known about them and their sums."""
    commit = program.commit
    lines = [
        "# Real clips", "",
        f"`make real`: commit {commit}, code {program.code}.", "",
        EXPLAINED, "",
        f"| {' | '.join(HEADS)} |", "|" + "---|" * len(HEADS),
    ]  # fmt: skip
    lines += [f"| {' | '.join(_cells(row, SEEN.get(commit, {})))} |" for row in rows]
    lines += ["", *_sums(rows), "", "## What the program said", ""]
    lines += [f"- **{row.clip.name}**: {said}" for row in rows if (said := _said(row))]
    return "\n".join(lines) + "\n"


def _cells(row: Row, seen: dict[str, str]) -> list[str]:
    cells = [row.clip.name, row.clip.kind, _outcome(row)]
    solve, clicked = row.solve, row.clicked
    cells.append("" if solve is None else f"{solve.cpu_s:.0f}")
    first, following = frame_costs(row)
    cells += [_number(first, 0), _number(following, 0)]
    detail = row.detail
    cells += [_number(detail.subject) if detail else "", _number(row.by_default)]
    cells += [_number(detail.tiles_lost), _number(detail.elsewhere)] if detail else ["", ""]
    cells.append(" / ".join(map(_number, row.row_keeps)) if row.row_keeps else "")
    cells += [_noise(row), _number(row.flicker), _number(row.overlap)]
    assert clicked is None or solve is not None
    return [*cells, seen.get(row.clip.name, "")]


def frame_costs(row: Row) -> tuple[float | None, float | None]:
    """CPU seconds of the first frame of a clip and of each after it; None where they are not known."""
    ended = row.clicked
    if ended is None or ended.status or ended.first_cpu_s is None:
        return None, None
    return ended.first_cpu_s, (ended.cpu_s - ended.first_cpu_s) / (len(row.clip.near_middle) - 1)


def cpu_seconds(row: Row) -> float:
    """CPU seconds of all steps of a clip."""
    return sum(each.cpu_s for each in (row.solve, row.clicked, row.default, row.row) if each is not None)


def _outcome(row: Row) -> str:
    if row.solve is None:
        return "**not run**"
    if row.solve.status:
        return f"**not solved**: {clean(row.solve.message, row.clip)}"
    if row.failure:
        return f"**failed**: {clean(row.failure, row.clip)}"
    return "solved" if row.clicked is not None else "solved, **not rendered**"


def clean(text: str, clip: RealClip) -> str:
    """A message without this machine's folders, fit for a cell."""
    for folder in (str(clip.file.parent), str(DATA), str(BUILD)):
        text = text.replace(folder + "/", "").replace(folder, "")
    return text.replace("|", "/").strip()


def _noise(row: Row) -> str:
    if row.noise is None or math.isnan(row.noise.result):
        return ""
    star = "*" if row.noise.ratio > 1.1 else ""
    return f"{row.noise.source:.2f} -> {row.noise.result:.2f}{star}"


def _number(value: float | None, digits: int = 2) -> str:
    return "" if value is None or math.isnan(value) else f"{value:.{digits}f}"


def _sums(rows: Sequence[Row]) -> list[str]:
    run = [row for row in rows if row.solve is not None]
    rendered = [row for row in run if row.is_rendered]
    moving = [row for row in rendered if row.clip.kind != "still"]
    total = sum(map(cpu_seconds, run))
    solved = [row for row in run if row.solve is not None and not row.solve.status]
    lines = [
        f"{len(run)} of {len(rows)} clips were run. {len(run) - len(solved)} were not solved; of"
        f" {len(solved)} clicks {len(solved) - len(rendered)} were refused. All commands took {total:.0f} CPU"
        f" s: {total / 120:.0f} minutes on two idle cores.",
    ]
    for name, those in (
        ("that move", moving),
        ("that stand still", [r for r in rendered if r not in moving]),
    ):
        details = [row.detail for row in those if row.detail is not None]
        if not details:
            continue
        kept, lost, left = (
            _mean([getattr(each, part) for each in details])
            for part in ("subject", "tiles_lost", "elsewhere")
        )
        lines.append(
            f"Subjects {name}, mean of {len(details)}: they keep {kept} of their detail, {lost} of their"
            f" tiles are lost, {left} is left elsewhere."
        )
    if overlaps := [row.overlap for row in rendered if row.overlap is not None]:
        lines.append(f"IoU, mean of {len(overlaps)} clips with hand-drawn masks: {_mean(overlaps)}.")
    noisy = [row.clip.name for row in rendered if row.noise is not None and row.noise.ratio > 1.1]
    lines.append(f"Noisier than the source with the dither: {', '.join(noisy) or 'none'}.")
    return [part for line in lines for part in (line, "")][:-1]


def _mean(values: Sequence[float]) -> str:
    known = [value for value in values if not math.isnan(value)]
    return _number(mean(known)) if known else "unknown"


def _said(row: Row) -> str:
    """Lines of the solve and of the render about quality and focus, in one."""
    if row.solve is None or row.solve.status:
        return ""
    lines = [line for line in row.solve.said.splitlines() if not line.startswith("solving:")]
    if row.clicked is not None:
        lines += [line for line in row.clicked.said.splitlines() if line.startswith(("in focus:", "note:"))]
    if row.default is not None:
        lines += [line for line in row.default.said.splitlines() if "uncertain" in line]
    return clean("; ".join(lines), row.clip)
