"""Contact sheets: source and results of several clips a page, rows of frames, and full-size pictures."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from .clips import RealClip
from .metrics import Pixels
from .scores import Row, read, shown
from .stages import Steps

PER_PAGE = 6
"""Clips a page."""
CELL = 620, 400
"""Width and height of a picture's place on a page, in pixels."""
LINE = 22
"""Pixels of a line of text."""
LETTERS = 75
"""Letters of a line that fit a cell."""
QUALITY = 88
RED, YELLOW = (230, 30, 30), (255, 230, 0)


def write(rows: Sequence[tuple[Steps, Row]], folder: Path) -> list[Path]:
    """Write pages, rows and full-size pictures of all clips into a folder; the pages and rows.

    Older pictures in the folder are removed.
    """
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "full").mkdir(parents=True)
    solved = [(steps, row) for steps, row in rows if row.solve is not None]
    written = []
    for number, begin in enumerate(range(0, len(solved), PER_PAGE), 1):
        page = np.vstack([_clip(steps, row) for steps, row in solved[begin : begin + PER_PAGE]])
        written.append(_save(page, folder / f"sheet-{number}.jpg"))
    for steps, row in solved:
        _copy_full(steps, row, folder / "full")
        if row.row is not None and not row.row.status:
            written.append(_save(_row(steps), folder / f"row-{steps.clip.name}.jpg"))
    return written


def _clip(steps: Steps, row: Row) -> Pixels:
    """Source with the subject, result with nothing picked, and result with a click, side by side."""
    clip = steps.clip
    cells = [_titled(_marked(clip), f"{clip.name}, frame {clip.middle}: source, subject, click")]
    for kind, ended, title in (
        ("default", row.default, "nothing picked"),
        ("click", row.clicked, "one click"),
    ):
        done = ended is not None and not ended.status
        if done:
            cells.append(_titled(read(steps.picture(kind, clip.middle)), title))
        else:
            message = ended.message if ended is not None else row.failure or "not rendered"
            cells.append(_titled(_words(message), title))
    return np.hstack(cells)


def _row(steps: Steps) -> Pixels:
    """Sources above, results below."""
    clip = steps.clip
    above = [_titled(shown(clip, frame), f"{clip.name} {frame}") for frame in clip.row]
    below = [
        _titled(read(steps.picture("row", frame)), "one click in the middle frame") for frame in clip.row
    ]
    half = len(above) // 2
    parts = (above[:half], below[:half], above[half:], below[half:])
    return np.vstack([np.hstack(part) for part in parts])


def _marked(clip: RealClip) -> Pixels:
    """The middle frame with its subject's outline and the click."""
    picture = np.ascontiguousarray(shown(clip, clip.middle))
    height, width = picture.shape[:2]
    thick = max(1, width // 500)
    outlines, _ = cv2.findContours(
        clip.subject(clip.middle).astype(np.uint8), cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE
    )
    cv2.drawContours(picture, outlines, -1, RED, thick)
    x, y = clip.click
    cv2.circle(picture, (round(x * width), round(y * height)), 4 * thick, YELLOW, -1)
    return picture


def _words(text: str) -> Pixels:
    """A gray picture of a cell's size with a message on it."""
    gray = np.full((CELL[1], CELL[0], 3), 40, np.uint8)
    for number, line in enumerate(textwrap.wrap(text, LETTERS), 1):
        _write_line(gray, line, (10, LINE * number))
    return gray


def _write_line(picture: Pixels, text: str, at: tuple[int, int]) -> None:
    # OpenCV's letters are ASCII.
    ascii_text = text.encode("ascii", "replace").decode()
    face = cv2.FONT_HERSHEY_SIMPLEX
    cv2.putText(picture, ascii_text, at, face, 0.45, (255, 255, 255), 1, cv2.LINE_AA)


def _titled(picture: Pixels, title: str) -> Pixels:
    """A picture in a cell of a page, (CELL[1] + LINE, CELL[0], 3), as large as fits, under a line of text."""
    height, width = picture.shape[:2]
    scale = min(CELL[0] / width, CELL[1] / height)
    how = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
    small = cv2.resize(picture, (int(scale * width), int(scale * height)), interpolation=how)
    cell = np.zeros((CELL[1] + LINE, CELL[0], 3), np.uint8)
    cell[LINE : LINE + small.shape[0], : small.shape[1]] = small
    _write_line(cell, title, (4, LINE - 7))
    return cell


def _save(picture: Pixels, path: Path) -> Path:
    if not cv2.imwrite(str(path), picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY]):
        raise SystemExit(f"{path} cannot be written; is the disk full?")
    return path


def _copy_full(steps: Steps, row: Row, folder: Path) -> None:
    """The full-size source and results of a clip's middle frame, and the results of its row."""
    clip = steps.clip
    cv2.imwrite(str(folder / f"{clip.name}-source.png"), shown(clip, clip.middle)[..., ::-1])
    for kind, ended, frames in (
        ("click", row.clicked, (clip.middle,)),
        ("default", row.default, (clip.middle,)),
        ("row", row.row, tuple(clip.row) if clip.has_row else ()),
    ):
        if ended is None or ended.status:
            continue
        for frame in frames:
            shutil.copy(steps.picture(kind, frame), folder / f"{clip.name}-{kind}-{frame:04d}.png")
