"""How bright the small clipped things of one picture are: light sources, glints, specular edges.

A camera records nothing over white, so a light source's blur disc comes out as dim as a sheet of paper's. How
bright the light source was can be read from its rim: pixels that it covers in part are not clipped, and the
brighter it is, the wider its point spread reaches at the level where the camera clips and the steeper the
picture falls off there. A model of the light source (its outline drawn in by some distance, one radiance,
blurred by the point spread that the picture's sharpest edges show, clipped) is compared to the pixels for
every pair of distance and radiance. What it gives is the *energy*: the clipped pixels of a light source are
more than the light source, so their count times its radiance is too much. Where the rim says little, the
radiance is near a prior (`PRIOR`).

Masia et al., "Evaluation of reverse tone mapping through varying exposure conditions", 2009, compare what
brightens clipped areas by rules of thumb; Banterle et al., "Inverse tone mapping", 2006, spread it from the
brightest pixels. Neither keeps energy.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import erf

import cv2
import numpy as np

from ..base.arrays import Floats, LinearRGBA, Map, Mask
from ..base.progress import checkpoint

RADIANCES: Floats = np.geomspace(1.0, 1000.0, 28)
"""Radiances of a light source that are compared, times white: a ratio of 1.29 apart."""
PRIOR = (4.0, 1.0)
"""Median radiance of a light source, times white, and the spread of its logarithm, where its rim tells
nothing."""
PAINT = 0.5
"""Probability that a blob is no brighter than it was recorded, before its rim is looked at. Of 0, 0.5, 0.9
and 0.99: bars, foreground and rack have 33.6, 34.9, 37.6 dB with 0.5 and 33.1, 33.4, 34.8 with 0.99."""
MISFIT = 0.2
"""Square root of linear light by which the model is off beside noise, OUTLIER what a pixel may be off by
before it counts less. Of 0.1, 0.15, 0.2, 0.3 and of 0.05, 0.1, 0.15, 0.2, 1 the best over bars, foreground
and rack (32 px, true depth): smaller ones trust rims of few samples, or a cord beside a light source, too
much."""
OUTLIER = 0.2
FINER = 4
"""Parts of a pixel that outlines are sampled by."""
STEP = 0.125
"""Pixels from one distance to the next by which an outline is drawn in."""
DISTANCES = (-0.75, 3.0)
"""Pixels: least and largest distance that an outline is drawn in by. A point of 1,000 times white is clipped
as far as 1.6 pixels with a spread of 0.42."""
SMOOTHED = 0.8
"""Pixels, standard deviation, by which an outline is smoothed. Of 0.5 and 0.8 the better one in bars."""
ROUND = 0.85
"""Share of an outline and of the ellipse with its moments that both have, from which on it is that."""
NEAR = 1.5
"""Pixels, standard deviation, within which what is around a blob tells what is behind it. By eye."""
UNCLIPPED = 0.9
"""Of a blob's brightest channel, under which another one in its middle is not clipped. By eye: noise and
compression."""
PAD = 5
"""Pixels around a blob in which its surroundings are looked at."""
EDGE_CONTRAST = 0.15
"""Linear light between both sides of an edge by which the point spread may be measured."""
EDGE_SHARE = 85.0
"""Percentile of edges, by sharpness, that counts as sharp: 0.42 px on bars, whose true filter has 0.42."""
FEWEST_EDGES = 100
SPREAD = 0.5
"""Pixels, standard deviation: the point spread of a picture of fewer edges, about a pixel's own."""
SPREADS = (0.38, 1.5)
"""Least and largest one that is believed."""
THICKNESS = (0.02, 0.04)
"""Of the long side: up to the first, a blob's thickness is a light source's; from the second on it is a sky,
a wall or a window. By eye."""
LENGTH = (0.1, 0.2)
"""Of the long side: as `THICKNESS`, of a blob's length. By eye."""
AMONG = (0.0, 0.25)
"""Share of large clipped areas in the surroundings, from none to so much that a blob is a piece of them: sky
between leaves. By eye."""
AROUND = 0.02
"""Of the long side, how far these surroundings reach. By eye."""
GROUND = (0.4, 0.8)
"""Linear light of what is around a blob: beside the first it may be a light source, beside the second it is
noise on something white. By eye."""
FLAT = (0.012, 0.022)
"""Linear light over the threshold, mean of a blob's pixels: from the second on they are clipped but for
noise, up to the first they are paint that is nearly white, as in walk and fence (else 0.7, 0.3 dB less)."""


@dataclass(frozen=True)
class Highlight:
    """A small clipped blob of a picture, and what its rim tells of its radiance."""

    corner: tuple[int, int]
    """Row and column of its patch in the picture."""
    centre: tuple[float, float]
    """x and y as shares of the picture's width and height."""
    area: int
    """Clipped pixels."""
    weight: float
    """0 to 1, how sure it is a light source and not a piece of a large clipped area."""
    clipped: Mask
    """(h, w) its pixels in the patch."""
    ground: Map
    """(h, w, 3) linear colour behind it, as what is around lets expect."""
    core: Floats
    """(3,) linear colour that its clipped pixels were recorded with, the median."""
    rim: Floats
    """(3,) linear light of its rim, sum of what is over the ground: its colour."""
    coverage: Map
    """(d, h, w) how much of its radiance arrives at each pixel, by distance that the outline is drawn in."""
    likelihood: Floats
    """(d, r) logarithm, by that distance and radiance."""

    @property
    def evidence(self) -> Floats:
        """(r,) logarithm of the likelihood of each of `RADIANCES`, whatever the outline is."""
        most = self.likelihood.max()
        return np.asarray(np.log(np.exp(self.likelihood - most).mean(axis=0) + 1e-300) + most)

    def light(self, evidence: Floats, colour: Floats) -> Map:
        """(h, w, 3) linear light of the patch without clipping, with evidence (r,) of the radiance and colour
        (3,), largest 1."""
        posterior = np.exp(evidence + _prior() - (evidence + _prior()).max())
        radiance = float(np.exp((posterior * np.log(RADIANCES)).sum() / posterior.sum()))
        # The outline that goes with it: between the radiances that were tried, of which it is a mean.
        place = float(np.interp(np.log(radiance), np.log(RADIANCES), np.arange(len(RADIANCES))))
        low, share = int(place), place - int(place)
        high = min(low + 1, len(RADIANCES) - 1)
        given = (1 - share) * self.likelihood[:, low] + share * self.likelihood[:, high]
        outline = np.exp(given - given.max())
        covered = np.einsum("d,dhw->hw", outline / outline.sum(), self.coverage)
        over = np.maximum(_bright(np.array([radiance]), colour, self.core) - self.ground, 0)
        return np.asarray(self.ground + covered[..., None] * over, np.float32)


def highlights(picture: LinearRGBA, threshold: float) -> list[Highlight]:
    """The small clipped blobs of a picture (H, W, 3 or 4), linear: connected pixels of which a channel has
    `threshold` of white or more. Those of no weight are left out. Passes checkpoints."""
    peak = np.ascontiguousarray(picture[..., :3].max(axis=2))
    clipped = (peak >= threshold).astype(np.uint8)
    if not clipped.any():
        return []
    long_side = max(peak.shape)
    count, label, stats, centres = cv2.connectedComponentsWithStats(clipped, connectivity=8)
    inner = cv2.distanceTransform(np.pad(clipped, 1), cv2.DIST_L2, 5)[1:-1, 1:-1]
    thickness = np.zeros(count, np.float32)
    np.maximum.at(thickness, label.ravel(), 2 * inner.ravel())
    level = np.bincount(label.ravel(), np.minimum(peak, 1).ravel(), count)
    thickness[0] = 0
    reach = 2 * round(AROUND * long_side) + 1
    large = (thickness > THICKNESS[1] * long_side)[label].astype(np.float32)
    among = cv2.boxFilter(large, -1, (reach, reach))[tuple(np.clip(centres.astype(int), 0, None).T[::-1])]
    flat = (min(threshold + each, 1 - 1e-3 / (1 + n)) for n, each in enumerate(FLAT))
    weight = (
        _falling(thickness / long_side, *THICKNESS)
        * _falling(stats[:, cv2.CC_STAT_WIDTH : cv2.CC_STAT_HEIGHT + 1].max(axis=1) / long_side, *LENGTH)
        * _falling(among, *AMONG)
        * (1 - _falling(level / np.maximum(stats[:, cv2.CC_STAT_AREA], 1), *flat))
    )
    weight[0] = 0
    spread = point_spread(picture) if weight.any() else SPREAD
    found = []
    for number in np.flatnonzero(weight > 0):
        checkpoint()
        x, y, width, height, area = (int(n) for n in stats[number])
        part = (
            slice(max(0, y - PAD), y + height + PAD),
            slice(max(0, x - PAD), x + width + PAD),
        )
        own = label[part] == number
        centre = (centres[number, 0] + 0.5) / peak.shape[1], (centres[number, 1] + 0.5) / peak.shape[0]
        fitted = _highlight(picture[part][..., :3], own, (clipped[part] > 0) & ~own, spread)
        if fitted is None:
            continue
        ground, core, rim, coverage, likelihood = fitted
        sure = float(weight[number] * _falling(float(np.median(ground[own].max(axis=-1))), *GROUND))
        if sure > 0:
            corner = part[0].start, part[1].start
            found.append(Highlight(corner, centre, area, sure, own, ground, core, rim, coverage, likelihood))
    return found


def point_spread(picture: LinearRGBA) -> float:
    """Standard deviation in pixels of a Gaussian that is as sharp as the picture's (H, W, 3 or 4) sharpest
    edges: the largest step from a pixel to the next, as a share of the contrast over seven."""
    grey = np.ascontiguousarray(picture[..., :3].max(axis=2))
    near_clipped = cv2.dilate((grey > 0.9).astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
    sharpness = []
    for light, off in ((grey, near_clipped), (grey.T, near_clipped.T)):
        light = np.ascontiguousarray(light)
        step = np.abs(np.diff(light, axis=1))
        along = np.ones((1, 7), np.uint8)
        contrast = (cv2.dilate(light, along) - cv2.erode(light, along))[:, :-1]
        peaks = step >= cv2.dilate(step, np.ones((1, 3), np.uint8))
        used = peaks & (contrast > EDGE_CONTRAST) & ~off[:, :-1]
        sharpness.append(step[used] / contrast[used])
    found = np.concatenate(sharpness)
    if len(found) < FEWEST_EDGES:
        return SPREAD
    # A pixel's step over the edge: the share of a Gaussian within half a pixel.
    spreads = np.linspace(*SPREADS, 113)
    steps = np.array([2 * _normal(0.5 / s) - 1 for s in spreads])
    return float(np.interp(-np.percentile(found, EDGE_SHARE), -steps, spreads))


def colour_of(rim: Floats) -> Floats:
    """(3,) colour, largest 1, of a rim's light (3,); white of a rim without light."""
    return np.asarray((rim + 0.02) / (rim.max() + 0.02))


def _highlight(
    light: Map, own: Mask, other: Mask, spread: float
) -> tuple[Map, Floats, Floats, Map, Floats] | None:
    """Ground, core, rim, coverage and likelihood of `Highlight`, of a patch (h, w, 3) where `own` is clipped
    and `other` pixels are clipped, too; None where nothing is around it."""
    away = cv2.distanceTransform((~own).astype(np.uint8), cv2.DIST_L2, 5)
    clear = np.full(own.shape, np.inf, np.float32)
    if other.any():
        clear = cv2.distanceTransform((~other).astype(np.uint8), cv2.DIST_L2, 5)
    ring = (away > 1.5) & (away <= 4.6) & (clear > 2.3)
    if not ring.any():
        ring = (away > 1.5) & ~other
    if not ring.any():
        return None
    ground = _ground(light, ring)
    if np.median(ground[own].max(axis=-1)) >= GROUND[1]:
        return None
    beside = (away > 0) & (away <= 1.5) & (clear > 1.5)
    root = np.sqrt(np.maximum(light, 0))
    texture = float(np.mean((root[ring] - np.sqrt(ground[ring])) ** 2))
    # What the surroundings are made of is not the light source's: as much of it as may be is white.
    unsure = float(np.std(light[ring] - ground[ring])) * np.sqrt(beside.sum())
    rim = np.maximum((light[beside] - ground[beside]).sum(axis=0, dtype=np.float64), 0) + unsure
    inside = _inside(light.max(axis=2), own, beside, ground.max(axis=2))
    deepest = float(np.clip(inside.max() - 0.1, 0, DISTANCES[1]))
    distances = np.arange(DISTANCES[0], deepest + 1e-6, STEP)
    drawn = np.clip(0.5 + FINER * (inside - distances[:, None, None]), 0, 1).astype(np.float32)
    # A pixel's own square is a part of the spread: a twelfth of its variance.
    optics = FINER * np.sqrt(max(spread**2 - 1 / 12, 0.01))
    coverage = np.stack([
        cv2.resize(
            cv2.GaussianBlur(mask, (0, 0), optics), own.shape[::-1], interpolation=cv2.INTER_AREA
        )
        for mask in drawn
    ])  # fmt: skip
    used = (away <= 3) & (clear > 1.5)
    seen, behind = root[used], ground[used]
    core = np.median(light[own].astype(np.float64), axis=0)
    bright = _bright(RADIANCES, colour_of(rim), core)
    over = np.maximum(bright[:, None] - behind, 0)
    white = np.float32(core.max())
    # In one array, and by functions that NumPy has vector instructions for: log1p has none.
    off = coverage[:, used][:, None, :, None] * over
    off += behind
    np.sqrt(np.minimum(off, white, out=off), out=off)
    off -= np.minimum(seen, np.sqrt(white))
    off *= off
    # Cauchy's likelihood: a pixel that shows something else, such as a cord, does not decide alone.
    off *= np.float32(1 / OUTLIER**2)
    off += 1
    np.log(off, out=off)
    misfit = OUTLIER**2 * off.reshape(*off.shape[:2], -1).sum(axis=2).astype(np.float64)
    return ground, core, rim, coverage, -misfit / (2 * (MISFIT**2 + texture))


def _bright(radiance: Floats, colour: Floats, core: Floats) -> Map:
    """(r, 3) linear light of a light source of radiances (r,) and a colour (3,), which a camera recorded as
    `core` (3,): a channel that it did not clip is known, one that it clipped is no darker than that."""
    expected = np.maximum(radiance[:, None] * colour, core)
    return np.where(core < UNCLIPPED * core.max(), core, expected).astype(np.float32)


def _ground(light: Map, ring: Mask) -> Map:
    """(h, w, 3) what is behind a blob, from the pixels around it: the nearest ones count most."""
    known = ring[..., None] * np.concatenate([light, np.ones_like(light[..., :1])], axis=2)
    blurred: Map = np.zeros_like(known)
    for weight, reach in ((1.0, NEAR), (1e-2, 3 * NEAR), (1e-4, 9 * NEAR)):
        blurred += np.float32(weight) * cv2.GaussianBlur(
            known, (0, 0), reach, borderType=cv2.BORDER_CONSTANT
        )  # fmt: skip
    return np.asarray(np.maximum(blurred[..., :3] / np.maximum(blurred[..., 3:], 1e-20), 0), np.float32)


def _inside(peak: Map, own: Mask, beside: Mask, ground: Map) -> Map:
    """(FINER h, FINER w) how many pixels inside of the outline of a blob (h, w) places are, negative outside.

    The outline is that of its pixels and half of those beside it, smoothed, or its ellipse.
    """
    share = np.clip((peak - ground) / np.maximum(1 - ground, 0.05), 0, 1)
    soft = np.where(own, 1.0, np.where(beside, 0.5 * share, 0)).astype(np.float32)
    size = FINER * own.shape[1], FINER * own.shape[0]
    soft = cv2.GaussianBlur(cv2.resize(soft, size, interpolation=cv2.INTER_NEAREST), (0, 0), FINER * SMOOTHED)
    mask = soft > 0.5 * min(1.0, float(soft.max()))
    row, column = np.nonzero(mask)
    place = np.stack([column, row]).astype(np.float64)
    spread = np.cov(place) + np.eye(2) / 12
    y, x = np.mgrid[: size[1], : size[0]]
    from_centre = np.stack([x - place[0].mean(), y - place[1].mean()], axis=-1)
    slope = from_centre @ np.linalg.inv(4 * spread)
    radius = np.sqrt(np.einsum("hwi,hwi->hw", from_centre, slope))
    ellipse = radius <= 1
    if (ellipse & mask).sum() > ROUND * (ellipse | mask).sum():
        # To first order: how much is missing to 1 over how fast that grows.
        steep = np.maximum(np.linalg.norm(slope, axis=-1), 1e-6) / np.maximum(radius, 1e-6)
        narrow = 2 * np.sqrt(np.linalg.eigvalsh(spread)[0])
        return np.asarray(np.minimum((1 - radius) / np.maximum(steep, 1e-6), narrow) / FINER, np.float32)
    within, beyond = (cv2.distanceTransform(part.astype(np.uint8), cv2.DIST_L2, 5) for part in (mask, ~mask))
    return np.asarray((within - beyond) / FINER, np.float32)


def _prior() -> Floats:
    """(r,) logarithm of how likely a radiance is before its rim is looked at."""
    light = np.exp(-((np.log(RADIANCES / PRIOR[0]) / PRIOR[1]) ** 2) / 2)
    paint = np.zeros(len(RADIANCES))
    paint[0] = 1
    return np.asarray(np.log(PAINT * paint + (1 - PAINT) * light / light.sum()))


def _falling[T: (float, Floats, Map)](value: T, low: float, high: float) -> T:
    """1 up to `low`, 0 from `high` on, without a kink (smoothstep)."""
    share = np.clip((value - low) / (high - low), 0, 1)
    return 1 - share * share * (3 - 2 * share)  # type: ignore[return-value, no-any-return]


def _normal(x: float) -> float:
    """Share of a normal distribution under x standard deviations."""
    return (1 + erf(x / 2**0.5)) / 2
