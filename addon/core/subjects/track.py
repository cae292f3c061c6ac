"""A subject carried through key frames of a clip, and between them by optical flow."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import cv2
import numpy as np

from ..base.arrays import Map
from ..base.progress import checkpoint
from .cut import Cut, neighbours, next_cut
from .flow import warped
from .networks import Networks
from .pictures import ClipPictures
from .salient import WHOLE, Look

EVERY = 4
"""Frames between key frames. Mean intersection over union on a swan 0.860 with 2, 0.933 with 4, 0.935 with
8; on a scooter 0.840 with 4, 0.798 with 8."""
SURE = 0.7
"""Intersection over union of the found mask with the carried one, from which on the next key frame is `EVERY`
frames away."""


@dataclass
class Track:
    """A subject carried both ways from one frame through key frames, as far as it was asked for.

    With the built-in networks each frame is a key frame. Between those of a segmenter flow carries the
    subject from both, and the nearer one counts more. Errors as of `ClipPictures.picture`.
    """

    pictures: ClipPictures
    networks: Networks
    start: int
    """Frame in which it is known."""
    first: Cut
    """The subject there."""
    _keys: dict[int, list[tuple[int, Cut]]] = field(default_factory=dict, repr=False)
    """By way, frames from the first one, and the subject there."""
    _steps: dict[int, int] = field(default_factory=dict, repr=False)

    def cut(self, frame: int) -> Cut:
        """Return the subject in a frame."""
        at = self.pictures.frames.index(frame) - self._first
        way = 1 if at >= 0 else -1
        at = abs(at)
        keys = self._until(way, at)
        number = max(n for n, (there, _) in enumerate(keys) if there <= at)
        before, key = keys[number]
        if before == at:
            return key
        after, next_key = keys[number + 1]
        near = (at - before) / (after - before)
        here, back = self._carried(key.share, way, before, at), self._carried(next_key.share, way, after, at)
        share = np.asarray(cv2.addWeighted(here, 1 - near, back, near, 0), np.float32)
        return replace(key, share=share, sure=min(key.sure, next_key.sure))

    @cached_property
    def _first(self) -> int:
        return self.pictures.frames.index(self.start)

    def _until(self, way: int, at: int) -> list[tuple[int, Cut]]:
        """Key frames one way, up to frame number `at` at least."""
        keys = self._keys.setdefault(way, [(0, self.first)])
        following = self._salient if self.first.is_salient else self._next
        while keys[-1][0] < at:
            checkpoint()
            keys.append(following(*keys[-1], way))
        return keys

    def _next(self, at: int, before: Cut, way: int) -> tuple[int, Cut]:
        to = at + 1
        if not before.is_seen:
            return to, before.gone()
        frame = self._frame(way, to)
        beside = neighbours(self.pictures, frame)[::way]
        carried = self._carried(before.share, way, at, to)
        return to, next_cut(self.networks, self.pictures.picture(frame), before, carried, beside)

    def _salient(self, at: int, before: Cut, way: int) -> tuple[int, Cut]:
        end = len(self.pictures.frames) - 1 - self._first if way > 0 else self._first
        step = self._steps.get(way, EVERY)
        while True:
            to = min(at + step, end)
            carried = self._carried(before.share, way, at, to)
            look = Look(self.networks, self.pictures, self._frame(way, to))
            share, agrees = look.next(carried, before.area, before.colours)
            if agrees >= SURE or step == 1 or not (carried > 0.5).any():
                self._steps[way] = min(2 * step, EVERY) if agrees >= SURE else step
                area = float(np.count_nonzero(share > 0.5))
                area = area if area > WHOLE * before.area else before.area
                return to, replace(before, share=share, sure=agrees, area=area)
            step = max(step // 2, 1)

    def _frame(self, way: int, at: int) -> int:
        return self.pictures.frames[self._first + way * at]

    def _carried(self, share: Map, way: int, start: int, to: int) -> Map:
        """A probability (h, w), moved by flow from one frame number to another."""
        step = 1 if to > start else -1
        for at in range(start, to, step):
            share = warped(share, self.pictures.flow.there(self._frame(way, at + step), -way * step)[0])
        return share
