"""What moves by itself, thing by thing, in a frame and in those around it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

import cv2
import numpy as np

from ..base.arrays import Floats, Ints, Mask
from ..camera.intrinsics import Intrinsics
from ..camera.reconstruction import Image
from .view_selection import relative_pose

STEP = 3
"""Registered frames from one in which an object is looked for to the next: a tenth of a second, in which it
still overlaps itself. Chosen by inspection."""
SAME_AREA = 1.6
"""Times that an object's area may change in so many frames: two that meet change by more. Chosen by
inspection."""

GAP = 6
"""Pixels between parts of one object, at most: hair, and fingers that are lost against what is behind. Chosen
by inspection."""


@dataclass(frozen=True)
class Sighting:
    """An object in a frame around the one whose depth is wanted."""

    after: int
    """Frames after that one."""
    mask: Mask
    """(h, w) over that frame's undistorted picture."""
    pinhole: Intrinsics
    """Of that picture."""
    rotation: Floats
    """(3, 3) from the camera space of the frame whose depth is wanted to this one's; see `translation`."""
    translation: Floats
    """(3,) X here = rotation @ X there + translation."""


@dataclass(frozen=True)
class MovingObject:
    """One thing that moves by itself."""

    mask: Mask
    """(h, w) in the frame whose depth is wanted."""
    around: Callable[[int], Sighting | None] = lambda steps: None
    """It so many times `STEP` registered frames after that one; None where it is not known."""
    inverse_depth: float | None = None
    """The median of its pixels', in 1 / scene units, where that is known."""


@dataclass(frozen=True)
class OverlapTrack:
    """A connected object followed through the masks of what moves by its overlap with itself."""

    mask: Mask
    """(h, w) in the first frame."""
    moving: Callable[[int], Mask | None]
    """(h, w) what moves, some times `STEP` frames after the first one; None where there is no such frame."""
    _known: dict[int, Mask | None] = field(default_factory=dict, repr=False, compare=False)

    def at(self, steps: int) -> Mask | None:
        """(h, w) the object so many times `STEP` frames after the first one, None where it was lost
        before."""
        if steps == 0:
            return self.mask
        if steps not in self._known:
            before = self.at(steps - 1 if steps > 0 else steps + 1)
            moving = None if before is None else self.moving(steps)
            usable = before is not None and moving is not None and before.shape == moving.shape
            self._known[steps] = same_object(before, moving) if usable else None  # type: ignore[arg-type]
        return self._known[steps]


def same_object(before: Mask, moving: Mask) -> Mask | None:
    """(h, w) the connected part of what moves (h, w) that overlaps most with an object (h, w); None where
    none is as large."""
    labels = connected(moving)
    overlap = np.bincount(labels[before], minlength=1)
    overlap[0] = 0
    best = int(overlap.argmax())
    if not overlap[best]:
        return None
    found = labels == best
    ratio = np.count_nonzero(found) / np.count_nonzero(before)
    return found if 1 / SAME_AREA < ratio < SAME_AREA else None


def separated(moving: Mask, subjects: Sequence[Mask]) -> tuple[list[Mask], list[Mask]]:
    """(h, w) each of the subjects that are told apart, as far as it moves (h, w), and each part of the rest
    that hangs together but for `GAP`.

    A subject may be in several parts: what stands before it is between them. Where two cover a pixel, the
    first one has it.
    """
    rest, told = moving.copy(), list[Mask]()
    for subject in subjects:
        told.append(subject & rest)
        rest &= ~subject
    labels = connected(rest)
    return told, [labels == label for label in range(1, int(labels.max(initial=0)) + 1)]


def connected(mask: Mask) -> Ints:
    """(h, w) labels from 1 of the parts of a mask (h, w) that hang together but for `GAP`, 0 elsewhere."""
    wide = cv2.dilate(mask.astype(np.uint8), np.ones((GAP + 1, GAP + 1), np.uint8))
    return np.where(mask, cv2.connectedComponents(wide, connectivity=8)[1], 0).astype(np.int32)


@dataclass(frozen=True)
class Subject:
    """One thing that is told apart from others."""

    mask: Callable[[int], Mask]
    """(h, w) by source frame, at any size."""
    inverse_depth: Callable[[int], float | None] = lambda frame: None
    """The median of its pixels', in 1 / scene units, by source frame, where that is known."""


@dataclass(frozen=True)
class ClipObjects:
    """What moves in a clip, thing by thing. Masks (h, w) are over a frame's undistorted picture."""

    images: Sequence[Image]
    """The registered frames."""
    pinhole: Callable[[Image], Intrinsics]
    """That of a frame's undistorted picture."""
    moving: Callable[[Image], Mask]
    """All that is known to move in a frame."""
    subjects: Sequence[Callable[[Image], Mask]] = ()
    """Each of those that are told apart."""
    inverse_depth: Callable[[int, int], float | None] = lambda subject, frame: None
    """That of a subject, by its number, in a frame, where it is known."""

    def of(self, image: Image, moving: Mask) -> list[MovingObject]:
        """What moves (h, w) in a frame."""
        first = int(np.searchsorted([each.frame for each in self.images], image.frame))
        frame = _Frame(self, image, first)
        told, parts = separated(moving, [subject(image) for subject in self.subjects])
        return [
            *(
                MovingObject(mask, partial(frame.subject, n), self.inverse_depth(n, image.frame))
                for n, mask in enumerate(told)
            ),
            *(
                MovingObject(mask, partial(frame.followed, OverlapTrack(mask, frame.moving)))
                for mask in parts
            ),
        ]


@dataclass(frozen=True)
class _Frame:
    """The frames around one, by how many times `STEP` registered frames they are after it."""

    clip: ClipObjects
    image: Image
    number: int
    """Of the frame among the registered ones."""

    def other(self, steps: int) -> Image | None:
        """Such a frame, None past the clip's ends."""
        at = self.number + STEP * steps
        return self.clip.images[at] if 0 <= at < len(self.clip.images) else None

    def moving(self, steps: int) -> Mask | None:
        """(h, w) all that moves there."""
        there = self.other(steps)
        return None if there is None else self.clip.moving(there)

    def subject(self, number: int, steps: int) -> Sighting | None:
        """One that is told apart."""
        there = self.other(steps)
        return None if there is None else self._sighting(there, self.clip.subjects[number](there))

    def followed(self, track: OverlapTrack, steps: int) -> Sighting | None:
        """One that is followed."""
        there, seen = self.other(steps), track.at(steps)
        return None if there is None or seen is None else self._sighting(there, seen)

    def _sighting(self, there: Image, seen: Mask) -> Sighting | None:
        if not seen.any():
            return None
        after = there.frame - self.image.frame
        return Sighting(after, seen, self.clip.pinhole(there), *relative_pose(self.image, there))
