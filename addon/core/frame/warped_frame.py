"""Data of a frame before its mesh is made, with its mesh, and with its views."""

import time
from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Floats, LinearRGBA
from ..base.errors import UserError
from ..depth.source import NO_PICTURE, PixelDepth
from ..depth.sparse import frame_features
from ..optics.aberrations import Aberrations
from ..optics.aperture_sampling import LEAST_PREFILTERED, MAX_VIEWS, MIN_VIEWS, views_needed
from ..warp.footprint import prefilter
from ..warp.layered_depth_image import LayeredDepthImage
from .cg_layers import CGSurface
from .clip_context import ClipContext
from .highlight_discs import HighlightDiscs
from .meshers import MESHERS
from .meshers.layers import can_be_layered
from .meshers.mesher import FrameGeometry, Surface, Views
from .options import check_options
from .plan import FrameOptions, FramePlan
from .steadied import Steadied


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


@dataclass(frozen=True)
class MeshedFrame:
    """A frame's mesh and texture before the number of views is known."""

    geometry: FrameGeometry
    surface: Surface
    blur: float
    """Diameter in pixels of its largest blur disc."""
    why: str = ""
    """The reason for another mesher than the selected one; empty otherwise."""
    depth_seconds: float = 0.0
    """Wall time of its depth, if that had to be found."""
    mesh_seconds: float = 0.0
    """Wall time of its mesh."""

    @property
    def views(self) -> int:
        """The selected number of views, or that for its largest blur disc in its quality."""
        return _count(self.geometry.settings, self.blur, self.geometry.mesher.is_prefiltered)

    @property
    def warped(self) -> WarpedFrame:
        """The frame prepared for its views, in the memory of the surface's texture."""
        return self.through(self.views, reuse=True)

    def through(self, count: int, prefiltered: bool = True, reuse: bool = False) -> WarpedFrame:
        """Prepare the frame for a number of views.

        Args:
            count: Number of views.
            prefiltered: True to blur the texture for the views, if the mesher allows it.
            reuse: True to write over the surface's texture, which saves memory; the surface cannot be used
                afterwards.
        """
        began = time.perf_counter()
        geometry, mesh, texture, share = self.geometry, self.surface.mesh, self.surface.texture, 1.0
        mesher, moved = geometry.mesher, geometry.steadied
        if moved:
            # Layers are displaced by the lens for which they were made.
            mesh, share = moved.mesh(mesh), moved.aperture_share
            geometry = replace(geometry, canvas=moved.canvas, lens=moved.lens)
        views, aperture = mesher.views(geometry, count), geometry.settings.aperture
        plan = FramePlan(
            geometry.frame, geometry.canvas, geometry.lens, mesh, views.offsets,
            views.registration, geometry.samples.pose_interpolated, views.weights, views.spread,
            aperture.vignetting, aperture.axial_colour, (aperture.matte_box_sides, aperture.matte_box_top),
            Aberrations.of(aperture),
        )  # fmt: skip
        if prefiltered and mesher.is_prefiltered:
            spread, of_layers = np.float32(views.spread), np.float32(share)
            texture = texture if reuse else texture.copy()
            prefilter(
                texture, self.surface.layers,
                lambda d: spread * geometry.lens.footprint(plan.discs(of_layers * d), count),
            )  # fmt: skip
        return WarpedFrame(
            plan, texture, mesher.name, self.why, self.surface.is_whole, geometry.depth,
            self.surface.layers, self.depth_seconds, self.mesh_seconds + time.perf_counter() - began,
            geometry.highlight_discs, moved, self._cg_surfaces(count, plan),
        )  # fmt: skip

    def _cg_surfaces(self, count: int, plan: FramePlan) -> tuple[CGSurface, ...]:
        """Prepare CG objects for a number of views of a plan."""
        lens, moved = self.geometry.lens, self.geometry.steadied
        if moved is not None:
            lens = replace(lens, radius=moved.lens.radius)
        made = [
            (each, *each.surface(lens, count, plan.spread, plan.discs)) for each in self.geometry.cg.layers
        ]
        focus = self.geometry.lens.focus if moved is None else moved.lens.focus
        found = []
        for one, mesh, picture in made:
            seen = moved.mesh(mesh) if moved else mesh
            if one.is_sharp:
                # In the focal plane to all views, and hidden by the surfaces in front of it.
                seen = replace(
                    seen, inverse_depth=np.full_like(mesh.inverse_depth, focus), order=seen.nearness
                )
            found.append(CGSurface(one, seen, picture))
        return tuple(found)


def drawn_size(settings: FrameOptions, size: tuple[int, int], has_cg: bool = False) -> tuple[int, int]:
    """Return the (width, height) at which a frame of a size is drawn.

    A quality may draw it smaller, with sharp pixels from the frame itself.
    """
    can_be_small = MESHERS[settings.method].needs_pixel_depth and not settings.stabilize
    return settings.quality.drawn_size(size, has_cg) if can_be_small else size


@dataclass(frozen=True)
class Forecast:
    """A forecast of a frame from samples of its depth, without its picture."""

    views: int
    """The selected number of views, or about the automatic one."""
    is_too_large: bool
    """True if the frame is drawn by layers and its blur discs are too large for them."""


def forecast(clip: ClipContext, frame: int, settings: FrameOptions, size: tuple[int, int]) -> Forecast:
    """Forecast a frame's mesh; raises the errors of `mesh_frame`."""
    geometry = frame_geometry(clip, frame, settings, drawn_size(settings, size))
    disc, mesher = sampled_disc(geometry), geometry.mesher
    is_too_large = mesher.needs_pixel_depth and not can_be_layered(geometry.lens, disc)
    return Forecast(_count(settings, disc, mesher.is_prefiltered and not is_too_large), is_too_large)


def view_offsets(clip: ClipContext, frame: int, settings: FrameOptions, size: tuple[int, int]) -> Floats:
    """Return (N, 2) positions of a frame's views on the aperture, in scene units, x right and y down.

    An automatic number is about that of the drawn frame. Raises UserError as `forecast` does.
    """
    geometry = frame_geometry(clip, frame, settings, drawn_size(settings, size))
    count = _count(settings, sampled_disc(geometry), geometry.mesher.is_prefiltered)
    views: Views = geometry.mesher.views(geometry, count)
    return geometry.lens.aperture_positions(views.offsets)


def frame_geometry(
    clip: ClipContext,
    frame: int,
    settings: FrameOptions,
    size: tuple[int, int],
    source: LinearRGBA = NO_PICTURE,
) -> FrameGeometry:
    """Collect the data of a frame before its depth; raises UserError for a lens that does not fit it."""
    if not (np.isfinite(settings.radius) and settings.radius > 0):
        raise UserError(f"the aperture radius is {settings.radius:g}; it must be greater than zero")
    check_options(settings)
    reconstruction, mesher = clip.reconstruction, MESHERS[settings.method]
    canvas = reconstruction.canvas(frame, size)
    if mesher.uses_given_depth:
        samples = clip.samples(frame, canvas)
    else:
        samples = frame_features(reconstruction, frame, canvas)
    lens = settings.focus.lens(reconstruction, frame, canvas.pinhole, settings.radius)
    lens = replace(lens.curved(settings.aperture.field_curvature), zone=settings.zone)
    wished = {
        "support a tilted focal plane": lens.is_tilted,
        "support an in-focus zone": settings.zone.is_active,
        "support field curvature or breathing": settings.aperture.field_curvature or settings.breathes,
        "stabilize": settings.stabilize,
    }
    if not mesher.takes_tilt and (
        what := next((words for words, is_wished in wished.items() if is_wished), "")
    ):
        raise UserError(f"the method {settings.method} does not {what}; choose another one")
    samples = replace(samples, inverse_depth=lens.rectified(samples.inverse_depth, samples.observed))
    lens.check(frame, samples.inverse_depth)
    picture = canvas.from_source(source) if source.size else source
    return FrameGeometry(clip, settings, mesher, canvas, picture, lens, samples)


def _count(settings: FrameOptions, blur: float, prefiltered: bool) -> int:
    """Return the selected number of views, or that for a largest blur disc in pixels."""
    if settings.views:
        return settings.views
    wanted = round(settings.quality.views * views_needed(blur, prefiltered))
    return min(max(wanted, LEAST_PREFILTERED if prefiltered else MIN_VIEWS), MAX_VIEWS)


def sampled_disc(geometry: FrameGeometry) -> float:
    """Return the diameter in pixels of the largest blur disc of the frame's samples."""
    return geometry.lens.largest_disc(geometry.samples.inverse_depth)
