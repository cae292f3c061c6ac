"""A subject carried from the frames in which it is known through the rest of the clip."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import cv2
import numpy as np

from ..base.arrays import Mask
from ..base.lru_cache import remembered
from .cut import Cut, first_cut, neighbours
from .networks import Networks
from .odds import overlap
from .pictures import ClipPictures
from .salient import Look
from .strokes import Stroke
from .track import Track, stepped

STROKE = 0.01
"""Width of a stroke, over the long side."""
UNSURE = 0.75
"""Intersection over union with the place where flow carries a subject, below which a frame is unsure."""


@dataclass(frozen=True)
class CarriedSubject:
    """A subject that strokes mark in some frames of a clip.

    It is carried both ways from each frame with strokes; between two such frames the nearer one counts more
    (Bai et al., "Video SnapCut", 2009). Strokes in a frame in which the strokes before them have found the
    subject correct it.
    """

    pictures: ClipPictures
    networks: Networks
    strokes: tuple[Stroke, ...]
    carried: Callable[[tuple[Stroke, ...]], CarriedSubject] | None = None
    """Returns the subject of fewer strokes, which may be carried already."""
    _tracks: dict[int, Track] = field(default_factory=dict, repr=False, compare=False)

    @cached_property
    def marked_frames(self) -> list[int]:
        """Frames with strokes that add, ascending; of a subject without such strokes, those with any."""
        adding = {stroke.frame for stroke in self.strokes if stroke.adds}
        correcting = {stroke.frame for stroke in self.strokes} if adding else set()
        return sorted(adding | correcting)

    def mask(self, frame: int) -> Mask:
        """Return the subject (h, w) in a frame; errors as of `ClipPictures.picture`."""
        return self.cut(frame).mask

    def masks(self, frame: int) -> Iterator[Mask]:
        """Yield the subject (h, w) in a frame; the last one equals `mask`.

        A frame with strokes first yields its cut before the comparison with its neighbours. Errors as of
        `ClipPictures.picture`.
        """
        if frame in self.marked_frames and frame not in self._tracks:
            yield self._first(frame)[0].mask
        yield self.mask(frame)

    def cut(self, frame: int) -> Cut:
        """Return the subject in a frame; errors as of `ClipPictures.picture`."""
        marked = self.marked_frames
        before = max((each for each in marked if each <= frame), default=None)
        after = min((each for each in marked if each >= frame), default=None)
        ways = [self._track(start).cut(frame) for start in (before, after) if start is not None]
        if before is None or after is None or before == after:
            return ways[0]
        near = (frame - before) / (after - before)
        share = cv2.addWeighted(ways[0].share, 1 - near, ways[1].share, near, 0)
        sure = max(min(way.sure for way in ways), overlap(ways[0].mask, ways[1].mask))
        return replace(ways[0], share=np.asarray(share, np.float32), sure=sure)

    def _track(self, start: int) -> Track:
        if start not in self._tracks:
            self._tracks[start] = Track(self.pictures, self.networks, start, self._marked(start))
        return self._tracks[start]

    def _marked(self, frame: int) -> Cut:
        """The subject in a frame with strokes."""
        first, corrects = self._first(frame)
        return first if corrects or first.is_salient else self._settled(frame, first)

    @remembered(math.inf)
    def _first(self, frame: int) -> tuple[Cut, bool]:
        """The subject in a frame with strokes, and whether these correct what earlier ones have found."""
        number = next(i for i, stroke in enumerate(self.strokes) if stroke.frame == frame)
        prior = self._prior(frame, self.strokes[:number])
        picture, strokes = self.pictures.picture(frame), self.strokes_in(frame)
        if prior is None and self.networks.segmenter is not None:
            share = Look(self.networks, self.pictures, frame).first(strokes[0])
            if share is not None:
                found = Cut.known(picture, np.where(strokes[1], np.float32(0), share), 1.0)
                return replace(found, is_salient=True), False
        beside = neighbours(self.pictures, frame)
        found = first_cut(self.networks, picture, strokes, beside, None if prior is None else prior.share)
        return (found, False) if prior is None else (replace(found, is_salient=prior.is_salient), True)

    def _prior(self, frame: int, earlier: tuple[Stroke, ...]) -> Cut | None:
        """It in a frame by earlier strokes; None where none of them adds."""
        if not any(stroke.adds for stroke in earlier):
            return None
        known = self.carried or partial(CarriedSubject, self.pictures, self.networks)
        return known(earlier).cut(frame)

    def _settled(self, frame: int, first: Cut) -> Cut:
        """A subject carried to frames beside it and back, which shows more of how it moves."""
        frames = self.pictures.frames
        at = frames.index(frame)
        adds, takes = self.strokes_in(frame)
        for other in (*frames[max(at - 1, 0) : at], *frames[at + 1 : at + 2]):
            there = stepped(self.pictures, self.networks, first, frame, other)
            back = stepped(self.pictures, self.networks, there, other, frame)
            share = np.where(takes, 0, np.where(adds, 1, back.share))
            first = Cut.known(self.pictures.picture(frame), np.asarray(share, np.float32), back.trust)
        return first

    def strokes_in(self, frame: int) -> tuple[Mask, Mask]:
        """Return the pixels (h, w) that the strokes in a frame add, and those that they take away."""
        height, width = self.pictures.picture(frame).shape[:2]
        rasters = np.zeros((2, height, width), np.uint8)
        thick = max(round(STROKE * max(height, width)), 1)
        for stroke in (each for each in self.strokes if each.frame == frame):
            # OpenCV draws nothing of a line with one corner.
            places = stroke.places if len(stroke.places) > 1 else 2 * stroke.places
            at = np.array(places) * (width, height) - 0.5
            line = np.rint(at * 16).astype(np.int32)[:, None]
            cv2.polylines(rasters[0 if stroke.adds else 1], [line], False, 1, thick, shift=4)
        return rasters[0] > 0, (rasters[1] > 0) & ~(rasters[0] > 0)
