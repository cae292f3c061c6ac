"""The folder beside a movie with its frames, until it is complete.

A mark in it names its owner, and only files of this program are replaced or removed there.
"""

import contextlib
import re
from pathlib import Path

from ...core.base import atomic
from ...core.base.errors import UserError
from . import frame_files

MARK = ".virtual-aperture-movie"
"""File in the folder that names the movie: written before the first frame, removed after the last."""
FRAMES = "######"
"""Stem of their names; they are PNG, or EXR where the movie has more light than white."""
LITTER = {".DS_Store", "Thumbs.db", "desktop.ini"}
"""Files that file managers put into opened folders."""
_FRAME = re.compile(r"-?\d{5,}\.(png|exr)")


def folder_of(out: Path) -> Path:
    """Return the folder of a movie's frames until it is complete."""
    return out.with_name(f"{out.name}.frames")


def check_free(out: Path) -> None:
    """Check that the folder of a movie's frames is free; an empty folder is.

    Raises:
        UserError: It is a file or a link, or holds files of something else, which are named.
    """
    folder = folder_of(out)
    why = f"the frames of {out.name} are kept in {folder} until it is complete"
    try:
        if folder.is_symlink() or folder.is_junction():
            raise UserError(f"{folder} is a link, and {why}; remove the link, or choose another movie name")
        if folder.exists() and not folder.is_dir():
            raise UserError(f"{folder} is a file, and {why}; move it away, or choose another movie name")
        strangers = _strangers(out) if folder.exists() else []
    except OSError as error:
        raise UserError(f"{folder} cannot be read: {error.strerror}; choose another movie name") from None
    if strangers:
        raise UserError(
            f"{strangers[0]} does not come from a run that makes {out.name}, or was changed since, and"
            f" {why}; move it away, or choose another movie name"
        )


def check_not_kept(folder: Path) -> None:
    """Check that a folder for frames is not one that is removed with a complete movie.

    Raises:
        UserError: It is.
    """
    if (folder / MARK).exists():
        raise UserError(
            f"{folder} keeps the frames of a movie and is removed when that is complete; write to another"
            " folder"
        )


def prepare(out: Path) -> Path:
    """Make and mark the folder, and take over the frames of an earlier run of the movie.

    Raises:
        UserError: As of `check_free`; or frames were changed after they were rendered.
    """
    check_free(out)
    folder = folder_of(out)
    if not _is_marked(out):
        atomic.write_bytes(folder / MARK, _mark_of(out))
    for path in sorted(folder.iterdir()):
        if _is_frame(path) and frame_files.is_changed(path) and not frame_files.still_problem(path):
            raise UserError(
                f"{path} was changed after it was rendered; move it away, or delete it to have it rendered"
                " again"
            )
    return folder


def clear(out: Path) -> list[Path]:
    """Remove this program's frames, and the folder if it is empty then; returns the remaining files."""
    folder = folder_of(out)
    atomic.collect_orphans(folder)
    with contextlib.suppress(OSError, UserError):
        for path in folder.iterdir():
            if _is_frame(path) and not frame_files.is_changed(path):
                path.unlink()
        ours = {MARK, *LITTER}
        if left := sorted(path for path in folder.iterdir() if path.name not in ours):
            return left
        # The mark last: a folder without one is not touched again.
        for name in (*LITTER, MARK):
            (folder / name).unlink(missing_ok=True)
        folder.rmdir()
    return []


def _strangers(out: Path) -> list[Path]:
    """Files in the folder that are not of a run of its movie."""
    is_marked = _is_marked(out)
    return [
        path
        for path in sorted(folder_of(out).iterdir())
        if path.name not in LITTER and not (is_marked and _is_ours(path)) and not _is_unfinished_mark(path)
    ]


def _is_ours(path: Path) -> bool:
    return path.name == MARK or path.name.startswith(atomic.PART) or _is_frame(path)


def _is_unfinished_mark(path: Path) -> bool:
    """Return whether a mark is left of a run that ended before its first frame."""
    return path.name.startswith(atomic.PART) and path.name.endswith((MARK, ".lock"))


def _is_frame(path: Path) -> bool:
    """Return whether a file is a frame with a key; an empty one was cut off by a power failure."""
    if _FRAME.fullmatch(path.name) is None or path.is_symlink() or not path.is_file():
        return False
    return not path.stat().st_size or frame_files.key_of(path) is not None


def _is_marked(out: Path) -> bool:
    mark = folder_of(out) / MARK
    return mark.is_file() and not mark.is_symlink() and mark.read_bytes() == _mark_of(out)


def _mark_of(out: Path) -> bytes:
    return f"Virtual Aperture keeps the frames of {out.name} here until the movie is complete.\n".encode()
