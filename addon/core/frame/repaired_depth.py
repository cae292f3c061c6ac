"""Depth of frames as the user's repairs leave it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import cv2
import numpy as np

from ..base.arrays import LinearRGBA, Map, Mask
from ..camera.canvas import Canvas
from ..depth.source import DepthSource, PixelDepth
from ..focus.focus import Focus
from ..focus.follow import EVERY, smoothed
from ..focus.place import Place, PlaceFinder
from ..focus.subject import inverse_depths
from ..optics.thin_lens import ThinLens
from ..subjects.clip_subjects import pixel_at
from .clip_context import ClipContext
from .highlights import HighlightSettings
from .repairs import Repair, repaired

COVERED = 1 / 3
"""Share of a subject above which repairs may change its median depth: the outline of a painted region grows
where it snaps to edges of the picture."""


def with_repairs(
    clip: ClipContext,
    frame: int,
    depth: PixelDepth,
    repairs: Sequence[Repair],
    canvas: Canvas,
    picture: LinearRGBA,
    lens: ThinLens,
) -> PixelDepth:
    """Repair the depth of a frame.

    Args:
        clip: The clip.
        frame: Number of the frame.
        depth: Depth of the canvas's pixels.
        repairs: Repairs in their order.
        canvas: The frame's canvas.
        picture: (H, W, 4) linear picture of the canvas.
        lens: Lens of the frame, for "sharp".

    Returns:
        The depth, with new values in the regions.

    Raises:
        UserError: A frame between the painted one and this one cannot be read.
    """
    if not repairs:
        return depth
    return repaired(depth, repairs, lambda one: _region(clip, one, frame), canvas, picture, lens)


def repaired_places(
    clip: ClipContext, frame: int, repairs: Sequence[Repair], focus: Focus | None
) -> PlaceFinder:
    """Return the finder of focus in a registered frame, whose depth the user has repaired.

    Args:
        clip: The clip.
        frame: Number of the frame.
        repairs: Repairs in their order.
        focus: The present focus, at which "sharp" repairs are; without one these are left out.

    Raises:
        UserError: The frame has no camera.
    """
    kept = tuple(each for each in repairs if focus is not None or each.kind != "sharp")
    if not kept:
        return clip.places(frame)
    depth = _RepairedDepth(clip, kept, focus or Focus(distance=1.0))
    return clip.places(frame, depth, partial(depth.covers, frame))


def repaired_subject(clip: ClipContext, name: str, frame: int, repairs: Sequence[Repair]) -> Place:
    """Focus on a subject and follow it through the clip, at the depth that repairs give it.

    Args:
        clip: The clip.
        name: Name of the subject.
        frame: Frame of the place.
        repairs: Repairs in their order. "Sharp" ones are left out: they are in focus at any distance.

    Raises:
        UserError: As of `ClipContext.subject_place`.
    """
    place, mask = clip.subject_place(name, frame), clip.parts.named(name).mask
    kept = tuple(each for each in repairs if each.kind != "sharp")
    if not kept:
        return place
    frames, depth = list(place.followed), _RepairedDepth(clip, kept, Focus(distance=1.0))
    asked = sorted({*frames[::EVERY], frames[-1], frame})
    covered = [each for each in asked if depth.covers_subject(each, mask(each))]
    if not covered:
        return place
    found = dict(inverse_depths(clip.reconstruction, depth, mask, covered))
    # A frame where the region snapped to a wrong edge does not count.
    factors = smoothed([place.followed[each] * found[each] if each in found else 1.0 for each in asked])
    followed = {each: place.followed[each] / float(np.interp(each, asked, factors)) for each in frames}
    return replace(
        place, focus=Focus(distance=followed[frame]), distance=followed[frame], followed=followed,
        source=f"{place.source}, repaired",
    )  # fmt: skip


@dataclass(frozen=True)
class _RepairedDepth(DepthSource):
    """The clip's depth with repairs."""

    clip: ClipContext
    repairs: tuple[Repair, ...]
    focus: Focus

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth | None:
        """Return the depth of all pixels of the canvas (H, W); of any picture, the frame's own is used."""
        shown = canvas.from_source(self.clip.picture(frame, HighlightSettings(gain=0.0)))
        known = self.clip.depth_source().at(frame, canvas, shown)
        if known is None:
            return None
        lens = self.focus.lens(self.clip.reconstruction, frame, canvas.pinhole, 1.0)
        return with_repairs(self.clip, frame, known, self.repairs, canvas, shown, lens)

    def kept(self, frame: int, canvas: Canvas) -> PixelDepth | None:
        """Return None: repairs are carried by optical flow, which takes seconds in a distant frame."""
        return None

    def covers(self, frame: int, x: float, y: float) -> bool:
        """Return whether a repair covers fractions x, y of a frame's picture."""
        return any(pixel_at(painted, x, y) for painted in self._painted(frame))

    def covers_subject(self, frame: int, shown: Mask) -> bool:
        """Return whether repairs may change the median depth of a subject (h, w) of a frame."""
        covered = np.zeros(shown.shape, bool)
        for painted in self._painted(frame):
            covered |= cv2.resize(painted.astype(np.uint8), shown.shape[::-1]) > 0
        return bool(np.count_nonzero(covered & shown) > COVERED * np.count_nonzero(shown))

    def _painted(self, frame: int) -> list[Mask]:
        """The regions (h, w) of the repairs that a frame shows."""
        found = (_region(self.clip, each, frame) for each in self.repairs)
        return [each[0] > 0.5 for each in found if each is not None]


def _region(clip: ClipContext, repair: Repair, frame: int) -> tuple[Map, Mask] | None:
    """Region (h, w) and reference (h, w) of a repair in a frame; None where the frame lacks it."""
    # Photos do not follow each other.
    is_shared = clip.reconstruction.is_ordered or repair.frame == frame
    return clip.carried_places.region(repair, frame) if is_shared else None
