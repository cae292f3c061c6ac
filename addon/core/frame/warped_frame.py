"""Preparation of a frame for its views: depth, blur, number of views, mesh, views."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Floats, LinearRGBA
from ..base.errors import UserError
from ..base.progress import stage
from ..camera.steady_path import LEVELS
from ..depth.source import NO_PICTURE, SURE, PixelDepth
from ..depth.sparse import frame_features
from ..optics.aperture_sampling import LEAST_PREFILTERED, MAX_VIEWS, MIN_VIEWS, views_needed
from ..warp.footprint import prefilter
from ..warp.layered_depth_image import LayeredDepthImage
from .cg_layers import NO_CG, CGObjects, CGSurface, DrawCG
from .clip_context import ClipContext
from .highlight_discs import HighlightDiscs, TrackedDepth, without_small_highlights
from .meshers import MESHERS
from .meshers.layers import can_be_layered
from .meshers.mesher import FrameGeometry, Mesher, Surface, Views
from .options import check_options
from .plan import FrameOptions, FramePlan
from .steadied import Steadied, steadied

FEWEST_SURE = 0.05
"""Least share of the picture with known depth for layers. Chosen by inspection."""
TOO_LARGE = "its blur discs are too large for layers"
TOO_UNSURE = f"the depth of less than {100 * FEWEST_SURE:g} % of its pixels can be found in the clip"
DEEP = 0.6
"""Share of a frame's time without its views for depth, if it must be computed: half or more by `python -m
benchmarks.timings.frame_costs`."""


@dataclass(frozen=True)
class WarpedFrame:
    """The renderer's data of a frame, and how they were made."""

    plan: FramePlan
    texture: LinearRGBA
    """(h, w, 4) texture of the plan's mesh, linear and premultiplied."""
    method: str
    """Name of the mesher that made the mesh."""
    why: str
    """The reason for another mesher than the selected one; empty otherwise."""
    is_whole: bool
    """True if the mesh has no holes for any view."""
    depth: PixelDepth | None = None
    """Depth of every pixel of the canvas, if computed."""
    layers: tuple[LayeredDepthImage, ...] = ()
    """Layers of the mesh, near to far."""
    depth_seconds: float = 0.0
    """Wall time of the depth."""
    mesh_seconds: float = 0.0
    """Wall time of the mesh and its texture."""
    highlight_discs: HighlightDiscs | None = None
    """Highlights that are not in the texture; their light is added to the mean of the views."""
    steadied: Steadied | None = None
    """The steadier camera of the plan, if any."""
    cg: tuple[CGSurface, ...] = ()
    """CG objects, which are not in the plan's mesh."""


def check_settings(settings: FrameOptions) -> None:
    """Raise UserError for an invalid aperture, number of views or method."""
    if not (np.isfinite(settings.radius) and settings.radius > 0):
        raise UserError(f"the aperture radius is {settings.radius:g}; it must be greater than zero")
    check_options(settings)


@dataclass(frozen=True)
class MeshedFrame:
    """A frame's mesh and texture before the number of views is known."""

    geometry: FrameGeometry
    mesher: Mesher
    surface: Surface
    blur: float
    """Diameter in pixels of its largest blur disc."""
    why: str = ""
    depth_seconds: float = 0.0
    mesh_seconds: float = 0.0
    highlight_discs: HighlightDiscs | None = None
    steadied: Steadied | None = None
    """The steadier camera, if any."""
    cg: CGObjects = NO_CG

    @property
    def softer(self) -> float:
        """Share of its pixels that the clip's own lens has blurred more than the user's."""
        own, depth = self.geometry.own_lens, self.geometry.depth
        if own is None or depth is None:
            return 0.0
        return own.share_softer(self.geometry.frame, self.geometry.lens, depth.inverse_depth)

    @property
    def views(self) -> int:
        """The selected number of views, or that for its largest blur disc in its quality."""
        return _count(self.geometry.settings, self.blur, self.mesher.is_prefiltered)

    def through(
        self, count: int, prefiltered: bool = True, reuse: bool = False, variant: int = 0
    ) -> WarpedFrame:
        """Prepare the frame for a number of views.

        Args:
            count: Number of views.
            prefiltered: True to blur the texture for the views, if the mesher allows it.
            reuse: True to write over the surface's texture, which saves memory; the surface cannot be used
                afterwards.
            variant: Gives other views of the same aperture.
        """
        began = time.perf_counter()
        geometry, mesh, texture, share = self.geometry, self.surface.mesh, self.surface.texture, 1.0
        if self.steadied:
            # Layers are displaced by the lens for which they were made.
            mesh, share = self.steadied.mesh(mesh), self.steadied.aperture_share
            geometry = replace(geometry, canvas=self.steadied.canvas, lens=self.steadied.lens)
        views = self.mesher.views(geometry, count, variant)
        if prefiltered and self.mesher.is_prefiltered:
            spread, of_layers = np.float32(views.spread), np.float32(share)
            texture = texture if reuse else texture.copy()
            prefilter(
                texture, self.surface.layers, lambda d: spread * geometry.lens.footprint(of_layers * d, count)
            )
        plan = FramePlan(
            geometry.frame, geometry.canvas, geometry.lens, mesh, views.offsets,
            views.registration, self.blur, geometry.samples.pose_interpolated, views.weights, views.spread,
            geometry.settings.aperture.vignetting, geometry.settings.aperture.axial_colour,
        )  # fmt: skip
        return WarpedFrame(
            plan, texture, self.mesher.name, self.why, self.surface.is_whole, geometry.depth,
            self.surface.layers, self.depth_seconds, self.mesh_seconds + time.perf_counter() - began,
            self.highlight_discs, self.steadied, self._cg_surfaces(count, views.spread),
        )  # fmt: skip

    def _cg_surfaces(self, count: int, spread: float) -> tuple[CGSurface, ...]:
        """Prepare CG objects for a number of views, whose open aperture is `spread` of its radius."""
        lens, moved = self.geometry.lens, self.steadied
        if moved is not None:
            lens = replace(lens, radius=moved.lens.radius)
        made = [(each, *each.surface(lens, count, spread)) for each in self.cg.layers]
        return tuple(
            CGSurface(one, moved.mesh(mesh) if moved else mesh, picture) for one, mesh, picture in made
        )


def warp_frame(
    clip: ClipContext, frame: int, settings: FrameOptions, size: tuple[int, int], source: LinearRGBA
) -> WarpedFrame:
    """Make mesh and views of a frame of size (width, height) from its picture (height, width, 4).

    Raises UserError as `mesh_frame` does. Passes checkpoints.
    """
    meshed = mesh_frame(clip, frame, settings, size, source)
    return meshed.through(meshed.views, reuse=True)


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
    began = time.perf_counter()
    geometry, mesher, why = _geometry(clip, frame, settings, size, source), MESHERS[settings.method], ""
    if mesher.needs_pixel_depth and not can_be_layered(geometry.lens, _sampled_disc(geometry)):
        mesher, why = MESHERS["features"], TOO_LARGE
    depth_seconds = 0.0
    if mesher.needs_pixel_depth:
        started = time.perf_counter()
        with stage("Depth", 0.0, DEEP):
            depth = clip.depth(frame, geometry.canvas, geometry.picture, settings.quality)
        depth_seconds = time.perf_counter() - started
        geometry = replace(geometry, depth=depth)
        if depth.confidence is not None and float(np.mean(depth.confidence > SURE)) < FEWEST_SURE:
            mesher, why = MESHERS["grid"], TOO_UNSURE
    blur = _sampled_disc(geometry)
    if geometry.depth is not None and mesher.needs_pixel_depth:
        lens = geometry.lens
        blur = lens.largest_disc(lens.untilted_raster(geometry.depth.inverse_depth))
    cg = NO_CG
    if draw_cg is not None:
        with stage("CG objects", DEEP, DEEP):
            cg = draw_cg(frame, geometry.canvas, geometry.depth)
        geometry = replace(geometry, picture=cg.shaded(geometry.picture))
        blur = max([blur, *(each.largest_disc(geometry.lens) for each in cg.layers)])
    moved = _steadied(geometry)
    if moved:
        geometry = replace(geometry, lens=moved.own_lens, beyond=_beyond(geometry, moved))
    elif mesher.needs_pixel_depth and not cg.layers and not geometry.lens.is_tilted:
        # Blur of the clip's own lens is completed to that of the user's; not on a steadier path.
        geometry = replace(geometry, own_lens=clip.own_lens)
    geometry, highlights = _without_small_highlights(geometry, mesher, moved)
    with stage("Mesh", DEEP if mesher.needs_pixel_depth else 0.0, 1.0):
        surface = mesher.make(geometry)
    spent = time.perf_counter() - began - depth_seconds
    return MeshedFrame(geometry, mesher, surface, blur, why, depth_seconds, spent, highlights, moved, cg)


def _steadied(geometry: FrameGeometry) -> Steadied | None:
    """Return the frame's view from a steadier path, if selected."""
    if not geometry.settings.stabilize:
        return None
    settings = geometry.settings
    return steadied(geometry, geometry.clip.steady_path(settings.stabilize, settings.fill_border))


def _beyond(geometry: FrameGeometry, steadier: Steadied) -> float:
    """Return the pixels past a frame's border that a steadier camera sees at the frame's depths."""
    samples, depth = geometry.samples, geometry.depth
    if depth is None:
        inverse = geometry.lens.tilted(samples.inverse_depth, samples.observed)
    else:
        inverse = depth.inverse_depth[::8, ::8]
    return steadier.beyond(np.percentile(inverse, LEVELS))


def _without_small_highlights(
    geometry: FrameGeometry, mesher: Mesher, steadier: Steadied | None
) -> tuple[FrameGeometry, HighlightDiscs | None]:
    """Separate the highlights that are drawn as discs from a frame, if they are on and it has layers."""
    settings, depth, lens = geometry.settings, geometry.depth_to_blur, geometry.lens
    if (
        not settings.highlights.gain
        or depth is None
        or not mesher.is_prefiltered
        or not geometry.picture.size
    ):
        return geometry, None
    displacement = lens.displacement(lens.untilted_raster(depth.inverse_depth))
    picture, highlights = without_small_highlights(
        geometry.picture, lens.snap_displacement(displacement.astype(np.float32)), settings.aperture,
        _tracked_depth(geometry),
    )  # fmt: skip
    if highlights and steadier:
        highlights = replace(highlights, steadied=steadier)
    return replace(geometry, picture=picture), highlights


def _tracked_depth(geometry: FrameGeometry) -> TrackedDepth | None:
    """Return the frame's feature points; None if depth is given or the clip's own lens is completed."""
    if geometry.clip.given_depth is not None or geometry.own_lens is not None:
        return None
    samples, lens = geometry.samples, geometry.lens
    displacement = lens.displacement(samples.inverse_depth).astype(np.float32)
    return TrackedDepth(samples.observed, lens.snap_displacement(displacement))


def drawn_size(settings: FrameOptions, size: tuple[int, int]) -> tuple[int, int]:
    """Return the (width, height) at which a frame of a size is drawn.

    A quality may draw it smaller, with sharp pixels from the frame itself.
    """
    can_be_small = MESHERS[settings.method].needs_pixel_depth and not settings.stabilize
    return settings.quality.drawn_size(size) if can_be_small else size


@dataclass(frozen=True)
class Forecast:
    """A forecast of a frame from samples of its depth, without its picture."""

    views: int
    """The selected number of views, or about the automatic one."""
    is_too_large: bool
    """True if the frame is drawn by layers and its blur discs are too large for them."""


def forecast(clip: ClipContext, frame: int, settings: FrameOptions, size: tuple[int, int]) -> Forecast:
    """Forecast the result of `warp_frame`; raises the same errors."""
    geometry, mesher = _geometry(clip, frame, settings, drawn_size(settings, size)), MESHERS[settings.method]
    disc = _sampled_disc(geometry)
    is_too_large = mesher.needs_pixel_depth and not can_be_layered(geometry.lens, disc)
    prefiltered = mesher.is_prefiltered and not is_too_large
    return Forecast(_count(settings, disc, prefiltered), is_too_large)


def view_offsets(clip: ClipContext, frame: int, settings: FrameOptions, size: tuple[int, int]) -> Floats:
    """Return (N, 2) positions of a frame's views on the aperture, in scene units, x right and y down.

    An automatic number is about that of the drawn frame. Raises UserError as `forecast` does.
    """
    geometry = _geometry(clip, frame, settings, drawn_size(settings, size))
    mesher = MESHERS[settings.method]
    count = _count(settings, _sampled_disc(geometry), mesher.is_prefiltered)
    views: Views = mesher.views(geometry, count, 0)
    return geometry.lens.aperture_positions(views.offsets)


def _geometry(
    clip: ClipContext,
    frame: int,
    settings: FrameOptions,
    size: tuple[int, int],
    source: LinearRGBA = NO_PICTURE,
) -> FrameGeometry:
    """Collect the data of a frame before its depth; raises UserError for a lens that does not fit it."""
    check_settings(settings)
    reconstruction = clip.reconstruction
    image, _ = reconstruction.image_at(frame)
    canvas = reconstruction.canvas(image, size)
    if MESHERS[settings.method].uses_given_depth:
        samples = clip.samples(frame, canvas)
    else:
        samples = frame_features(reconstruction, frame, canvas)
    lens = settings.focus.lens(reconstruction, frame, canvas.pinhole, settings.radius)
    if lens.is_tilted and not MESHERS[settings.method].takes_tilt:
        raise UserError(
            f"the method {settings.method} does not support a tilted focal plane; choose another one"
        )
    if settings.stabilize and not MESHERS[settings.method].takes_tilt:
        raise UserError(f"the method {settings.method} does not stabilize; choose another one")
    samples = replace(samples, inverse_depth=lens.untilted(samples.inverse_depth, samples.observed))
    lens.check(frame, samples.inverse_depth)
    picture = canvas.from_source(source) if source.size else source
    return FrameGeometry(clip, settings, canvas, picture, lens, samples, None)


def _count(settings: FrameOptions, blur: float, prefiltered: bool) -> int:
    """Return the selected number of views, or that for a largest blur disc in pixels."""
    if settings.views:
        return settings.views
    wanted = round(settings.quality.views * views_needed(blur, prefiltered))
    return min(max(wanted, LEAST_PREFILTERED if prefiltered else MIN_VIEWS), MAX_VIEWS)


def _sampled_disc(geometry: FrameGeometry) -> float:
    """Return the diameter in pixels of the largest blur disc of the frame's samples."""
    return geometry.lens.largest_disc(geometry.samples.inverse_depth)
