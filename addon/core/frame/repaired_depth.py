"""Depth of frames as the user's repairs leave it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from ..base.arrays import LinearRGBA, Map, Mask
from ..camera.canvas import Canvas
from ..depth.source import DepthSource, PixelDepth
from ..focus.focus import Focus
from ..focus.place import PlaceFinder
from ..optics.thin_lens import ThinLens
from .clip_context import ClipContext
from .highlights import HighlightSettings
from .repairs import Repair, repaired


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
        for found in (_region(self.clip, each, frame) for each in self.repairs):
            if found is not None:
                rows, columns = found[0].shape
                if found[0][min(int(y * rows), rows - 1), min(int(x * columns), columns - 1)] > 0.5:
                    return True
        return False


def _region(clip: ClipContext, repair: Repair, frame: int) -> tuple[Map, Mask] | None:
    """Region (h, w) and reference (h, w) of a repair in a frame; None where the frame lacks it."""
    # Photos do not follow each other.
    is_shared = clip.reconstruction.is_ordered or repair.frame == frame
    return clip.carried_places.region(repair, frame) if is_shared else None
