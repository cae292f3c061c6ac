"""The depth of field of a clip's own lens.

Circles of confusion are measured at edges beside feature points, whose depth is known: blurred once more by a
known amount, the gradient of a sharp edge falls more than that of a soft one (Zhuo and Sim, "Defocus map
estimation from a single image", 2011). Their variance is a parabola over inverse depth, with its apex at the
focal plane. The user's lens then adds the difference, as variances of blurs add (Bae and Durand, "Defocus
magnification", 2007).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..base.arrays import Floats, Map
from ..base.store import NOT_KEPT, Store, numbers
from ..camera.reconstruction import Reconstruction
from ..depth.source import PixelDepth
from ..depth.sparse import frame_features
from ..media.light import to_linear
from ..media.picture_file import Pixels
from ..optics.thin_lens import ThinLens

LONGEST = 1280
"""Longest side in pixels of the measured pictures; larger ones add nothing."""
FRAMES = 8
"""Measured frames of a clip, evenly spread."""
SMOOTHING = 0.7
"""Standard deviation in pixels of the first blur, against noise."""
AGAIN = 2.0
"""Standard deviation in pixels of the second blur, which separates edges of up to four pixels."""
STEEP = 0.01
"""Least change of the square root of linear light a pixel of an edge; less is noise."""
NEAR = 4
"""Pixels around a feature point in which its edge is searched."""
PARTS, LEVELS = 3, 10
"""Parts of the clip, and levels of depth in each, whose edges are grouped."""
FEWEST = 12
"""Least edges of a level."""
SHARPEST = 0.2
"""Quantile of a level's edges that measures it: shadows and round objects have soft edges in focus, too, but
no edge is sharper than the lens."""
PLACES = 24
"""Tested positions of the focal plane in the first part of the clip and in the last."""
LEAST_DISC = 2.5
"""Least diameter in pixels of the largest circle of confusion: surfaces of a pinhole's clip differ by as much
as a disc of 1.6 (a scratch script, on walk and blocks)."""
EXPLAINED = 0.6
"""Least share of the variance between levels that the lens explains."""
LEAST_REST = 1e-6
"""Least difference of the apertures' areas as a share of the user's, a divisor."""
SIGMAS = 4.0
"""Diameter of a disc in standard deviations along an axis."""


@dataclass(frozen=True)
class OwnLens:
    """The thin lens with which a clip was filmed."""

    radius: float
    """Radius of its aperture in scene units."""
    focus: tuple[float, float]
    """Inverse depth of its focal plane in the first and the last frame."""
    frames: tuple[int, int]
    """Numbers of these frames."""

    def focus_at(self, frame: int) -> float:
        """Return the inverse depth of its focal plane in a frame."""
        first, last = self.frames
        share = float(np.clip((frame - first) / max(last - first, 1), 0, 1))
        return (1 - share) * self.focus[0] + share * self.focus[1]

    def share_softer(self, frame: int, lens: ThinLens, inverse_depth: Floats | Map) -> float:
        """Return the share of inverse depths (any shape) that the clip shows more blurred than a lens does.

        Differences below the acceptable circle of confusion are ignored.
        """
        wished = np.abs(lens.blur_disc(np.asarray(inverse_depth, np.float64)))
        own = 2 * self.radius * lens.pinhole.fx * np.abs(inverse_depth - self.focus_at(frame))
        return float(np.mean(own > wished + lens.acceptable_disc))

    def missing(self, frame: int, lens: ThinLens, inverse_depth: Floats | Map) -> Floats:
        """Return inverse depths (any shape) at which a lens has the blur that the clip lacks.

        If the clip's discs are larger than the lens's, they are those of the focal plane.
        """
        wished = inverse_depth - lens.focus
        own = self.radius / lens.radius * (inverse_depth - self.focus_at(frame))
        left = np.sqrt(np.maximum(wished**2 - own**2, 0))
        return np.asarray(lens.focus + np.copysign(left, wished), np.float64)

    def true(self, frame: int, lens: ThinLens, missing: Floats) -> Floats:
        """Return inverse depths (n,) from `missing` (n,); in the focal plane, the nearest one to it.

        With u = d - focus and e the distance of the planes, u^2 - s (u - e)^2 = m^2 has one root on each
        side.
        """
        share, apart = (self.radius / lens.radius) ** 2, self.focus_at(frame) - lens.focus
        left = missing - lens.focus
        b, c = share * apart, -(share * apart**2) - left**2
        rest = 1 - share
        # Lenses of equal apertures differ only between their focal planes.
        rest = float(np.copysign(max(abs(rest), LEAST_REST), rest))
        root = np.sqrt(np.maximum(b**2 - rest * c, 0))
        return np.asarray(lens.focus + (-b + np.where(left < 0, -root, root)) / rest)

    def remaining(self, frame: int, lens: ThinLens, depth: PixelDepth) -> PixelDepth:
        """Replace the inverse depths of a frame's depth by `missing` ones."""

        def each(values: Map | None) -> Map | None:
            return None if values is None else self.missing(frame, lens, values).astype(np.float32)

        inverse = self.missing(frame, lens, depth.inverse_depth)
        return replace(
            depth, inverse_depth=inverse, behind=each(depth.behind), past_border=each(depth.past_border)
        )


def own_lens(
    reconstruction: Reconstruction, read: Callable[[int], Pixels], store: Store = NOT_KEPT
) -> OwnLens | None:
    """Estimate the lens with which a clip was filmed, or read it from its storage.

    Returns None if the clip is about equally sharp, if sharpness does not depend on depth, and for photos,
    each of which has its own lens. Raises UserError if a frame cannot be read.
    """
    if not reconstruction.is_ordered:
        return None
    found = store.once(numbers("clip-lens", 0, 5), lambda: _estimated(reconstruction, read))
    if not len(found):
        return None
    radius, *focus, first, last = found.tolist()
    return OwnLens(radius, (focus[0], focus[1]), (int(first), int(last)))


def _estimated(reconstruction: Reconstruction, read: Callable[[int], Pixels]) -> Floats:
    """Estimate the fields of a clip's lens, in a row; empty if there is none."""
    frames = reconstruction.frames[np.linspace(0, len(reconstruction.frames) - 1, FRAMES).astype(int)]
    found = [_edges(reconstruction, read, int(frame)) for frame in np.unique(frames)]
    first, last = int(frames[0]), int(frames[-1])
    levels = _levels(found, first, last)
    if len(levels) < 2 * PARTS:
        return np.zeros(0)
    focus, square = _parabola(levels)
    if not square > 0:
        return np.zeros(0)
    # Variances in pixels belong to this focal length.
    image, _ = reconstruction.image_at(first)
    radius = SIGMAS * float(np.sqrt(square)) / (2 * reconstruction.intrinsics(image).fx)
    return np.array([radius, *focus, first, last], np.float64)


def _edges(reconstruction: Reconstruction, read: Callable[[int], Pixels], frame: int) -> Floats:
    """Return (n, 3) frame, inverse depth and blur variance in pixels^2 of features' steepest edges."""
    canvas = reconstruction.canvas(frame)
    features = frame_features(reconstruction, frame, canvas)
    light = to_linear(read(frame))[..., :3].mean(axis=2)
    smaller = min(1.0, LONGEST / max(light.shape))
    if smaller < 1:
        light = cv2.resize(light, None, fx=smaller, fy=smaller, interpolation=cv2.INTER_AREA)
    steepness, variance = edge_variances(light)
    x, y = np.floor(smaller * canvas.features_to_source(features.observed)).astype(int).T
    best, found = np.zeros(len(x)), np.zeros(len(x))
    height, width = steepness.shape
    for down in range(-NEAR, NEAR + 1):
        for across in range(-NEAR, NEAR + 1):
            at = np.clip(y + down, 0, height - 1), np.clip(x + across, 0, width - 1)
            steeper = steepness[at] > best
            best, found = np.where(steeper, steepness[at], best), np.where(steeper, variance[at], found)
    there = best > 0
    variances = found[there] / smaller**2
    return np.column_stack([np.full(there.sum(), frame), features.inverse_depth[there], variances])


def edge_variances(light: Map) -> tuple[Map, Map]:
    """Return the steepness (H, W) of edges in linear light (H, W), and their blur's variance in pixels^2.

    Steepness is 0 elsewhere.
    """
    # Noise is about uniform in square roots of light.
    sharp = cv2.GaussianBlur(np.sqrt(np.maximum(light, 0)).astype(np.float32), (0, 0), SMOOTHING)
    x, y = _gradient(np.asarray(sharp))
    u, v = _gradient(np.asarray(cv2.GaussianBlur(sharp, (0, 0), AGAIN)))
    steepness = np.hypot(x, y)
    # Across an edge a gradient falls by sqrt((s^2 + again^2) / s^2).
    kept = np.maximum(x * u + y * v, 0) / np.maximum(steepness, np.float32(1e-9)) ** 2
    share = np.clip(kept**2, 0, np.float32(0.99))
    ridge = steepness >= cv2.dilate(steepness, np.ones((3, 3), np.uint8))
    edge = ridge & (steepness > STEEP) & (kept > 0)
    variance = AGAIN**2 * share / (1 - share) - SMOOTHING**2
    return np.where(edge, steepness, 0), np.maximum(variance, 0)


def _gradient(values: Map) -> tuple[Map, Map]:
    """Return (H, W) changes a pixel to the right and down."""
    x, y = (cv2.Sobel(values, cv2.CV_32F, *axis, ksize=3, scale=1 / 8) for axis in ((1, 0), (0, 1)))
    return np.asarray(x), np.asarray(y)


def _levels(edges: Sequence[Floats], first: int, last: int) -> Floats:
    """Return (n, 3) share of the way through the clip, inverse depth and variance of sharp edges by level."""
    every, found = np.concatenate(edges), []
    part = np.minimum((every[:, 0] - first) * PARTS // max(last - first, 1), PARTS - 1)
    for number in range(PARTS):
        own = every[part == number]
        own = own[np.argsort(own[:, 1])]
        for level in np.array_split(own, LEVELS):
            if len(level) >= FEWEST:
                way = (level[:, 0].mean() - first) / max(last - first, 1)
                found.append((way, np.median(level[:, 1]), np.quantile(level[:, 2], SHARPEST)))
    return np.reshape(found, (-1, 3))


def _parabola(levels: Floats) -> tuple[tuple[float, float], float]:
    """Inverse depths of the focal plane at both ends of the clip, and the growth (px^2) of variance or 0."""
    way, inverse, variance = levels.T
    # Relative errors of blur are constant.
    weight = 1 / (variance + SMOOTHING**2)
    places = np.linspace(inverse.min(), inverse.max(), PLACES)
    first, last = (axis.ravel() for axis in np.meshgrid(places, places, indexing="ij"))
    squared = (inverse - (first[:, None] * (1 - way) + last[:, None] * way)) ** 2

    def mean(values: Floats) -> Floats:
        return np.asarray((values * weight**2).sum(axis=-1) / (weight**2).sum())

    apart, away = squared - mean(squared)[:, None], variance - mean(variance)
    growth = mean(apart * away) / np.maximum(mean(apart**2), 1e-300)
    least = mean(variance) - growth * mean(squared)
    good = (growth > 0) & (least > -(SMOOTHING**2))
    cost = np.where(good, mean((away - growth[:, None] * apart) ** 2), np.inf)
    best = int(np.argmin(cost))
    largest = float(growth[best] * squared[best].max())
    told = cost[best] <= (1 - EXPLAINED) * mean(away**2) and SIGMAS * np.sqrt(max(largest, 0)) >= LEAST_DISC
    return (float(first[best]), float(last[best])), float(growth[best]) if told else 0.0
