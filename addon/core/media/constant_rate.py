"""Which frame of a clip a movie of a constant rate shows when."""

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from .sequence import LAST_FRAME

RATES = tuple(map(Fraction, (
    "24000/1001", "24", "25", "30000/1001", "30", "48", "50", "60000/1001", "60", "90", "100", "120", "240",
    "480", "960",
)))  # fmt: skip
"""Frames a second that cameras have."""
SAME = 0.01
"""Relative difference up to which a measured rate is one of those: times in milliseconds are that coarse."""
RUN = 8
"""Frames over which the fastest rate is taken: single times jitter."""
FASTEST = 32767
"""Blender's largest number of frames a second (`RenderSettings.fps`)."""


def keeps_rate(seconds: NDArray[np.float64], fps: float, within: float = 0.5) -> bool:
    """Return whether frames shown at `seconds` (n,) are all less than half a frame from a constant rate's.

    That begins with the first frame, against which sound is set. `within` are other frames than half a one.
    """
    off = (seconds - seconds[:1]) * fps - np.arange(len(seconds))
    return bool(np.all(np.abs(off) < within - 1e-6))


def fitting_rate(seconds: NDArray[np.float64]) -> float:
    """Return the rate of a movie with a place for every frame of a clip of a variable rate.

    It is the clip's fastest, or a camera's above it, so that each of the frames shown at `seconds` (n,)
    begins within a frame of the movie from its time. Where no rate does that, it is the clip's fastest: so
    close are only glitches of a recorder.
    """
    run = min(RUN, len(seconds) - 1)
    measured = run / float(np.min(seconds[run:] - seconds[:-run]))
    nearest = min(RATES, key=lambda rate: abs(float(rate) - measured))
    least = float(nearest) if abs(float(nearest) - measured) < SAME * measured else measured
    faster = [float(rate) for rate in RATES if rate > least and seconds[-1] * float(rate) < LAST_FRAME]
    return next((rate for rate in (least, *faster) if largest_shift(seconds, rate) * rate <= 1), least)


def largest_shift(seconds: NDArray[np.float64], rate: float) -> float:
    """Return by how many seconds a movie's frames begin off their times `seconds` (n,) at the most."""
    early, late = _free_of_order(seconds * rate)
    return (0.5 + float(np.max(late - early)) / 2) / rate


def _free_of_order(own: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The least of the later and the largest of the earlier times (n,), each less its place in the order."""
    offset = own - np.arange(len(own))
    return np.minimum.accumulate(offset[::-1])[::-1], np.maximum.accumulate(offset)


def beginnings(seconds: Sequence[float], rate: float, sound: float) -> NDArray[np.intp]:
    """Return the frames (n,) of a movie with a constant rate at which those of a clip begin, each at its own.

    Each begins at the movie's frame nearest to its own time in `seconds`, ascending, counted from the sound,
    which also begins at one of the movie's frames: picture and sound differ by at most half a frame. Frames
    that are closer than one of the movie's are moved apart, so that the largest distance from their times is
    least (minimax isotonic regression; Barlow et al. 1972, Statistical Inference under Order Restrictions).
    """
    early, late = _free_of_order((np.asarray(seconds) - sound) * rate)
    return np.rint((early + late) / 2).astype(np.intp) + np.arange(len(early))


def held_frames(seconds: Sequence[float], end: float, rate: float, sound: float) -> NDArray[np.intp]:
    """Return the indices (m,) of the frames that the frames of a movie with a constant rate show.

    Each is held from its own of the `beginnings` to the next one's, and the last until `end`.
    """
    begins = beginnings(seconds, rate, sound)
    last = max(begins[-1] + 1, round((end - sound) * rate))
    return np.repeat(np.arange(len(begins)), np.diff(begins, append=last))
