"""A frame on its way to its picture, and the meshers that make its layers."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import LinearRGBA
from ..camera.canvas import Canvas
from ..depth.source import PixelDepth
from ..depth.sparse import DepthSamples
from ..optics.aperture import ApertureSamples, aperture_samples
from ..optics.aperture_sampling import (
    LEAST_PREFILTERED,
    MAX_VIEWS,
    MIN_VIEWS,
    views_needed,
    vogel_disc,
)
from ..optics.thin_lens import ThinLens
from ..warp.footprint import prefilter
from ..warp.layer import Layer, joined
from ..warp.mesh import WarpMesh
from .cg_layers import NO_CG, CGObjects, DrawCG
from .clip_context import ClipContext
from .highlight_discs import HighlightDiscs
from .plan import FrameOptions
from .steadied import Steadied
from .views import Views


@dataclass(frozen=True)
class Frame:
    """A frame of a clip; each step of its way adds what it has found."""

    number: int
    clip: ClipContext
    options: FrameOptions
    mesher: Mesher
    """The selected mesher, or one that replaces it."""
    canvas: Canvas
    """Canvas of the frame's own camera."""
    picture: LinearRGBA
    """(H, W, 4) picture of the canvas, linear and premultiplied."""
    small: LinearRGBA
    """(h, w, 4) the source picture at the size of the views."""
    source: LinearRGBA
    """(H, W, 4) the source picture at the final size; the same if the views have this size."""
    lens: ThinLens
    """Lens for the mesh, which sees all that the views see."""
    samples: DepthSamples
    """Positions of known inverse depth, `lens.rectified`."""
    views: Views
    """The virtual cameras, without positions until their number is known."""
    draw_cg: DrawCG | None = None
    """Draws the CG objects."""
    why: str = ""
    """The reason for another mesher than the selected one; empty otherwise."""
    depth: PixelDepth | None = None
    """Depth of every pixel of the canvas, for meshers that need it; not yet `lens.rectified`."""
    blur: float = 0.0
    """Diameter in pixels of its largest blur disc."""
    beyond: float = 0.0
    """Pixels past the canvas's border that views see, besides those of a plain lens there."""
    cg: CGObjects = NO_CG
    steadied: Steadied | None = None
    """The steadier camera of the views, if any."""
    highlight_discs: HighlightDiscs | None = None
    """Highlights that are no longer in the picture; their light is added to the mean of the views."""
    layers: tuple[Layer, ...] = ()
    """The clip's layers, near to far."""
    cg_layers: tuple[Layer, ...] = ()
    """Layers of CG objects, in the order of `cg`; none before the number of views is known."""
    depth_seconds: float = 0.0
    """Wall time of its depth, if that had to be found."""
    mesh_seconds: float = 0.0
    """Wall time of its layers."""
    draw_seconds: float = 0.0
    """Wall time of its views and of the effects after them."""

    @property
    def is_layered(self) -> bool:
        """Return whether its layers are made from the depth of every pixel."""
        return self.mesher.needs_pixel_depth

    @property
    def is_whole(self) -> bool:
        """Return whether its layers have no holes for any view."""
        return self.is_layered and bool(self.picture[..., 3].min() > 0.999)

    @property
    def mesh(self) -> WarpMesh:
        """The triangles of the clip's layers."""
        return joined(self.layers)

    @property
    def size(self) -> tuple[int, int]:
        """Final (width, height)."""
        return self.source.shape[1], self.source.shape[0]

    @property
    def count(self) -> int:
        """The selected number of views, or that for its largest blur disc in its quality."""
        if self.options.views:
            return self.options.views
        prefiltered = self.mesher.is_prefiltered
        wanted = round(self.options.quality.views * views_needed(self.blur, prefiltered))
        return min(max(wanted, LEAST_PREFILTERED if prefiltered else MIN_VIEWS), MAX_VIEWS)

    def through(self, count: int = 0, prefiltered: bool = True, reuse: bool = False) -> Frame:
        """Prepare a frame with layers for its views.

        Args:
            count: Number of views; 0 for the frame's own.
            prefiltered: True to blur its layers for the views, if the mesher allows it.
            reuse: True to write over this frame's layers, which saves memory; it cannot be used afterwards.
        """
        began, count, moved, layers = time.perf_counter(), count or self.count, self.steadied, self.layers
        views = self.mesher.views(self, count)
        if prefiltered and self.mesher.is_prefiltered:
            if not reuse:
                layers = tuple(replace(each, picture=each.picture.copy()) for each in layers)
            # Layers are displaced by the lens for which they were made.
            share = np.float32(1.0 if moved is None else moved.aperture_share)
            spread = np.float32(views.spread)
            prefilter(layers, lambda d: spread * views.lens.footprint(views.discs(share * d), count))
        if moved is not None:
            layers = tuple(replace(each, mesh=moved.mesh(each.mesh)) for each in layers)
        return replace(
            self, views=views, layers=layers, cg_layers=self._drawn_cg(count, views),
            mesh_seconds=self.mesh_seconds + time.perf_counter() - began,
        )  # fmt: skip

    def _drawn_cg(self, count: int, views: Views) -> tuple[Layer, ...]:
        """Prepare CG objects for a number of views."""
        lens, found = replace(self.lens, radius=views.lens.radius), []
        for each in self.cg.layers:
            layer = each.layer(lens, count, views.spread, views.discs)
            mesh = layer.mesh if self.steadied is None else self.steadied.mesh(layer.mesh)
            if each.is_sharp:
                # In the focal plane to all views, and hidden by the surfaces in front of it.
                focus = np.full_like(mesh.inverse_depth, views.lens.focus)
                mesh = replace(mesh, inverse_depth=focus, order=mesh.nearness)
            found.append(replace(layer, mesh=mesh))
        return tuple(found)


def even_views(frame: Frame, count: int) -> Views:
    """Return views on Vogel's spiral for a round aperture, otherwise those of `equal_share_views`."""
    if not frame.options.aperture.is_disc:
        return equal_share_views(frame, count)
    return frame.views.placed(ApertureSamples(vogel_disc(count)))


def equal_share_views(frame: Frame, count: int) -> Views:
    """Return views in the centroids of equal shares of the aperture; prefiltered layers need these."""
    return frame.views.placed(aperture_samples(frame.options.aperture, count))


@dataclass(frozen=True)
class Mesher:
    """A way to make the layers of a frame; `meshers.MESHERS` lists all.

    >>> def make(frame):
    ...     margin = frame.lens.margin(frame.samples.inverse_depth)
    ...     return (Layer(feature_mesh(frame.samples, frame.canvas, margin), frame.picture),)
    >>> plain = Mesher("plain", 99, "Triangles of the samples as they are", make)
    """

    name: str
    """Name on the command line and in .blend files."""
    number: int
    """Number of the enumeration's item in .blend files: never used twice."""
    help: str
    """Text in the interface and on the command line, one sentence without a full stop."""
    make: Callable[[Frame], tuple[Layer, ...]]
    """Makes the layers of a frame, near to far."""
    views: Callable[[Frame, int], Views] = even_views
    """Places a number of views of a frame."""
    needs_pixel_depth: bool = False
    """True if it needs the depth of every pixel; others take samples."""
    is_prefiltered: bool = False
    """True if its layers are blurred by each view's share of the aperture, so that fewer views suffice."""
    takes_tilt: bool = True
    """True if the focal plane can be tilted."""
    uses_given_depth: bool = True
    """True if samples of the user's depth maps replace feature points."""
    fewest_focus_points: int = 0
    """Least number of picked points."""
    settings: tuple[str, ...] = ()
    """Fields of `FrameOptions` that only this mesher uses."""
