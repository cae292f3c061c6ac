"""Effects of a frame: all that changes its geometry or its picture.

Each acts before the layers are made, on the mean of the views, or on the finished picture. `EFFECTS` lists
all in the order in which they act; a new one is a file and a line here.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Floats, LinearRGBA, in_channels
from ..base.progress import stage
from ..camera.steady_path import LEVELS
from ..depth.source import SURE
from ..optics.aberrations import Aberrations
from ..optics.aperture import RED_AND_BLUE
from ..optics.breathing import enlargement, magnified
from . import detail, grain
from .frame import Frame
from .highlight_discs import TrackedDepth, without_small_highlights
from .meshers import MESHERS
from .repaired_depth import with_repairs
from .steadied import steadied
from .vignetting import LEAST_LEFT, light_left

FEWEST_SURE = 0.05
"""Least share of the picture with known depth for layers. Chosen by inspection."""
TOO_UNSURE = f"the depth of less than {100 * FEWEST_SURE:g}% of its pixels can be found in the clip"
DEEP = 0.6
"""Share of a frame's time without its views for depth, if it must be computed: half or more by `python -m
benchmarks.timings.frame_costs`."""
Average = Callable[[Frame], LinearRGBA]
"""Draws the mean of a frame's views (h, w, 4) in their canvas."""


@dataclass(frozen=True)
class Effect:
    """The parts of an effect, each of which may be missing."""

    before: Callable[[Frame], Frame] = lambda frame: frame
    """Changes a frame before its layers are made."""
    on_mean: Callable[[LinearRGBA, Frame], LinearRGBA] = lambda mean, frame: mean
    """Changes the mean of its views (h, w, 4) in their canvas."""
    after: Callable[[LinearRGBA, Frame, Average], LinearRGBA] = lambda picture, frame, average: picture
    """Changes its picture (H, W, 4) in the geometry of the source."""


def _repair(frame: Frame) -> Frame:
    """Repair the depth where the user has painted."""
    if frame.depth is None or not frame.options.repairs:
        return frame
    depth = with_repairs(
        frame.clip, frame.number, frame.depth, frame.options.repairs, frame.canvas, frame.picture, frame.lens
    )
    return replace(frame, depth=depth)


def _trust_depth(frame: Frame) -> Frame:
    """Measure the largest blur disc by the depth; without sure depth there is one coarse mesh."""
    if frame.depth is None:
        return frame
    sure = frame.depth.confidence
    if sure is not None and float(np.mean(sure > SURE)) < FEWEST_SURE:
        return replace(frame, mesher=MESHERS["features"], why=TOO_UNSURE)
    lens = frame.lens
    return replace(frame, blur=lens.largest_disc(lens.rectified_raster(frame.depth.inverse_depth)))


def _add_cg(frame: Frame) -> Frame:
    """Draw CG objects, and their shadows on the clip."""
    if frame.draw_cg is None:
        return frame
    with stage("CG objects", DEEP, DEEP):
        cg = frame.draw_cg(frame.number, frame.canvas, frame.depth)
    blur = max([frame.blur, *(each.largest_disc(frame.lens) for each in cg.layers)])
    return replace(frame, cg=cg, picture=cg.shaded(frame.picture), blur=blur)


def _move_camera(frame: Frame) -> Frame:
    """Move the camera of the views to a steadier path, and let it breathe."""
    options, wished, enlarged = frame.options, frame.options.stabilize, _enlargement(frame)
    if not wished and enlarged == 1:
        return frame
    path = frame.clip.steady_path(wished, options.fill_border) if wished else None
    image, _ = frame.clip.reconstruction.image_at(frame.number)
    moved = steadied(image, frame.canvas, frame.lens, path, enlarged)
    inverse: Floats
    if frame.depth is None:
        inverse = frame.lens.unrectified(frame.samples.inverse_depth, frame.samples.observed)
    else:
        inverse = frame.depth.inverse_depth[::8, ::8]
    frame = replace(
        frame, steadied=moved, lens=moved.own_lens, beyond=moved.beyond(np.percentile(inverse, LEVELS)),
        views=replace(frame.views, canvas=moved.canvas, lens=moved.lens),
    )  # fmt: skip
    if frame.small is frame.source:
        return frame
    # A frame on a steadier path is not drawn smaller: this one breathes.
    return replace(frame, small=moved.magnified(frame.small), source=moved.magnified(frame.source))


def _enlargement(frame: Frame) -> float:
    """Return the factor by which breathing enlarges a frame."""
    options, camera = frame.options, frame.canvas.camera
    if not options.breathes:
        return 1.0
    focal, typical = options.sensor * camera.fx / camera.width, frame.clip.reconstruction.typical_depth
    middle = 1 / typical if typical > 0 else 0.0
    return enlargement(options.aperture.breathing, focal, frame.lens.axis, middle)


def _bend_rays(frame: Frame) -> Frame:
    """Give the views the lens's aberrations."""
    aberrations = Aberrations.of(frame.options.aperture)
    bent = aberrations.largest * frame.lens.disparity_scale * frame.lens.axis
    views = replace(frame.views, aberrations=aberrations)
    if not aberrations.is_active:
        return replace(frame, views=views)
    return replace(frame, views=views, beyond=frame.beyond + bent, blur=frame.blur + 2 * bent)


def _remove_highlights(frame: Frame) -> Frame:
    """Remove the highlights that are drawn as discs from the picture of a frame with layers."""
    depth, lens, options = frame.depth, frame.lens, frame.options
    if depth is None or not (options.highlights.gain and frame.is_layered and frame.picture.size):
        return frame
    displacement = lens.displacement(lens.rectified_raster(depth.inverse_depth))
    picture, discs = without_small_highlights(
        frame.picture, lens.snap_displacement(displacement.astype(np.float32)), options.aperture,
        _tracked_depth(frame),
    )  # fmt: skip
    return replace(frame, picture=picture, highlight_discs=discs)


def _tracked_depth(frame: Frame) -> TrackedDepth | None:
    """Return the frame's feature points; None if depth is given."""
    if frame.clip.given_depth is not None:
        return None
    samples, lens = frame.samples, frame.lens
    displacement = lens.displacement(samples.inverse_depth).astype(np.float32)
    return TrackedDepth(samples.observed, lens.snap_displacement(displacement))


def _add_highlights(mean: LinearRGBA, frame: Frame) -> LinearRGBA:
    if frame.highlight_discs is not None:
        discs, cg = frame.highlight_discs, frame.cg.layers
        mean[..., :3] += discs.light(frame.views, frame.layers, cg, frame.steadied)
    return mean


def _narrow_barrel(frame: Frame) -> Frame:
    """Cut the views' light by a long barrel and a matte box, and shift their colours."""
    aperture = frame.options.aperture
    views = replace(
        frame.views, vignetting=aperture.vignetting, axial_colour=aperture.axial_colour,
        matte_box=(aperture.matte_box_sides, aperture.matte_box_top),
    )  # fmt: skip
    return replace(frame, views=views)


def _normalize_barrel(mean: LinearRGBA, frame: Frame) -> LinearRGBA:
    """Normalize the light that barrel and matte box leave: surfaces in focus keep their brightness."""
    if frame.views.is_cut:
        mean /= in_channels(light_left(frame.views), 4)
    return mean


def _close_gaps(mean: LinearRGBA, frame: Frame) -> LinearRGBA:
    """Give gaps between triangles in some of the views the colour of the other views."""
    if frame.is_whole:
        mean /= in_channels(np.maximum(mean[..., 3], np.float32(LEAST_LEFT)), 4)
    return mean


def _add_detail(picture: LinearRGBA, frame: Frame, average: Average) -> LinearRGBA:
    """Enlarge a picture that is drawn smaller, with the source's detail where it is in focus."""
    if frame.small is frame.source:
        return picture
    sharp, share = detail.sharp_frame(frame), None
    if sharp is not None:
        share = np.asarray(frame.views.canvas.to_source(average(sharp))[..., :3])
    return detail.enlarged(picture, frame.small, frame.source, share)


def _shift_colours(picture: LinearRGBA, frame: Frame, average: Average) -> LinearRGBA:
    """Enlarge the red picture about the principal point and shrink the blue one: lateral color."""
    amount = frame.options.aperture.lateral_colour
    if not amount:
        return picture
    middle = frame.views.canvas.camera.scaled(*frame.size).principal_point
    result = picture.copy()
    for channel, factor in zip(RED_AND_BLUE, (1 + amount, 1 - amount), strict=True):
        result[..., channel] = magnified(picture[..., channel], factor, middle)
    return result


def _add_grain(picture: LinearRGBA, frame: Frame, average: Average) -> LinearRGBA:
    """Add noise like the clip's where blur removes it."""
    amount = frame.options.grain
    noise = frame.clip.noise(frame.number, frame.size) if amount else None
    if noise is None:
        return picture
    with stage("Grain", 1.0, 1.0):
        painted = grain.lost_frame(frame, noise, frame.size[0] / frame.views.canvas.camera.width)
        lost = painted.views.canvas.to_source(average(painted))
    lost = detail.resized(lost, frame.size)[..., :3]
    return grain.grained(picture, lost, noise, frame.number, amount, frame.source)


def _keep_fixed(picture: LinearRGBA, frame: Frame, average: Average) -> LinearRGBA:
    """Put the clip's fixed pixels, such as black bars, back in their place."""
    own = frame.clip.fixed_light(frame.number)
    if own is None:
        return picture
    own = detail.resized(own, frame.size)
    return own + in_channels(np.maximum(1 - own[..., 3], 0), 4) * picture


EFFECTS = (
    Effect(before=_repair),
    Effect(before=_trust_depth),
    Effect(before=_add_cg),
    Effect(before=_move_camera),
    Effect(before=_bend_rays),
    Effect(before=_narrow_barrel, on_mean=_normalize_barrel),
    Effect(on_mean=_close_gaps),
    Effect(before=_remove_highlights, on_mean=_add_highlights),
    Effect(after=_add_detail),
    Effect(after=_shift_colours),
    Effect(after=_add_grain),
    Effect(after=_keep_fixed),
)
"""All effects."""
