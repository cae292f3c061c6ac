"""Subjects of a clip that are found by themselves: what contradicts the static scene around."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial

import cv2
import numpy as np

from ..base.arrays import Bytes, Map, Mask
from ..base.lru_cache import LRUCache
from ..base.progress import checkpoint
from ..camera.reconstruction import Reconstruction
from ..depth.depth_store import DepthStore
from ..depth.matching import Matcher, winning_levels
from ..depth.moving_objects import MovingObjectOptions
from ..depth.multi_view_stereo import Moving
from ..media.picture_file import Pixels
from .flow import ClipFlow, brought_together
from .gate import moves
from .segmentation import SegmentationOptions, components, contradiction, segmented
from .static_plate import LeftOut, PlateOptions, StaticPlate

KEPT_EVIDENCE = 16
"""Frames whose evidence is remembered: those around one, and some more."""
KEPT_SOURCES = 64
"""Source frames of which it is remembered what moves in them: more than any frame needs."""
DECISION = "gate-000000"
"""File of a store with the decision whether the clip has moving objects."""


@dataclass(frozen=True)
class SubjectOptions:
    """How subjects are found."""

    plate: PlateOptions = field(default_factory=PlateOptions)
    """The static scene that they contradict."""
    segmentation: SegmentationOptions = field(default_factory=SegmentationOptions)
    """What belongs to them."""
    objects: MovingObjectOptions = field(default_factory=MovingObjectOptions)
    """Where they stand."""
    passes: int = 2
    """Times that what moves in source frames is found with what was found before left out. By eye: with one,
    parts of a dog that walks along the view stay in its own plate."""
    likely: float = 0.3
    """Probability from which on what its neighbours say to move in a source frame is left out. By eye."""
    grown: int = 7
    """Pixels across the dilation of what is left out of plates: its outline is no background. By eye."""
    reach: int = 2
    """Frames before and after whose evidence counts. By eye."""
    fade: float = 0.7
    """Times as much that evidence counts for each frame that it is away. By eye."""


@dataclass(frozen=True)
class Evidence:
    """What tells a clip's subjects from its static scene. Errors as of `PlaneSweepStereo.at`."""

    plates: StaticPlate
    flow: ClipFlow
    options: SubjectOptions
    left_out: LeftOut
    """What moves in a source frame, and is left out of the static scene."""
    find_left_out: Callable[[Sequence[int]], object]
    """Has that be found for source frames."""
    _single: LRUCache[tuple[Map, Map]] = field(
        default_factory=lambda: LRUCache[tuple[Map, Map]](KEPT_EVIDENCE), repr=False, compare=False
    )

    def at(self, frame: int) -> tuple[Map, Map]:
        """(h, w) log-odds that a pixel of the undistorted picture is a subject's, and the weight of that in
        [0, 1], by the static scene and the frames around."""
        return brought_together(self.flow, frame, self.alone, self.options.reach, self.options.fade)

    def of_frame(self, frame: int) -> tuple[Map, Map]:
        """The evidence of one frame alone."""
        checkpoint()
        sources = self.plates.around(frame)
        self.plates.find_depth(sources)
        self.find_left_out(sources)
        plate = self.plates.plate(frame, self.left_out)
        return contradiction(self.plates.picture(frame), plate, self.options.segmentation)

    def alone(self, frame: int) -> tuple[Map, Map]:
        """What `of_frame` tells, remembered."""
        return self._single.get(frame, lambda: self.of_frame(frame))


@dataclass(frozen=True)
class FoundSubjects:
    """What moves by itself in the frames of a clip, whole; asked for in order it is found faster.

    Depends on nothing but the clip, so that each frame is the same whichever was asked for before. Errors as
    of `PlaneSweepStereo.at`.
    """

    reconstruction: Reconstruction
    read: Callable[[int], Pixels]
    """A frame's picture (H, W, 3 or 4) as `Footage.read` gives it."""
    masks: Moving | None = None
    """What is known to move by itself, (h, w) of a source frame at any size."""
    options: SubjectOptions = field(default_factory=SubjectOptions)
    store: DepthStore | None = None
    """Where what is found is kept."""
    matcher: Matcher = winning_levels
    """Finds the depth levels of pixels."""

    @cached_property
    def is_sure(self) -> bool:
        """Whether the clip certainly has moving objects. In other clips no subject is found: an apparent one
        is a part of the static scene that few frames see."""
        known = None if self.store is None else self.store.read(DECISION, ("moves",))
        if known is not None:
            return bool(known["moves"])
        found = moves(self.reconstruction, self.read)
        if self.store is not None:
            self.store.write(DECISION, {"moves": np.array(found)})
        return found

    def mask(self, frame: int) -> Mask | None:
        """(h, w) what moves by itself, over the source frame with its distortion, at the size worked at; None
        for a clip without moving objects."""
        if not self.is_sure:
            return None
        return self._kept(frame, "moving", lambda: self._outlined(frame, *self.evidence.at(frame)))

    def mask_alone(self, frame: int) -> Mask | None:
        """(h, w) as `mask`, by the evidence of the frame itself: parts of an outline can be missing. In a
        fifth of the time, where the frames around are not asked for."""
        if not self.is_sure:
            return None
        return self._kept(frame, "alone", lambda: self._outlined(frame, *self.evidence.alone(frame)))

    def _kept(self, frame: int, kind: str, find: Callable[[], Mask]) -> Mask:
        return find() if self.store is None else self.store.moving(frame, find, kind)

    def _outlined(self, frame: int, odds: Map, weight: Map) -> Mask:
        """(h, w) subjects over a source frame, of log-odds (h, w) with their weights (h, w)."""
        options = self.options.segmentation
        found = components(segmented(self.picture(frame), odds, weight, options), odds, weight, options)
        return self.plates.canvas(frame).mask_to_source(found)

    def picture(self, frame: int) -> Bytes:
        """(h, w, 3) a frame's undistorted picture at the size worked at, display-encoded RGB."""
        return self.plates.picture(frame)

    @cached_property
    def evidence(self) -> Evidence:
        """What tells them."""
        return self._after(self.options.passes)

    def _after(self, passes: int) -> Evidence:
        """The evidence after so many passes over source frames."""
        left_out, find = (partial(each, passes) for each in (self._left_out, self._find_left_out))
        return Evidence(self.plates, self.flow, self.options, left_out, find)

    @cached_property
    def plates(self) -> StaticPlate:
        """The static scene."""
        return StaticPlate(
            self.reconstruction, self.read, self.masks, self.options.plate, self.store, self.matcher
        )

    @cached_property
    def flow(self) -> ClipFlow:
        """Optical flow at the size worked at."""
        return ClipFlow(tuple(int(frame) for frame in self.reconstruction.frames), self.picture)

    def _left_out(self, passes: int, frame: int) -> Mask:
        """(h, w) what moves in a source frame after some passes, a little wider: no part of the static scene.

        Each pass leaves out of the frames around what the one before has found in them; without any it is
        what a frame's own neighbours tell. Only what a frame needs is found, as a clip may be long.
        """
        return self._passes[passes].get(frame, lambda: self._of_pass(passes, [frame])[frame])

    def _find_left_out(self, passes: int, frames: Sequence[int]) -> None:
        """Have `_left_out` be known for frames, each that no other process is at first."""
        new = [frame for frame in frames if frame not in self._passes[passes]]
        for frame, mask in self._of_pass(passes, new).items():
            self._passes[passes].get(frame, partial(np.asarray, mask))

    def _of_pass(self, passes: int, frames: Sequence[int]) -> dict[int, Mask]:
        find = partial(self._found_in_pass, passes)
        if self.store is None or not passes:
            return {frame: find(frame) for frame in frames}
        return self.store.masks(frames, f"alone-{passes}", find)

    def _found_in_pass(self, passes: int, frame: int) -> Mask:
        hinted = self._grown(self.plates.moving(frame)) if passes == 0 else self._left_out(0, frame)
        if passes == 0:
            return hinted
        options = self.options
        odds, weight = self._after(passes - 1).of_frame(frame)
        probability = segmented(self.picture(frame), odds, weight, options.segmentation)
        own = self._grown(components(probability, odds, weight, options.segmentation))
        return own | (hinted & (probability > options.likely))

    @cached_property
    def _passes(self) -> list[LRUCache[Mask]]:
        """What was found in source frames, by passes."""
        return [LRUCache(KEPT_SOURCES) for _ in range(self.options.passes + 1)]

    def _grown(self, mask: Mask) -> Mask:
        around = np.ones((self.options.grown,) * 2, np.uint8)
        closed = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, around)
        return np.asarray(cv2.dilate(closed, around) > 0)
