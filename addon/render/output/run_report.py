"""The report on a run of frames: one entry a frame in a file, and a line at the end."""

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

import cv2

from ...core.base.arrays import Bytes
from ...core.base.atomic import write_bytes
from ...core.base.errors import Remedy, UserError
from ...core.base.file_names import check_file
from ...core.base.regular_file import read_object
from ...core.frame.frame import Frame
from ...core.frame.inspection import pictures
from ...core.frame.report import FrameReport, Used, frame_report, summary
from ...core.sfm.state import is_state_file
from ..views.average import draw_shares

KIND = "virtual aperture frame reports"
JOB = "specificationVersion"
"""Key of every job in the Open Job Description format."""


def check_report(path: Path, overwrite: bool) -> None:
    """Check a file of reports before any work; UserError if it cannot be one."""
    if path.suffix.lower() != ".json":
        raise UserError(f"{path.name} is not a report file; end it in .json")
    check_file(path)
    if not path.exists() or _is_ours(path):
        return
    if is_state_file(path) or JOB in read_object(path):
        what = "a farm's job" if JOB in read_object(path) else "what a working folder says of its solve"
        raise UserError(f"{path} is {what}, which a report must not replace; choose another file")
    if not overwrite:
        raise UserError(
            f"{path} already exists and is not a report; choose another file, or overwrite it",
            Remedy.OVERWRITE,
        )


def _is_ours(path: Path) -> bool:
    return bool(read_object(path).get("kind") == KIND)


class RunReport:
    """The sources of every frame of a run; its `on_frame` is called with each of them."""

    def __init__(self, path: Path | None = None, key: str = "", overwrite: bool = False) -> None:
        """Add to `path` after entries of the same `key`; UserError for another's, unless `overwrite`."""
        self._path, self._key = path, key
        self._used: dict[int, Used] = {}
        self._reports: dict[int, FrameReport] = {}
        if path is None or not path.exists():
            return
        # A solve may have been put there since.
        check_report(path, overwrite)
        held = read_object(path) if _is_ours(path) else {}
        if held.get("key") == key:
            self._reports = _entries(held)
        elif not overwrite:
            raise UserError(
                f"{path} has the reports of a run with other settings; choose another file, or overwrite it",
                Remedy.OVERWRITE,
            )

    def on_frame(self, frame: Frame) -> None:
        """Add a frame's entry; it is in the file when this returns."""
        used = Used.of(frame)
        self._used[used.frame] = used
        if self._path is None:
            return
        shares = draw_shares(frame)
        self._reports[used.frame] = frame_report(frame, shares)
        self._write(self._path)

    def take_over(self, path: Path) -> None:
        """Make the entries of another file of reports, where it is there, this one's."""
        if self._path is None or not _is_ours(path):
            return
        self._reports |= _entries(read_object(path))
        self._write(self._path)

    def lacks(self, frames: list[int]) -> list[int]:
        """Return the frames without an entry in the file."""
        return [frame for frame in frames if self._path is not None and frame not in self._reports]

    def summary(self, frames: list[int]) -> str:
        """Return one line about a run's frames, with those of an earlier one; "" if nothing is known."""
        reports = [self._reports[frame] for frame in frames if frame in self._reports]
        used = {one.frame: Used(one.frame, one.method, one.why) for one in reports} | self._used
        return summary(used.values(), reports)

    def _write(self, path: Path) -> None:
        entries = [self._reports[frame].as_dict() for frame in sorted(self._reports)]
        write_bytes(path, text_of(entries, self._key).encode())


def text_of(entries: list[dict[str, object]], key: str) -> str:
    """Return the file of reports: an entry a line."""
    lines = ",\n".join(json.dumps(entry) for entry in entries)
    return f'{{"kind": {json.dumps(KIND)}, "key": {json.dumps(key)}, "frames": [\n{lines}\n]}}\n'


def _entries(held: dict[str, Any]) -> dict[int, FrameReport]:
    """The entries of a file of reports, by frame, without invalid ones."""
    frames = held.get("frames")
    known = map(_entry, frames if isinstance(frames, list) else [])
    return {entry.frame: entry for entry in known if entry is not None}


def _entry(held: object) -> FrameReport | None:
    names = [one.name for one in fields(FrameReport)]
    if not isinstance(held, dict) or set(held) != set(names):
        return None
    return FrameReport(**held)


class Inspector:
    """The debug views and the report of one frame; its `on_frame` is called when it is drawn."""

    def __init__(self) -> None:
        self.pictures: dict[str, Bytes] = {}
        """(H, W, 3) sRGB; empty until a frame was drawn to its end."""
        self.report: FrameReport | None = None

    def on_frame(self, frame: Frame) -> None:
        """Keep what the frame was drawn from."""
        shares = draw_shares(frame)
        self.report = frame_report(frame, shares)
        self.pictures = pictures(frame, shares)


def write_picture(path: Path, picture: Bytes) -> None:
    """Write a PNG of (H, W, 3) sRGB; UserError if it cannot be written."""
    done, data = cv2.imencode(".png", picture[..., ::-1])
    assert done
    write_bytes(path, data.tobytes())
