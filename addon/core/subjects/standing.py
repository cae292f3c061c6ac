"""How far a marked subject is that stands on the ground: smooth over time, so that all of it stays in
focus."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

EVERY = 3
"""Registered frames from one in which it is looked at to the next: a tenth of a second. By eye."""
SIDES = 3
"""Of those, before and after one, that tell how far it is there, too: half a second. By eye."""
LEAST = 2
"""Of those, that must show where it stands."""
NEARER = 70.0
"""Percentile of what they tell: a foot that is lifted, or lost against the ground, seems farther. By eye."""


@dataclass(frozen=True)
class StandingTrack:
    """The inverse depth, in 1 / scene units, of a subject where it stands, through a clip.

    A line through the frames around, looked at `EVERY` few frames and interpolated between: continuous, and
    the same whichever frame was asked for before.
    """

    frames: tuple[int, ...]
    """The registered frames, ascending."""
    alone: Callable[[int], float | None]
    """What a frame alone tells; None where it does not show where the subject stands."""
    _alone: dict[int, float | None] = field(default_factory=dict, repr=False, compare=False)
    _smooth: dict[int, float | None] = field(default_factory=dict, repr=False, compare=False)

    def inverse_depth(self, frame: int) -> float | None:
        """That of a frame; None where no frame around shows where the subject stands."""
        number = min(int(np.searchsorted(self.frames, frame)), len(self.frames) - 1)
        before, past = divmod(number, EVERY)
        one, other = self._smoothed(before), self._smoothed(before + 1) if past else None
        if one is None or other is None:
            return one if other is None else other
        share = past / EVERY
        return (1 - share) * one + share * other

    def _smoothed(self, step: int) -> float | None:
        """That of the frame after so many times `EVERY`."""
        if step not in self._smooth:
            around = range(step - SIDES, step + SIDES + 1)
            known = [(each - step, value) for each in around if (value := self._seen(each)) is not None]
            self._smooth[step] = _at_zero(*np.array(known).T) if len(known) >= LEAST else None
        return self._smooth[step]

    def _seen(self, step: int) -> float | None:
        number = step * EVERY
        if not 0 <= number < len(self.frames):
            return None
        if step not in self._alone:
            self._alone[step] = self.alone(self.frames[number])
        return self._alone[step]


def _at_zero(times: np.ndarray, values: np.ndarray) -> float:
    """The value at time 0 of a line (Theil, 1950) that `NEARER` of the values (n,) at times (n,) are
    below."""
    slope = 0.0
    # Beyond what is known a line would run away.
    if len(times) > 2 and times.min() <= 0 <= times.max():
        one, other = np.triu_indices(len(times), 1)
        slope = float(np.median((values[other] - values[one]) / (times[other] - times[one])))
    return float(np.percentile(values - slope * times, NEARER))
