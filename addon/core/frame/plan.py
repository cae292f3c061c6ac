"""The user's settings of the lens."""

from dataclasses import dataclass, field

from ..base.options import option
from ..focus.focus import Focus
from ..optics.aperture import Aperture
from ..optics.aperture_sampling import MOST_VIEWS
from ..optics.zone import InFocusZone
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
