"""The plan of a frame, which the renderer follows: its warp mesh and virtual cameras."""

from dataclasses import dataclass, field

import numpy as np

from ..base.arrays import Floats, Map
from ..base.options import option
from ..camera.canvas import Canvas
from ..focus.focus import Focus
from ..optics.aberrations import NO_ABERRATIONS, Aberrations
from ..optics.aperture import Aperture
from ..optics.aperture_sampling import MOST_VIEWS
from ..optics.thin_lens import ThinLens
from ..optics.zone import InFocusZone
from ..warp.mesh import WarpMesh
from .highlights import RESTORED, HighlightSettings
from .quality import NORMAL, QUALITIES, Quality
from .repairs import Repair


@dataclass(frozen=True)
class FrameOptions:
    """The user's settings of the lens."""

    focus: Focus
    radius: float
    """Radius of the virtual aperture in scene units."""
    views: int = option(
        0, "Views", "Number of virtual cameras; 0 uses as many as the largest blur disc needs",
        least=0, most=MOST_VIEWS, soft_most=256, words={"auto": 0},
    )  # fmt: skip
    method: str = option("layers", "Method", "How views are synthesized")
    """Name of the mesher, a key of `meshers.MESHERS`."""
    seed: int = option(
        0, "Seed", "Random seed for the positions of the thesis's method", least=0, most=2**31 - 1
    )
    borrow: bool = option(
        True, "Borrow",
        "Fill in what the frame does not show, behind silhouettes and past the border, from other frames;"
        " when off, it is invented from the surroundings",
    )  # fmt: skip
    zone_front: float = option(
        0.0, "Zone in Front",
        "How far in front of the focal plane everything stays sharp, as a share of its distance: 0.2 is up to"
        " a fifth nearer",
        least=0.0, most=0.95, precision=2, unit="FACTOR",
    )  # fmt: skip
    zone_behind: float = option(
        0.0, "Zone Behind",
        "How far behind the focal plane everything stays sharp, as a share of its distance: 0.5 is up to half"
        " as far again",
        least=0.0, most=1000.0, soft_most=1.0, precision=2,
    )  # fmt: skip
    blur_in_front: float = option(
        1.0, "Blur in Front",
        "Strength of the blur in front of the in-focus zone: 1 is the lens's own, 0 leaves all sharp",
        least=0.0, most=2.0, soft_most=1.0, precision=2,
    )  # fmt: skip
    blur_behind: float = option(
        1.0, "Blur Behind",
        "Strength of the blur behind the in-focus zone: 1 is the lens's own, 0 leaves all sharp",
        least=0.0, most=2.0, soft_most=1.0, precision=2,
    )  # fmt: skip
    stabilize: float = option(
        0.0, "Stabilize",
        "How far the camera's path is smoothed, as far as the clip shows enough: 0 keeps it as it is,"
        " 1 makes it a line. The picture is cropped a little, unless its border is filled",
        least=0.0, most=1.0, precision=2, unit="FACTOR",
    )  # fmt: skip
    """Strength of `steady_path`; 0 draws from the clip's own cameras."""
    fill_border: bool = option(
        False, "Fill Border",
        "Keep the whole picture on a steadier path: what it shows past the clip's border is filled in from"
        " other frames, not cropped",
    )  # fmt: skip
    """True if `steady_path` keeps the whole picture."""
    grain: float = option(
        1.0, "Grain",
        "How much of the clip's noise is added again where the blur removes it: 1 makes blurred areas as"
        " noisy as the clip, 0 leaves them smooth. Clips without visible noise are not changed",
        least=0.0, most=4.0, soft_most=1.0, words={"off": 0.0}, precision=2,
    )  # fmt: skip
    aperture: Aperture = field(default_factory=Aperture)
    sensor: float = 0.0
    """Width of the sensor in scene units, by which the lens breathes; 0 if it is unknown."""
    highlights: HighlightSettings = RESTORED
    """Restoration of clipped light."""
    repairs: tuple[Repair, ...] = ()
    """Repairs of depth, in their order."""
    quality: Quality = option(  # noqa: RUF009
        NORMAL, "Quality", "Render time against quality", choices=QUALITIES, can_be_keyed=False
    )
    """Budget of the frame; a number of views overrides the quality's own."""

    @property
    def breathes(self) -> bool:
        """Return whether the field of view changes with the focus."""
        return bool(self.aperture.breathing and self.sensor)

    @property
    def zone(self) -> InFocusZone:
        """The in-focus zone."""
        return InFocusZone(self.zone_front, self.zone_behind, self.blur_in_front, self.blur_behind)


@dataclass(frozen=True)
class FramePlan:
    """The renderer's data of a frame, besides the texture."""

    frame: int
    canvas: Canvas
    lens: ThinLens
    mesh: WarpMesh
    """Mesh with inverse depths that are `lens.rectified`."""
    offsets: Floats
    """(N, 2) positions in scene units, x right and y down, as `ThinLens.sheared_positions`."""
    registration: Floats
    """(N, 2, 3) maps from pixels of a synthesized view to pixels in register with the focal plane."""
    pose_interpolated: bool
    """True if the frame was not registered; its camera comes from its neighbours."""
    weights: Floats | None = None
    """(N,) shares of the aperture's light; None for equal ones."""
    spread: float = 1.0
    """Radius of a disc as large as the open part of the aperture, in aperture radii."""
    vignetting: float = 0.0
    """See `Aperture`."""
    axial_colour: float = 0.0
    """See `Aperture`."""
    matte_box: tuple[float, float] = (0.0, 0.0)
    """`Aperture.matte_box_sides` and `matte_box_top`."""
    aberrations: Aberrations = NO_ABERRATIONS

    @property
    def is_cut(self) -> bool:
        """Return whether the aperture is cut toward the border of the picture."""
        return bool(self.vignetting or any(self.matte_box))

    @property
    def reach(self) -> float:
        """Radius in pixels of the blur discs of infinitely far points on the axis."""
        return float(self.lens.radius * self.canvas.pinhole.fx * self.lens.axis)

    @property
    def half_diagonal(self) -> float:
        """Half of the picture's diagonal, in pixels."""
        return float(np.hypot(self.canvas.pinhole.width, self.canvas.pinhole.height) / 2)

    @property
    def places(self) -> Floats:
        """(N, 2) positions of the views on the aperture, in its radii."""
        return self.lens.aperture_positions(self.offsets) / self.lens.radius

    def field_places(self, xy: Floats) -> Floats:
        """Return places (..., 2) in the picture of pixels (..., 2), in halves of its diagonal."""
        return np.asarray((xy - self.canvas.pinhole.principal_point) / self.half_diagonal)

    def discs(self, displacement: Map, xy: Floats | None = None) -> Map:
        """Return signed radii (h, w) in pixels of the blur discs of displacements (h, w), with aberrations.

        Their places are the pixels xy (h, w, 2), or else those of a raster with the canvas in its middle.
        """
        if not self.aberrations.is_active:
            return displacement
        if xy is None:
            xy = self.lens.raster_places(displacement.shape)
        return self.aberrations.radius(displacement, self.field_places(xy), self.reach)

    @property
    def axial_shift(self) -> float:
        """Inverse depth, 1 / scene units, by which `RED_AND_BLUE` are focused farther away than green."""
        return self.axial_colour * self.lens.axis
