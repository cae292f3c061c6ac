"""Moving objects of a clip that are not people, each as the strokes that mark it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Floats, Mask
from .carried import SAME_PERSON, CarriedSubject
from .gate import MovingTracks, moves
from .strokes import Stroke

MOST_OBJECTS = 4
"""Objects that are followed, each at the cost of a person."""


@dataclass(frozen=True)
class ObjectsOfClip:
    """The moving objects of a clip.

    Each is a group of neighbouring tracks that contradict a still scene, carried like a subject that the user
    marks from the frame in which the group is largest. Errors as of `ClipPictures.picture`.
    """

    tracks: Sequence[MovingTracks]
    """Tracks of moving objects in sampled frames, ascending."""
    carried: Callable[[tuple[Stroke, ...]], CarriedSubject]
    """Returns the subject that strokes mark."""
    people: Callable[[int], Mask]
    """(h, w) the people in a frame, who are no objects."""

    def strokes(self) -> list[tuple[Stroke, ...]]:
        """Return the strokes that mark each object; none where the clip has no moving objects for sure."""
        if not moves(self.tracks):
            return []
        waiting = [(each.frame, group) for each in self.tracks for group in each.groups()]
        waiting = [each for each in waiting if not self._covers(self.people(each[0]), each[1])]
        waiting.sort(key=lambda each: -len(each[1]))
        found = list[tuple[Stroke, ...]]()
        while waiting and len(found) < MOST_OBJECTS:
            frame, group = waiting[0]
            strokes = tuple(Stroke(frame, (tuple(place),)) for place in group.tolist())
            mask = self.carried(strokes).mask
            others = [each for each in waiting[1:] if not self._covers(mask(each[0]), each[1])]
            if len(others) < len(waiting) - 1:
                found.append(strokes)
            waiting = others
        return found

    @staticmethod
    def _covers(mask: Mask, places: Floats) -> bool:
        """Whether most of places (n, 2), shares of the picture, are on a mask (h, w)."""
        height, width = mask.shape
        column, row = np.floor(places * (width, height)).astype(int).T
        return bool(mask[row.clip(0, height - 1), column.clip(0, width - 1)].mean() >= SAME_PERSON)
