"""Subjects of a clip that nobody has marked: its people, and groups of tracks on other moving objects."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Floats, Mask
from .carried import CarriedSubject
from .gate import MovingTracks, moves
from .networks import Networks
from .people import SEEN_IN, people, sampled
from .pictures import ClipPictures
from .strokes import Stroke, down

MOST = 4
"""People, and other objects, that are followed; each costs 0.1 to 0.2 s of processor time a frame."""
SAME = 0.5
"""Share of a candidate that a followed subject covers, from which on they are one."""
DOTS = 5
"""Dots that mark a person. People of four clips with drawn masks have a mean IoU of 0.769 by these, 0.767 by
the whole mask of the networks."""


@dataclass(frozen=True)
class Candidate:
    """A subject as one frame shows it."""

    frame: int
    places: Floats
    """(n, 2) dots on it, shares of the picture, (0, 0) top left."""
    is_sure: bool
    """False if another frame has to show it, too."""


def found_people(pictures: ClipPictures, networks: Networks) -> list[Candidate]:
    """Find people in a few frames of a clip, the surest first.

    Returns:
        Nobody where fewer than `SEEN_IN` of these frames show people.

    Raises:
        UserError: A frame cannot be read.
    """
    looked = {frame: people(networks, pictures.picture(frame)) for frame in sampled(pictures.frames)}
    if sum(bool(found) for found in looked.values()) < min(SEEN_IN, len(looked)):
        return []
    found = [(frame, person) for frame, those in looked.items() for person in those]
    found.sort(key=lambda each: -each[1].agreement)
    return [Candidate(frame, np.array(down(person.mask, DOTS)), True) for frame, person in found]


def found_objects(tracks: Sequence[MovingTracks], people: Callable[[int], Mask]) -> list[Candidate]:
    """Find groups of neighbouring tracks that contradict a still scene, the largest first.

    Args:
        tracks: Those of moving objects in sampled frames, ascending.
        people: Returns the people (h, w) in a frame, which are not objects.

    Returns:
        Nothing where the clip has no moving objects for sure.

    Raises:
        UserError: A frame cannot be read.
    """
    if not moves(tracks):
        return []
    found = [Candidate(each.frame, group, False) for each in tracks for group in each.groups()]
    found = [each for each in found if _covered(people(each.frame), each) < SAME]
    return sorted(found, key=lambda each: -len(each.places))


def distinct(
    waiting: list[Candidate], carried: Callable[[tuple[Stroke, ...]], CarriedSubject]
) -> list[CarriedSubject]:
    """Return each subject once, carried from its first candidate.

    Args:
        waiting: Candidates, the best first.
        carried: Returns the subject that strokes mark.

    Raises:
        UserError: A frame cannot be read.
    """
    found = list[CarriedSubject]()
    while waiting and len(found) < MOST:
        first, *waiting = waiting
        subject = carried(tuple(Stroke(first.frame, ((x, y),)) for x, y in first.places.tolist()))
        others = [each for each in waiting if _covered(subject.mask(each.frame), each) < SAME]
        if first.is_sure or len(others) < len(waiting):
            found.append(subject)
        waiting = others
    return found


def _covered(mask: Mask, candidate: Candidate) -> float:
    """The share of a candidate's dots that are on a mask (h, w)."""
    height, width = mask.shape
    column, row = np.floor(candidate.places * (width, height)).astype(int).T
    return float(mask[row.clip(0, height - 1), column.clip(0, width - 1)].mean())
