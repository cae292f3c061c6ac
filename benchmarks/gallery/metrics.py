"""Figures of a rendered frame beside its source, for which no truth is needed.

Pictures are (H, W, 3) uint8, display-encoded RGB of one size; values are in steps of 255. Regions are (H, W)
bool. *Detail* is what a band-pass of the brightness leaves: structures finer than the blur and coarser than
noise. How much of it a result keeps is a regression on the source, so noise that was added is no detail, nor
is detail in another place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

Map = NDArray[np.float32]
Mask = NDArray[np.bool_]
Pixels = NDArray[np.uint8]

FINE, COARSE = 1.0, 4.0
"""Standard deviations in pixels, at a short side of `UNIT`, of the Gaussians whose difference is the band."""
UNIT = 480.0
"""Short side in pixels from which on the band grows with the picture."""
TILE = 16, 32
"""Least and largest side of a tile in pixels; between them a thirtieth of the picture's short side."""
TEXTURED = 2.0
"""Root mean square of the band, in 255ths, from which on a tile of the source has detail: four times what
rounding to 8 bits leaves in the whole spectrum."""
LOST = 0.6
"""Share of its detail that a tile must keep to count as sharp."""
BORDER = 0.03
"""Of the picture's width: surroundings of the subject that count neither as subject nor as elsewhere. The
default blur disc is as large."""
FLAT = 1.5
"""Standard deviation in 255ths, after smoothing by `SMOOTH`, up to which a tile is flat."""
SMOOTH = 3.0
"""Pixels: leaves a tenth of white noise."""
FLATTEST = 0.25
"""Share of the flat tiles that noise is measured in: those with the least noise in the source."""
FEWEST = 8
"""Tiles, at least, for a figure."""
DITHER = 0.5
"""Noise in 255ths that Blender's dither and rounding leave in a flat 8-bit picture."""
SLOW = 0.01
"""Of the picture's width: Gaussian that pictures are smoothed by before they are compared over time."""
FLOW_WIDTH = 640
"""Pixels across of the pictures that optical flow is found in."""
CONSISTENT = 1.0
"""Pixels that flow there and back may be apart."""


@dataclass(frozen=True)
class Detail:
    """How much of the source's detail a result has; NaN where the source has none."""

    subject: float
    """Share kept on the subject."""
    tiles_lost: float
    """Share of the subject's tiles with detail that kept less than `LOST`."""
    elsewhere: float
    """Share left outside the subject and its surroundings."""


@dataclass(frozen=True)
class Noise:
    """Standard deviation of high-pass noise in 255ths in flat, blurred tiles; NaN where there are too few."""

    source: float
    result: float

    @property
    def ratio(self) -> float:
        """Of the result to the source with Blender's dither."""
        return self.result / float(np.hypot(self.source, DITHER))


def luma(picture: Pixels) -> Map:
    """(H, W) brightness in 255ths, Rec. 601."""
    return np.asarray(picture.astype(np.float32) @ np.array([0.299, 0.587, 0.114], np.float32))


def band(picture: Pixels) -> Map:
    """(H, W) the band of detail of a picture's brightness, in 255ths."""
    scale, light = max(1.0, min(picture.shape[:2]) / UNIT), luma(picture)
    fine, coarse = (cv2.GaussianBlur(light, (0, 0), sigma * scale) for sigma in (FINE, COARSE))
    return np.asarray(fine - coarse, np.float32)


def kept(source: Map, result: Map, region: Mask) -> float:
    """Regression coefficient of the result's band on the source's in a region: 1 where they are equal."""
    energy = float(np.square(source[region], dtype=np.float64).sum())
    shared = float(np.sum(source[region] * result[region], dtype=np.float64))
    return max(shared, 0.0) / energy if energy else float("nan")


def tile_side(shape: tuple[int, ...]) -> int:
    """Side in pixels of the tiles of a picture."""
    return int(np.clip(min(shape[:2]) // 30, *TILE))


def tile_sums(values: NDArray[np.generic], side: int) -> NDArray[np.float64]:
    """(rows, columns) sums over whole tiles; what is left at the right and bottom is dropped."""
    rows, columns = (size // side for size in values.shape)
    whole = np.asarray(values[: rows * side, : columns * side], np.float64)
    return np.asarray(whole.reshape(rows, side, columns, side).sum(axis=(1, 3)))


def detail(source: Pixels, result: Pixels, subject: Mask) -> Detail:
    """Detail kept on the subject, and left elsewhere."""
    before, after, side = band(source), band(result), tile_side(source.shape)
    own = np.where(subject, before, 0)
    energy, shared, count = (tile_sums(each, side) for each in (own**2, own * after, subject))
    textured = (count >= side**2 / 2) & (energy > count * TEXTURED**2)
    lost = float(np.mean(shared[textured] < LOST * energy[textured])) if textured.any() else float("nan")
    return Detail(kept(before, after, subject), lost, kept(before, after, outside(subject)))


def outside(subject: Mask) -> Mask:
    """(H, W) pixels farther from the subject than its surroundings."""
    reach = 2 * round(BORDER * subject.shape[1]) + 1
    return np.asarray(cv2.dilate(subject.astype(np.uint8), np.ones((reach, reach), np.uint8)) == 0)


def blurred(source: Pixels, result: Pixels) -> Mask:
    """(H, W) pixels around which detail was lost, also where there is none, as the nearest detail tells."""
    before, after, reach = band(source), band(result), BORDER * source.shape[1]
    energy, shared = (
        cv2.GaussianBlur(np.asarray(each, np.float32), (0, 0), reach) for each in (before**2, before * after)
    )
    return np.asarray(shared < LOST * energy)


def high_pass(picture: Pixels) -> Map:
    """(H, W) what a Laplacian of differences leaves of the brightness, scaled to the standard deviation of
    white noise: Immerkaer 1996, "Fast noise variance estimation"."""
    kernel = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32) / 6
    return np.asarray(cv2.filter2D(luma(picture), -1, kernel))


def noise(source: Pixels, result: Pixels, subject: Mask) -> Noise:
    """Noise of source and result in the same flat tiles that are blurred."""
    side = TILE[0]
    calm = cv2.GaussianBlur(luma(source), (0, 0), SMOOTH)
    mean, square, left = (tile_sums(each, side) / side**2 for each in (calm, calm**2, subject))
    usable = tile_sums(blurred(source, result) & outside(subject), side) == side**2
    usable &= (square - mean**2 < FLAT**2) & (left == 0)
    before, after = (tile_sums(high_pass(each) ** 2, side) / side**2 for each in (source, result))
    count = max(FEWEST, round(FLATTEST * np.count_nonzero(usable)))
    if np.count_nonzero(usable) < FEWEST:
        return Noise(float("nan"), float("nan"))
    chosen = np.argsort(before[usable], kind="stable")[:count]
    own, drawn = (float(np.sqrt(each[usable][chosen].mean())) for each in (before, after))
    return Noise(own, drawn)


def flicker(sources: Sequence[Pixels], results: Sequence[Pixels], subjects: Sequence[Mask]) -> float:
    """How much more blurred areas of the results change over time than the sources do: a ratio.

    Consecutive frames are aligned by the sources' optical flow and smoothed, so that neither noise nor fine
    detail that is a pixel off counts. Mean absolute changes, where flow agrees there and back, outside of the
    subjects. NaN where nothing is blurred.
    """
    own, drawn = 0.0, 0.0
    for (one, two), (first, second), subject in zip(
        pairwise(sources), pairwise(results), subjects, strict=False
    ):
        place, is_sure = _aligned(one, two)
        where = is_sure & blurred(one, first) & outside(subject)
        for a, b, is_result in ((one, two, False), (first, second, True)):
            moved = cv2.remap(luma(b), place, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)  # type: ignore[call-overload]
            change = float(np.abs(_slow(luma(a)) - _slow(moved))[where].sum(dtype=np.float64))
            own, drawn = (own, drawn + change) if is_result else (own + change, drawn)
    return drawn / own if own else float("nan")


def _slow(light: Map) -> Map:
    return np.asarray(cv2.GaussianBlur(light, (0, 0), SLOW * light.shape[1]))


def _aligned(one: Pixels, two: Pixels) -> tuple[Map, Mask]:
    """(H, W, 2) where a frame's pixels are in the next one, and (H, W) where that is sure."""
    height, width = one.shape[:2]
    scale = min(1.0, FLOW_WIDTH / width)
    small = [
        cv2.resize(luma(each), None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA).astype(np.uint8)
        for each in (one, two)
    ]
    finder = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    there = finder.calc(small[0], small[1], None)  # type: ignore[call-overload]
    back = finder.calc(small[1], small[0], None)  # type: ignore[call-overload]
    rows, columns = there.shape[:2]
    grid = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=2).astype(np.float32)
    place = grid + there
    returned = there + cv2.remap(back, place, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)  # type: ignore[call-overload]
    sure = np.linalg.norm(returned, axis=2) < CONSISTENT
    sure &= np.all((place >= 0) & (place <= [columns - 1, rows - 1]), axis=2)
    flow = cv2.resize(there, (width, height), interpolation=cv2.INTER_LINEAR) / np.float32(scale)
    full = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=2).astype(np.float32)
    is_sure = cv2.resize(sure.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST) > 0
    return np.asarray(full + flow, np.float32), np.asarray(is_sure)


def touching(matte: Mask, subject: Mask) -> Mask:
    """(H, W) the connected parts of a matte that touch the subject: others are other moving objects."""
    _, labels = cv2.connectedComponents(matte.astype(np.uint8), connectivity=8)
    own = np.unique(labels[subject & matte])
    return np.asarray(np.isin(labels, own[own > 0]))
