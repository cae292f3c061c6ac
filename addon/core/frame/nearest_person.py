"""Focus on the nearest person of each frame, and by an automatic director."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, Mask
from ..base.errors import UserError
from ..base.progress import part
from ..focus.focus import Focus
from ..focus.place import Place
from ..focus.pull import FocusMark
from ..subjects.clip_subjects import ClipSubject
from ..subjects.people import SMALLEST
from .clip_context import ClipContext
from .first_person import middle_of
from .repaired_depth import repaired_subject
from .repairs import Repair

TURN = 13
"""Frames, half a second, in which focus goes from one person to another, as focus pullers do; most of as many
must have the same nearest person, so that focus does not flicker."""
EVEN = np.ones(TURN) / TURN
"""Weights of the frames for a majority."""


def nearest_person(clip: ClipContext, frame: int, repairs: Sequence[Repair] = ()) -> Place:
    """Put the nearest person of each frame in focus.

    Focus goes over as in `directed`, whose errors it has; it does not prefer faces.

    Args:
        clip: The clip.
        frame: Frame of the place.
        repairs: Repairs of depth in their order.

    Returns:
        The place, with its distance in every frame of the clip.
    """
    cast = _cast(clip, repairs, by_faces=False)
    weights = _weights(_nearest(cast.inverse, cast.shown), len(cast.people))
    distances = 1 / (weights * cast.inverse).sum(axis=0)
    followed = dict(zip(cast.frames, distances.tolist(), strict=True))
    chosen = cast.people[int(weights[:, cast.frames.index(frame)].argmax())].mask(frame)
    return Place(
        Focus(distance=followed[frame]), frame, followed[frame], "the nearest person in every frame",
        followed=followed, xy=middle_of(chosen) if chosen.any() else None, subject="nearest person",
    )  # fmt: skip


def directed(clip: ClipContext, repairs: Sequence[Repair] = ()) -> list[FocusMark]:
    """Set focus marks as an automatic director would: on the nearest face, or person where no face is seen.

    Each person is followed as by `repaired_subject`. Where another one is the nearest for most of `TURN`
    frames, focus goes there in as many. Passes checkpoints.

    Args:
        clip: The clip.
        repairs: Repairs of depth in their order.

    Returns:
        Marks in the order of their frames, named by their reasons.

    Raises:
        UserError: The clip shows no person of a sufficient size, or a frame cannot be read.
    """
    cast = _cast(clip, repairs, by_faces=True)
    chosen = _nearest(cast.inverse, np.where(cast.faces.any(axis=0), cast.faces, cast.shown))
    marks, before = list[FocusMark](), None
    for start in [0, *(np.flatnonzero(np.diff(chosen)) + 1)]:
        number = int(chosen[start])
        # The pull is half over where they change.
        frame = cast.frames[min(start + TURN // 2, len(chosen) - 1) if start else 0]
        person, place = cast.people[number], cast.places[number]
        face, mask = clip.parts.subjects.face(person, frame), person.mask(frame)
        xy = middle_of(mask) if mask.any() else None
        if face is not None:
            xy = float(face[::2].mean()), float(face[1::2].mean())
        away = place.followed[frame]
        place = replace(place, focus=Focus(distance=away), frame=frame, distance=away, xy=xy)
        marks.append(FocusMark(frame, (place,), pull=TURN, name=cast.reason(start, number, before)))
        before = number
    return marks


@dataclass(frozen=True)
class _Cast:
    """The people of a clip (p,) in its frames (n,)."""

    frames: list[int]
    people: list[ClipSubject]
    places: list[Place]
    inverse: Floats
    """(p, n) inverse depths, in 1 / scene units."""
    shown: Mask
    """(p, n) whether they are seen, and large enough."""
    faces: Mask
    """(p, n) whether their faces are seen in most of `TURN` frames."""

    def reason(self, start: int, person: int, before: int | None) -> str:
        """Return why focus goes to a person in a frame, both by number, from another one."""
        earlier, soon = max(start - TURN, 0), min(start + TURN, len(self.frames) - 1)
        who = "Face" if self.faces[person, start] else "Person"
        if before is None:
            return f"Nearest {who.lower()}"
        if not self.shown[person, max(earlier - TURN, 0) : earlier + 1].any():
            return f"{who} enters"
        if not self.shown[before, soon]:
            return "Other leaves"
        if self.faces[before, soon] >= self.faces[person, start]:
            return "Comes nearer"
        return "Other turns away" if self.faces[before, earlier] else "Face is seen"


def _cast(clip: ClipContext, repairs: Sequence[Repair], by_faces: bool) -> _Cast:
    """The people of a clip, whose faces are looked for or not; errors as of `directed`."""
    people = clip.parts.people if clip.may_focus_on_subjects else []
    if not people:
        raise UserError("no person was found in the clip; pick what should be in focus, or mark a subject")
    frames, places = [int(each) for each in clip.reconstruction.frames], list[Place]()
    shown, faces = np.zeros((2, len(people), len(frames)), bool)
    subjects = clip.parts.subjects
    pictures = subjects.pictures
    for number, person in enumerate(people):
        with part(number, len(people)):
            places.append(repaired_subject(clip, person.name, frames[0], repairs))
            seen = [person.mask(key).mean() >= SMALLEST for key in pictures.keys]
            shown[number] = pictures.of_keys(np.array(seen))
            if by_faces:
                face = [
                    s and subjects.face(person, k) is not None
                    for k, s in zip(pictures.keys, seen, strict=True)
                ]
                faces[number] = pictures.of_keys(np.array(face))
    if not shown.any():
        raise UserError("people are too small in the clip to focus on; pick what should be in focus")
    inverse = np.array([[1 / place.followed[each] for each in frames] for place in places])
    return _Cast(frames, people, places, inverse, shown, _smooth(faces, EVEN) > 0.5)


def _nearest(inverse: Floats, shown: Mask) -> NDArray[np.intp]:
    """The nearest person (n,) in most of `TURN` frames, by inverse depths (p, n) where they are shown."""
    nearest = np.where(shown, inverse, -np.inf).argmax(axis=0)
    seen = np.flatnonzero(shown.any(axis=0))
    nearest = nearest[seen[np.abs(seen - np.arange(len(nearest))[:, None]).argmin(axis=1)]]
    return _smooth(np.arange(len(inverse))[:, None] == nearest, EVEN).argmax(axis=0)


def _weights(chosen: NDArray[np.intp], count: int) -> Floats:
    """Shares (p, n) of people in the focus of frames, which goes over in `TURN` of them."""
    window = np.hanning(TURN + 2)[1:-1]
    return _smooth(np.arange(count)[:, None] == chosen, window / window.sum())


def _smooth(rows: Floats | Mask, kernel: Floats) -> Floats:
    """Convolve rows (p, n) with a kernel (k,) of odd length; the ends are repeated."""
    wide = np.pad(rows, ((0, 0), (len(kernel) // 2,) * 2), mode="edge")
    return np.array([np.convolve(row, kernel, mode="valid") for row in wide])
