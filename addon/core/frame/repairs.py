"""Repairs of depth: strokes that the user paints over a mistake, carried through the clip by optical flow."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ..base import numbers
from ..base.arrays import Floats, LinearRGBA, Map, Mask
from ..base.errors import UserError
from ..base.lru_cache import LRUCache
from ..base.regular_file import read_regular
from ..camera.canvas import Canvas
from ..depth.matte import around, opacity_over
from ..depth.source import PixelDepth
from ..media.light import encode_srgb
from ..optics.thin_lens import ThinLens
from ..subjects.flow import grid, warped
from ..subjects.pictures import ClipPictures

KINDS = {"same": "Same as Here", "nearer": "Nearer", "farther": "Farther", "sharp": "Sharp", "soft": "Soft"}
"""Kinds of repairs, and their names for users."""
SURE = 0.3
"""Least certainty of flow at which a pixel is still the painted one. Chosen by inspection."""
LEAST_LEFT = 1 / 3
"""Share of the painted pixels that a frame must show; with fewer, flow has lost them."""
REFERENCE = 0.012
"""Radius of the reference over the long side: the median of its depths is the depth of *Same as Here*."""
EDGE = 0.5
"""Radius over that of the brush within which the painted region snaps to edges of the picture."""
NOISE = 0.02
"""Least standard deviation of the colours of a side, display-encoded: noise and JPEG."""
ALIKE = 1.0
"""Log-likelihood by which a pixel must be more like the other side. Chosen by inspection."""
MOST = 12.0
"""Largest negative log-likelihood of a colour: one pixel must not decide for those around it."""
ALONE = 5
"""Side in pixels of the square whose pixels decide together."""
FARTHEST = 2
"""Percentile of inverse depths that is the background of *Soft*."""
KEPT = 16
"""Remembered maps of places, 2 MB each."""


@dataclass(frozen=True)
class Repair:
    """One stroke of a brush over a mistake."""

    kind: str
    """A key of `KINDS`."""
    frame: int
    """Number of the painted frame."""
    places: tuple[tuple[float, float], ...]
    """Corners of the stroke, fractions of the picture, (0, 0) top left."""
    radius: float = 0.02
    """Radius of the brush, a share of the picture's width."""
    amount: float = 0.25
    """How much nearer or farther: 0.25 is a quarter of the distance."""
    reference: tuple[float, float] | None = None
    """Place in the painted frame with the right depth, for "same"."""


def read_repairs(file: Path) -> tuple[Repair, ...]:
    """Read repairs from a JSON file: a list of objects with the fields of `Repair`.

    Raises:
        UserError: The file, which is named, cannot be read or holds anything else.
    """
    try:
        held = json.loads(read_regular(file))
    except (OSError, ValueError, RecursionError) as error:
        raise UserError(f"{file} cannot be read as JSON: {error}") from None
    if not isinstance(held, list):
        raise UserError(f'{file} holds no list of repairs; write [{{"kind": "nearer", ...}}, ...]')
    return tuple(_repair(file, number, each) for number, each in enumerate(held, 1))


def _repair(file: Path, number: int, held: Any) -> Repair:
    """A repair from an object of a file."""
    try:
        known = {"kind", "frame", "places", "radius", "amount", "reference"}
        if not isinstance(held, dict) or (more := held.keys() - known):
            raise ValueError(f"it has {', '.join(sorted(more))}" if isinstance(held, dict) else "no object")
        made = Repair(
            str(held["kind"]), numbers.whole(str(held["frame"])), tuple(map(_place, held["places"])),
            **{name: numbers.real(str(held[name])) for name in ("radius", "amount") if name in held},
            reference=_place(held["reference"]) if held.get("reference") is not None else None,
        )  # fmt: skip
        check_repair(made)
    except (KeyError, TypeError, ValueError, UserError) as error:
        what = f"{error.args[0]} is missing" if isinstance(error, KeyError) else str(error)
        raise UserError(f"{file}: repair {number} is not valid: {what}") from None
    return made


def _place(pair: Any) -> tuple[float, float]:
    x, y = pair
    return numbers.real(str(x)), numbers.real(str(y))


def check_repair(repair: Repair) -> None:
    """Check the values of a repair.

    Raises:
        UserError: One is out of its bounds, or the reference is missing.
    """
    if repair.kind not in KINDS:
        raise UserError(f"there is no kind of repair {repair.kind!r}; choose one of {', '.join(KINDS)}")
    if not repair.places or not all(0 <= each <= 1 for place in repair.places for each in place):
        raise UserError("a repair's places must be pairs of numbers from 0 to 1, at least one")
    if not 0 < repair.radius <= 0.5:
        raise UserError(f"the brush has a radius of {repair.radius:g}; give a number up to 0.5")
    if not 0 < repair.amount <= 10:
        raise UserError(f"the amount of a repair is {repair.amount:g}; give a number up to 10")
    if repair.kind == "same" and repair.reference is None:
        raise UserError('a repair "same" needs a reference, the place with the right depth')


@dataclass(frozen=True)
class CarriedPlaces:
    """Places of a frame's pixels in a painted frame, by optical flow from frame to frame."""

    pictures: ClipPictures
    _kept: LRUCache[tuple[Map, Map]] = field(
        default_factory=lambda: LRUCache[tuple[Map, Map]](KEPT), repr=False, compare=False
    )

    def region(self, repair: Repair, frame: int) -> tuple[Map, Mask] | None:
        """Return the painted region (h, w) in [0, 1] and the reference's pixels (h, w) in a frame.

        They have the size of the pictures; None where the frame does not show most of the region. Passes
        checkpoints. Errors as of `ClipPictures.picture`.
        """
        if not {frame, repair.frame} <= set(self.pictures.frames):
            return None
        place, sure = self._places(repair.frame, frame)
        height, width = sure.shape
        away = _distances(repair.places, (height, width))
        reach = repair.radius * width
        painted = np.clip(reach + 0.5 - warped(away, place), 0, 1) * (sure > SURE)
        own = np.clip(reach + 0.5 - away, 0, 1)
        if painted.sum() < LEAST_LEFT * own.sum():
            return None
        beside = np.full(sure.shape, np.inf)
        if repair.reference is not None:
            middle = np.array(repair.reference) * [width, height]
            beside = np.linalg.norm(place - middle, axis=2)
        return painted, np.asarray((beside < REFERENCE * max(height, width)) & (sure > SURE))

    def _places(self, start: int, frame: int) -> tuple[Map, Map]:
        """Places (h, w, 2) of a frame's pixels in the first frame, and their least certainty (h, w)."""
        frames, flow = self.pictures.frames, self.pictures.flow
        at, to = frames.index(start), frames.index(frame)
        way = 1 if to > at else -1
        last, places = to, self._kept.known((at, to))
        while places is None and last != at:
            last -= way
            places = self._kept.known((at, last))
        if places is None:
            shape = self.pictures.picture(start).shape[:2]
            places = grid(shape), np.ones(shape, np.float32)
        for number in range(last + way, to + way, way) if last != to else ():
            back, certain = flow.there(frames[number], frames[number - way])
            places = warped(places[0], back), np.minimum(warped(places[1], back), certain)
            self._kept.get((at, number), partial(_same, places))
        return places


def _same(places: tuple[Map, Map]) -> tuple[Map, Map]:
    return places


def _distances(places: Sequence[tuple[float, float]], shape: tuple[int, int]) -> Map:
    """(h, w) distance in pixels from a stroke, whose corners are fractions of the picture."""
    size = np.array(shape[::-1])
    # Two corners at least: of a single one OpenCV draws nothing.
    corners = np.clip((np.array([*places, places[-1]]) * size).astype(int), 0, size - 1).astype(np.int32)
    line = np.full(shape, 255, np.uint8)
    cv2.polylines(line, [corners.reshape(-1, 1, 2)], False, 0)
    return np.asarray(cv2.distanceTransform(line, cv2.DIST_L2, cv2.DIST_MASK_PRECISE), np.float32)


def repaired(
    depth: PixelDepth,
    repairs: Sequence[Repair],
    region_of: Callable[[Repair], tuple[Map, Mask] | None],
    canvas: Canvas,
    picture: LinearRGBA,
    lens: ThinLens,
) -> PixelDepth:
    """Repair the depth of a frame.

    Args:
        depth: Depth of the canvas's pixels.
        repairs: Repairs in their order.
        region_of: Returns region and reference in the frame, as `CarriedPlaces.region`.
        canvas: The frame's canvas.
        picture: (H, W, 4) linear picture of the canvas, to whose edges regions snap.
        lens: Lens of the frame, for "sharp".

    Returns:
        The depth, with new values and full confidence in the regions.
    """
    inverse = np.array(depth.inverse_depth)
    sure, opacity = (None if each is None else each.copy() for each in (depth.confidence, depth.opacity))
    for repair in repairs:
        if (found := region_of(repair)) is None:
            continue
        region = _snapped(opacity_over(canvas, found[0]), picture, EDGE * repair.radius * picture.shape[1])
        value = _value(repair, inverse, region, opacity_over(canvas, found[1]) > 0.5, lens)
        if value is None:
            continue
        inverse[region] = np.maximum(value, 0)
        if sure is not None:
            sure[region] = 1
        if opacity is not None:
            opacity[region] = np.nan
    return replace(depth, inverse_depth=inverse, confidence=sure, opacity=opacity)


def _value(
    repair: Repair, inverse: Floats, region: Mask, reference: Mask, lens: ThinLens
) -> Floats | float | None:
    """New inverse depths (n,) of a region (H, W), or one for all; None where the reference is hidden."""
    match repair.kind:
        case "nearer":
            return np.asarray(inverse[region] * (1 + repair.amount))
        case "farther":
            return np.asarray(inverse[region] / (1 + repair.amount))
        case "sharp":
            places = np.asarray(np.argwhere(region)[:, ::-1] + 0.5, np.float64)
            return lens.unrectified(np.full(len(places), float(lens.focus)), places)
        case "soft":
            return float(np.percentile(inverse[::8, ::8], FARTHEST))
        case _:
            return float(np.median(inverse[reference])) if reference.any() else None


def _snapped(region: Map, picture: LinearRGBA, radius: float) -> Mask:
    """The region (H, W) with its outline moved to edges of the picture (Bai et al., 2009)."""
    painted = region > 0.5
    reach = max(round(radius), 1)
    part = around(painted, 3 * reach)
    own = painted[part].astype(np.uint8)
    if not own.any() or own.all():
        return np.asarray(painted)
    shown = encode_srgb(np.clip(picture[part][..., :3], 0, 1)).astype(np.float32)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    inner, outer = cv2.erode(own, disc), 1 - cv2.dilate(own, disc)
    cost_in, cost_out = (_unlikely(shown, side.astype(np.float32), 3 * reach) for side in (inner, outer))
    more = cv2.blur(np.where(own > 0, ALIKE, -ALIKE) + cost_out - cost_in, (ALONE, ALONE))
    band = (inner == 0) & (outer == 0)
    result = painted.copy()
    result[part] = np.where(band, more > 0, own > 0)
    return np.asarray(result)


def _unlikely(shown: Map, side: Map, reach: int) -> Map:
    """Negative log-likelihood (h, w) of colours (h, w, 3) by those of a side (h, w) within a reach."""
    window = (2 * reach + 1, 2 * reach + 1)
    weight = np.maximum(cv2.blur(side, window), np.float32(1e-6))[..., None]
    mean = cv2.blur(shown * side[..., None], window) / weight
    spread = cv2.blur(shown**2 * side[..., None], window) / weight - mean**2
    spread = np.maximum(spread, np.float32(NOISE**2))
    cost = ((shown - mean) ** 2 / spread + np.log(spread)).sum(axis=2) / 2
    # Without any pixel of the side around, it is as unlikely as can be.
    return np.asarray(np.where(weight[..., 0] > 1e-5, np.minimum(cost, MOST), MOST), np.float32)
