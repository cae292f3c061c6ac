"""The state of a working folder, `solve.json` and its model: checked, and put there whole."""

import contextlib
import hashlib
import json
import os
import shutil
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ..base import atomic
from ..base.digest import file_digest
from ..base.errors import Remedy, UserError
from ..base.file_lock import NAME, FolderLock
from ..base.file_names import checked_name
from ..base.regular_file import read_object, read_regular
from ..media.clip import Footage
from ..media.clip_identity import identity
from ..media.video import video_info
from .report import Figures

STATE = "solve.json"
MODEL = "model"
DIGEST = "digest"
"""Digest of the rest of a state; a state edited by hand may lack it."""
VERSION = 1
"""Version of the state's format; a later one is refused."""
LONGEST = 64 << 20
"""Bytes of a state at most: a frame's number takes ten, so it has room for days of video."""
_TYPES: dict[str, type] = {"footage": str, "relative": str, "identity": str, "frames": list, "report": dict}
PREFIX = ".solving-"
"""Begins the name of a folder in which a solve comes to be."""
OLD = "old"
"""In it, the model that is being replaced."""


class UnusableStateError(UserError):
    """A working folder's state cannot be read; solving again replaces it."""


def read_state(work_dir: Path) -> dict[str, Any] | None:
    """Return the content of `solve.json`, None without it; UnusableStateError if it cannot be used."""
    path = work_dir / STATE
    try:
        text = read_regular(path, LONGEST).decode()
        state = json.loads(text) if text else None
    except FileNotFoundError:
        return None
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError):
        raise _damaged(path, "it is not JSON") from None
    if state is None:
        raise _damaged(path, "it is empty")
    if not isinstance(state, dict) or not isinstance(state.get("version"), int):
        raise _damaged(path, "it lacks a version")
    if state["version"] > VERSION:
        raise UnusableStateError(
            f"{path} was made with a newer Virtual Aperture; update the extension, or solve again",
            Remedy.AGAIN,
        )
    for name, kind in _TYPES.items():
        if not isinstance(state.get(name), kind):
            raise _damaged(path, f"it lacks {name}")
    if state.pop(DIGEST, None) not in (None, _digest(state)):
        raise _damaged(path, "it is not what the solve wrote")
    if not state["frames"] or not all(type(frame) is int for frame in state["frames"]):
        raise _damaged(path, "its frames are not numbers")
    return state


def is_state_file(path: Path) -> bool:
    """Return whether a file is a state file, wherever it lies, or has its name."""
    held = read_object(path)
    is_one = all(isinstance(held.get(name), kind) for name, kind in _TYPES.items())
    return is_one or (path.name == STATE and (path.parent / MODEL).is_dir())


def write_state(path: Path, state: dict[str, Any]) -> None:
    """Write `solve.json` with its own digest, durably: a later change is noticed. Raises OSError."""
    as_read = json.loads(json.dumps(state))
    path.write_text(json.dumps(as_read | {DIGEST: _digest(as_read)}, indent=1), encoding="utf-8")
    atomic.sync(path)


def _digest(state: dict[str, Any]) -> str:
    """64 hexadecimal digits of a state, in whichever order it is."""
    return hashlib.sha256(json.dumps(state, sort_keys=True).encode()).hexdigest()


def _damaged(path: Path, why: str) -> UnusableStateError:
    return UnusableStateError(
        f"{path} is damaged ({why}); restore it, or solve again in its place", Remedy.AGAIN
    )


def check_model(model: Path, state: dict[str, Any]) -> None:
    """Check that a model is the one of a state; a state edited by hand may lack this.

    Raises:
        UserError: A file, which is named, is another one.
    """
    digests = state.get("model", {})
    for name, digest in digests.items() if isinstance(digests, dict) else ():
        path = model / str(name)
        if not path.is_file():
            raise UserError(f"{path} is missing; restore it, or solve again in its place", Remedy.AGAIN)
        if file_digest(path) != digest:
            raise UserError(
                f"{path} was changed or damaged after the solve; restore it, solve again in its place, or"
                " import your changes into another folder",
                Remedy.AGAIN,
            )


def recorded_places(work_dir: Path, state: dict[str, Any]) -> list[Path]:
    """Return possible paths of a state's clip: relative to the folder, which may have moved, and absolute."""
    beside = [(work_dir / state["relative"]).resolve()] if state["relative"] else []
    return [*beside, Path(state["footage"])]


class Staging:
    """A folder within the working folder in which a solve comes to be: kept whole, or gone without a trace.

    While it lasts nobody else can have one there. Raises UserError where no folder can be made, or somebody
    else has one.
    """

    def __init__(self, work_dir: Path) -> None:
        self.work_dir = checked_name(work_dir)
        self._made: Path | None = None
        self._lock: FolderLock | None = None
        try:
            if not work_dir.exists():
                self._made = next(p for p in [*reversed(work_dir.parents), work_dir] if not p.exists())
                work_dir.mkdir(parents=True, exist_ok=True)
            self._lock = FolderLock(work_dir)
            recover(work_dir, self._lock)
            self._before = _state_bytes(work_dir)
            self.folder = work_dir / atomic.owned_name(PREFIX)
            self.folder.mkdir()
        except OSError as error:
            self._let_go()
            raise UserError(
                f"the working folder {work_dir} cannot be solved into: {error.strerror}"
            ) from None
        except UserError:
            self._let_go()
            raise

    def keep(self, footage: Footage, clip_identity: str, options: dict[str, Any], figures: Figures) -> None:
        """Move `model` into place, the state file last, as it makes the folder a solve.

        Args:
            footage: The clip.
            clip_identity: Identity of the clip before it was solved.
            options: Options that distinguish this solve from others of the clip.
            figures: Those of the solver or reader.

        Raises:
            UserError: It cannot be moved; the old solve is unchanged.
        """
        if identity(footage.path) != clip_identity:
            raise UserError(f"the clip {footage.path} changed while it was being solved; solve it again")
        if _state_bytes(self.work_dir) != self._before:
            # Where no locks are known, nobody was kept from it.
            raise UserError(
                f"another solve was written to {self.work_dir} in the meantime; choose another folder",
                Remedy.WORK_DIR,
            )
        model, old = self.work_dir / MODEL, self.folder / OLD
        try:
            files = sorted((self.folder / MODEL).iterdir())
            state = {
                "version": VERSION,
                "footage": str(footage.path),
                "relative": _relative(footage.path, self.work_dir),
                "identity": clip_identity,
                "frames": footage.frames,
                "video": asdict(video_info(footage.path)) if footage.is_video else None,
                **options,
                "pixel_aspect": footage.pixel_aspect,
                "report": figures.as_dict(),
                "model": {path.name: file_digest(path) for path in files},
            }
            for path in files:
                atomic.sync(path)
            write_state(self.folder / STATE, state)
            if model.exists():
                model.rename(old)
            (self.folder / MODEL).rename(model)
            atomic.publish(self.folder / STATE, self.work_dir / STATE)
        except OSError as error:
            if old.exists():
                shutil.rmtree(model, ignore_errors=True)
                old.rename(model)
            self.discard()
            raise UserError(
                f"the solve cannot be moved into {self.work_dir}: {error.strerror}; the old one was kept"
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


def recover(work_dir: Path, lock: FolderLock | None = None) -> None:
    """Remove the remains of dead processes from a working folder; unfinished moves are completed.

    It is harmless beside others that do the same, and during a solve. `lock` is the caller's own.
    """
    if lock is not None and lock.is_locked:
        # The maker of another one had the lock, and has released it.
        left = [path for path in work_dir.iterdir() if path.name.startswith(PREFIX)]
    else:
        left = atomic.orphans(work_dir, PREFIX, work_dir / NAME)
    for folder in left:
        with contextlib.suppress(OSError):
            _finish_moving(work_dir, folder)
            shutil.rmtree(folder)
    atomic.collect_orphans(work_dir)


def _finish_moving(work_dir: Path, folder: Path) -> None:
    """Complete a move of `Staging.keep` out of a folder: the model is moved before its state."""
    if not (work_dir / MODEL).exists() and (folder / OLD).exists():
        (folder / OLD).rename(work_dir / MODEL)
        return
    try:
        state = json.loads(read_regular(folder / STATE, LONGEST))
        if state["model"]:
            check_model(work_dir / MODEL, state)
            (folder / STATE).replace(work_dir / STATE)
    except (UserError, ValueError, KeyError, TypeError, OSError):
        # There is none, or the model in place is not its.
        return


def _state_bytes(work_dir: Path) -> bytes | None:
    try:
        return read_regular(work_dir / STATE, LONGEST)
    except FileNotFoundError:
        return None


def _relative(path: Path, folder: Path) -> str:
    try:
        # Slashes are understood everywhere, backslashes are not.
        return os.path.relpath(path, folder).replace(os.sep, "/")
    except ValueError:  # another drive
        return ""
