"""A subject that a salient-object network cuts out of key frames, carried between them by optical flow."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from ..base.arrays import Bytes, Map, Mask
from .cut import COLOUR, LEAST, LIKE
from .networks import Networks
from .odds import Box, Colours, distance, overlap
from .people import bodies, overlap_of, touching
from .pictures import ClipPictures, displayed

CLICKED = (0.25, 0.35, 0.5, 0.7, 1.0)
"""Sides, over the long side, of the squares around a click in which its object is looked for."""
CROP = 1.4
"""Side of a crop over the subject's."""
GRID = 12
"""Steps of a crop's place in its side: a crop that follows each pixel makes the outline flicker."""
OWN, NEAR = 0.25, 0.12
"""Share of a found part that flow must have carried there, and distance from it, over the crop's side, that a
part may reach."""
AGREES = 0.5
"""Intersection over union of two looks at a click, from which on the second one is right."""
WHOLE = 0.8
"""Share of the area that a subject had, from which it counts as whole."""
PERSON = 0.5
"""Share of a stroke on a detected body, and intersection over union of the object with it, from which on it
is a person, whom the other networks follow at a fifth of the cost: dancer 0.84 / 0.75 (mean / least) by them,
and 0.82 / 0.66 by IS-Net."""
RIDER = 0.8
"""Share of such a body in the object, from which on it is only a part of it."""


@dataclass(frozen=True)
class Look:
    """A network's look at a subject in one frame."""

    networks: Networks
    """Those with a segmenter."""
    pictures: ClipPictures
    frame: int

    @cached_property
    def _whole(self) -> Bytes:
        """(H, W, 3) the frame at its own size."""
        return displayed(self.pictures.read(self.frame))

    def first(self, marked: Mask) -> Map | None:
        """Return the probability (h, w) of the object under a stroke (h, w).

        It is None where there is none, and for a person.
        """
        shape, long_side = marked.shape, max(marked.shape)
        places = np.argwhere(marked)
        middle, extent = places.mean(axis=0), float(np.ptp(places, axis=0).max())
        sides = [side * long_side for side in CLICKED if side * long_side > extent]
        boxes = [Box.square(middle, side, shape) for side in sides]
        parts = [touching(self._seen(box) > 0.5, marked) for box in boxes]
        parts = [part for part in parts if part.sum() > max(LEAST, marked.sum().item())]
        if not parts:
            return None
        best = max(parts, key=lambda part: sum(overlap(part, other) for other in parts))
        found = self._seen(_box(best))
        again = touching(found > 0.5, marked)
        best = again if overlap(again, best) > AGREES else best
        return None if self._is_person(marked, best) else _only(best, found)

    def _is_person(self, marked: Mask, found: Mask) -> bool:
        """Whether a stroke (h, w) is on a person, and the found mask (h, w) is not a larger object."""
        picture = self.pictures.picture(self.frame)
        shares = bodies(self.networks, picture) if self.networks.exist else []
        there = [body > 0.5 for body in shares]
        there = [body for body in there if overlap_of(marked, body) > PERSON]
        return any(overlap(body, found) > PERSON or overlap_of(body, found) < RIDER for body in there)

    def next(self, carried: Map, area: float, colours: Colours) -> tuple[Map, float]:
        """Return the subject where flow carries it.

        Args:
            carried: (h, w) its probability there.
            area: Pixels of the whole subject, which something may hide in part.
            colours: Its colours.

        Returns:
            Its probability (h, w), and how far it agrees with the carried one, in [0, 1].
        """
        there = carried > 0.5
        if np.count_nonzero(there) < LEAST:
            return np.zeros_like(carried), 0.0
        box, alike = _box(there), colours.odds(self.pictures.picture(self.frame), COLOUR[0])
        seen = self._seen(box)
        near = distance(there) < NEAR * (box.right - box.left)
        kept = _parts((seen > 0.5) & near, there, alike, area)
        return _only(kept, seen), overlap(kept, there)

    def _seen(self, box: Box) -> Map:
        """The network's probability (h, w) in a box; 0 outside."""
        segmenter, shape = self.networks.segmenter, self.pictures.picture(self.frame).shape[:2]
        assert segmenter is not None
        times = self._whole.shape[1] / shape[1]
        large = Box(*(round(each * times) for each in (box.left, box.top, box.right, box.bottom)))
        seen = segmenter.probability(np.ascontiguousarray(self._whole[large.part]))
        found = np.zeros(shape, np.float32)
        size = box.right - box.left, box.bottom - box.top
        found[box.part] = cv2.resize(seen, size, interpolation=cv2.INTER_AREA)
        return found


def _box(mask: Mask) -> Box:
    """The square around a mask (h, w), in coarse steps of its place and size."""
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    extent = CROP * max(rows[-1] - rows[0] + 1, columns[-1] - columns[0] + 1, 16)
    side = 2 ** (round(np.log2(extent) * 8) / 8)
    step = side / GRID
    middle = [round((each[0] + each[-1] + 1) / 2 / step) * step for each in (rows, columns)]
    return Box.square(middle, side, mask.shape)


def _parts(found: Mask, there: Mask, alike: Map, area: float) -> Mask:
    """The parts of a found mask (h, w) that are a subject's.

    `OWN` of them is where it is expected (h, w). If less than `WHOLE` of its area is there, others of its
    colours, by their log-odds (h, w), make it whole: those come into view behind an occluder.
    """
    number, labels = cv2.connectedComponents(found.astype(np.uint8))
    areas = np.bincount(labels.ravel(), minlength=number)
    areas[0] = 0
    own = np.bincount(labels[there], minlength=number) >= OWN * np.maximum(areas, 1)
    own[0] = False
    colours = np.bincount(labels.ravel(), alike.ravel(), number) / np.maximum(areas, 1)
    for label in np.argsort(-colours, kind="stable"):
        whole = areas[own].sum() + areas[label]
        if not own[label] and colours[label] > LIKE and areas[own].sum() < WHOLE * area >= WHOLE * whole:
            own[label] = areas[label] > 0
    return np.asarray(own[labels])


def _only(part: Mask, share: Map) -> Map:
    """A probability (h, w) in a part (h, w) of it, soft outline included, and 0 elsewhere."""
    near = cv2.dilate(part.astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
    return np.where(near, share, np.float32(0)).astype(np.float32)
