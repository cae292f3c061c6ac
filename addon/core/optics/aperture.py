"""The shape of an aperture, its transmission, and the virtual cameras over it.

Positions on the aperture are in shares of its radius, x right and y down as in the picture. Things behind the
focal plane are blurred into the aperture's shape, things in front of it into that shape upside down. Names
and units are those of Blender's `Camera.dof`, where it has them.
"""

import hashlib
from dataclasses import dataclass
from functools import cached_property, lru_cache

import cv2
import numpy as np

from ..base.arrays import Floats, Map, Mask
from ..base.errors import UserError
from ..base.options import check, option
from .aperture_sampling import centroidal_disc, check_count, relaxed

CELLS = 128
"""Cells along the square around the aperture, on which it is sampled: a polygon's area is right to 0.5 %."""
SUBSAMPLES = 4
"""Along a cell of a raster, by which the share of it that lets light through is sampled."""
FINEST = CELLS * SUBSAMPLES
"""Samples of transmission along the square. An aperture picture has no finer detail."""
LEAST_LIGHT = 1e-3
"""Transmission relative to the brightest place below which the aperture is closed; 8 bits hold 1/255."""
MOST_LOST = 0.99
"""Largest share of light that apodisation removes at the rim; 1 would be a smaller aperture."""
MOST_AXIAL = 0.5
"""Largest share by which colours focus apart: at 1, red and blue focus at infinity."""
MOST_BENT = 2.0
"""Largest aberrations: discs in the corners are three times as long as wide."""
MOST_LATERAL = 0.05
"""Largest share by which red and blue pictures are larger or smaller. Chosen by inspection."""
RED_AND_BLUE = [0, 2]
"""Channels that `Aperture.axial_colour` focuses farther away: a lens that is corrected for two colours has
its shortest focal length between them, in green."""
MOST_BLADES = 16
"""Most blades of a polygon, as in Blender's `Camera.dof.aperture_blades`; more are round."""
GOLDEN = 0.7548776662466927, 0.5698402909980532
"""Steps of the sequence that positions begin with: Roberts, "The unreasonable effectiveness of
quasirandom sequences", 2018, in two dimensions."""


@dataclass(frozen=True, eq=False)
class ApertureImage:
    """A picture as the aperture: the thesis's bokeh brush, section 5.6."""

    light: Map
    """(h, w) how much light passes, linear, not negative. Its longer side is the aperture's diameter."""

    @cached_property
    def digest(self) -> str:
        """16 hexadecimal digits of its shape and values."""
        content = repr(self.light.shape).encode() + np.ascontiguousarray(self.light).tobytes()
        return hashlib.sha256(content).hexdigest()[:16]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ApertureImage) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def __repr__(self) -> str:
        return f"ApertureImage({self.digest})"

    def at(self, x: Floats, y: Floats) -> Floats:
        """Light (...) at places x and y (...), bilinear; none outside of the picture."""
        height, width = self.light.shape
        half = max(height, width) / 2
        column, row = (x * half + (width - 1) / 2).astype(np.float32), (y * half + (height - 1) / 2)
        found = cv2.remap(
            self.light.astype(np.float32), column, row.astype(np.float32), cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_CONSTANT, borderValue=0,
        )  # fmt: skip
        return np.asarray(found, np.float64)


@dataclass(frozen=True)
class Aperture:
    """How much light passes at each place of an aperture; without arguments it is a round hole."""

    blades: int = option(
        0,
        "Blades",
        "Number of aperture blades, at least 3; 0 makes a round aperture",
        least=0,
        most=MOST_BLADES,
    )
    """Corners of a polygon, which lie on the rim; fewer than 3 make it round."""
    rotation: float = option(
        0.0, "Rotation", "Rotation of the blades, anticlockwise as seen in the image", unit="ANGLE"
    )
    """Radians, anticlockwise as seen in the picture. At 0 the middle of an edge lies to the right."""
    roundness: float = option(
        0.0, "Roundness", "Curvature of the blades' edges: 0 is straight, 1 a full circle",
        least=0.0, most=1.0, unit="FACTOR",
    )  # fmt: skip
    """Curvature of the blades' edges: 0 is straight, 1 is an arc of the circle."""
    ratio: float = option(
        1.0, "Anamorphic Squeeze", "Height of blur discs relative to their width, as with an anamorphic lens",
        least=1.0, most=10.0, soft_most=2.0,
    )  # fmt: skip
    """By which it is narrower than high: an anamorphic lens's is 1.33 to 2."""
    obstruction: float = option(
        0.0, "Mirror Lens",
        "Radius of a mirror lens's secondary mirror, as a fraction of the aperture's: turns blur discs into"
        " rings",
        least=0.0, most=0.95, soft_most=0.7, unit="FACTOR",
    )  # fmt: skip
    """Radius of the secondary mirror in its middle, as a share of the aperture's: 0 for none."""
    apodisation: float = option(
        0.0, "Apodization", "How much light a filter absorbs at the rim: gives blur discs soft edges",
        least=0.0, most=MOST_LOST, unit="FACTOR",
    )  # fmt: skip
    """Share of the light that a filter takes at the rim, less inwards: (1 - a)^(r^2) passes."""
    spherical_aberration: float = option(
        0.0, "Spherical Aberration",
        "Above 0, blur discs are brighter at the rim (soap-bubble bokeh), below 0 in the middle (creamy"
        " bokeh), both in front of and behind the focus",
        least=-1.0, most=1.0,
    )  # fmt: skip
    """-1 to 1: light moves to the rim (soap bubbles) or to the middle (creamy): 1 + s (2 r^2 - 1) passes,
    which keeps a disc's energy. A look: real lenses have the opposite on the other side of the focus."""
    vignetting: float = option(
        0.0, "Cat's-Eye (Vignetting)",
        "Optical vignetting: how far blur discs are cut off toward the corners, as a fraction of their"
        " radius. What is in focus keeps its brightness",
        least=0.0, most=1.0, unit="FACTOR",
    )  # fmt: skip
    """By how much of its radius the barrel's opening is shifted against the aperture in the picture's
    corners: blur discs there are cat's eyes. In between it is linear in the distance from the middle."""
    axial_colour: float = option(
        0.0, "Color Fringing",
        "How out of focus red and blue are where green is sharp, as a fraction of the blur at infinity: blur"
        " discs have magenta edges in front of the focus and green ones behind it. 0.02 is a fast lens wide"
        " open",
        least=0.0, most=MOST_AXIAL, soft_most=0.1, unit="FACTOR",
    )  # fmt: skip
    """Share of inverse depth by which red and blue focus farther away than green: the secondary spectrum of
    an achromat (Kingslake and Johnson, "Lens design fundamentals", 2010). Where green is sharp, their disc
    has this share of the disc of infinitely far points."""
    swirl: float = option(
        0.0, "Swirl",
        "How much blur discs in the corners are stretched around the picture's middle behind the focus, and"
        " squeezed in front of it, as a fraction of the blur at infinity. 0.5 is a Petzval lens",
        least=-MOST_BENT, most=MOST_BENT, soft_least=0.0, soft_most=1.0,
    )  # fmt: skip
    """Share of inverse depth by which the sagittal focus in the corners is nearer than the tangential one:
    astigmatism, which grows with the square of the distance from the picture's middle."""
    field_curvature: float = option(
        0.0, "Field Curvature",
        "How much nearer the lens focuses in the corners than in the picture's middle, as a fraction of the"
        " blur at infinity; below 0, farther away",
        least=-MOST_BENT, most=MOST_BENT, soft_least=-0.5, soft_most=0.5,
    )  # fmt: skip
    """Share of inverse depth by which the corners focus nearer; it grows with the square of the distance from
    the picture's middle."""
    coma: float = option(
        0.0, "Coma",
        "Length of the comets that points in the corners become, as a fraction of the blur at infinity. Above"
        " 0 they point to the picture's middle",
        least=-MOST_BENT, most=MOST_BENT, soft_least=0.0, soft_most=0.3,
    )  # fmt: skip
    """Length of a comet in the picture's corners, in radii of the disc of infinitely far points; it grows
    with the distance from the middle, and blurs the focal plane, too."""
    anamorphic_focus: float = option(
        0.0, "Anamorphic Focus",
        "How much nearer the lens focuses across than upright, as a fraction of the blur at infinity: discs"
        " are wider behind the focus and narrower in front of it",
        least=-MOST_BENT, most=MOST_BENT, soft_least=-0.3, soft_most=0.3,
    )  # fmt: skip
    """Share of inverse depth by which the picture's width focuses nearer than its height: an anamorphic lens
    has a cylinder for each."""
    lateral_colour: float = option(
        0.0, "Lateral Color",
        "How much larger the red picture is than the green one, and the blue one smaller: colored edges"
        " toward the border, also in focus. 0.001 is a pixel at a thousand from the middle",
        least=-MOST_LATERAL, most=MOST_LATERAL, soft_least=-0.005, soft_most=0.005, precision=4,
    )  # fmt: skip
    """Share of the distance from the picture's middle by which red is farther away from it, and blue less."""
    matte_box_sides: float = option(
        0.0, "Matte Box Sides",
        "How far a matte box's upright edges cut into blur discs at the left and right border, as a fraction"
        " of their radius: they end in straight lines",
        least=0.0, most=1.0, unit="FACTOR",
    )  # fmt: skip
    """By how much of the aperture's radius the edges of a square opening are shifted at the left and right
    border; in between it is linear in the distance from the middle."""
    matte_box_top: float = option(
        0.0, "Matte Box Top",
        "How far a matte box's level edges cut into blur discs at the upper and lower border, as a fraction"
        " of their radius",
        least=0.0, most=1.0, unit="FACTOR",
    )  # fmt: skip
    """As `matte_box_sides`, at the upper and lower border."""
    breathing: float = option(
        0.0, "Breathing",
        "How much the field of view narrows as the focus comes nearer, by the distances of Scale: 1 is a"
        " lens that moves all of its glass, 0.15 to 0.25 a cinema lens; below 0 it widens",
        least=-1.0, most=1.0, soft_least=0.0,
    )  # fmt: skip
    """Share of a thin lens's change of its image distance: see `breathing.enlargement`."""
    image: ApertureImage | None = None
    """A picture in place of blades and roundness."""

    def __post_init__(self) -> None:
        """UserError for a shape that means nothing."""
        check(self)
        if self.image is None:
            return
        if not np.isfinite(self.image.light).all():
            raise UserError("the aperture image has pixels that are not finite (NaN or infinite)")
        if not (self.image.light.size and self.image.light.max() > 0):
            raise UserError("the aperture image is black, so no light passes")
        open_cells(self)

    @property
    def is_disc(self) -> bool:
        """Return whether the aperture is a round hole of uniform transmission."""
        is_round = self.image is None and (self.blades < 3 or self.roundness == 1)
        is_even = self.apodisation == self.spherical_aberration == self.obstruction == 0
        return is_round and is_even and self.ratio == 1

    @property
    def transmission(self) -> float:
        """Return the ratio of the light that passes to a round hole's, in the picture's centre."""
        _, light, _ = open_cells(self)
        return float(light.sum() * (2 / CELLS) ** 2 / np.pi)

    def light(self, x: Floats, y: Floats) -> Floats:
        """Return the transmission (...) at positions x and y (...), in shares of the radius.

        It is not negative, and 1 without absorption.
        """
        wide = x * self.ratio
        squared = wide**2 + y**2
        if self.image is not None:
            passed = self.image.at(wide, y)
        else:
            passed = (squared <= self._rim(wide, y) ** 2).astype(np.float64)
        passed = passed * (squared >= self.obstruction**2)
        passed *= (1 - self.apodisation) ** squared
        return np.asarray(passed * np.maximum(1 + self.spherical_aberration * (2 * squared - 1), 0))

    def _rim(self, x: Floats, y: Floats) -> Floats:
        """Distance of the rim from the middle in the direction of places."""
        if self.blades < 3:
            return np.ones_like(x)
        half = np.pi / self.blades
        # From the middle of an edge; y points down.
        angle = (np.arctan2(-y, x) - self.rotation + half) % (2 * half) - half
        return np.asarray((1 - self.roundness) * np.cos(half) / np.cos(angle) + self.roundness)

    def raster(self, size: int, scale: float = 1.0) -> tuple[Floats, Floats]:
        """Return mean transmission and open share (size, size) of cells of the square around the aperture.

        `scale` enlarges the aperture within the same square.
        """
        fine = size * SUBSAMPLES
        place = ((np.arange(fine) + 0.5) * 2 / fine - 1) / scale
        light = self.light(*np.meshgrid(place, place))
        return _cell_means(light, size), _cell_means(light > LEAST_LIGHT * light.max(), size)


def _cell_means(values: Floats | Mask, size: int) -> Floats:
    """(size, size) means of the cells of a raster `SUBSAMPLES` times as fine."""
    return np.asarray(values.reshape(size, SUBSAMPLES, size, SUBSAMPLES).mean(axis=(1, 3)), np.float64)


@dataclass(frozen=True)
class ApertureSamples:
    """Virtual cameras over an aperture."""

    positions: Floats
    """(N, 2) in shares of the radius. Read-only."""
    weights: Floats | None = None
    """(N,) share of the aperture's light that each stands for, their sum 1; None for equal ones."""
    spread: float = 1.0
    """Radius of a disc as large as the open part of the aperture, in shares of the aperture's: each position
    stands for an N-th of it."""


@lru_cache(maxsize=64)
def aperture_samples(aperture: Aperture, count: int) -> ApertureSamples:
    """Return a number of virtual cameras over an aperture.

    Each stands in the centroid of an equal share of the light (see `relaxed`). Blurred by a disc of the size
    of a share, the positions blur like the aperture; their weighted mean is the centroid of the light. Raises
    UserError if the count is out of range.
    """
    check_count(count)
    if aperture.is_disc:
        return ApertureSamples(centroidal_disc(count))
    cells, light, area = open_cells(aperture)
    found, mass = relaxed(_start(cells, count), cells, light, area)
    # Positions that are not fully relaxed have shares of unequal size.
    return ApertureSamples(_fixed(found), _fixed(mass / mass.sum()), float(np.sqrt(area / np.pi)))


@lru_cache(maxsize=16)
def open_cells(aperture: Aperture) -> tuple[Floats, Floats, float]:
    """Return the centres (n, 2) of open cells, their light (n,), and their area in squared radii.

    Raises:
        UserError: No light passes.
    """
    light, share = aperture.raster(CELLS)
    row, column = np.nonzero(share)
    if not len(row):
        raise UserError(
            "the aperture lets no light through; lower its ratio or central mirror, or choose another image"
        )
    cells = (np.column_stack([column, row]) + 0.5) * 2 / CELLS - 1
    return _fixed(cells), _fixed(light[row, column]), float(share.sum() * (2 / CELLS) ** 2)


def _start(cells: Floats, count: int) -> Floats:
    """(count, 2) first positions, evenly over the open cells (n, 2)."""
    cell = np.full((CELLS, CELLS), False)
    at = np.clip(((cells + 1) / 2 * CELLS).astype(int), 0, CELLS - 1)
    cell[at[:, 1], at[:, 0]] = True
    tried = int(np.ceil(1.5 * count * CELLS**2 / len(cells))) + 64
    place = (0.5 + np.outer(np.arange(tried), GOLDEN)) % 1
    column, row = (place * CELLS).astype(int).T
    found = place[cell[row, column]][:count]
    if len(found) < count:
        # Thin shapes: cells in their order, evenly.
        return np.asarray(cells[np.linspace(0, len(cells) - 1, count).astype(int)])
    return np.asarray(2 * found - 1)


def _fixed(values: Floats) -> Floats:
    """The array made read-only, as caches share it."""
    values.flags.writeable = False
    return values
