"""The working folder that keeps a solve.

DIR/solve.json   which clip, which frames, how it was solved, and the report
DIR/model/       the reconstruction as a COLMAP text model; where we solved it ourselves, also the points that
                 frames show and did not track, and the tracks of what moves
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from .colmap_model import read_model, write_model
from .counting import counted
from .errors import Remedy, UserError
from .folder_lock import FolderLock
from .footage import Footage, open_footage
from .readers.matching import Imported
from .reconstruction import Ints, Reconstruction, normalise
from .solve_report import Report, report

STATE = "solve.json"
VISIBLE = "visible.npz"
"""Of the model: frame and point of everything that a frame shows and was not tracked in."""
VERSION = 1


@dataclass(frozen=True)
class Solve:
    """A finished solve and its clip."""

    work_dir: Path
    footage: Path
    frames: tuple[int, ...]
    reconstruction: Reconstruction
    report: dict[str, Any]

    @cached_property
    def worth(self) -> Report:
        """The numbers and the advice."""
        return report(self.reconstruction, self.frames, self.report)

    @property
    def summary(self) -> str:
        """One line for the user."""
        worth = self.worth
        found = {
            "clip": "found",
            "given": "given as",
            "guess": "assumed to be",
            "file": "read as",
            "metadata": "said to be",
        }
        sure = (
            f" (+- {100 * worth.focal_sigma:.1f} %)"
            if worth.focal_from == "clip" and worth.focal_sigma
            else ""
        )
        return (
            f"{worth.registered} of {counted(worth.frames, 'frame')} registered,"
            f" {counted(worth.points, 'point')}, reprojection error {worth.reprojection_error:.2f} px,"
            f" focal length {found[worth.focal_from]} {worth.focal[0]:.0f} px{sure}"
        )


def default_work_dir(footage: Path, beside: Path) -> Path:
    """The working folder of a clip when none is named: `<clip>.aperture` in the folder `beside`."""
    stem = footage.name.replace("#", "").replace("%", "") or footage.parent.name
    return beside / f"{Path(stem).stem if footage.suffix else stem}.aperture"


class Staging:
    """A folder within the working folder in which a solve comes to be: kept whole, or gone without a trace.

    While it lasts nobody else can have one there. Raises UserError where no folder can be made, or somebody
    else has one.
    """

    def __init__(self, work_dir: Path) -> None:
        self.work_dir = work_dir
        self._made: Path | None = None
        self._lock: FolderLock | None = None
        try:
            if not work_dir.exists():
                self._made = next(p for p in [*reversed(work_dir.parents), work_dir] if not p.exists())
                work_dir.mkdir(parents=True, exist_ok=True)
            self._lock = FolderLock(work_dir)
            self.folder = Path(tempfile.mkdtemp(prefix=".solving-", dir=work_dir))
        except OSError as error:
            self._let_go()
            raise UserError(
                f"no solve can be started in the working folder {work_dir}: {error.strerror}"
            ) from None

    def keep(self, footage: Footage, options: dict[str, Any], said: dict[str, Any]) -> None:
        """Move `model` into place, the state file last, because it makes the folder a solve.

        `options` tell this solve from others of the same clip. Raises UserError, the old solve as it was.
        """
        state = {
            "version": VERSION,
            "footage": str(footage.path),
            "relative": _relative(footage.path, self.work_dir),
            "identity": identity(footage.path),
            "frames": footage.frames,
            **options,
            "report": said,
        }
        model, old = self.work_dir / "model", self.folder / "old"
        try:
            (self.folder / STATE).write_text(json.dumps(state, indent=1), encoding="utf-8")
            if model.exists():
                model.rename(old)
            (self.folder / "model").rename(model)
            (self.folder / STATE).replace(self.work_dir / STATE)
        except OSError as error:
            if old.exists():
                shutil.rmtree(model, ignore_errors=True)
                old.rename(model)
            self.discard()
            raise UserError(
                f"the solve cannot be moved into {self.work_dir}: {error.strerror}; the old one is as it was"
            ) from None
        self._made = None
        self.discard()

    def discard(self) -> None:
        """Remove what is not kept."""
        shutil.rmtree(self.folder, ignore_errors=True)
        self._let_go()

    def _let_go(self) -> None:
        if self._lock is not None:
            self._lock.release()
        if self._made is None:
            return
        # Only folders of our own making, and only while they are empty.
        folder = self.work_dir
        with contextlib.suppress(OSError):
            while folder != self._made.parent:
                folder.rmdir()
                folder = folder.parent
        self._made = None


def load_solve(work_dir: Path) -> Solve:
    """The solve that a working folder keeps; UserError where there is none or its clip is gone."""
    state = _state(work_dir)
    if state is None:
        raise UserError(f"{work_dir} holds no solve; solve the clip into it first", Remedy.SOLVE)
    footage = Path(state["footage"])
    if not _footage_exists(footage) and state["relative"]:
        footage = (work_dir / state["relative"]).resolve()
    if not _footage_exists(footage):
        raise UserError(f"the clip {state['footage']} of {work_dir} is gone; put it back, or solve again")
    frames = tuple(int(f) for f in state["frames"])
    return Solve(work_dir, footage, frames, _with_visible(work_dir / "model"), state["report"])


def keep_visible(model: Path, points: Mapping[int, Ints]) -> None:
    """Write what each frame shows besides what it tracked, points (k,) by frame number, beside a model."""
    frame = np.repeat(list(points), [len(each) for each in points.values()])
    np.savez_compressed(model / VISIBLE, frame=frame, point=np.concatenate(list(points.values())))


def _with_visible(model: Path) -> Reconstruction:
    reconstruction = read_model(model)
    try:
        with np.load(model / VISIBLE) as kept:
            frame, point = kept["frame"], kept["point"].astype(np.int32)
    except FileNotFoundError:
        return reconstruction
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        frame = point = np.zeros(1, np.int32) - 1
    if len(frame) != len(point) or np.any((point < 0) | (point >= len(reconstruction.points))):
        raise UserError(f"{model / VISIBLE} is damaged; delete the folder and solve again")
    images = [replace(image, visible=point[frame == image.frame]) for image in reconstruction.images]
    return replace(reconstruction, images=tuple(images))


def recorded_clip(work_dir: Path) -> Path | None:
    """Where the clip of a working folder lies as seen from there; None where the folder does not say."""
    try:
        state = _state(work_dir)
    except UserError:
        return None
    return (work_dir / state["relative"]).resolve() if state is not None and state["relative"] else None


def identity(path: Path) -> str:
    """What a clip is recognised by wherever it lies: a video's size and a hash of its first and last MiB,
    a sequence's file names and sizes. Not the times, which copying changes."""
    digest = hashlib.sha256()
    if path.is_file():
        size = path.stat().st_size
        with path.open("rb") as file:
            digest.update(str(size).encode() + file.read(1 << 20))
            file.seek(max(0, size - (1 << 20)))
            digest.update(file.read())
    else:
        for image in open_footage(path).files:
            digest.update(f"{image.name}\n{image.stat().st_size}\n".encode())
    return digest.hexdigest()


def is_solved(work_dir: Path, footage: Footage, options: dict[str, Any]) -> bool:
    """Whether the folder holds this very solve; UserError where it holds something else."""
    state = _state_of(work_dir, footage)
    if state is None:
        return False
    same = all(value in (None, state.get(name, value)) for name, value in options.items())
    return same and tuple(state["frames"]) == footage.frames and (work_dir / "model").is_dir()


def holds_solve(work_dir: Path, footage: Footage) -> bool:
    """Whether the folder holds a solve of the clip, of whichever frames and whosever; UserError where it
    holds something else."""
    return _state_of(work_dir, footage) is not None and (work_dir / "model").is_dir()


def imported_from(work_dir: Path) -> str | None:
    """The format of the import that the folder keeps; None where it keeps none."""
    state = _state(work_dir)
    return None if state is None else state.get("imported")


def keep_import(found: Imported, footage: Footage, work_dir: Path) -> None:
    """Keep another program's solve as if it were our own; UserError where the folder holds something else, or
    is being solved into."""
    reconstruction = normalise(found.reconstruction)
    staging = Staging(work_dir)
    try:
        _state_of(work_dir, footage)
        model = staging.folder / "model"
        model.mkdir()
        write_model(model, reconstruction)
        said = {"focal_from": "file", "method": found.format, "notes": list(found.notes)}
        staging.keep(footage, {"imported": found.format}, said)
    finally:
        staging.discard()


def _state_of(work_dir: Path, footage: Footage) -> dict[str, Any] | None:
    """What the folder says of its solve of the clip; UserError where it holds something else."""
    if not work_dir.exists():
        return None
    if not work_dir.is_dir():
        raise UserError(f"{work_dir} is a file; name a folder", Remedy.WORK_DIR)
    state = _state(work_dir)
    if state is None:
        if any(not p.name.startswith(".solving") for p in work_dir.iterdir()):
            raise UserError(
                f"{work_dir} is not empty and holds no solve; name another folder", Remedy.WORK_DIR
            )
        return None
    if state["identity"] != identity(footage.path):
        raise UserError(
            f"{work_dir} holds the solve of {Path(state['footage']).name}, not of {footage.path.name};"
            " name another folder",
            Remedy.WORK_DIR,
        )
    return state


def _state(work_dir: Path) -> dict[str, Any] | None:
    try:
        state = json.loads((work_dir / STATE).read_text(encoding="utf-8"))
        if state["version"] > VERSION:
            raise UserError(f"{work_dir} was made with a newer Virtual Aperture; update the extension")
        missing = {"footage", "relative", "identity", "frames", "report"} - set(state)
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError):
        missing = {"everything"}
    if missing:
        raise UserError(f"{work_dir / STATE} is damaged; delete the folder and solve again")
    return dict(state)


def _footage_exists(path: Path) -> bool:
    return path.exists() or (path.parent.is_dir() and ("#" in path.name or "%" in path.name))


def _relative(path: Path, folder: Path) -> str:
    try:
        return os.path.relpath(path, folder)
    except ValueError:  # another drive
        return ""
