"""Depth found in the clip itself, by stereo fused over time, as a source of depth."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, LinearRGBA, Map
from ..base.errors import Remedy, UserError
from ..base.progress import checkpoint
from ..camera.canvas import Canvas
from .completed_depth import completed
from .matte import opacity_over, outlined
from .multi_view_stereo import DenseDepth, Moving
from .source import NO_PICTURE, DepthSource, PixelDepth
from .sparse import DepthSamples
from .temporal_fusion import TemporalFusion

ORIGIN = "the clip's dense depth"
COLOUR_DISTANCE = 0.04
"""Distance of colours (display values in [0, 1]) worth a small picture's pixel. Chosen by inspection."""
DISCONTINUITY = 0.03
"""Share of the largest inverse depth beyond which neighbours have no mean. Chosen by inspection."""


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


def upsampled(depth: NDArray[np.floating], picture: LinearRGBA) -> Floats:
    """Return small inverse depths (h, w) at the size (H, W) of a picture (H, W, 4), with its edges.

    The value comes from the neighbour that is nearest and most alike in colour, of four. Kopf et al., "Joint
    bilateral upsampling", 2007, with a single vote.
    """
    height, width = picture.shape[:2]
    if depth.shape == (height, width):
        return depth.astype(np.float64)
    small = depth.astype(np.float32)
    shown = cv2.pow(np.clip(picture[..., :3], 0, 1), 1 / 2.2)
    guide = cv2.resize(shown, small.shape[::-1], interpolation=cv2.INTER_AREA)
    x = (np.arange(width, dtype=np.float32) + 0.5) * (small.shape[1] / width) - 0.5
    y = (np.arange(height, dtype=np.float32) + 0.5) * (small.shape[0] / height) - 0.5
    # The four neighbours in the small picture; past its border those at it.
    rows, columns = (
        [np.clip(np.floor(at) + step, 0, n - 1).astype(int) for step in (0, 1)]
        for at, n in zip((y, x), small.shape, strict=True)
    )
    weights = [
        (1 - np.abs(y - row))[:, None] * (1 - np.abs(x - column))
        for row in (np.floor(y), np.floor(y) + 1)
        for column in (np.floor(x), np.floor(x) + 1)
    ]
    neighbours = [(row, column) for row in rows for column in columns]
    found, low, high = (np.full((height, width), fill, np.float32) for fill in (0, np.inf, -np.inf))
    for weight, at in zip(weights, neighbours, strict=True):
        checkpoint(1.0)
        value = small[np.ix_(*at)]
        found += weight * value
        np.minimum(low, value, out=low)
        np.maximum(high, value, out=high)
    # Colours are compared where they differ.
    row, column = np.nonzero(high - low > DISCONTINUITY * float(small.max(initial=0)))
    own, best = shown[row, column], np.full(len(row), np.inf, np.float32)
    for weight, (rows_of, columns_of) in zip(weights, neighbours, strict=True):
        checkpoint(1.0)
        at = rows_of[row], columns_of[column]
        unlike = own - guide[at]
        off = np.sqrt(np.einsum("nc,nc->n", unlike, unlike)) / np.float32(COLOUR_DISTANCE)
        off += 1 - weight[row, column]
        nearer = off < best
        best[nearer] = off[nearer]
        found[row[nearer], column[nearer]] = small[at][nearer]
    return found.astype(np.float64)
