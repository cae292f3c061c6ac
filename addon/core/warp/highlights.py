"""Brightness of the small clipped blobs of a picture: light sources, glints, specular edges.

A clipped light source gets the dim blur disc of a sheet of paper, but its rim reveals its brightness: pixels
that it partly covers are not clipped, and the brighter it is, the farther its point spread reaches at the
clipping level and the steeper the picture falls off there. A model (the outline shrunk by some distance, one
radiance, blurred by the point spread of the picture's sharpest edges, clipped) is compared to the pixels for
all distances and radiances. It gives the *energy*: a light source covers fewer pixels than are clipped, so
their count times its radiance is too much. If the rim is ambiguous, the radiance is near a prior (`PRIOR`).

Masia et al., "Evaluation of reverse tone mapping through varying exposure conditions", 2009, compare
heuristics that brighten clipped areas; Banterle et al., "Inverse tone mapping", 2006, expand the brightest
pixels. Neither preserves energy.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from ..base.arrays import Floats, Indices, Map, Mask
from ..base.progress import checkpoint
from .clipped_blobs import LUMA, PAD, Blobs, Patches, gaussian
from .highlight_kinds import RADIANCES, UNCLIPPED, Lamps, as_tinted, by_area, is_known, tints

MISFIT = 0.085
"""Error of the model beside noise, in square roots of linear light. Bounds from 0.05 to 0.115 by
`tests/frame/test_highlights.py` and `benchmarks.accuracy.highlight_radiance` at 010ab4e6."""
OUTLIER = 0.2
"""Error of a pixel, in the same unit, from which its weight falls."""
FINER = 4
"""Samples of outlines a pixel, along each axis."""
STEP = 0.125
"""Pixels between the distances by which an outline is shrunk."""
DISTANCES = (-0.75, 3.0)
"""Bounds of this distance in pixels. A point of 1,000 times white is clipped up to 1.6 (spread 0.42)."""
REACH = 4.0
"""Largest such distance in spreads: an edge of 1,000 times white is clipped up to 3.1."""
SMOOTHED = 0.8
"""Standard deviation in pixels of the outlines' smoothing. In bars 0.8 is better than 0.5."""
ROUND = 0.85
"""Least intersection over union of an outline and its moments' ellipse to be replaced by it."""
EVERY = 2, 3
"""Steps of distance and radiance in the coarse pass."""
UNLIKELY = 30.0
"""Log likelihood below the maximum beyond which values are not refined. With 12, 20 and 30 the light of a
night street's lamps differs by 9, 0.08 and 0.001 % from that without a limit."""
FAINT = 1e-6
"""Negligible share of a light source's radiance: a thousandth of white for the brightest."""
IMPOSSIBLE = -1e9
"""Log likelihood of an impossible model."""
AT_ONCE = 1 << 18
"""Samples of all distances processed at once, to fit a processor's cache."""


@dataclass(frozen=True)
class LostLight:
    """The light that clipping removed from a picture."""

    pixel: Indices
    """(k,) increasing indices of pixels, row by row."""
    light: Map
    """(k, 3) linear light to add."""


Told = tuple[Floats, Floats, Floats]
"""Sums over other frames of their weight (n,), and of weight times evidence (n, r) and tint (n, 3)."""


def lamps(blobs: Blobs) -> Lamps:
    """Measure the rims of blobs; passes checkpoints."""
    evidence = np.zeros((len(blobs), len(RADIANCES)), np.float32)
    tint = np.zeros((len(blobs), 3), np.float32)
    for some, outlines in _modelled(blobs):
        evidence[some.number], tint[some.number] = outlines.evidence, outlines.tint
    return Lamps(blobs.centre.astype(np.float32), blobs.area.astype(np.float32), evidence, tint)


def lost_light(blobs: Blobs, threshold: float, told: Told, kinds: Floats) -> LostLight:
    """Return the light that clipping removed from blobs.

    Passes checkpoints.

    Args:
        blobs: The blobs.
        threshold: Pixels of this light or more are clipped.
        told: Estimates of other frames.
        kinds: Kinds of lamps in the clip, from `kinds_of`.
    """
    pixels, found = [np.zeros(0, np.intp)], [np.zeros((0, 3), np.float32)]
    prior = np.log(by_area(blobs.area) @ kinds)
    least = UNCLIPPED * threshold
    for some, outlines in _modelled(blobs):
        total, evidence, tint = (each[some.number] for each in told)
        # The more evidence other frames have, the less the frame itself counts: its own estimate flickers.
        share = 1 / (1 + total)[:, None]
        whole = total[:, None] + share
        evidence = (evidence + share * outlines.evidence) / whole
        tint = (tint + share * outlines.tint) / whole
        tint = tint / tint.max(axis=1, keepdims=True)
        lost = outlines.light(evidence + prior[some.number], tint, some.ground) - some.light
        clipped = some.light >= np.maximum(UNCLIPPED * some.light.max(axis=1, keepdims=True), least)
        lost *= (some.seen[:, None] & clipped) * blobs.weight[some.number, None, None, None]
        pixels.append(some.pixel[some.seen])
        found.append(np.moveaxis(np.maximum(lost, 0), 1, -1)[some.seen])
    order = np.argsort(np.concatenate(pixels))
    return LostLight(np.concatenate(pixels)[order], np.concatenate(found).astype(np.float32)[order])


@dataclass(frozen=True)
class _Outlines:
    """Models of k blobs in patches (h, w), for d distances by which their outlines are shrunk."""

    coverage: Map
    """(k, d, h, w) share of the radiance that reaches each pixel."""
    likelihood: Floats
    """(k, d, r) log likelihood by distance and radiance; `IMPOSSIBLE` for distances beyond the inside."""
    core: Floats
    """(k, 3), see `Patches.core`."""
    tint: Floats
    """(k, 3), see `Lamps.tint`."""

    @property
    def evidence(self) -> Floats:
        """(k, r), see `Lamps.evidence`; the mean over outlines."""
        most = self.likelihood.max(axis=(1, 2), keepdims=True)
        mean = np.log(np.exp(self.likelihood - most).sum(axis=1) + 1e-300)
        return np.asarray(mean - mean.max(axis=1, keepdims=True))

    def light(self, posterior: Floats, colour: Floats, ground: Map) -> Map:
        """Linear light (k, 3, h, w) without clipping, from log posteriors (k, r), colours and background."""
        posterior = np.exp(posterior - posterior.max(axis=1, keepdims=True))
        place = posterior @ np.log(RADIANCES) / posterior.sum(axis=1)
        radiance = np.exp(place)
        # Its outline is between those of the compared radiances, of which it is a mean.
        place = np.interp(place, np.log(RADIANCES), np.arange(len(RADIANCES)))
        low = np.minimum(place.astype(int), len(RADIANCES) - 2)
        share, each = (place - low)[:, None], np.arange(len(low))
        given = (1 - share) * self.likelihood[each, :, low] + share * self.likelihood[each, :, low + 1]
        outline = np.exp(given - given.max(axis=1, keepdims=True))
        outline = (outline / outline.sum(axis=1, keepdims=True)).astype(np.float32)
        flat = self.coverage.reshape(*self.coverage.shape[:2], -1)
        covered = (outline[:, None] @ flat).reshape(-1, 1, *ground.shape[2:])
        over = np.maximum(_bright(radiance[:, None], colour, self.core)[..., None, None] - ground, 0)
        return np.asarray(ground + covered * over)


def _modelled(blobs: Blobs) -> Iterator[tuple[Patches, _Outlines]]:
    """Yield groups of a picture's blobs and their models."""
    # A pixel's own square is a part of the spread: a twelfth of its variance.
    optics = FINER * float(np.sqrt(max(blobs.spread**2 - 1 / 12, 0.01)))
    for patches in blobs.patches:
        inside = _inside(patches)
        deepest = np.clip(inside.max(axis=(1, 2)) - 0.1, 0, min(REACH * blobs.spread, DISTANCES[1]))
        count = ((deepest - DISTANCES[0]) / STEP + 1e-6).astype(int) + 1
        # Grouped by the number of distances.
        order = np.argsort(count, kind="stable")
        most = max(1, AT_ONCE // (int(count.max()) * inside[0].size))
        for first in range(0, len(order), most):
            checkpoint()
            which = order[first : first + most]
            some = patches.among(which)
            yield some, _outlines(some, inside[which], count[which], optics, blobs.white)


def _outlines(patches: Patches, inside: Map, steps: Indices, optics: float, clips: float) -> _Outlines:
    """Model k blobs by depths `inside` their outlines; `optics` in samples, light clipped at `clips`."""
    distances = (DISTANCES[0] + STEP * np.arange(steps.max())).astype(np.float32)
    drawn = FINER * inside[:, None] + (0.5 - FINER * distances[:, None, None])
    np.clip(drawn, 0, 1, out=drawn)
    down, across = (_shrunk(n, optics) for n in patches.light.shape[2:])
    # Whole patches in one product.
    rows = drawn.reshape(-1, drawn.shape[-1]) @ across.T
    coverage = down @ rows.reshape(*drawn.shape[:3], -1)
    tint = tints(patches.rim, patches.doubt)
    bright = _bright(RADIANCES[:, None, None], tint, patches.core)
    root = np.tensordot(LUMA, np.sqrt(np.maximum(patches.light, 0)), (0, 1))
    # Pixels that every outline covers, or none, are uninformative.
    told = patches.used & (coverage[:, 0] > FAINT) & (coverage[:, -1] < 1 - FAINT)
    likelihood = np.full((*coverage.shape[:2], len(RADIANCES)), IMPOSSIBLE)
    hint = as_tinted(tint, patches.core)
    for one, (count, mask) in enumerate(zip(steps, told, strict=True)):
        likelihood[one, :count] = _likelihood(
            coverage[one, :count][:, mask], bright[:, one], patches.ground[one][:, mask], root[one][mask],
            2 * (MISFIT**2 + float(patches.texture[one])), clips * bright[0, one].max(),
        ) + hint[one]  # fmt: skip
    return _Outlines(coverage, likelihood, patches.core, tint)


def _likelihood(coverage: Map, bright: Map, ground: Map, root: Map, spread: float, cap: np.float32) -> Floats:
    """Return (d, r) log likelihoods of sources `bright` (r, 3) with coverage (d, p), given luma (p,)."""
    # In units of the outlier's square root of light, so that no later scaling is needed.
    scale = (LUMA / OUTLIER) ** 2
    over = scale[:, None] * np.maximum(bright[:, :, None] - ground, 0)
    behind = scale[:, None] * ground
    white = scale[:, None] * cap
    seen = np.asarray(np.minimum(root, np.sqrt(cap)) / OUTLIER, np.float32)
    (rows, down), (columns, across) = _between(len(coverage), EVERY[0]), _between(len(over), EVERY[1])
    first = -_misfit(coverage[rows, None, None] * over[columns], behind, white, seen) / spread
    found = down @ first @ across.T
    # Only likely models are refined.
    close = found > found.max() - UNLIKELY
    close[np.ix_(rows, columns)] = False
    row, column = np.nonzero(close)
    found[row, column] = -_misfit(coverage[row, None] * over[column], behind, white, seen) / spread
    return np.asarray(found)


def _misfit(light: Map, behind: Map, white: Map, seen: Map) -> Floats:
    """Return the error of p pixels of light (..., 3, p), which is overwritten, in units of `OUTLIER`."""
    # In one array, and by functions with vector instructions in NumPy: log1p has none.
    light += behind
    np.minimum(light, white, out=light)
    np.sqrt(light, out=light)
    light = light[..., 0, :] + light[..., 1, :] + light[..., 2, :]
    light -= seen
    # Cauchy's likelihood: a pixel of another object, such as a cord, does not decide alone.
    light *= light
    light += 1
    # A float holds the product of 16 factors of at most 26: one logarithm in place of 16.
    for _ in range(4):
        half, rest = divmod(light.shape[-1], 2)
        if rest:
            light[..., 0] *= light[..., -1]
        light[..., :half] *= light[..., half : 2 * half]
        light = light[..., :half]
    return np.asarray(OUTLIER**2 * np.log(light).sum(axis=-1, dtype=np.float64))


@lru_cache
def _between(count: int, every: int) -> tuple[Indices, Floats]:
    """Return (c,) every n-th of `count` indices and the last, and the interpolation matrix (n, c)."""
    some = np.unique(np.append(np.arange(0, count, every), count - 1))
    return some, np.stack([np.interp(np.arange(count), some, one) for one in np.eye(len(some))], axis=1)


def _bright(radiance: Floats, colour: Floats, core: Floats) -> Map:
    """Return (..., 3) light of sources; unclipped channels of `core` are known, others are minima."""
    expected = np.maximum(radiance * colour, core)
    return np.where(is_known(core), core, expected).astype(np.float32)


def _inside(patches: Patches) -> Map:
    """(k, FINER h, FINER w) depths in pixels inside the outlines of blobs, exact from -1 on."""
    peak, ground = patches.light.max(axis=1), patches.ground.max(axis=1)
    share = np.clip((peak - ground) / np.maximum(1 - ground, 0.05), 0, 1)
    soft = np.where(patches.own, 1.0, np.where(patches.beside, 0.5 * share, 0)).astype(np.float32)
    down, across = (_smoother(n) for n in peak.shape[1:])
    soft = down @ (soft.reshape(-1, soft.shape[-1]) @ across.T).reshape(*soft.shape[:2], -1)
    outline = soft > 0.5 * np.minimum(1, soft.max(axis=(1, 2), keepdims=True))
    found, is_round = _ellipses(outline)
    if not is_round.all():
        found[~is_round] = _signed_distances(outline[~is_round])
    return found


def _ellipses(outline: Mask) -> tuple[Map, Mask]:
    """Return (k, h, w) depths in pixels inside ellipses with the moments of outlines, and which (k,) fit."""
    height, width = outline.shape[1:]
    shape = outline.astype(np.float32)
    # Around the patch's centre, so that the products of floats are exact.
    y, x = (np.arange(n, dtype=np.float32) - n // 2 for n in (height, width))
    across, down = shape.sum(axis=1, dtype=np.float64), shape.sum(axis=2, dtype=np.float64)
    count = across.sum(axis=1)
    mean_x, mean_y = across @ x / count, down @ y / count
    left = np.maximum(count - 1, 1)
    xx, yy = across @ x**2 - count * mean_x**2, down @ y**2 - count * mean_y**2
    xy = ((shape @ x).astype(np.float64) * y).sum(axis=1) - count * mean_x * mean_y
    spread = np.stack([xx, xy, xy, yy], axis=1).reshape(-1, 2, 2) / left[:, None, None] + np.eye(2) / 12
    inverse = np.linalg.inv(4 * spread).astype(np.float32)
    a, b, c = (inverse[:, i, j, None, None] for i, j in ((0, 0), (0, 1), (1, 1)))
    dx = (x[None, None] - mean_x[:, None, None]).astype(np.float32)
    dy = (y[None, :, None] - mean_y[:, None, None]).astype(np.float32)
    along, beside = a * dx + b * dy, b * dx + c * dy
    radius = np.sqrt(along * dx + beside * dy)
    ellipse = radius <= 1
    both, either = ((part).sum(axis=(1, 2)) for part in (ellipse & outline, ellipse | outline))
    # To first order: the distance of the radius from 1 over its slope.
    steep = np.maximum(np.sqrt(along**2 + beside**2), 1e-6) / np.maximum(radius, 1e-6)
    narrow = 2 * np.sqrt(np.linalg.eigvalsh(spread)[:, :1, None])
    found = np.minimum((1 - radius) / np.maximum(steep, 1e-6), narrow) / FINER
    return np.asarray(found, np.float32), np.asarray(both > ROUND * either)


def _signed_distances(outline: Mask) -> Map:
    """Return (k, h, w) depths in pixels inside outlines (k, h, w)."""
    around = FINER * PAD
    # Stacked vertically, too far apart to affect each other.
    stack = np.pad(outline, ((0, 0), (around, around), (0, 0)))
    flat = stack.reshape(-1, stack.shape[2]).astype(np.uint8)
    within, beyond = (cv2.distanceTransform(part, cv2.DIST_L2, 5) for part in (flat, 1 - flat))
    return np.asarray((within - beyond).reshape(stack.shape)[:, around:-around] / FINER, np.float32)


@lru_cache(maxsize=256)
def _smoother(size: int) -> Map:
    """Return the (FINER n, n) matrix that upsamples and smooths n pixels."""
    finer = np.repeat(np.eye(size), FINER, axis=0)
    return np.asarray(gaussian(FINER * size, FINER * SMOOTHED) @ finer, np.float32)


@lru_cache(maxsize=256)
def _shrunk(size: int, optics: float) -> Map:
    """Return the (n, FINER n) matrix that blurs samples by `optics` and averages them to n pixels."""
    pixels = np.repeat(np.eye(size), FINER, axis=1) / FINER
    return np.asarray(pixels @ gaussian(FINER * size, optics), np.float32)
