"""Focus that follows the nearest person of each frame."""

from collections.abc import Sequence

import numpy as np

from ..base.arrays import Floats, Mask
from ..base.errors import UserError
from ..base.progress import part
from ..focus.focus import Focus
from ..focus.place import Place
from ..subjects.people import SMALLEST
from .clip_context import ClipContext
from .first_person import middle_of
from .repaired_depth import repaired_subject
from .repairs import Repair

TURN = 13
"""Frames, half a second, in which focus goes from one person to another, as focus pullers do; most of as many
must have the same nearest person, so that focus does not flicker."""


def nearest_person(clip: ClipContext, frame: int, repairs: Sequence[Repair] = ()) -> Place:
    """Put the nearest person of each frame in focus.

    Each person is followed as by `repaired_subject`. Where another one is the nearest for most of
    `TURN` frames, focus goes there in as many. Passes checkpoints.

    Args:
        clip: The clip.
        frame: Frame of the place.
        repairs: Repairs of depth in their order.

    Returns:
        The place, with its distance in every frame of the clip.

    Raises:
        UserError: The clip shows no person, or a frame cannot be read.
    """
    people = clip.parts.people if clip.may_focus_on_subjects else []
    if not people:
        raise UserError("no person was found in the clip; pick what should be in focus, or mark a subject")
    frames = [int(each) for each in clip.reconstruction.frames]
    inverse, shown = np.zeros((len(people), len(frames))), np.zeros((len(people), len(frames)), bool)
    for number, person in enumerate(people):
        with part(number, len(people)):
            followed = repaired_subject(clip, person.name, frame, repairs).followed
            inverse[number] = [1 / followed[each] for each in frames]
            pictures = clip.parts.subjects.pictures
            seen = [person.mask(key).mean() >= SMALLEST for key in pictures.keys]
            shown[number] = pictures.of_keys(np.array(seen))
    if not shown.any():
        raise UserError("people are too small in the clip to focus on; pick what should be in focus")
    weights = _weights(inverse, shown)
    distances = 1 / (weights * inverse).sum(axis=0)
    followed = dict(zip(frames, distances.tolist(), strict=True))
    here = frames.index(frame)
    chosen = people[int(weights[:, here].argmax())].mask(frame)
    return Place(
        Focus(distance=followed[frame]), frame, followed[frame], "the nearest person in every frame",
        followed=followed, xy=middle_of(chosen) if chosen.any() else None, subject="nearest person",
    )  # fmt: skip


def _weights(inverse: Floats, shown: Mask) -> Floats:
    """Shares (p, n) of people in the focus of frames, from inverse depths (p, n) where they are shown."""
    nearest = np.where(shown, inverse, -np.inf).argmax(axis=0)
    seen = np.flatnonzero(shown.any(axis=0))
    at = np.arange(inverse.shape[1])
    nearest = nearest[seen[np.abs(seen - at[:, None]).argmin(axis=1)]]
    alone = (np.arange(len(inverse))[:, None] == nearest).astype(float)
    steady = _smooth(alone, np.ones(TURN) / TURN).argmax(axis=0)
    chosen = (np.arange(len(inverse))[:, None] == steady).astype(float)
    window = np.hanning(TURN + 2)[1:-1]
    return _smooth(chosen, window / window.sum())


def _smooth(rows: Floats, kernel: Floats) -> Floats:
    """Convolve rows (p, n) with a kernel (k,) of odd length; the ends are repeated."""
    wide = np.pad(rows, ((0, 0), (len(kernel) // 2,) * 2), mode="edge")
    return np.array([np.convolve(row, kernel, mode="valid") for row in wide])
