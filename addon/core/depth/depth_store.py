"""Depth kept on disk beside the solve: results that do not depend on the lens are found once.

FOLDER/KEY/depth-000123.npz    a frame's inverse depth in 12 bits, its confidence in 4, its moving pixels, and
                               inverse depth past its border
FOLDER/KEY/moving-SUBJECT-000123.npz   the probability of a subject in a frame
FOLDER/KEY/moving-SUBJECT-sizes.npz   the sizes of a subject through the clip
FOLDER/KEY/moving-people.npz   the people of the clip, each in the frame of their detection
FOLDER/KEY/moving-objects.npz   the strokes that mark the other moving objects of the clip
FOLDER/KEY/single-000123.npz, coarse-000123.npz   depth of a key frame, and of a source frame of the static
                               scene, before fusion with others
FOLDER/KEY/lost-THRESHOLD-000123.npz, lamps-THRESHOLD-000123.npz   the clipped light of a frame, and
                               estimates from the rims of its highlights (`frame/kept_highlights.py`)
FOLDER/KEY/clip-noise.npz, clip-lens.npz   numbers of the whole clip

KEY is a digest of all inputs. A file that is damaged, or of another size, does not exist. Processes that
work on the same clip share kept results: each makes those that no other is making (`made`).
"""

from __future__ import annotations

import contextlib
import io
import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base import atomic, limits
from ..base.arrays import Bytes, Floats, Map, Mask
from ..base.errors import Remedy, UserError
from ..base.file_lock import FileLock
from ..base.npz import read_arrays
from ..base.progress import checkpoint

FINEST = 4095
"""Steps from a frame's least inverse depth to its largest: 0.02 pixels where a disc has 96. With 65535 a
file is twice as large, of noise."""
UNKNOWN = FINEST + 1
"""Instead of a step, where nothing is known."""
MAPS: dict[str, type[np.generic]] = {
    "inverse": np.uint16, "confidence": np.uint8, "moving": np.uint8, "past": np.uint16,
}  # fmt: skip
"""Pictures in a frame's file, and their types."""
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
SUREST = 15
"""Steps of confidence from 0 to 1; it is compared with thresholds only."""


@dataclass(frozen=True)
class KeptDepth:
    """A frame's depth as it is kept: the same whether it was just found or is read again."""

    inverse_depth: Map
    """(h, w) 1 / z, in 1 / scene units."""
    confidence: Map
    """(h, w) in [0, 1]."""
    moving: Mask
    """(h, w) moving pixels."""
    past_border: Map
    """(h + 2 m, w + 2 m) 1 / z past the border, NaN where it is not known."""
    steps: dict[str, NDArray[np.generic]]
    """The pictures `MAPS` of its file, and ranges of inverse depth."""

    @classmethod
    def of(
        cls, inverse_depth: Map, confidence: Map, moving: Mask, past_border: Map | None = None
    ) -> KeptDepth:
        """Encode a frame's depth; the arguments have the shapes of the fields."""
        beyond = np.full(inverse_depth.shape, np.nan, np.float32) if past_border is None else past_border
        (inverse, span), (past, past_span) = _in_steps(inverse_depth), _in_steps(beyond)
        sure = np.rint(SUREST * confidence).astype(np.uint8)
        return cls._of_steps({
            "inverse": inverse, "confidence": sure, "moving": moving.astype(np.uint8), "past": past,
            "range": span, "past_range": past_span,
        })  # fmt: skip

    @classmethod
    def _of_steps(cls, steps: dict[str, NDArray[np.generic]]) -> KeptDepth:
        inverse = _from_steps(steps["inverse"], steps["range"])
        past = _from_steps(steps["past"], steps["past_range"])
        sure = steps["confidence"].astype(np.float32) / np.float32(SUREST)
        return cls(inverse, sure, steps["moving"].astype(bool), past, steps)

    @classmethod
    def read(cls, parts: dict[str, NDArray[np.generic]], shape: tuple[int, ...]) -> KeptDepth | None:
        """Decode the arrays of a file; None if they are damaged or of another shape than (h, w)."""
        maps = {name: decoded(parts[name], 3 * max(shape)) for name in MAPS}
        found = {name: one for name, one in maps.items() if one is not None and one.dtype == MAPS[name]}
        if set(found) != set(MAPS) or any(parts[name].shape != (2,) for name in ("range", "past_range")):
            return None
        past = found["past"].shape
        around = past[0] - shape[0]
        fit = [found[name].shape == shape for name in ("inverse", "confidence", "moving")]
        if not all(fit) or around < 0 or around % 2 or past != (shape[0] + around, shape[1] + around):
            return None
        return cls._of_steps(parts | found)


def _in_steps(inverse_depth: Map) -> tuple[NDArray[np.uint16], Floats]:
    """Return inverse depth (h, w), NaN in unknown pixels, in steps; and the least one and a step (2,)."""
    known = ~np.isnan(inverse_depth)
    low = float(np.min(inverse_depth, initial=np.inf, where=known)) if known.any() else 0.0
    high = float(np.max(inverse_depth, initial=low, where=known))
    step = max((high - low) / FINEST, float(np.finfo(np.float32).tiny))
    steps = np.rint((inverse_depth - low) / step).clip(0, FINEST)
    return np.where(known, steps, UNKNOWN).astype(np.uint16), np.array([low, step])


def _from_steps(steps: NDArray[np.generic], span: NDArray[np.generic]) -> Map:
    """Return the inverse depth (h, w) of `_in_steps`."""
    low, step = (np.float32(each) for each in span.tolist())
    return np.where(steps == UNKNOWN, np.float32(np.nan), low + np.asarray(steps, np.uint16) * step)


class DepthStore:
    """The kept depth of one clip's frames.

    If the disk is full or not writable, nothing is raised: less is kept, and `problem` has the reason.
    """

    def __init__(self, folder: Path, key: Callable[[], str], most: int | None = None) -> None:
        """Open a store.

        Args:
            folder: Folder of all keys.
            key: Returns the key of the present inputs; results are not kept after it changes.
            most: Most bytes in the folder; the keys not written to for longest are removed. Without it the
                user's limit counts (`limits.most_kept_depth`).
        """
        self._key, self._key_now = key(), key
        self._folder, self._most = folder / self._key, most or limits.most_kept_depth()
        self._taken, self._counted = 0, -math.inf
        self.problem: UserError | None = None
        """Why the last thing that was to be kept is not; None where it is."""

    def depth(self, frame: int, shape: tuple[int, int], kind: str = "depth") -> KeptDepth | None:
        """Return a frame's kept depth of a shape (h, w) and one of `KINDS`; None if there is none."""
        kept = self.read(f"{kind}-{frame:06d}", (*MAPS, "range", "past_range"))
        return None if kept is None else KeptDepth.read(kept, shape)

    def keep_depth(self, frame: int, depth: KeptDepth, kind: str = "depth") -> None:
        """Keep a frame's depth, of one of `KINDS`."""
        parts = {name: encoded(each) if name in MAPS else each for name, each in depth.steps.items()}
        self.write(f"{kind}-{frame:06d}", parts)

    def made[R](
        self,
        frames: Sequence[int],
        name: Callable[[int], str],
        read: Callable[[int], R | None],
        make: Callable[[int], R],
    ) -> dict[int, R]:
        """Return a result for each frame, kept or made.

        Frames that another process is working on are waited for, after all others, so that processes share
        the work. A single frame is made at once: processes share its inputs. `name` returns the name of a
        frame's file, `read` the kept result or None, and `make` makes and keeps one.
        """
        found, left = dict[int, R](), list(frames)
        until = time.monotonic() + PATIENCE
        while left:
            waiting = []
            for frame in left:
                there = read(frame)
                if there is None:
                    with self._claimed(name(frame)) if len(frames) > 1 else nullcontext(True) as is_mine:
                        if not is_mine and time.monotonic() < until:
                            waiting.append(frame)
                            continue
                        # The process with the claim may just have kept it.
                        there = read(frame) if len(frames) > 1 else None
                        there = make(frame) if there is None else there
                    until = time.monotonic() + PATIENCE
                found[frame] = there
            if waiting == left:
                checkpoint()
                time.sleep(PAUSE)
            left = waiting
        return found

    def once[R](self, name: str, read: Callable[[], R | None], make: Callable[[], R]) -> R:
        """Return a result of the whole clip, kept or made; other processes that need it wait meanwhile.

        `name` is that of its file, `read` returns the kept result or None, and `make` makes and keeps it.
        """
        until = time.monotonic() + LONG_PATIENCE
        while (there := read()) is None:
            with self._claimed(name) as is_mine:
                if is_mine or time.monotonic() > until:
                    # The process with the claim may just have kept it.
                    there = read()
                    return make() if there is None else there
            checkpoint()
            time.sleep(PAUSE)
        return there

    @contextlib.contextmanager
    def _claimed(self, name: str) -> Iterator[bool]:
        """Claim a file against other processes; yields whether the claim succeeded.

        Without file locks each process makes its own.
        """
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            lock = FileLock(self._folder / f"{name}.lock", UserError, patience=0)
        except UserError:
            yield False
        except OSError:
            yield True
        else:
            with lock:
                yield True

    def is_kept(self, name: str) -> bool:
        """Return whether there is a file of a name, which begins as one of `KINDS`; it may be damaged."""
        return (self._folder / f"{name}.npz").exists()

    def read(self, name: str, parts: tuple[str, ...]) -> dict[str, NDArray[np.generic]] | None:
        """Return arrays by name from a kept file; None if it is missing or damaged."""
        path = self._folder / f"{name}.npz"
        try:
            # It is not compressed once more.
            return read_arrays(path, parts, path.stat().st_size)
        except (OSError, ValueError):
            return None

    def write(self, name: str, parts: dict[str, NDArray[np.generic]]) -> None:
        """Keep arrays by name in the file of a name, which begins as one of `KINDS`."""
        data = io.BytesIO()
        np.savez(data, allow_pickle=False, **parts)
        # It is only kept for later: a frame that is asked for must not fail of it.
        self.problem = None
        try:
            if self._key_now() != self._key:
                raise UserError("the clip, its solve or its masks have changed in the meantime")
            if not self._has_room(data.tell(), name.startswith(KINDS[0])):
                raise UserError(
                    f"no more than {self._most} bytes of depth are kept for a clip; allow more",
                    Remedy.KEPT_DEPTH,
                )
            atomic.write_bytes(self._folder / f"{name}.npz", data.getvalue())
            self._taken += data.tell()
        except OSError as error:
            self.problem = UserError(f"{self._folder} cannot be written: {error.strerror or error}")
        except UserError as error:
            # Without the traceback, which holds all that was to be written.
            self.problem = UserError(str(error), *error.remedies)

    def _has_room(self, more: int, goes_first: bool) -> bool:
        """Return whether more bytes fit.

        For files that go first, files of other keys are removed for it, the oldest first, and then own ones
        of intermediate results.
        """
        if time.monotonic() > self._counted + RECOUNT:
            if self._counted < 0:
                atomic.collect_orphans(self._folder)
            self._counted = time.monotonic()
            self._taken = sum(_size(folder) for folder in _folders(self._folder.parent))
        if goes_first:
            for folder in sorted(_folders(self._folder.parent), key=_written):
                if self._taken + more > self._most and folder != self._folder:
                    self._taken -= _delete(folder)
            if self._taken + more > self._most:
                self._taken -= _delete(self._folder, KINDS[1:])
        return self._taken + more <= self._most


def kept_numbers(
    store: DepthStore | None, name: str, counts: Sequence[int], make: Callable[[], Floats]
) -> Floats:
    """Read numbers (n,) stored under a name, or compute and store them; n is one of `counts`."""

    def read() -> Floats | None:
        kept = store.read(name, ("numbers",)) if store else None
        numbers = np.zeros((0, 0)) if kept is None else kept["numbers"]
        is_whole = numbers.ndim == 1 and len(numbers) in counts and numbers.dtype == np.float64
        return np.asarray(numbers, np.float64) if is_whole and np.isfinite(numbers).all() else None

    def made() -> Floats:
        numbers = np.asarray(make(), np.float64)
        if store:
            store.write(name, {"numbers": numbers})
        return numbers

    return store.once(name, read, made) if store else made()


def kept_size(folder: Path) -> int:
    """Return the bytes of the kept depth in a folder, of all keys; 0 without any."""
    return sum(_size(each) for each in _folders(folder))


def delete_kept(folder: Path) -> int:
    """Delete the kept depth in a folder, of all keys, and nothing else; how many bytes that frees.

    OSError where a file cannot be deleted.
    """
    freed = 0
    for each in _folders(folder):
        freed += _delete(each)
    return freed


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
