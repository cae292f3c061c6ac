"""A subject that the user marks by strokes: cut out where they are, and carried through the clip."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import cv2
import numpy as np

from ..base.arrays import Bytes, Map, Mask
from ..base.progress import checkpoint
from .flow import warped
from .found import Evidence, FoundSubjects
from .parts import of_its_colours, without_islands
from .segmentation import ColourModel, logistic, smoothed
from .stroke_cut import CarryOptions, contradicts, cut_out
from .strokes import MarkedSubject, Stroke

KEPT_SUBJECTS = 12
"""Marked subjects that are remembered: a clip's, and those before the last strokes."""


GLIMPSE, GLIMPSE_ITERATIONS = 2, 2
"""Times smaller that a frame is for a first look, and iterations of GrabCut: a tenth of the time."""


RIM = 5
"""Pixels across what is no more than the rim of something that moves. By eye."""


@dataclass(frozen=True)
class Cut:
    """A subject in one frame."""

    share: Bytes
    """(h, w) probability in 255ths, over the undistorted picture at the size worked at."""
    sure: float
    """In [0, 1]: intersection over union with what was carried there; 1 in a frame with a stroke."""


@dataclass(frozen=True)
class _Track:
    """What is carried from a frame with strokes one way."""

    cuts: list[Cut]
    area: float
    """Pixels, where it was last seen whole."""
    velocity: tuple[float, float]
    """Pixels a frame of its middle, when it was last seen whole."""
    whole: Bytes
    """(h, w) as `Cut.share`, where it was last seen whole."""
    others: Mask
    """(h, w) what else contradicts the static scene, in the last of the cuts."""
    number: int = 0
    """Of that one among the cuts."""


@dataclass(frozen=True)
class CarriedSubject:
    """A subject in the frames of a clip, by strokes in some of them.

    From each frame with strokes it is carried both ways; between two such frames what comes from either side
    counts the more the nearer that is (Bai et al., "Video SnapCut", 2009, carries colours and shape, too).
    Then it is carried once more, with what was found left out of the static scene: what pauses, or walks
    towards the camera, is seen in one place so long that it is taken for static there. Errors as of
    `FoundSubjects.mask`.
    """

    found: FoundSubjects
    strokes: tuple[Stroke, ...]
    options: CarryOptions = field(default_factory=CarryOptions)
    passes: int = 2
    """Times that it is carried."""
    _tracks: dict[tuple[int, int], _Track] = field(default_factory=dict, repr=False, compare=False)
    _marked: dict[int, Cut] = field(default_factory=dict, repr=False, compare=False)
    _blending: dict[int, bool] = field(default_factory=dict, repr=False, compare=False)
    _on_the_way: dict[int, Evidence] = field(default_factory=dict, repr=False, compare=False)

    @property
    def marked_frames(self) -> list[int]:
        """Frames with strokes that add, ascending."""
        return sorted({stroke.frame for stroke in self.strokes if stroke.adds})

    def mask(self, frame: int) -> Mask:
        """(h, w) the subject, over the source frame with its distortion, at the size worked at."""
        return self.found.plates.canvas(frame).mask_to_source(self.cut(frame).share > 127)

    def looks(self, frame: int) -> Iterator[Mask]:
        """(h, w) as `mask`, as soon as something of it is known: by colours, then of each pass."""
        if frame in self.marked_frames:
            yield self.glimpse(frame)
        if self.before is not None:
            yield self.before.mask(frame)
        yield self.mask(frame)

    def glimpse(self, frame: int) -> Mask:
        """(h, w) as `mask`, of the strokes in a frame and its colours alone: in a fraction of a second, where
        the static scene may take many. Empty in a frame without strokes that add."""
        picture = self.found.picture(frame)
        size = tuple(each // GLIMPSE for each in picture.shape[1::-1])
        small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
        adds, takes = (
            cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_AREA) > 0
            for mask in self._strokes_in(frame)
        )
        options = replace(self.options, iterations=GLIMPSE_ITERATIONS)
        share = cut_out(np.asarray(small), (adds, takes), None, options, self.found.options.segmentation)
        whole = cv2.resize(share, picture.shape[1::-1], interpolation=cv2.INTER_LINEAR)
        return self.found.plates.canvas(frame).mask_to_source(whole > 0.5)

    def cut(self, frame: int) -> Cut:
        """The subject in a frame, carried there as far as that was not done before."""
        marked = self.marked_frames
        if frame in marked:
            return self._at_strokes(frame)
        before = max((each for each in marked if each < frame), default=None)
        after = min((each for each in marked if each > frame), default=None)
        ways = [self._carried(start, frame) for start in (before, after) if start is not None]
        if before is None or after is None:
            return ways[0]
        near = (frame - before) / (after - before)
        share = cv2.addWeighted(ways[0].share, 1 - near, ways[1].share, near, 0)
        both = (ways[0].share > 127, ways[1].share > 127)
        return Cut(np.asarray(share, np.uint8), max(min(way.sure for way in ways), _overlap(*both)))

    @cached_property
    def before(self) -> CarriedSubject | None:
        """The pass before."""
        passes = self.passes - 1
        return CarriedSubject(self.found, self.strokes, self.options, passes) if passes else None

    def _evidence(self, start: int) -> Evidence:
        """What tells the subject carried from a frame with strokes."""
        if self.before is not None:
            return self._evidence_after
        return self._evidence_on_the_way(start) if self._blends_in(start) else self.found.evidence

    def _blends_in(self, start: int) -> bool:
        """Whether what is under a frame's strokes hardly contradicts the static scene, of which it is taken
        for a part then: it pauses, or walks along the view."""
        if start not in self._blending:
            adds, _ = self._strokes_in(start)
            evidence = self.found.evidence.at(start)
            self._blending[start] = not contradicts(adds, evidence, self.options)
        return self._blending[start]

    @cached_property
    def _evidence_after(self) -> Evidence:
        """With what the pass before has found left out."""
        before = self.before
        assert before is not None
        return self.found.evidence_without(lambda frame: before.cut(frame).share > 127)

    def _evidence_on_the_way(self, start: int) -> Evidence:
        """By those source frames alone that lie nearer to a frame with strokes, to which it was carried
        before: no other is known to be free of it."""
        if start not in self._on_the_way:
            numbers = {frame: number for number, frame in enumerate(self.found.flow.frames)}

            def far(frame: int) -> int:
                return abs(numbers[frame] - numbers[start])

            def tells(frame: int, source: int) -> bool:
                # A frame asks for the evidence of those around, too.
                return far(source) < far(frame) - self.found.options.reach

            self._on_the_way[start] = self.found.evidence_without(
                lambda source: self._carried(start, source).share > 127, tells
            )
        return self._on_the_way[start]

    def _at_strokes(self, frame: int) -> Cut:
        if frame not in self._marked:
            own = self.found.evidence if self.before is None else self._evidence_after
            evidence, segmentation = own.at(frame), self.found.options.segmentation
            mine = self._strokes_in(frame)
            share = cut_out(self.found.picture(frame), mine, evidence, self.options, segmentation)
            self._marked[frame] = Cut(_bytes(share), 1.0)
        return self._marked[frame]

    def _strokes_in(self, frame: int) -> tuple[Mask, Mask]:
        """(h, w) what the strokes in a frame add, and what they take away."""
        canvas = self.found.plates.canvas(frame)
        size = np.array([canvas.camera.width, canvas.camera.height])
        shape = self.found.picture(frame).shape[:2]
        rasters = np.zeros((2, *shape), np.uint8)
        width = max(round(self.options.width * max(shape)), 1)
        for stroke in (each for each in self.strokes if each.frame == frame):
            at = canvas.features_from_source(np.array(stroke.places) * size) - 0.5
            line = np.rint(at * 16).astype(np.int32)[:, None]
            cv2.polylines(rasters[0 if stroke.adds else 1], [line], False, 1, width, shift=4)
        return rasters[0] > 0, rasters[1] > 0

    def _carried(self, start: int, frame: int) -> Cut:
        """The subject carried from a frame with strokes to another one."""
        frames = self.found.flow.frames
        first, last = frames.index(start), frames.index(frame)
        way = 1 if last > first else -1
        key = (start, way)
        if start == frame:
            return self._at_strokes(start)
        if key not in self._tracks:
            cut = self._at_strokes(start)
            area = np.count_nonzero(cut.share > 127)
            others = _others(cut.share > 127, *self.found.evidence.at(start))
            self._tracks[key] = _Track([cut], float(area), (0.0, 0.0), cut.share, others)
        while len(self._tracks[key].cuts) <= abs(last - first):
            checkpoint()
            at = first + way * len(self._tracks[key].cuts)
            self._tracks[key] = self._further(start, self._tracks[key], frames[at], way)
        return self._tracks[key].cuts[abs(last - first)]

    def _further(self, start: int, track: _Track, frame: int, way: int) -> _Track:
        """A track with the next frame of its way."""
        before, options = track.cuts[-1].share, self.options
        place, _ = self.found.flow.there(frame, -way)
        ago = next(n for n, cut in enumerate(reversed(track.cuts)) if cut.share.any())
        if ago:
            # What was seen of it last may have been its rest beside what hides it.
            x, y = np.array(track.velocity) * (len(track.cuts) - track.number)
            prior = cv2.warpAffine(track.whole, np.array([[1, 0, x], [0, 1, y]]), before.shape[::-1])
        else:
            prior = np.asarray(warped(before.astype(np.float32), place), np.uint8)
        others = warped(track.others.astype(np.float32), place) > 0.5
        cut, others = self._cut(start, frame, np.asarray(prior), others, ago)
        track = replace(track, others=others)
        seen, area = cut.share > 127, track.area
        if np.count_nonzero(seen) < options.lost * area:
            # What is left of it would be carried as if it were all.
            return replace(track, cuts=[*track.cuts, Cut(np.zeros_like(before), 0.0)])
        if np.count_nonzero(seen) < options.whole * area:
            # Its middle moves as it gets hidden, or comes out.
            return replace(track, cuts=[*track.cuts, cut])
        now = track.velocity if ago else _shift(before > 127, seen)
        velocity = tuple(0.7 * old + 0.3 * new for old, new in zip(track.velocity, now, strict=True))
        if not any(track.velocity):
            velocity = now
        area = 0.8 * area + 0.2 * float(np.count_nonzero(seen))
        return _Track(
            [*track.cuts, cut], area, (velocity[0], velocity[1]), cut.share, others, len(track.cuts)
        )

    def _cut(self, start: int, frame: int, prior: Bytes, others: Mask, hidden: int) -> tuple[Cut, Mask]:
        """The subject in a frame in which it is expected at a prior (h, w) of 255, and others that move at
        (h, w); and (h, w) those.

        It was `hidden` for so many frames before: then only what contradicts the static scene can be it.
        """
        options, picture = self.options, self.found.picture(frame)
        long_side, there = max(picture.shape), prior > 127
        inwards = cv2.distanceTransform(there.astype(np.uint8), cv2.DIST_L2, 5)
        outwards = cv2.distanceTransform((~there).astype(np.uint8), cv2.DIST_L2, 5)
        odds, weight = self._evidence(start).at(frame)
        trust = 1.0 if hidden else self._moves(there, odds, weight)
        most = (1 - trust) * options.carried + trust * options.carried_moving
        carried = np.clip((inwards - outwards) / (options.band * long_side), -1, 1) * most
        if hidden:
            carried = np.where(there, 0, -options.carried_moving)
        carried[outwards > options.leap * long_side] = -3 * options.carried
        # What is left out of the static scene does not agree with it by being a part of it.
        agrees = 1.0 if self.before is not None or self._blends_in(start) else trust
        told = options.told * weight * np.where(odds > 0, odds, np.float32(agrees) * odds)
        # What was another thing that moves is so still, unless its colours are the subject's.
        others &= ~there | (not hidden)
        told = np.where(others, np.minimum(told, 0), told)
        carried = np.where(others, np.minimum(carried, -options.carried_moving), carried)
        colours = self._colours.odds(picture, options.colour)
        total = np.asarray(told + carried + colours, np.float32)
        segmentation = self.found.options.segmentation
        share = logistic(smoothed(picture, total, segmentation.near_lambda, segmentation))
        kept = without_islands(share > 0.5, there, np.asarray(told), options.island)
        kept = of_its_colours(kept, colours, options.another)
        share = np.where(kept | (share <= 0.5), share, 0)
        cut = Cut(_bytes(share), _overlap(share > 0.5, there))
        return cut, _others(share > 0.5, odds, weight)

    def _moves(self, there: Mask, odds: Map, weight: Map) -> float:
        """In [0, 1] how surely a subject (h, w) contradicts the static scene, wherever it is seen."""
        low, high = self.options.moves
        known = float(weight[there].sum())
        share = float((weight * (odds > 0.5))[there].sum()) / max(known, 1.0)
        return float(np.clip((share - low) / (high - low), 0, 1))

    @cached_property
    def _colours(self) -> ColourModel:
        """Of the frames with strokes."""
        models = [
            ColourModel.of(
                self.found.picture(frame),
                np.asarray(self._at_strokes(frame).share / 255, np.float32),
                self.found.options.segmentation,
            )
            for frame in self.marked_frames
        ]
        return ColourModel.mean(models)


@dataclass(frozen=True)
class ClipSubjects:
    """Subjects of a clip, whatever is marked."""

    found: FoundSubjects
    _carried: OrderedDict[str, CarriedSubject] = field(default_factory=OrderedDict, repr=False, compare=False)

    def carried(self, marked: MarkedSubject) -> CarriedSubject:
        """A marked subject in the frames of the clip; the last `KEPT_SUBJECTS` are remembered."""
        carried = self._carried.setdefault(marked.key, CarriedSubject(self.found, marked.strokes))
        self._carried.move_to_end(marked.key)
        while len(self._carried) > KEPT_SUBJECTS:
            self._carried.popitem(last=False)
        return carried


def _others(subject: Mask, odds: Map, weight: Map) -> Mask:
    """(h, w) what else than a subject (h, w) contradicts the static scene, by log-odds (h, w) and their
    weights (h, w), and is more than the rim of something."""
    found = ((odds * weight > 0.5) & ~subject).astype(np.uint8)
    return np.asarray(cv2.morphologyEx(found, cv2.MORPH_OPEN, np.ones((RIM, RIM), np.uint8)) > 0)


def _bytes(share: Map) -> Bytes:
    return np.rint(255 * share).astype(np.uint8)


def _overlap(one: Mask, other: Mask) -> float:
    """Intersection over union of two masks (h, w); 1 of two that are empty."""
    union = np.count_nonzero(one | other)
    return np.count_nonzero(one & other) / union if union else 1.0


def _shift(before: Mask, now: Mask) -> tuple[float, float]:
    """Pixels from the middle of a mask (h, w) to that of the next one."""
    middles = [np.argwhere(mask).mean(axis=0) if mask.any() else np.zeros(2) for mask in (before, now)]
    down, across = middles[1] - middles[0]
    return float(across), float(down)
