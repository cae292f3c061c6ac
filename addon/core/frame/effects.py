"""Effects of a frame: parts of the picture that are not geometry.

Each acts before the mesh is made, on the mean of the views, or on the finished picture. `EFFECTS` lists all
in the order in which they act; a new one is a file and a line here.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import LinearRGBA, in_channels
from ..base.progress import stage
from ..media.noise import Noise
from ..optics.aperture import RED_AND_BLUE
from ..optics.breathing import magnified
from . import detail, grain
from .highlight_discs import TrackedDepth, without_small_highlights
from .meshers.mesher import FrameGeometry
from .vignetting import LEAST_LEFT, light_left
from .warped_frame import WarpedFrame


@dataclass(frozen=True)
class Drawing:
    """A frame whose views are averaged."""

    warped: WarpedFrame
    geometry: FrameGeometry
    small: LinearRGBA
    """(h, w, 4) the source picture at the size of the views."""
    source: LinearRGBA
    """(H, W, 4) the source picture at the final size."""
    noise: Noise | None
    """Noise of the clip at the final size; None if it is not visible."""
    draw: Callable[[WarpedFrame], LinearRGBA]
    """Draws the mean of a frame's views (h, w, 4) in its canvas."""

    @property
    def size(self) -> tuple[int, int]:
        """Final (width, height)."""
        return self.source.shape[1], self.source.shape[0]


@dataclass(frozen=True)
class Effect:
    """The parts of an effect, each of which may be missing."""

    before: Callable[[FrameGeometry], FrameGeometry] = lambda geometry: geometry
    """Changes a frame before its mesh is made."""
    on_mean: Callable[[LinearRGBA, WarpedFrame], LinearRGBA] = lambda mean, warped: mean
    """Changes the mean of its views (h, w, 4) in its canvas."""
    after: Callable[[LinearRGBA, Drawing], LinearRGBA] = lambda picture, drawing: picture
    """Changes its picture (H, W, 4) in the geometry of the source."""


def _remove_highlights(geometry: FrameGeometry) -> FrameGeometry:
    """Remove the highlights that are drawn as discs from the picture of a frame with layers."""
    depth, lens, settings = geometry.depth, geometry.lens, geometry.settings
    is_layered = depth is not None and geometry.mesher.is_prefiltered
    if not (settings.highlights.gain and is_layered and geometry.picture.size):
        return geometry
    assert depth is not None
    displacement = lens.displacement(lens.rectified_raster(depth.inverse_depth))
    picture, discs = without_small_highlights(
        geometry.picture, lens.snap_displacement(displacement.astype(np.float32)), settings.aperture,
        _tracked_depth(geometry),
    )  # fmt: skip
    if discs and geometry.steadied:
        discs = replace(discs, steadied=geometry.steadied)
    return replace(geometry, picture=picture, highlight_discs=discs)


def _tracked_depth(geometry: FrameGeometry) -> TrackedDepth | None:
    """Return the frame's feature points; None if depth is given."""
    if geometry.clip.given_depth is not None:
        return None
    samples, lens = geometry.samples, geometry.lens
    displacement = lens.displacement(samples.inverse_depth).astype(np.float32)
    return TrackedDepth(samples.observed, lens.snap_displacement(displacement))


def _add_highlights(mean: LinearRGBA, warped: WarpedFrame) -> LinearRGBA:
    if warped.highlight_discs is not None:
        cg = [each.layer for each in warped.cg]
        mean[..., :3] += warped.highlight_discs.light(warped.plan, warped.layers, cg)
    return mean


def _normalize_barrel(mean: LinearRGBA, warped: WarpedFrame) -> LinearRGBA:
    """Normalize the light that barrel and matte box leave: surfaces in focus keep their brightness."""
    if warped.plan.is_cut:
        mean /= in_channels(light_left(warped.plan), 4)
    return mean


def _close_gaps(mean: LinearRGBA, warped: WarpedFrame) -> LinearRGBA:
    """Give gaps between triangles in some of the views the colour of the other views."""
    if warped.is_whole:
        mean /= in_channels(np.maximum(mean[..., 3], np.float32(LEAST_LEFT)), 4)
    return mean


def _add_detail(picture: LinearRGBA, drawing: Drawing) -> LinearRGBA:
    """Enlarge a picture that is drawn smaller, with the source's detail where it is in focus."""
    if drawing.small is drawing.source:
        return picture
    sharp, share = detail.sharp_frame(drawing.warped), None
    if sharp is not None:
        share = np.asarray(sharp.plan.canvas.to_source(drawing.draw(sharp))[..., :3])
    return detail.enlarged(picture, drawing.small, drawing.source, share)


def _shift_colours(picture: LinearRGBA, drawing: Drawing) -> LinearRGBA:
    """Enlarge the red picture about the principal point and shrink the blue one: lateral color."""
    amount = drawing.geometry.settings.aperture.lateral_colour
    if not amount:
        return picture
    middle = drawing.warped.plan.canvas.camera.scaled(*drawing.size).principal_point
    result = picture.copy()
    for channel, factor in zip(RED_AND_BLUE, (1 + amount, 1 - amount), strict=True):
        result[..., channel] = magnified(picture[..., channel], factor, middle)
    return result


def _add_grain(picture: LinearRGBA, drawing: Drawing) -> LinearRGBA:
    """Add noise like the clip's where blur removes it."""
    warped, noise, settings = drawing.warped, drawing.noise, drawing.geometry.settings
    if noise is None:
        return picture
    with stage("Grain", 1.0, 1.0):
        painted = grain.lost_frame(warped, noise, drawing.size[0] / warped.plan.canvas.camera.width)
        lost = detail.resized(painted.plan.canvas.to_source(drawing.draw(painted)), drawing.size)[..., :3]
    return grain.grained(picture, lost, noise, warped.plan.frame, settings.grain, drawing.source)


def _keep_fixed(picture: LinearRGBA, drawing: Drawing) -> LinearRGBA:
    """Put the clip's fixed pixels, such as black bars, back in their place."""
    own = drawing.geometry.clip.fixed_light(drawing.geometry.frame)
    if own is None:
        return picture
    own = detail.resized(own, drawing.size)
    return own + in_channels(np.maximum(1 - own[..., 3], 0), 4) * picture


EFFECTS = (
    Effect(on_mean=_normalize_barrel),
    Effect(on_mean=_close_gaps),
    Effect(before=_remove_highlights, on_mean=_add_highlights),
    Effect(after=_add_detail),
    Effect(after=_shift_colours),
    Effect(after=_add_grain),
    Effect(after=_keep_fixed),
)
"""All effects."""
