"""Locks against two solves in one working folder, or two runs for one movie."""

import contextlib
from pathlib import Path

from .errors import Remedy, UserError
from .file_lock import FileLock, is_abandoned, owner_of

NAME = ".solving.lock"
OUTPUT = ".virtual-aperture-"
"""Prefix of an output's lock, which ends in .lock."""


class FolderLock(FileLock):
    """Holds an existing folder for solving; raises UserError with the owner's name if it is held."""

    def __init__(self, folder: Path) -> None:
        super().__init__(
            folder / NAME,
            lambda who: UserError(
                f"{folder} is being solved into{who}; wait for it, cancel it, or choose another folder",
                Remedy.WORK_DIR,
            ),
        )


class OutputLock(FileLock):
    """Holds an output file and makes its folder; raises UserError if it is held or cannot be written."""

    def __init__(self, out: Path) -> None:
        try:
            out.parent.mkdir(parents=True, exist_ok=True)
            collect_locks(out.parent)
            super().__init__(
                out.with_name(f"{OUTPUT}{out.name}.lock"),
                lambda who: UserError(
                    f"{out} is being written{who}; wait for it, cancel it, or choose another file"
                ),
            )
        except OSError as error:
            raise UserError(f"{out} cannot be written: {error.strerror or error}") from error


def collect_locks(folder: Path) -> None:
    """Remove the output locks whose owners have ended."""
    for path in folder.glob(f"{OUTPUT}*.lock"):
        owner = owner_of(path)
        pid = owner.get("pid")
        if is_abandoned(path, str(owner.get("table")), pid if isinstance(pid, int) else 0):
            with contextlib.suppress(UserError, OSError):
                FileLock(path, UserError).release()
