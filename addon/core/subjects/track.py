"""A subject carried through key frames of a clip, and between them by optical flow."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import cv2
import numpy as np

from ..base.arrays import Map
from ..base.progress import checkpoint
from .cut import UNRECOGNISED, Cut, neighbours, next_cut
from .flow import warped
from .networks import Networks
from .pictures import EVERY, ClipPictures
from .salient import WHOLE, Look

SURE, SALIENT = 0.78, 0.7
"""Intersection over union of the found subject with the carried one, below which a key frame is put half as
far away, by the built-in networks and by a segmenter. With 0.7 the least frames of car and scooter by a click
have 0.76 and 0.67 instead of 0.81 and 0.71; with 0.85 no mask is better, and a walker costs a fifth more."""


@dataclass
class Track:
    """A subject carried both ways from one frame through key frames, as far as it was asked for.

    Key frames are those of `ClipPictures.keys`, and others between them where the subject changes much. Every
    frame is a key frame of a subject that no network recognises: a drawn disc that moves 9 pixels a frame has
    an intersection over union of 0.36 after a step of four frames. Between two key frames flow carries the
    subject from both, the nearer one counts more, and the built-in networks look again. So a frame costs the
    key frames between it and the first one. Errors as of `ClipPictures.picture`.
    """

    pictures: ClipPictures
    networks: Networks
    start: int
    """Frame in which it is known."""
    first: Cut
    """The subject there."""
    _keys: dict[int, list[tuple[int, Cut]]] = field(default_factory=dict, repr=False)
    """By way, numbers of frames, and the subject there."""

    def cut(self, frame: int) -> Cut:
        """Return the subject in a frame."""
        at = self.pictures.frames.index(frame)
        keys = self._until(1 if at >= self._first else -1, at)
        away = abs(at - self._first)
        number = next(n for n, (there, _) in enumerate(keys) if abs(there - self._first) >= away)
        there, key = keys[number]
        return key if there == at else self._between(keys[number - 1], keys[number], at)

    @cached_property
    def _first(self) -> int:
        return self.pictures.frames.index(self.start)

    def _until(self, way: int, at: int) -> list[tuple[int, Cut]]:
        """Key frames one way, up to frame number `at` at least."""
        keys = self._keys.setdefault(way, [(self._first, self.first)])
        while way * (at - keys[-1][0]) > 0:
            checkpoint()
            keys.append(self._next(way, keys))
        return keys

    def _next(self, way: int, keys: list[tuple[int, Cut]]) -> tuple[int, Cut]:
        """The key frame after others; one with too much change before it is put half as far away."""
        at, before = keys[-1]
        sure = SALIENT if self.first.is_salient else SURE
        grid = (at // EVERY + 1 if way > 0 else (at - 1) // EVERY) * EVERY
        away = abs(min(max(grid, 0), len(self.pictures.frames) - 1) - at)
        if len(keys) > 1:
            last = abs(at - keys[-2][0])
            away = min(away, 2 * last if before.sure >= sure else last)
        if before.trust < UNRECOGNISED:
            away = 1
        while True:
            to = at + way * away
            found = self._salient(at, before, to) if self.first.is_salient else self._stepped(at, before, to)
            if found.sure >= sure or away == 1 or not before.is_seen:
                return to, found
            away //= 2

    def _stepped(self, at: int, before: Cut, to: int) -> Cut:
        frames = self.pictures.frames
        return stepped(self.pictures, self.networks, before, frames[at], frames[to])

    def _salient(self, at: int, before: Cut, to: int) -> Cut:
        look = Look(self.networks, self.pictures, self.pictures.frames[to])
        share, agrees = look.next(self._carried(before.share, at, to), before.area, before.colours)
        area = float(np.count_nonzero(share > 0.5))
        return replace(
            before, share=share, sure=agrees, area=area if area > WHOLE * before.area else before.area
        )

    def _between(self, one: tuple[int, Cut], other: tuple[int, Cut], at: int) -> Cut:
        """The subject in a frame between two key frames."""
        (start, key), (end, next_key) = one, other
        near = (at - start) / (end - start)
        if not key.is_seen or not next_key.is_seen:
            near = float(next_key.is_seen)
        here, back = self._carried(key.share, start, at), self._carried(next_key.share, end, at)
        share = np.asarray(cv2.addWeighted(here, 1 - near, back, near, 0), np.float32)
        if self.first.is_salient:
            return replace(key, share=share, sure=min(key.sure, next_key.sure))
        frame, nearer = self.pictures.frames[at], key if near < 0.5 else next_key
        beside = neighbours(self.pictures, frame)
        return next_cut(self.networks, self.pictures.picture(frame), nearer, share, beside)

    def _carried(self, share: Map, start: int, to: int) -> Map:
        """A probability (h, w), moved by flow from one frame number to another."""
        frames, way = self.pictures.frames, 1 if to > start else -1
        for at in range(start, to, way):
            share = warped(share, self.pictures.flow.there(frames[at + way], frames[at])[0])
        return share


def stepped(pictures: ClipPictures, networks: Networks, before: Cut, start: int, frame: int) -> Cut:
    """Return a subject, known in frame `start`, in another frame near it."""
    if not before.is_seen:
        return before.gone()
    carried = warped(before.share, pictures.flow.there(frame, start)[0])
    step = pictures.frames.index(frame) - pictures.frames.index(start)
    beside = neighbours(pictures, frame, abs(step))[:: 1 if step > 0 else -1]
    return next_cut(networks, pictures.picture(frame), before, carried, beside)
