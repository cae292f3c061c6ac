"""One frame made ready for its views, in the order of the data: depth, blur, number of views, mesh, views."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import LinearRGBA, Map
from ..base.errors import UserError
from ..base.progress import stage
from ..camera.canvas import Canvas
from ..camera.reconstruction import Floats
from ..depth.source import PixelDepth
from ..depth.sparse import frame_features
from ..warp.footprint import prefilter
from ..warp.layered_depth_image import LayeredDepthImage
from .aperture_sampling import views_needed
from .clip_context import ClipContext
from .meshers import MESHERS
from .meshers.layers import can_be_layered
from .meshers.mesher import FrameGeometry, Mesher, Surface, Views
from .plan import FramePlan, LensSettings
from .thin_lens import ThinLens

SURE = 0.1
"""Confidence in [0, 1] from which on a pixel's depth is known: by eye."""
FEWEST_SURE = 0.05
"""Share of the picture whose depth must be known for layers: by eye."""
TOO_LARGE = "its blur discs are too large for layers"
TOO_UNSURE = f"the depth of less than {100 * FEWEST_SURE:g} % of its pixels can be told from the clip"
DEEP = 0.6
"""Share of a frame's time without its views that is over after depth, where that is to be found: half or more
by `python -m benchmarks.timings.frame_costs`."""
NOTHING: LinearRGBA = np.zeros((0, 0, 4), np.float32)
"""Instead of a picture, where only the geometry is asked for."""


@dataclass(frozen=True)
class WarpedFrame:
    """Everything that a renderer needs of a frame, and how it came to be."""

    plan: FramePlan
    texture: LinearRGBA
    """(h, w, 4) what is painted on the plan's mesh, linear and premultiplied."""
    method: str
    """Name of the mesher that made the mesh."""
    why: str
    """Why it is not the one that was asked for; empty where it is."""
    is_whole: bool
    """Whether no view may see through the mesh."""
    depth: PixelDepth | None = None
    """Of every pixel of the canvas, where it was found."""
    layers: tuple[LayeredDepthImage, ...] = ()
    """That the mesh was made of, near ones first."""
    depth_seconds: float = 0.0
    """Wall time that finding the depth took."""
    mesh_seconds: float = 0.0
    """Wall time that the mesh and its texture took."""


def check_settings(settings: LensSettings) -> None:
    """UserError for an aperture, a number of views or a method that means nothing."""
    if not (np.isfinite(settings.radius) and settings.radius > 0):
        raise UserError(f"the aperture radius is {settings.radius:g}; it must be greater than zero")
    if settings.views < 0:
        raise UserError(f"the number of views is {settings.views}; it must be at least 1")
    if settings.method not in MESHERS:
        raise UserError(f"there is no method {settings.method!r}; choose one of {', '.join(MESHERS)}")


def warp_frame(
    clip: ClipContext, frame: int, settings: LensSettings, size: tuple[int, int], source: LinearRGBA
) -> WarpedFrame:
    """Warp mesh and views of a frame rendered at size (width, height), of its picture (height, width, 4).

    Raises UserError for settings that mean nothing, where the frame's geometry does not carry them, and where
    the clip cannot be read. Passes checkpoints.
    """
    began = time.perf_counter()
    geometry, mesher, why = _geometry(clip, frame, settings, size, source), MESHERS[settings.method], ""
    if mesher.needs_pixel_depth and not can_be_layered(geometry.lens, _sampled_disc(geometry)):
        mesher, why = MESHERS["features"], TOO_LARGE
    depth, depth_seconds = None, 0.0
    if mesher.needs_pixel_depth:
        started = time.perf_counter()
        with stage("Depth", 0.0, DEEP):
            depth = clip.depth(frame, geometry.canvas, geometry.picture)
        depth_seconds = time.perf_counter() - started
        if depth.confidence is not None and float(np.mean(depth.confidence > SURE)) < FEWEST_SURE:
            mesher, why = MESHERS["grid"], TOO_UNSURE
        else:
            geometry = replace(geometry, depth=depth)
    made = replace(_meshed(geometry, mesher), why=why, depth=depth, depth_seconds=depth_seconds)
    return replace(made, mesh_seconds=time.perf_counter() - began - depth_seconds)


@dataclass(frozen=True)
class Forecast:
    """What a frame will be, as far as samples of its depth tell without its picture."""

    views: int
    """About how many virtual cameras it will have; as many as were asked for, if a number was."""
    is_too_large: bool
    """Whether it is to be drawn by layers and its blur discs are too large for them."""


def forecast(clip: ClipContext, frame: int, settings: LensSettings, size: tuple[int, int]) -> Forecast:
    """What `warp_frame` will make of a frame; UserError as it raises, but for what only the picture tells."""
    geometry, mesher = _geometry(clip, frame, settings, size), MESHERS[settings.method]
    disc = _sampled_disc(geometry)
    is_too_large = mesher.needs_pixel_depth and not can_be_layered(geometry.lens, disc)
    prefiltered = mesher.is_prefiltered and not is_too_large
    return Forecast(settings.views or views_needed(disc, prefiltered), is_too_large)


def view_offsets(clip: ClipContext, frame: int, settings: LensSettings, size: tuple[int, int]) -> Floats:
    """(N, 2) positions of a frame's virtual cameras in scene units, x right and y down, without its picture.

    With an automatic number there are about as many as the frame will have. Raises UserError as `forecast`.
    """
    geometry = _geometry(clip, frame, settings, size)
    mesher = MESHERS[settings.method]
    count = settings.views or views_needed(_sampled_disc(geometry), mesher.is_prefiltered)
    views: Views = mesher.views(geometry, count)
    return views.offsets


def _geometry(
    clip: ClipContext,
    frame: int,
    settings: LensSettings,
    size: tuple[int, int],
    source: LinearRGBA = NOTHING,
) -> FrameGeometry:
    """What is known of a frame before its depth is found; UserError where the lens means nothing there."""
    check_settings(settings)
    reconstruction = clip.reconstruction
    image, _ = reconstruction.image_at(frame)
    canvas = Canvas(reconstruction.intrinsics(image).scaled(*size))
    if MESHERS[settings.method].uses_given_depth:
        samples = clip.samples(frame, canvas)
    else:
        samples = frame_features(reconstruction, frame, canvas)
    focus = settings.focus.inverse_depth(reconstruction, frame)
    lens = ThinLens(canvas.pinhole, settings.radius, focus)
    lens.check(frame, samples.inverse_depth)
    picture = canvas.from_source(source) if source.size else source
    return FrameGeometry(clip, settings, canvas, picture, lens, samples, None)


def _sampled_disc(geometry: FrameGeometry) -> float:
    """Diameter in pixels of the largest blur disc of the frame's samples."""
    return geometry.lens.largest_disc(geometry.samples.inverse_depth)


def _meshed(geometry: FrameGeometry, mesher: Mesher) -> WarpedFrame:
    """The frame's plan by a mesher, with as many views as its largest blur disc needs."""
    blur = _sampled_disc(geometry)
    if geometry.depth is not None:
        blur = geometry.lens.largest_disc(geometry.depth.inverse_depth)
    views = mesher.views(geometry, geometry.settings.views or views_needed(blur, mesher.is_prefiltered))
    with stage("Mesh", DEEP if mesher.needs_pixel_depth else 0.0, 1.0):
        surface = mesher.make(geometry)
    plan = FramePlan(
        geometry.frame, geometry.canvas, geometry.lens, surface.mesh, views.offsets, views.registration,
        blur, geometry.samples.pose_interpolated,
    )  # fmt: skip
    _prefilter(surface, geometry.lens, len(views.offsets))
    return WarpedFrame(plan, surface.texture, mesher.name, "", surface.is_whole, layers=surface.layers)


def _prefilter(surface: Surface, lens: ThinLens, views: int) -> None:
    """Blur the texture of a surface of layers in place as so many views need it; others stay as they are."""

    def radius(disparity: Map) -> Map:
        return np.asarray(np.abs(lens.snap_displacement(disparity)) / np.float32(np.sqrt(views)), np.float32)

    if surface.layers:
        prefilter(surface.texture, surface.layers, radius)
