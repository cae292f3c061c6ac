"""Results kept on disk beside the solve that do not depend on the lens: each is made once.

FOLDER/KEY/depth-000123.npz    a frame's depth (`depth/stored_depth.py`)
FOLDER/KEY/single-000123.npz, coarse-000123.npz   depth of a key frame, and of a source frame of the static
                               scene, before fusion with others
FOLDER/KEY/moving-SUBJECT-000123.npz   the probability of a subject in a frame
FOLDER/KEY/moving-SUBJECT-sizes.npz   the sizes of a subject through the clip
FOLDER/KEY/moving-people.npz   the people of the clip, each in the frame of their detection
FOLDER/KEY/moving-objects.npz   the strokes that mark the other moving objects of the clip
FOLDER/KEY/lost-THRESHOLD-000123.npz, lamps-THRESHOLD-000123.npz   the clipped light of a frame, and
                               estimates from the rims of its highlights (`frame/kept_highlights.py`)
FOLDER/KEY/clip-noise.npz, clip-fixed.npz   numbers of the whole clip, and its fixed pixels

KEY is a digest of all inputs. A file that is damaged, or of another size, does not exist. Processes that
work on the same clip share kept results: each makes those that no other is making (`made`).
"""

from __future__ import annotations

import contextlib
import io
import math
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from . import atomic, limits
from .arrays import Bytes, Floats
from .errors import Remedy, UserError
from .file_lock import claimed
from .npz import read_arrays
from .progress import checkpoint

PNG = b"\x89PNG\r\n\x1a\n"
"""Begins a PNG, whose width and height stand at its 17th byte (ISO/IEC 15948)."""
LONGEST_SIDE = 16384
"""Pixels of a mask at most, as of any picture that is drawn."""
KINDS = "depth", "moving", "single", "coarse", "lost", "lamps", "clip"
"""Prefixes of file names; files of other keys go where there is no room for the first kind."""
RECOUNT = 10.0
"""Seconds after which files are counted again, which other processes write, too."""
PAUSE, PATIENCE = 0.03, 60.0
"""Seconds between two looks whether another process has made what is needed, and until it is made here
instead: that one may be stopped. Chosen by inspection."""
LONG_PATIENCE = 300.0
"""The same for a result of the whole clip, which takes minutes."""
Arrays = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Entry[R]:
    """A file of a store, and how its arrays become a result."""

    name: str
    """Begins as one of `KINDS`."""
    parts: tuple[str, ...]
    """Names of its arrays; planes (h, w) of uint8 and uint16 are stored as PNG."""
    encode: Callable[[R], Arrays]
    """Returns the arrays of a result."""
    decode: Callable[[Arrays], R | None]
    """Returns the result of such arrays; None if they are damaged, or of another size."""
    longest: int = LONGEST_SIDE
    """Most pixels of a plane's side."""
    rounds: bool = False
    """True if arrays are less exact than a result: it is then decoded from them even if it was just made."""


def numbers(name: str, *counts: int) -> Entry[Floats]:
    """Return the entry of finite numbers (n,), where n is one of `counts`."""

    def decode(parts: Arrays) -> Floats | None:
        row = parts["numbers"]
        is_whole = row.ndim == 1 and len(row) in counts and row.dtype == np.float64
        return row if is_whole and np.isfinite(row).all() else None

    return Entry(name, ("numbers",), lambda row: {"numbers": np.asarray(row, np.float64)}, decode)


class Store:
    """The kept results of one clip.

    If the disk is full or not writable, nothing is raised: less is kept, and `problem` has the reason.
    """

    def __init__(
        self, folder: Path | None = None, key: Callable[[], str] = str, most: int | None = None
    ) -> None:
        """Open a store.

        Args:
            folder: Folder of all keys; without it nothing is kept.
            key: Returns the key of the present inputs; results are not kept after it changes.
            most: Most bytes in the folder; the keys not written to for longest are removed. Without it the
                user's limit counts (`limits.most_kept_depth`).
        """
        self._key, self._key_now = key(), key
        self._folder, self._most = folder and folder / self._key, most or limits.most_kept_depth()
        self._taken, self._counted = 0, -math.inf
        self.problem: UserError | None = None
        """Why the last result that was to be kept is not; None where it is."""

    def read[R](self, entry: Entry[R]) -> R | None:
        """Return a kept result; None if it is missing or damaged."""
        try:
            # It is not compressed once more.
            path = self._path(entry.name)
            parts = read_arrays(path, entry.parts, path.stat().st_size)
        except (OSError, ValueError):
            return None
        for name, part in parts.items():
            plane = decoded(part, entry.longest) if part.dtype == np.uint8 else part
            if plane is None:
                return None
            parts[name] = plane
        return entry.decode(parts)

    def get[R](self, entry: Entry[R], make: Callable[[], R]) -> R:
        """Return a result, kept or made at once; it is the same in both cases."""
        if (found := self.read(entry)) is not None:
            return found
        value = make()
        parts = entry.encode(value)
        self.write(entry.name, parts)
        rounded = entry.decode(parts) if entry.rounds else None
        return value if rounded is None else rounded

    def once[R](self, entry: Entry[R], make: Callable[[], R]) -> R:
        """Return a result of the whole clip, kept or made; other processes that need it wait meanwhile."""
        return self._shared({0: entry}, lambda _: make(), LONG_PATIENCE)[0]

    def made[R](self, entries: Mapping[int, Entry[R]], make: Callable[[int], R]) -> dict[int, R]:
        """Return the results of frames by their entries, kept or made.

        Frames that another process is working on are waited for, after all others, so that processes share
        the work. A single frame is made at once: processes share its inputs.
        """
        if len(entries) == 1:
            return {frame: self.get(entry, partial(make, frame)) for frame, entry in entries.items()}
        return self._shared(entries, make, PATIENCE)

    def _shared[R](
        self, entries: Mapping[int, Entry[R]], make: Callable[[int], R], patience: float
    ) -> dict[int, R]:
        found, left = dict[int, R](), list(entries)
        until = time.monotonic() + patience
        while left:
            waiting = []
            for frame in left:
                there = self.read(entries[frame])
                if there is None:
                    with self._claimed(entries[frame].name) as is_mine:
                        if not is_mine and time.monotonic() < until:
                            waiting.append(frame)
                            continue
                        # The process with the claim may just have kept it.
                        there = self.get(entries[frame], partial(make, frame))
                    until = time.monotonic() + patience
                found[frame] = there
            if waiting == left:
                checkpoint()
                time.sleep(PAUSE)
            left = waiting
        return found

    def _claimed(self, name: str) -> AbstractContextManager[bool]:
        """Claim a file against other processes; enters with whether the claim succeeded."""
        if self._folder is None:
            return nullcontext(True)
        with contextlib.suppress(OSError):
            self._folder.mkdir(parents=True, exist_ok=True)
        return claimed(self._folder / f"{name}.lock")

    def _path(self, name: str) -> Path:
        """Return the file of a name; raises FileNotFoundError where nothing is kept."""
        if self._folder is None:
            raise FileNotFoundError
        return self._folder / f"{name}.npz"

    def is_kept(self, name: str) -> bool:
        """Return whether there is a file of a name, which begins as one of `KINDS`; it may be damaged."""
        return self._folder is not None and self._path(name).exists()

    def write(self, name: str, parts: Arrays) -> None:
        """Keep arrays by name in the file of a name, which begins as one of `KINDS`."""
        if self._folder is None:
            return
        data = io.BytesIO()
        packed = {
            part: encoded(each) if each.ndim == 2 and each.dtype in (np.uint8, np.uint16) else each
            for part, each in parts.items()
        }
        np.savez(data, allow_pickle=False, **packed)
        # It is only kept for later: a frame that is asked for must not fail of it.
        self.problem = None
        try:
            if self._key_now() != self._key:
                raise UserError("the clip, its solve or its masks have changed in the meantime")
            if not self._has_room(self._folder, data.tell(), name.startswith(KINDS[0])):
                raise UserError(
                    f"no more than {self._most} bytes of depth are kept for a clip; allow more",
                    Remedy.KEPT_DEPTH,
                )
            atomic.write_bytes(self._path(name), data.getvalue())
            self._taken += data.tell()
        except OSError as error:
            self.problem = UserError(f"{self._folder} cannot be written: {error.strerror or error}")
        except UserError as error:
            # Without the traceback, which holds all that was to be written.
            self.problem = UserError(str(error), *error.remedies)

    def _has_room(self, folder: Path, more: int, goes_first: bool) -> bool:
        """Return whether more bytes fit.

        For files that go first, files of other keys are removed for it, the oldest first, and then own ones
        of intermediate results.
        """
        every = folder.parent
        if time.monotonic() > self._counted + RECOUNT:
            if self._counted < 0:
                atomic.collect_orphans(folder)
            self._counted = time.monotonic()
            self._taken = sum(_size(each) for each in _folders(every))
        if goes_first:
            for other in sorted(_folders(every), key=_written):
                if self._taken + more > self._most and other != folder:
                    self._taken -= _delete(other)
            if self._taken + more > self._most:
                self._taken -= _delete(folder, KINDS[1:])
        return self._taken + more <= self._most


NOT_KEPT = Store()
"""Keeps nothing."""


def kept_size(folder: Path) -> int:
    """Return the bytes of the kept depth in a folder, of all keys; 0 without any."""
    return sum(_size(each) for each in _folders(folder))


def delete_kept(folder: Path) -> int:
    """Delete the kept depth in a folder, of all keys, and nothing else; how many bytes that frees.

    OSError where a file cannot be deleted.
    """
    return sum(_delete(each) for each in _folders(folder))


def encoded(plane: NDArray[np.generic]) -> Bytes:
    """Return a plane (h, w) as a PNG file's bytes (n,)."""
    # A fifth of the time of level 6, for a sixth more bytes.
    how = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE]
    return np.asarray(cv2.imencode(".png", plane, how)[1], np.uint8)


def decoded(data: NDArray[np.generic], longest: int) -> NDArray[np.generic] | None:
    """Return a PNG's plane (h, w); None where it is damaged, or a side longer than it can be."""
    sides = np.frombuffer(data.tobytes()[16:24], ">u4")
    if data.tobytes()[:8] != PNG or len(sides) < 2 or sides.max() > longest:
        return None
    with contextlib.suppress(cv2.error):
        return cv2.imdecode(np.asarray(data, np.uint8), cv2.IMREAD_UNCHANGED)
    return None


def _folders(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if path.is_dir()] if folder.is_dir() else []


def _kept_files(folder: Path, kinds: Sequence[str] = KINDS) -> list[Path]:
    return [path for kind in kinds for path in folder.glob(f"{kind}-*.npz")]


def _delete(folder: Path, kinds: Sequence[str] = KINDS) -> int:
    """Delete a key's files of some kinds; how many bytes that frees."""
    freed = 0
    for path in _kept_files(folder, kinds):
        # Another process may have been first.
        with contextlib.suppress(FileNotFoundError):
            freed += path.stat().st_size
            path.unlink()
    # Whatever else lies there is not ours.
    with contextlib.suppress(OSError):
        folder.rmdir()
    return freed


def _written(folder: Path) -> float:
    """When a folder was written to; 0 where it is gone."""
    try:
        return folder.stat().st_mtime
    except FileNotFoundError:
        return 0.0


def _size(folder: Path) -> int:
    size = 0
    for path in _kept_files(folder):
        with contextlib.suppress(FileNotFoundError):
            size += path.stat().st_size
    return size
