"""A subject that a salient-object network cuts out of key frames, carried between them by optical flow."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import cv2
import numpy as np

from ..base.arrays import Bytes, Map, Mask
from ..base.lru_cache import remembered
from ..base.progress import checkpoint
from .cut import COLOUR, LEAST, LIKE, Cut
from .flow import warped
from .networks import Networks
from .odds import Box, Colours, distance, overlap
from .people import bodies, overlap_of, touching
from .pictures import ClipPictures, displayed

CLICKED = (0.25, 0.35, 0.5, 0.7, 1.0)
"""Sides, over the long side, of the squares around a click in which its object is looked for."""
CROP, WIDER = 1.4, 2.2
"""Side of a crop over the subject's, and that of a second look where the first one contradicts flow."""
GRID = 12
"""Steps of a crop's place in its side: a crop that follows each pixel makes the outline flicker."""
EVERY = 4
"""Frames between key frames. Mean intersection over union on a swan 0.860 with 2, 0.933 with 4, 0.935 with
8; on a scooter 0.840 with 4, 0.798 with 8."""
OWN, NEAR = 0.25, 0.12
"""Share of a found part that flow must have carried there, and distance from it, over the crop's side, that a
part may reach."""
AGREES, SURE = 0.5, 0.7
"""Intersection over union of the found mask with the carried one, from which on the network is right, and
from which on the next key frame is `EVERY` frames away."""
SEAM = 0.024
"""Width of an outline over the root of the subject's area: thicker errors of a key frame are repaired."""
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
        found = list[tuple[Map, float, Mask]]()
        boxes = [_box(there, times) for times in (CROP, WIDER)]
        alike = colours.odds(self.pictures.picture(self.frame), COLOUR[0])
        for box in boxes:
            seen = self._seen(box)
            near = distance(there) < NEAR * (box.right - box.left)
            kept = _parts((seen > 0.5) & near, there, alike, area)
            found.append((_only(kept, seen), overlap(kept, there), kept))
            if found[-1][1] >= AGREES:
                return found[-1][:2]
        best = max(found, key=lambda each: each[1])
        # Two looks that agree with each other are right, not flow.
        agreed = overlap(found[0][2], found[1][2]) > best[1]
        return (best[0] if agreed else carried), best[1]

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


@dataclass(frozen=True)
class _Key:
    """A subject in a key frame."""

    at: int
    """Frames from the first one."""
    share: Map
    """(h, w) its probability."""
    sure: float
    """As of `Cut`."""
    area: float
    """Pixels of the whole subject."""


@dataclass
class SalientTrack:
    """A subject carried both ways from one frame through key frames, as far as it was asked for.

    Between key frames flow carries it from both, and the nearer one counts more. Errors as of
    `ClipPictures.picture`.
    """

    pictures: ClipPictures
    networks: Networks
    start: int
    """Frame in which it is known."""
    first: Cut
    """The subject there."""
    _keys: dict[int, list[_Key]] = field(default_factory=dict, repr=False)
    _steps: dict[int, int] = field(default_factory=dict, repr=False)

    def cut(self, frame: int) -> Cut:
        """Return the subject in a frame."""
        frames = self.pictures.frames
        at = frames.index(frame) - self._first
        way = 1 if at >= 0 else -1
        keys = self._until(way, abs(at))
        number = max(n for n, key in enumerate(keys) if key.at <= abs(at))
        key, share, sure = keys[number], self._repaired(way, number), keys[number].sure
        if key.at < abs(at):
            after = keys[number + 1]
            near = (abs(at) - key.at) / (after.at - key.at)
            here = self._carried(share, way, key.at, abs(at))
            back = self._carried(self._repaired(way, number + 1), way, after.at, abs(at))
            share, sure = cv2.addWeighted(here, 1 - near, back, near, 0), min(sure, after.sure)
        share = np.asarray(share, np.float32)
        return replace(self.first, share=share, sure=sure, area=float(np.count_nonzero(share > 0.5)))

    @cached_property
    def _first(self) -> int:
        return self.pictures.frames.index(self.start)

    def _until(self, way: int, at: int) -> list[_Key]:
        """Key frames one way, with one after frame number `at` and another one, where the clip has them."""
        end = len(self.pictures.frames) - 1 - self._first if way > 0 else self._first
        keys = self._keys.setdefault(way, [_Key(0, self.first.share, 1.0, self.first.area)])
        while keys[-1].at < end and (len(keys) < 3 or keys[-2].at <= at):
            keys.append(self._next(keys[-1], way, end))
        return keys

    def _next(self, before: _Key, way: int, end: int) -> _Key:
        step = self._steps.get(way, EVERY)
        while True:
            checkpoint()
            to = min(before.at + step, end)
            carried = self._carried(before.share, way, before.at, to)
            look = Look(self.networks, self.pictures, self._frame(way, to))
            share, agrees = look.next(carried, before.area, self.first.colours)
            if agrees >= SURE or step == 1 or not (carried > 0.5).any():
                self._steps[way] = min(2 * step, EVERY) if agrees >= SURE else step
                area = float(np.count_nonzero(share > 0.5))
                return _Key(to, share, agrees, area if area > WHOLE * before.area else before.area)
            step = max(step // 2, 1)

    def _frame(self, way: int, at: int) -> int:
        return self.pictures.frames[self._first + way * at]

    def _carried(self, share: Map, way: int, start: int, to: int) -> Map:
        """A probability (h, w), moved by flow from one frame number to another."""
        step = 1 if to > start else -1
        for at in range(start, to, step):
            share = warped(share, self.pictures.flow.there(self._frame(way, at + step), -way * step)[0])
        return share

    @remembered()
    def _repaired(self, way: int, number: int) -> Map:
        """A key frame's probability (h, w), with that of its neighbours where both contradict it."""
        keys = self._keys[way]
        at, share = keys[number].at, keys[number].share
        if not 0 < number < len(keys) - 1:
            return share
        near = [self._carried(each.share, way, each.at, at) for each in (keys[number - 1], keys[number + 1])]
        one, other, own = (each > 0.5 for each in (*near, share))
        width = max(round(SEAM * float(np.sqrt(np.count_nonzero(own)))), 1)
        disc = np.ones((2 * width + 1, 2 * width + 1), np.uint8)
        wrong = np.zeros_like(own)
        for part in (one & other & ~own, ~one & ~other & own):
            thick = cv2.morphologyEx(part.astype(np.uint8), cv2.MORPH_OPEN, disc)
            wrong |= (cv2.dilate(thick, disc) > 0) & part
        return np.where(wrong, (near[0] + near[1]) / 2, share)


def _box(mask: Mask, times: float = CROP) -> Box:
    """The square around a mask (h, w), in coarse steps of its place and size."""
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    extent = times * max(rows[-1] - rows[0] + 1, columns[-1] - columns[0] + 1, 16)
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
