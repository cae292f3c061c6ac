"""The input and output of meshers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ...base.arrays import Floats, LinearRGBA
from ...camera.canvas import Canvas
from ...depth.source import PixelDepth
from ...depth.sparse import DepthSamples
from ...optics.aperture import ApertureSamples, aperture_samples
from ...optics.aperture_sampling import exact_registration, vogel_disc
from ...optics.thin_lens import ThinLens
from ...warp.layered_depth_image import LayeredDepthImage
from ...warp.mesh import WarpMesh
from ..cg_layers import NO_CG, CGObjects
from ..clip_context import ClipContext
from ..highlight_discs import HighlightDiscs
from ..plan import FrameOptions
from ..steadied import Steadied


@dataclass(frozen=True)
class FrameGeometry:
    """The data of a frame for its mesh."""

    clip: ClipContext
    settings: FrameOptions
    mesher: Mesher
    """The selected mesher, or one that replaces it."""
    canvas: Canvas
    picture: LinearRGBA
    """(H, W, 4) picture of the canvas, linear and premultiplied."""
    lens: ThinLens
    samples: DepthSamples
    """Positions of known inverse depth, `lens.rectified`."""
    depth: PixelDepth | None = None
    """Depth of every pixel of the canvas, for meshers that need it; not yet `lens.rectified`."""
    cg: CGObjects = NO_CG
    steadied: Steadied | None = None
    """The steadier camera of the views, if any."""
    beyond: float = 0.0
    """Pixels past the canvas's border that a steadier camera sees."""
    highlight_discs: HighlightDiscs | None = None
    """Highlights that are no longer in the picture."""

    @property
    def frame(self) -> int:
        """The source frame's number."""
        return self.samples.frame


@dataclass(frozen=True)
class Surface:
    """A warp mesh with its texture."""

    mesh: WarpMesh
    texture: LinearRGBA
    """(h, w, 4) linear, premultiplied."""
    is_whole: bool = False
    """True if the mesh has no holes for any view."""
    layers: tuple[LayeredDepthImage, ...] = ()
    """Layers of the mesh, near to far."""


@dataclass(frozen=True)
class Views:
    """Virtual cameras over the aperture."""

    offsets: Floats
    """(N, 2) positions in scene units, x right and y down, as `ThinLens.sheared_positions`."""
    registration: Floats
    """(N, 2, 3) maps from pixels of a view to pixels in register with the focal plane."""
    weights: Floats | None = None
    """(N,) shares of the aperture's light; None for equal ones."""
    spread: float = 1.0
    """See `ApertureSamples`."""


def even_views(geometry: FrameGeometry, count: int) -> Views:
    """Return views with the focal plane exactly in register.

    Positions are Vogel's spiral for a round aperture, otherwise those of `equal_share_views`.
    """
    if not geometry.settings.aperture.is_disc:
        return equal_share_views(geometry, count)
    return _in_register(geometry, ApertureSamples(vogel_disc(count)))


def equal_share_views(geometry: FrameGeometry, count: int) -> Views:
    """Return views in the centroids of equal shares of the aperture, in register at the focal plane.

    Prefiltered textures need these.
    """
    return _in_register(geometry, aperture_samples(geometry.settings.aperture, count))


def _in_register(geometry: FrameGeometry, samples: ApertureSamples) -> Views:
    offsets = geometry.lens.sheared_positions(geometry.lens.radius * samples.positions)
    registration = exact_registration(geometry.canvas, offsets, geometry.lens.focus)
    return Views(offsets, registration, samples.weights, samples.spread)


@dataclass(frozen=True)
class Mesher:
    """A way to make the warp mesh of a frame; `meshers.MESHERS` lists all.

    >>> def make(geometry):
    ...     margin = geometry.lens.margin(geometry.samples.inverse_depth)
    ...     return Surface(feature_mesh(geometry.samples, geometry.canvas, margin), geometry.picture)
    >>> plain = Mesher("plain", 99, "Triangles of the samples as they are", make)
    """

    name: str
    """Name on the command line and in .blend files."""
    number: int
    """Number of the enumeration's item in .blend files: never used twice."""
    help: str
    """Text in the interface and on the command line, one sentence without a full stop."""
    make: Callable[[FrameGeometry], Surface]
    views: Callable[[FrameGeometry, int], Views] = even_views
    """Returns a number of views of a frame."""
    needs_pixel_depth: bool = False
    """True if it needs the depth of every pixel; others take samples."""
    is_prefiltered: bool = False
    """True if its texture is blurred by each view's share of the aperture, so that fewer views suffice."""
    takes_tilt: bool = True
    """True if the focal plane can be tilted."""
    uses_given_depth: bool = True
    """True if samples of the user's depth maps replace feature points."""
    fewest_focus_points: int = 0
    """Least number of picked points."""
    settings: tuple[str, ...] = ()
    """Fields of `FrameOptions` that only this mesher uses."""
