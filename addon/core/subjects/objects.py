"""Moving objects of a clip that are not people, each as the strokes that mark it."""

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
    marks from the frame in which the group is largest. Groups that are on it in other frames are the same
    object. Errors as of `ClipPictures.picture`.
    """

    tracks: Sequence[MovingTracks]
    """Tracks of moving objects in sampled frames, ascending."""
    carried: Callable[[tuple[Stroke, ...]], CarriedSubject]
    """Returns the subject that strokes mark."""
    people: Callable[[int], Mask]
    """Returns the people (h, w) in a frame, which are not objects."""

    def subjects(self) -> list[CarriedSubject]:
        """Return each object; none where the clip has no moving objects for sure."""
        if not moves(self.tracks):
            return []
        waiting = [(each.frame, group) for each in self.tracks for group in each.groups()]
        waiting = [each for each in waiting if _covered(self.people(each[0]), each[1]) < SAME_PERSON]
        found = list[CarriedSubject]()
        while waiting and len(found) < MOST_OBJECTS:
            first = waiting.pop(max(range(len(waiting)), key=lambda number: len(waiting[number][1])))
            frame, places = first
            subject = self.carried(tuple(Stroke(frame, ((x, y),)) for x, y in places.tolist()))
            others = [each for each in waiting if _covered(subject.mask(each[0]), each[1]) < SAME_PERSON]
            if len(others) < len(waiting):
                found.append(subject)
            waiting = others
        return found


def _covered(mask: Mask, places: Floats) -> float:
    """The share of places (n, 2), shares of the picture, that are on a mask (h, w)."""
    height, width = mask.shape
    column, row = np.floor(places * (width, height)).astype(int).T
    return float(mask[row.clip(0, height - 1), column.clip(0, width - 1)].mean())
