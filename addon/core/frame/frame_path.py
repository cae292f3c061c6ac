"""The path of a frame: its picture and depth, layers, views through the lens, their mean, and effects."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from ..base.arrays import Floats, LinearRGBA
from ..base.progress import checkpoint, stage
from ..camera.steady_path import LEVELS
from ..depth.source import NO_PICTURE, SURE
from ..optics.aberrations import Aberrations
from ..optics.breathing import enlargement
from .cg_layers import DrawCG
from .clip_context import ClipContext
from .detail import resized
from .effects import EFFECTS, Drawing
from .meshers import MESHERS
from .meshers.layers import can_be_layered
from .meshers.mesher import FrameGeometry
from .plan import FrameOptions
from .repaired_depth import with_repairs
from .steadied import Steadied, steadied
from .warped_frame import MeshedFrame, WarpedFrame, drawn_size, frame_geometry, sampled_disc

FEWEST_SURE = 0.05
"""Least share of the picture with known depth for layers. Chosen by inspection."""
TOO_LARGE = "its blur discs are too large for layers"
TOO_UNSURE = f"the depth of less than {100 * FEWEST_SURE:g}% of its pixels can be found in the clip"
DEEP = 0.6
"""Share of a frame's time without its views for depth, if it must be computed: half or more by `python -m
benchmarks.timings.frame_costs`."""
READ, WARPED = 0.01, 0.7
"""Shares of a frame's time that have passed once it is read and once its mesh is made; the rest draws its
views. From `python -m benchmarks.timings.frame_costs`, with 24 views on 2 cores and unknown depth."""
DrawViews = Callable[[WarpedFrame], LinearRGBA]
"""Draws the views of a frame and returns their weighted mean (h, w, 4) in its canvas."""


@dataclass(frozen=True)
class Drawn:
    """A drawn frame with more data than its picture."""

    warped: WarpedFrame
    source: LinearRGBA
    """(h, w, 4) linear picture of the frame at the size of the views."""
    seconds: float
    """Wall time of drawing."""
    notes: tuple[str, ...] = ()
    """Notes for the user."""
    whole: LinearRGBA = field(default_factory=lambda: NO_PICTURE)
    """(H, W, 4) picture of the frame at its final size."""


def draw_frame(
    clip: ClipContext,
    frame: int,
    options: FrameOptions,
    size: tuple[int, int],
    draw_views: DrawViews,
    draw_cg: DrawCG | None = None,
) -> tuple[LinearRGBA, Drawn]:
    """Draw one frame through the lens.

    Passes checkpoints. Raises UserError if the settings do not fit the frame, or the clip cannot be read.

    Args:
        clip: The clip.
        frame: Number of the frame.
        options: The lens.
        size: Final (width, height).
        draw_views: Draws the views.
        draw_cg: Draws the CG objects.

    Returns:
        The picture (h, w, 4), float32, linear and premultiplied, and how it was made.
    """
    with stage("Reading", 0.0, READ):
        source = resized(clip.picture(frame, options.highlights), size)
        small = resized(source, drawn_size(options, size, draw_cg is not None))
        noise = clip.noise(frame, size) if options.grain else None
    with stage("Mesh", READ, WARPED):
        meshed = mesh_frame(clip, frame, options, (small.shape[1], small.shape[0]), small, draw_cg)
        warped = meshed.warped
    began = time.perf_counter()

    def average(prepared: WarpedFrame) -> LinearRGBA:
        return mean_of_views(prepared, draw_views)

    with stage("Views", WARPED, 1.0):
        mean = average(warped)
    checkpoint(1.0)
    picture = warped.plan.canvas.to_source(mean)
    if warped.steadied is not None and small is not source:
        # A frame on a steadier path is not drawn smaller: this one breathes.
        small, source = (warped.steadied.magnified(each) for each in (small, source))
    drawing = Drawing(warped, meshed.geometry, small, source, noise, average)
    for effect in EFFECTS:
        picture = effect.after(picture, drawing)
    return picture, Drawn(warped, small, time.perf_counter() - began, _notes(meshed), source)


def mean_of_views(warped: WarpedFrame, draw_views: DrawViews) -> LinearRGBA:
    """Return the mean of a frame's views (h, w, 4) in its canvas, with its effects."""
    mean = draw_views(warped)
    for effect in EFFECTS:
        mean = effect.on_mean(mean, warped)
    return mean


def mesh_frame(
    clip: ClipContext,
    frame: int,
    settings: FrameOptions,
    size: tuple[int, int],
    source: LinearRGBA,
    draw_cg: DrawCG | None = None,
) -> MeshedFrame:
    """Make the warp mesh of a frame of size (width, height) from its picture (height, width, 4).

    Passes checkpoints. Raises UserError if the settings do not fit the frame, or the clip cannot be read.
    """
    began, aberrations = time.perf_counter(), Aberrations.of(settings.aperture)
    geometry, why, depth_seconds = _with_depth(frame_geometry(clip, frame, settings, size, source))
    blur = sampled_disc(geometry)
    if geometry.depth is not None and geometry.mesher.needs_pixel_depth:
        lens = geometry.lens
        blur = lens.largest_disc(lens.rectified_raster(geometry.depth.inverse_depth))
    if draw_cg is not None:
        with stage("CG objects", DEEP, DEEP):
            cg = draw_cg(frame, geometry.canvas, geometry.depth)
        geometry = replace(geometry, cg=cg, picture=cg.shaded(geometry.picture))
        blur = max([blur, *(each.largest_disc(geometry.lens) for each in cg.layers)])
    enlarged = _enlargement(geometry)
    if settings.stabilize or enlarged != 1:
        path = clip.steady_path(settings.stabilize, settings.fill_border) if settings.stabilize else None
        image, _ = clip.reconstruction.image_at(frame)
        moved = steadied(image, geometry.canvas, geometry.lens, path, enlarged)
        beyond = _beyond(geometry, moved)
        geometry = replace(geometry, steadied=moved, lens=moved.own_lens, beyond=beyond)
    if aberrations.is_active:
        bent = aberrations.largest * geometry.lens.disparity_scale * geometry.lens.axis
        geometry, blur = replace(geometry, beyond=geometry.beyond + bent), blur + 2 * bent
    for effect in EFFECTS:
        geometry = effect.before(geometry)
    with stage("Mesh", DEEP if geometry.mesher.needs_pixel_depth else 0.0, 1.0):
        surface = geometry.mesher.make(geometry)
    spent = time.perf_counter() - began - depth_seconds
    return MeshedFrame(geometry, surface, blur, why, depth_seconds, spent)


def _with_depth(geometry: FrameGeometry) -> tuple[FrameGeometry, str, float]:
    """Add depth; also returns the reason for another mesher than the selected one, and the wall time."""
    if not geometry.mesher.needs_pixel_depth:
        return geometry, "", 0.0
    if not can_be_layered(geometry.lens, sampled_disc(geometry)):
        return replace(geometry, mesher=MESHERS["features"]), TOO_LARGE, 0.0
    began = time.perf_counter()
    with stage("Depth", 0.0, DEEP):
        depth = geometry.clip.depth(
            geometry.frame, geometry.canvas, geometry.picture, geometry.settings.quality
        )
        depth = with_repairs(
            geometry.clip, geometry.frame, depth, geometry.settings.repairs, geometry.canvas,
            geometry.picture, geometry.lens,
        )  # fmt: skip
    geometry, why = replace(geometry, depth=depth), ""
    if depth.confidence is not None and float(np.mean(depth.confidence > SURE)) < FEWEST_SURE:
        geometry, why = replace(geometry, mesher=MESHERS["features"]), TOO_UNSURE
    return geometry, why, time.perf_counter() - began


def _enlargement(geometry: FrameGeometry) -> float:
    """Return the factor by which breathing enlarges a frame."""
    settings, camera = geometry.settings, geometry.canvas.camera
    if not settings.breathes:
        return 1.0
    focal, typical = settings.sensor * camera.fx / camera.width, geometry.clip.reconstruction.typical_depth
    middle = 1 / typical if typical > 0 else 0.0
    return enlargement(settings.aperture.breathing, focal, geometry.lens.axis, middle)


def _beyond(geometry: FrameGeometry, steadier: Steadied) -> float:
    """Return the pixels past a frame's border that a steadier camera sees at the frame's depths."""
    samples, depth = geometry.samples, geometry.depth
    if depth is None:
        inverse: Floats = geometry.lens.unrectified(samples.inverse_depth, samples.observed)
    else:
        inverse = depth.inverse_depth[::8, ::8]
    return steadier.beyond(np.percentile(inverse, LEVELS))


def _notes(meshed: MeshedFrame) -> tuple[str, ...]:
    """Return what the user should know of a frame."""
    geometry, found = meshed.geometry, []
    frame, moved, wished = geometry.frame, geometry.steadied, geometry.settings.stabilize
    if geometry.samples.pose_interpolated:
        found.append(f"Frame {frame} was not solved: its camera is interpolated from its neighbours")
    if moved and moved.strength < wished:
        found.append(
            f"Stabilize is {moved.strength:.2f} instead of {wished:.2f}: from a steadier path the camera"
            " would see what the clip does not show"
        )
    if meshed.why:
        found.append(f"Frame {frame} uses the method {geometry.mesher.name}: {meshed.why}")
    return tuple(found)
