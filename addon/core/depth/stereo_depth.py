"""Depth found in the clip itself, by stereo fused over time, as a source of depth."""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..base.arrays import LinearRGBA, Map
from ..base.errors import Remedy, UserError
from ..camera.canvas import Canvas
from .completed_depth import completed
from .joint_upsampling import upsampled
from .matte import opacity_over, outlined
from .multi_view_stereo import DenseDepth, Moving
from .source import NO_PICTURE, DepthSource, PixelDepth
from .sparse import DepthSamples
from .temporal_fusion import TemporalFusion

ORIGIN = "the clip's dense depth"


@dataclass(frozen=True)
class StereoDepth(DepthSource):
    """Depth of every frame with a camera, found where it is not kept, with maps for unsure pixels.

    Errors as of `TemporalFusion.at` and of the maps.
    """

    fusion: TemporalFusion
    better: TemporalFusion | None = None
    """Depth of a better quality, used where it is kept."""
    masks: Moving | None = None
    """Opacity of moving pixels by masks."""
    maps: DepthSource | None = None
    """Maps for unsure pixels, of all frames or some."""

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth:
        """Return the depth of all pixels of the canvas that shows `picture` (H, W, 4).

        With `NO_PICTURE` it has the size at which depth is found.
        """
        depth, origin = self._with_map(self._better(frame) or self.fusion.at(frame))
        mask = self.masks(frame) if self.masks and picture.size else None
        found = whole_depth(depth, picture, None if mask is None else opacity_over(canvas, mask))
        return replace(found, origin=origin)

    def kept(self, frame: int, canvas: Canvas) -> PixelDepth | None:
        """Return `at` without a picture, for a frame whose depth was found before; else None."""
        known = self._better(frame) or self.fusion.kept(frame)
        return None if known is None else whole_depth(self._with_map(known)[0])

    def samples(self, frame: int, canvas: Canvas) -> DepthSamples | None:
        """Return the map's."""
        return None if self.maps is None else self.maps.samples(frame, canvas)

    def _better(self, frame: int) -> DenseDepth | None:
        """The kept depth of a better quality."""
        return self.better.kept(frame) if self.better else None

    def _with_map(self, depth: DenseDepth) -> tuple[DenseDepth, str]:
        """Depth completed by its frame's map, and where it comes from."""
        given = None
        if self.maps is not None:
            given = self.maps.at(depth.frame, self.fusion.canvas(depth.frame), NO_PICTURE)
        if given is None:
            return depth, ORIGIN
        shape = given.inverse_depth.astype(np.float32)
        if shape.shape != depth.inverse_depth.shape:
            shape = cv2.resize(shape, depth.inverse_depth.shape[::-1], interpolation=cv2.INTER_NEAREST)
        return completed(depth, shape), f"{ORIGIN} and {given.origin}"


class NoDepth(DepthSource):
    """Depth for a camera that stays in its place: there is none in the pictures."""

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth:
        """Raise UserError."""
        raise UserError(
            f"the depth of frame {frame} cannot be found because the camera does not move; provide depth"
            " maps of the clip",
            Remedy.DEPTH_MAPS,
        )

    def kept(self, frame: int, canvas: Canvas) -> None:
        """Return None."""


def whole_depth(
    depth: DenseDepth, picture: LinearRGBA = NO_PICTURE, opacity: Map | None = None
) -> PixelDepth:
    """Return small depth for every pixel of the canvas picture (H, W, 4), along its edges.

    Moving objects end at their outline, the matte's (H, W) where there is one. Without a picture the depth
    keeps its size.
    """
    if not picture.size:
        inverse = depth.inverse_depth.astype(np.float64)
        return PixelDepth(inverse, depth.confidence, depth.moving, depth.past_border, ORIGIN)
    size = (picture.shape[1], picture.shape[0])
    confidence = cv2.resize(depth.confidence, size)
    past = None if depth.past_border is None else _past_border(depth.past_border, depth.inverse_depth, size)
    inverse = upsampled(depth.inverse_depth, picture)
    inverse = outlined(inverse, depth.inverse_depth, depth.moving, picture, opacity)
    return PixelDepth(inverse, np.asarray(confidence), depth.moving, past, ORIGIN, opacity)


def _past_border(past: Map, inside: Map, size: tuple[int, int]) -> Map:
    """(H + 2 M, W + 2 M) inverse depth around a picture of `size` (W, H), from that of a smaller one."""
    margin = (past.shape[0] - inside.shape[0]) // 2
    beyond = int(margin * min(size[0] / inside.shape[1], size[1] / inside.shape[0]))
    at = (
        ((np.arange(-beyond, large + beyond) + 0.5) * small / large + margin).astype(int)
        for large, small in zip(size[::-1], inside.shape, strict=True)
    )
    return np.asarray(past[np.ix_(*at)])
