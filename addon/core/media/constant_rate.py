"""Which frame of a clip a movie of a constant rate shows when."""

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from .clip import Footage

RATES = tuple(
    map(
        Fraction,
        ("24000/1001", "24", "25", "30000/1001", "30", "48", "50", "60000/1001", "60", "90", "100", "120"),
    )
)
"""Frames a second that cameras have."""
SAME = 0.01
"""Relative difference up to which a measured rate is one of those: times in milliseconds are that coarse."""
RUN = 8
"""Frames over which the fastest rate is taken: single times jitter."""
FASTEST = 240.0
"""Frames a second; frames closer in time are glitches of a recorder."""


def movie_rate(footage: Footage) -> float:
    """Return the rate of a movie with place for every frame of a clip: the clip's fastest."""
    if footage.video is None or not footage.video.is_variable:
        return footage.fps
    seconds = footage.video.seconds
    run = min(RUN, len(seconds) - 1)
    measured = min(FASTEST, run / float(np.min(seconds[run:] - seconds[:-run])))
    nearest = min(RATES, key=lambda rate: abs(float(rate) - measured))
    return float(nearest) if abs(float(nearest) - measured) < SAME * measured else measured


def held_frames(seconds: Sequence[float], end: float, rate: float, sound: float) -> NDArray[np.intp]:
    """Return the indices (n,) of the frames that the frames of a movie with a constant rate show.

    Each frame begins at the movie's frame nearest to its own time in `seconds`, ascending, counted from the
    sound, which also begins at one of the movie's frames: picture and sound differ by at most half a frame.
    If two frames are closer than that, the second comes a frame later; a frame that would be later by more
    is left out. The last one is held until `end`.
    """
    own = (np.asarray(seconds) - sound) * rate
    first = round(own[0])
    begins: list[int] = []
    shown: list[int] = []
    for index, at in enumerate(own):
        place = max(round(at), begins[-1] + 1 if begins else first)
        if place - at < 1:
            begins.append(place)
            shown.append(index)
    last = max(begins[-1] + 1, round((end - sound) * rate))
    return np.repeat(shown, np.diff([*begins, last]))
