"""2D feature tracks through a clip.

Corners followed by optical flow are as accurate as SIFT on video, several times cheaper, and keep their
points where texture is weak; SIFT's descriptors find a feature again that was hidden for a while.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Bytes, Floats, Ints, Mask
from ...base.counting import counted
from ...base.errors import Remedy, UserError
from ...media.clip import Footage
from ...media.light import to_gray8, to_rgb8
from ...media.picture_file import Pixels
from ..steps import progress
from .klt import TwoScales, new_corners
from .sift import Matcher

Step = Callable[[Bytes], tuple[NDArray[np.int64], NDArray[np.float32]]]
"""Called with one frame (H, W) after the other. Returns track numbers (n,), ascending, those of new tracks
following on the old ones', and places (n, 2), OpenCV's: the first pixel's middle at (0, 0)."""
Watch = Callable[[Pixels, Floats], None]
"""Called with each frame (H, W, 3 or 4) as stored and its features (n, 2), as fractions of its size."""
# Chosen by inspection of tracks.
LONG_SIDE = 960
"""Pixels of the longer side; larger frames are shrunk for tracking."""
SHORT_SIDE = 16
"""Least pixels of the shorter side, once reduced: features need room."""
MIN_CORRELATION = 0.35
"""Correlation of a frame with the one before, shifted to fit, below which it shows something else."""
THUMBNAIL = 64
"""Width in pixels at which frames are compared."""
MIN_OVERLAP = 0.4
"""Share of the picture, at least, that two frames shifted to fit have in common."""


@dataclass(frozen=True)
class Tracks:
    """Observations of features, sorted by frame. A track may miss frames."""

    frames: tuple[int, ...]
    """Frame numbers of the clip."""
    width: int
    height: int
    frame_index: Ints
    """(m,) index into `frames`."""
    track: Ints
    """(m,) track number, 0 to `count` - 1, ascending within a frame."""
    xy: Floats
    """(m, 2) pixels of the source frame, first pixel centre at (0.5, 0.5)."""
    rgb: NDArray[np.uint8]
    """(count, 3) sRGB colour where the track begins."""
    correlations: Floats = field(default_factory=lambda: np.zeros(0))
    """(F,) correlation of each frame with the one before, shifted to fit; empty where it is not known."""

    @property
    def count(self) -> int:
        """Number of tracks."""
        return len(self.rgb)

    def only(self, rows: Mask) -> Tracks:
        """Return the observations of a mask (m,); tracks keep their numbers."""
        return replace(self, frame_index=self.frame_index[rows], track=self.track[rows], xy=self.xy[rows])

    def in_frame(self, index: int) -> tuple[Ints, Floats]:
        """Track numbers (n,), ascending, and positions (n, 2) of one frame."""
        # In the array's own type: searched for another, all of it is converted first.
        low, high = np.searchsorted(self.frame_index, np.array([index, index + 1], self.frame_index.dtype))
        return self.track[low:high], self.xy[low:high]

    def shared(self, i: int, j: int) -> tuple[Floats, Floats]:
        """Return the places (n, 2) and (n, 2) of the tracks that two frames share."""
        (before, a), (after, b) = self.in_frame(i), self.in_frame(j)
        _, at_a, at_b = np.intersect1d(before, after, assume_unique=True, return_indices=True)
        return a[at_a], b[at_b]


def track_features(footage: Footage, watch: Watch = lambda *_: None) -> Tracks:
    """Follow Harris corners by optical flow through all frames of the clip.

    They are right in 28 of 28 solves with known truth, corners by the smaller eigenvalue in 27, SIFT
    keypoints, followed or matched, in 24 (`make bench-solve`).

    Args:
        footage: The clip.
        watch: Called with each frame's picture and features.

    Raises:
        UserError: The clip has too few frames.
    """
    return run(TwoScales(new_corners).step, footage, watch)


def match_features(footage: Footage) -> Tracks:
    """Match SIFT keypoints between frames: it survives fast motion and finds features again after a gap.

    Keypoints that are seen only once are left out. UserError where the clip has too few frames.
    """
    tracks = run(Matcher().step, footage)
    kept = np.bincount(tracks.track, minlength=tracks.count) > 1
    some, number = tracks.only(kept[tracks.track]), np.cumsum(kept) - 1
    return replace(some, rgb=tracks.rgb[kept], track=number[some.track].astype(np.int32))


def check_shape(footage: Footage) -> None:
    """Check the shape of a clip's pictures; UserError if too small or too long for features."""
    width, height = footage.width, footage.height
    if min(width, height) * min(1.0, LONG_SIDE / max(width, height)) < SHORT_SIDE:
        raise UserError(
            f"{footage.path.name} is {width}x{height} pixels; features can only be followed in images of at"
            f" least {SHORT_SIDE} pixels a side, less than {LONG_SIDE // SHORT_SIDE} times as long as wide"
        )


def run(step: Step, footage: Footage, watch: Watch = lambda *_: None) -> Tracks:
    """Run a tracker on a clip.

    Frames are reduced to `LONG_SIDE`; places are the source's.

    Args:
        step: The tracker's.
        footage: The clip.
        watch: Called with each frame's picture and features.
    """
    if len(footage.frames) < 4:
        raise UserError(
            f"{footage.path.name} has {counted(len(footage.frames), 'frame')}; at least 4 frames from a"
            " moving camera are needed; photos can be solved as stills",
            Remedy.STILLS,
        )
    zoom = min(1.0, LONG_SIDE / max(footage.width, footage.height))
    numbers: list[NDArray[np.int64]] = []
    places: list[NDArray[np.float32]] = []
    colours: list[NDArray[np.uint8]] = []
    correlations = np.ones(len(footage.frames))
    before: NDArray[np.float32] | None = None
    born = 0
    for done, frame in enumerate(footage.frames):
        progress("Tracking features", done, len(footage.frames))
        picture = footage.read(frame)
        gray = to_gray8(picture, LONG_SIDE)
        number, place = step(gray)
        watch(picture, (place + 0.5) / gray.shape[::-1])
        new = np.searchsorted(number, born)
        colours.append(colours_at(picture, (place[new:] + 0.5) / zoom))
        born += len(number) - int(new)
        numbers.append(number.astype(np.int32))
        places.append(place)
        small = thumbnail(gray)
        correlations[done] = 1.0 if before is None else correlation(before, small)
        before = small
    # The shrunk size is rounded, so that its two scales differ a little.
    scale = np.array([footage.width / gray.shape[1], footage.height / gray.shape[0]])
    xy = (np.concatenate(places).astype(np.float64) + 0.5) * scale
    index = np.repeat(np.arange(len(numbers)), [len(n) for n in numbers]).astype(np.int32)
    return Tracks(
        footage.frames, footage.width, footage.height, index, np.concatenate(numbers), xy,
        np.concatenate(colours), correlations,
    )  # fmt: skip


def cuts(tracks: Tracks) -> tuple[int, ...]:
    """Return the indices of the frames that begin another shot.

    At a cut no track goes on from before, and the picture, shifted as a pan would shift it, is unlike the one
    before. A flash is no cut, since the old tracks go on after it. The first frame is none either.
    """
    frames = len(tracks.frames)
    first, last = np.full(tracks.count, frames), np.full(tracks.count, -1)
    np.minimum.at(first, tracks.track, tracks.frame_index)
    np.maximum.at(last, tracks.track, tracks.frame_index)
    born = np.bincount(first[last >= 0], minlength=frames)
    died = np.bincount(last[last >= 0] + 1, minlength=frames + 1)[:frames]
    # Tracks that began before each frame and end in it or after it.
    across = np.concatenate([[0], np.cumsum(born)[:-1]]) - np.cumsum(died)
    seen = np.bincount(tracks.frame_index, minlength=frames) > 0
    unlike = tracks.correlations < MIN_CORRELATION if len(tracks.correlations) else np.ones(frames, bool)
    cut = seen & unlike & (across == 0) & (np.cumsum(seen) > 1)
    return tuple(np.nonzero(cut)[0].tolist())


def are_bridged(footage: Footage, starts: Sequence[int]) -> bool:
    """Return whether SIFT keypoints connect each frame, an index into the clip's, with the frame before."""
    for start in starts:
        matcher = Matcher()
        before, after = (
            matcher.step(to_gray8(footage.read(frame), LONG_SIDE))[0]
            for frame in footage.frames[start - 1 : start + 1]
        )
        if not np.isin(after, before).any():
            return False
    return True


def thumbnail(gray: Bytes) -> NDArray[np.float32]:
    """Return a frame (H, W) made `THUMBNAIL` pixels wide, its slow changes of brightness taken out."""
    size = (THUMBNAIL, max(round(THUMBNAIL * gray.shape[0] / gray.shape[1]), 1))
    small = cv2.resize(gray, size, interpolation=cv2.INTER_AREA).astype(np.float32)
    return np.asarray(small - cv2.GaussianBlur(small, (0, 0), THUMBNAIL / 16), np.float32)


def correlation(a: NDArray[np.float32], b: NDArray[np.float32]) -> float:
    """Return the best correlation of two pictures (h, w) over all shifts with `MIN_OVERLAP`.

    It is 0 for pictures without contrast. Lewis, "Fast normalized cross-correlation", 1995.
    """
    shape = (2 * a.shape[0], 2 * a.shape[1])
    one, x, y, xx, yy = (np.fft.rfft2(p, shape) for p in (np.ones_like(a), a, b, a * a, b * b))

    def summed(p: NDArray[np.complexfloating], q: NDArray[np.complexfloating]) -> Floats:
        return np.asarray(np.fft.irfft2(p * np.conj(q), shape), np.float64)

    count = np.maximum(summed(one, one), 1.0)
    sum_x, sum_y = summed(x, one), summed(one, y)
    spread = (summed(xx, one) - sum_x**2 / count) * (summed(one, yy) - sum_y**2 / count)
    both = summed(x, y) - sum_x * sum_y / count
    # A grey level's quantisation is no contrast.
    usable = (count > MIN_OVERLAP * a.size) & (spread > (0.01 * count) ** 2)
    return float(np.max(both / np.sqrt(np.where(usable, spread, 1.0)), where=usable, initial=0.0))


def colours_at(picture: Pixels, places: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Return the sRGB colours (n, 3) of a picture (H, W, 3 or 4) as stored at places (n, 2) in its pixels."""
    height, width = picture.shape[:2]
    column, row = np.clip(places.astype(int), 0, [width - 1, height - 1]).T
    return to_rgb8(picture[row, column])
