"""The stages and attempts of a solve, and pictures of the tracker's work, as they are shown."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Bytes, Floats
from ..base.messages import Progress, send
from ..media.light import to_rgb8
from ..media.picture_file import Pixels

SHARES = {
    "Tracking features": (0.0, 0.2),
    "Finding features": (0.0, 0.2),
    "Matching photos": (0.2, 0.75),
    "Placing photos": (0.75, 1.0),
    "Verifying matches": (0.2, 0.26),
    "Comparing cameras": (0.2, 0.6),
    "Solving cameras": (0.26, 0.34),
    "Settling the focal length": (0.34, 0.4),
    "Looking for a lens": (0.4, 0.6),
    "Finding how the camera turns": (0.6, 1.0),
    "Registering frames": (0.6, 0.6),
    "Adjusting": (0.6, 1.0),
    "Looking for people": (0.6, 0.6),
}
"""Which part of the whole each stage is, in a clip of `USUAL` frames: medians of twelve clips."""
USUAL = 100
_frames = [USUAL]
"""The number of the clip's frames."""
WIDTH, MOST = 480, 500
"""Pixels across of a picture, and features in it. They show the work and take no part in it."""
EVERY = 0.5
"""Seconds between two pictures; a redraw takes 0.06 to 0.3 s in software OpenGL, beside the solve."""


def progress(stage: str, done: int, total: int) -> None:
    """Show that `done` of the `total` steps of a stage are done."""
    if stage == "Tracking features":
        _frames[0] = total
    low, high = SHARES.get(stage, (0.0, 1.0))
    # Tracking and adjusting grow with the frames, what is between them does not.
    parts = np.array([0.0, 0.2 * _frames[0] / USUAL, 0.4, 0.4 * _frames[0] / USUAL]).cumsum()
    share = np.interp(low + (high - low) * done / max(total, 1), [0, 0.2, 0.6, 1], parts / parts[-1])
    send(Progress(stage, done, total, share=float(share)))


class Watch:
    """Shows a picture of the tracker's work every `EVERY` seconds; called with every frame."""

    def __init__(self, tell: Callable[[Sight], object]) -> None:
        self._tell, self._told = tell, -EVERY

    def __call__(self, picture: Pixels, places: Floats) -> None:
        """A frame (H, W, 3 or 4) as stored, and places (n, 2) in it as fractions of its size."""
        now = time.monotonic()
        if now - self._told < EVERY:
            return
        self._told = now
        self._tell(sight_of(picture, places))


@dataclass(frozen=True, eq=False)
class Sight:
    """A picture and its features."""

    picture: Bytes
    """(h, w, 3) sRGB."""
    places: NDArray[np.float32]
    """(n, 2) features as fractions of the picture, (0, 0) top left."""


def sight_of(picture: Pixels, places: Floats) -> Sight:
    """Return a frame (H, W, 3 or 4) as stored, made small, with places (n, 2) as fractions of its size.

    Many places are thinned out evenly.
    """
    height, width = picture.shape[:2]
    size = min(WIDTH, width), max(1, round(min(WIDTH, width) * height / width))
    small = cv2.resize(to_rgb8(picture), size, interpolation=cv2.INTER_AREA)
    some = places[:: -(-len(places) // MOST) or 1]
    return Sight(small.astype(np.uint8), some.astype(np.float32))


@dataclass(frozen=True)
class Attempt:
    """A hypothesis of a solve, or a step of one, and its verdict."""

    name: str
    """Tracks, start and lens, such as "corners, zoom, at once"."""
    seconds: float
    """CPU seconds since the attempt before."""
    explained: float | None = None
    """Share of the observations that it explains; None where it has no cameras."""
    score: float | None = None
    """As `adjustment.solution.score`; None where nothing is compared by it."""
    refusal: str = ""
    """Message of the error that ended it."""


class Record:
    """The attempts of a solve under way."""

    def __init__(self) -> None:
        self.attempts: list[Attempt] = []
        self.hypothesis = ""
        """Begins the names of the next attempts."""
        self._since = time.process_time()

    def add(
        self, *step: str, explained: float | None = None, score: float | None = None, refusal: str = ""
    ) -> None:
        """Add an attempt that ends now; arguments as of `Attempt`."""
        before, self._since = self._since, time.process_time()
        name = ", ".join(filter(None, (self.hypothesis, *step)))
        self.attempts.append(Attempt(name, round(self._since - before, 2), explained, score, refusal))


def table(attempts: Sequence[Attempt]) -> str:
    """Return attempts as lines for users."""
    if not attempts:
        return "attempts      no record: imported, solved from photos, or by an older version"
    width = max(len(each.name) for each in attempts)
    rows = [f"{'attempt':{width}}  CPU s  explained  score  verdict"]
    for each in attempts:
        explained = "" if each.explained is None else f"{100 * each.explained:.0f}%"
        score = "" if each.score is None else f"{each.score:.2f}"
        rows.append(
            f"{each.name:{width}}  {each.seconds:5.1f}  {explained:>9}  {score:>5}  {each.refusal}".rstrip()
        )
    return "\n".join(rows)
