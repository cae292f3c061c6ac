"""Subjects' pixels in one frame: what contradicts the static scene, made whole along colours and edges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ..base.arrays import Bytes, Ints, Map, Mask
from ..base.global_smoother import globally_smoothed
from .static_plate import Plate, summed


@dataclass(frozen=True)
class SegmentationOptions:
    """When a pixel contradicts the static scene, and what belongs to it."""

    least_noise: float = 9.0
    """Grey levels, of three channels together, by which a pixel may leave the static scene. By eye."""
    spread: float = 0.7
    """Times the distance of the quartiles of the source frames that counts as noise. By eye."""
    doubtful: float = 80.0
    """Grey levels, of three channels together, between the quartiles of the source frames at which they tell
    little of what agrees with them. Of 40 to 150, it found most of who pauses, and no less of others."""
    misplaced: tuple[float, float] = (0.15, 1.2)
    """Pixels by which the static scene is misplaced, at least and at most. By eye."""
    beside: int = 3
    """Pixels across the window whose colours the static scene may have at its silhouettes. Of 3, 5 and 7, the
    bench's tram behind pickets has 0.93, 0.88 and 0.82 of intersection over union, and 0.81 without."""
    deviations: float = 3.0
    """Standard deviations at which a pixel contradicts as much as it agrees. By eye."""
    shadow_range: tuple[float, float] = (0.35, 2.9)
    """Times as bright as the static scene that a shadow on it is, or light amid shadow. By eye."""
    shadow_window: int = 7
    """Pixels across the window in which a shadow is one factor. By eye."""
    shadow_tolerance: float = 9.0
    """Grey levels by which the static scene in shadow may differ from itself times the factor. By eye."""
    contradicts: float = 3.0
    """Log-odds of a pixel that contradicts the static scene wholly. By eye."""
    agrees: float = -2.0
    """Log-odds of a pixel that agrees with the static scene. By eye."""
    chance: int = 5
    """Pixels across the window most of which contradict the static scene around one that agrees with it by
    chance: half of a sweater's pixels before a hedge do. Of 7, outlines are wider."""
    colour: float = 1.0
    """Log-odds that colours alone may add. By eye."""
    bins: int = 24
    """Bins of a colour channel in the histograms. By eye."""
    ring: float = 0.08
    """Share of the long side around a subject in which its surroundings' colours are taken. By eye."""
    near_lambda: float = 8.0
    """Lambda of the fast global smoother where something is known. By eye."""
    far_lambda: float = 200.0
    """Lambda of that smoother where it fills what nothing is known of. By eye."""
    smoother_sigma: float = 9.0
    """Grey levels at which that smoother stops. By eye."""
    prior: float = -1.0
    """Log-odds of a pixel of which nothing is known."""
    prior_weight: float = 0.02
    """Weight of that prior, against 1 for a pixel of which all is known. By eye."""
    least_area: float = 0.0015
    """Share of the picture; less is noise. By eye."""
    least_part: float = 0.0002
    """Share of the picture, of a part of a subject that is near the rest of it. By eye."""
    part_away: float = 0.03
    """Share of the long side that such a part is away at most. By eye."""
    least_share: float = 0.5
    """Share of a subject's pixels of which the static scene alone tells it, at least. By eye."""


def contradiction(picture: Bytes, plate: Plate, options: SegmentationOptions) -> tuple[Map, Map]:
    """(h, w) log-odds that a pixel of a frame (h, w, 3) is a subject's, as far as it contradicts its plate,
    and (h, w) the weight of that in [0, 1].

    Differences count against what noise, the spread of the source frames, and errors of the plate's place
    explain; the first and the last are found from the frame. A shadow is the static scene times one factor,
    and no contradiction. A pixel amid others that contradict does so, too.
    """
    off = summed(cv2.absdiff(picture, plate.colour))
    # A pixel off, such a place has the colours of the other side.
    off = np.where(plate.silhouette, _outside(picture, plate.colour, options.beside), off)
    spread = summed(cv2.subtract(plate.high, plate.low))
    slope = _slope(plate.colour)
    known = plate.count > 1
    noise, misplaced = _errors(off[known], slope[known], options)
    variance = noise**2 + (options.spread * spread) ** 2 + (misplaced * slope) ** 2
    differs = np.asarray(off**2 / (off**2 + options.deviations**2 * variance), np.float32)
    shadow = _shadow(picture, plate, options)
    share = np.rint(255 * differs * (1 - shadow)).astype(np.uint8)
    odds = _log_odds(np.maximum(share, cv2.medianBlur(share, options.chance)) / np.float32(255), options)
    weight = np.minimum(plate.count / np.float32(3), 1)
    # What a single source frame shows may be what moves: it tells of what is the same, and of nothing else.
    weight[(plate.count == 1) & (odds > 0)] = 0
    # What source frames show in two ways may be a subject that paused there: agreeing with it tells little.
    weight = np.where(odds < 0, weight * np.exp(-((spread / options.doubtful) ** 2)), weight)
    return odds, np.asarray(weight * (1 - np.float32(0.7) * shadow * _certain(differs)), np.float32)


def _outside(picture: Bytes, colour: Bytes, across: int) -> Map:
    """(h, w) grey levels, of all channels together, by which a picture (h, w, 3) leaves the colours (h, w, 3)
    in a window of so many pixels."""
    window = np.ones((across, across), np.uint8)
    above = cv2.subtract(picture, cv2.dilate(colour, window))
    return summed(cv2.add(above, cv2.subtract(cv2.erode(colour, window), picture)))


def _slope(picture: Bytes) -> Map:
    """(h, w) grey levels a pixel, of all channels of a picture (h, w, 3) together."""
    across, down = (cv2.Sobel(picture, cv2.CV_32F, *way, scale=1 / 8) for way in ((1, 0), (0, 1)))
    return summed(cv2.magnitude(across, down))


def _errors(off: Map, slope: Map, options: SegmentationOptions) -> tuple[float, float]:
    """Grey levels of noise, and pixels of misplacement, that explain most differences (n,) of a frame from
    its plate, which has slopes (n,)."""
    if not len(off):
        return options.least_noise, options.misplaced[1]
    smooth = slope <= np.percentile(slope, 30)
    noise = max(1.5 * float(np.median(off[smooth])), options.least_noise)
    steep = ~smooth & (slope > noise)
    if not steep.any():
        return noise, options.misplaced[0]
    ratio = np.sqrt(np.maximum(off[steep] ** 2 - noise**2, 0)) / slope[steep]
    return noise, float(np.clip(np.percentile(ratio, 60), *options.misplaced))


def _shadow(picture: Bytes, plate: Plate, options: SegmentationOptions) -> Map:
    """(h, w) in [0, 1] how far a frame (h, w, 3) is its plate in another light: times one factor."""
    own, there = (one.astype(np.float32) + 8 for one in (picture, plate.colour))
    window = (options.shadow_window,) * 2
    # The least squares factor in a window, of all channels.
    factor = cv2.blur(summed(own * there), window) / cv2.blur(summed(there * there), window)
    residual = cv2.blur(summed(cv2.absdiff(own, factor[..., None] * there)), window) / 3
    low, high = options.shadow_range
    inside = (factor > low) & (factor < high)
    likely = np.exp(-((residual / options.shadow_tolerance) ** 2))
    return np.where(inside, likely, 0).astype(np.float32)


def _log_odds(share: Map, options: SegmentationOptions) -> Map:
    """(h, w) log-odds that a pixel is a subject's, of how far it contradicts the static scene (h, w)."""
    return np.asarray(options.agrees + (options.contradicts - options.agrees) * _certain(share), np.float32)


def _certain(share: Map) -> Map:
    """Shares (h, w) in [0, 1] of which those near the ends count as 0 or 1."""
    return np.asarray(np.clip(1.25 * share - 0.125, 0, 1), np.float32)


def propagated(picture: Bytes, odds: Map, weight: Map, options: SegmentationOptions) -> Map:
    """(h, w) log-odds (h, w) with their weights (h, w) in [0, 1], smooth along the surfaces of a picture
    (h, w, 3); where nothing is known they are those of the surface around."""
    prior = np.float32(options.prior_weight)
    above = smoothed(picture, weight * odds, options.far_lambda, options)
    below = smoothed(picture, weight, options.far_lambda, options)
    around = (above + prior * options.prior) / (np.maximum(below, 0) + prior)
    known = np.asarray(weight * odds + (1 - weight) * around, np.float32)
    return smoothed(picture, known, options.near_lambda, options)


def smoothed(picture: Bytes, values: Map, reach: float, options: SegmentationOptions) -> Map:
    """(h, w) values along the surfaces of a picture (h, w, 3): Min et al., "Fast global image smoothing based
    on weighted least squares", 2014, whose lambda is `reach`."""
    return globally_smoothed(picture, values, reach, options.smoother_sigma)


@dataclass(frozen=True)
class ColourModel:
    """Colours of a subject and of its surroundings, as histograms in Lab."""

    inside: Map
    """(bins^3,) share of the subject's pixels."""
    outside: Map
    """(bins^3,) share of the pixels around it."""
    bins: int
    """Of a channel."""

    @classmethod
    def of(cls, picture: Bytes, subject: Map, options: SegmentationOptions) -> ColourModel:
        """Of a picture (h, w, 3) in which (h, w) is the probability of the subject."""
        size, flat = options.bins, _bins(picture, options.bins)
        likely = subject > 0.5
        reach = 2 * int(options.ring * max(picture.shape)) + 1
        near = cv2.dilate(likely.astype(np.uint8), np.ones((reach, reach), np.uint8)) > 0
        found = list[Map]()
        for weight in (np.where(likely, subject, 0), np.where(near & ~likely, 1 - subject, 0)):
            histogram = np.bincount(flat.ravel(), weight.ravel(), size**3)
            cube = histogram.reshape(size, size, size).astype(np.float32)
            for _ in range(3):
                # A little wider along each axis in turn.
                cube = cv2.blur(cube.reshape(size, size * size), (1, 3)).reshape(size, size, size)
                cube = np.ascontiguousarray(cube.transpose(1, 2, 0))
            found.append(np.asarray(cube.ravel() / max(float(cube.sum()), 1e-9), np.float32))
        return cls(found[0], found[1], size)

    @classmethod
    def mean(cls, models: Sequence[ColourModel]) -> ColourModel:
        """Of what several models know, equal shares."""
        inside, outside = (
            np.asarray(np.mean([getattr(model, part) for model in models], axis=0), np.float32)
            for part in ("inside", "outside")
        )
        return cls(inside, outside, models[0].bins)

    def odds(self, picture: Bytes, most: float) -> Map:
        """(h, w) log-odds of a picture's (h, w, 3) pixels to be the subject's, by colour; `most` at most."""
        floor = np.float32(1e-5)
        ratio = np.log((self.inside + floor) / (self.outside + floor))
        return np.asarray(np.clip(ratio * most / 2, -most, most)[_bins(picture, self.bins)], np.float32)


def _bins(picture: Bytes, size: int) -> Ints:
    """(h, w) the bin of each pixel of a picture (h, w, 3), of `size` in each channel of Lab."""
    lightness, a, b = cv2.split(cv2.cvtColor(picture, cv2.COLOR_RGB2Lab).astype(np.int32) * size >> 8)
    return np.asarray((lightness * size + a) * size + b, np.int32)


def segmented(picture: Bytes, odds: Map, weight: Map, options: SegmentationOptions) -> Map:
    """(h, w) probability that a pixel of a frame (h, w, 3) is a subject's, of log-odds (h, w) with their
    weights (h, w); colours and edges decide where these do not."""
    first = propagated(picture, odds, weight, options)
    probability = logistic(first)
    if not (probability > 0.5).any():
        return probability
    colours = ColourModel.of(picture, probability, options).odds(picture, options.colour)
    return logistic(smoothed(picture, first + colours, options.near_lambda, options))


def logistic(odds: Map) -> Map:
    """(h, w) probability of log-odds (h, w)."""
    return np.asarray(1 / (1 + np.exp(-odds)), np.float32)


def components(probability: Map, odds: Map, weight: Map, options: SegmentationOptions) -> Mask:
    """(h, w) connected parts of what is a subject with more than even probability (h, w) that are large
    enough, and of which the static scene alone tells it, by log-odds (h, w) and their weights (h, w)."""
    number, labels, stats, _ = cv2.connectedComponentsWithStats(
        (probability > 0.5).astype(np.uint8), connectivity=8
    )
    told, known = (
        np.bincount(labels.ravel(), part.ravel(), number) for part in (weight * (odds > 0.5), weight)
    )
    sure = (told > options.least_share * known) & (np.arange(number) > 0)
    area = stats[:, cv2.CC_STAT_AREA] / probability.size
    large = (sure & (area >= options.least_area))[labels]
    if not large.any():
        return np.asarray(large)
    # A hand before a sleeve that looks as the background does is no noise.
    away = cv2.distanceTransform((~large).astype(np.uint8), cv2.DIST_L2, 5)
    near = np.zeros(number, bool)
    near[labels[away < options.part_away * max(probability.shape)]] = True
    return np.asarray((sure & near & (area >= options.least_part))[labels])
