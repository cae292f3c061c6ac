"""The user's depth maps in the units of the reconstruction.

A map holds depth or inverse depth (disparity, but for a factor), with any scale and shift, as depth networks
and sensors write them. The feature points of the reconstruction determine kind, scale and shift.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..base.arrays import Floats
from ..base.errors import UserError
from .sparse import FEWEST_POINTS
from .user_maps import DepthMap, DepthMaps

KINDS = ("depth", "inverse")
"""Kind of a map's stored value d: z = a d + b, or 1 / z = a d + b."""
DISCONTINUITY = 0.1
"""Relative difference of inverse depth from which no depth is interpolated between pixels. Chosen by
inspection."""
NEAREST = 10.0
"""Largest inverse depth relative to the nearest feature; nearer values are glitches. Chosen by inspection."""
SAMPLES = 9
"""Frames that decide what the maps of the clip have in common. Chosen by inspection."""
EXPLAINS = 0.9
"""Largest residual of a fit, relative to that of a constant depth. Chosen by inspection."""
USUAL = 3.0
"""Times what the clip's fits miss: a frame that is worse is not merely short of depth range. Chosen by
inspection."""
CAP = 15.0
"""Times the median deviation of inverse depths: no wrong point counts for more. Chosen by inspection."""
LEAST_CAP = 0.1
"""Least influence of a wrong point, relative to the median inverse depth. Chosen by inspection."""
TRIALS = 300
"""Random pairs of points whose lines are tried: of half wrong points, 75 are right in the mean."""
SCORED = 600
"""Points by which these lines are judged. Chosen by inspection, for time."""
REACH = 4.0
"""Residuals, in units of their scale, from which points are outliers."""
TIGHTEST = 0.005
"""Share of the clip's median inverse depth by which a frame's scale and shift may always differ from the
clip's. Chosen by inspection."""
INDEPENDENT = 50
"""Features at most whose errors have nothing in common: a bent map is wrong alike for neighbours. Chosen by
inspection."""
SLOWEST = 5e-4
"""A frame, of the clip's median inverse depth: by how much scale and shift may always change. Chosen by
inspection."""
MEDIAN_SQUARE = 0.455
"""The median of the square of a normal variable, over its variance."""


@dataclass(frozen=True)
class ClipFit:
    """The common fit of a clip's maps. u = (d - centre) / span stands for the stored value d."""

    kind: str
    """Kind of the maps, one of `KINDS`."""
    centre: float
    """Stored value that is the median of the sampled ones."""
    span: float
    """Stored values from the 5th to the 95th percentile."""
    unit: float
    """The clip's median inverse depth: lines are fitted to inverse depth / unit, or to its inverse."""
    nearest: float
    """The largest inverse depth of a feature."""
    line: Floats
    """(2,) median slope and offset over u."""
    spread: Floats
    """(2,) standard deviation of slope and offset from frame to frame."""
    missed: float
    """Mean distance of a frame's features from its map over the unit, the median of the frames."""


@dataclass(frozen=True)
class FrameLine:
    """The fit of a frame's map by its own features."""

    frame: int
    line: Floats
    """(2,) slope and offset over u, as of `ClipFit`."""
    information: Floats
    """(2, 2) the inverse of their covariance; 0 where the frame has too few features."""


def fit_clip(maps: DepthMaps, features: Callable[[int], tuple[Floats, Floats]]) -> ClipFit:
    """Decide on a few frames what a clip's maps hold, depth or inverse depth, and the usual scale and shift.

    `features` gives a frame's places (n, 2) in pixels of the clip's picture and inverse depths (n,). Raises
    UserError where the maps explain the points no better than one depth for all does.
    """
    steps = np.linspace(0, len(maps.frames) - 1, min(SAMPLES, len(maps.frames)))
    seen = []
    for frame in (maps.frames[i] for i in np.unique(np.round(steps).astype(int))):
        stored, inverse = _sampled(maps.read(frame), *features(frame))
        if len(stored) >= FEWEST_POINTS:
            seen.append((frame, stored, inverse))
    if not seen:
        raise UserError(
            f"the depth maps in {maps.pictures.path.name} know fewer than {FEWEST_POINTS} feature points a"
            " frame; check that they belong to this clip and are not empty"
        )
    found = [_fit_clip(kind, seen) for kind in KINDS]
    fit, misses = min(found, key=lambda one: float(np.median(one[1][:, 0] / one[1][:, 1])))
    shares = misses[:, 0] / misses[:, 1]
    if np.median(shares) > EXPLAINS:
        worst = int(np.argmax(shares))
        raise _refusal(seen[worst][0], maps.pictures.path.name, *misses[worst])
    return fit


def frame_line(depth: DepthMap, xy: Floats, inverse_depth: Floats, clip: ClipFit) -> FrameLine:
    """Return the line of a frame by its own features.

    It comes from random pairs (MSAC: Torr and Zisserman, "MLESAC", 2000), then from least squares with
    Huber's weights.
    """
    stored, inverse = _sampled(depth, xy, inverse_depth)
    if len(stored) < FEWEST_POINTS:
        return FrameLine(depth.frame, clip.line, np.zeros((2, 2)))
    line, information = _line(clip.kind, (stored - clip.centre) / clip.span, inverse / clip.unit)
    return FrameLine(depth.frame, line, information * min(1.0, INDEPENDENT / len(stored)))


def steadied(lines: Sequence[FrameLine], frame: int, clip: ClipFit) -> Floats:
    """Return (2,) slope and offset of one of a few frames that follow each other, steady in time.

    They walk at random from frame to frame, by as much as those of these frames differ beyond what their
    features leave open, and are known besides as exactly as they vary in the clip (Rauch, Tung and Striebel,
    "Maximum likelihood estimates of linear dynamic systems", 1965, solved at once).
    """
    prior = np.diag(1 / np.maximum(clip.spread, TIGHTEST) ** 2)
    count = len(lines)
    system, wanted = np.zeros((count, 2, count, 2)), np.zeros((count, 2))
    for at, one in enumerate(lines):
        system[at, :, at] = one.information + prior
        wanted[at] = one.information @ one.line + prior @ clip.line
    known = [one for one in lines if one.information.any()]
    if len(known) > 2:
        noise = np.array([np.diag(np.linalg.inv(one.information)) for one in known])
        steps = np.diff([one.frame for one in known])[:, None]
        apart = np.diff([one.line for one in known], axis=0) ** 2 - noise[1:] - noise[:-1]
        walk = np.maximum(np.median(apart / steps, axis=0) / MEDIAN_SQUARE, SLOWEST**2)
        for at, (one, other) in enumerate(pairwise(lines)):
            tie = np.diag(1 / (walk * (other.frame - one.frame)))
            system[at, :, at] += tie
            system[at + 1, :, at + 1] += tie
            system[at, :, at + 1] -= tie
            system[at + 1, :, at] -= tie
    found = np.linalg.solve(system.reshape(2 * count, 2 * count), wanted.ravel()).reshape(count, 2)
    return np.asarray(found[next(at for at, one in enumerate(lines) if one.frame == frame)])


def fit_depth(depth: DepthMap, xy: Floats, inverse_depth: Floats, clip: ClipFit, line: Floats) -> Floats:
    """Bring a map to the units of the reconstruction, and to the clip's size.

    `xy` (n, 2) are features in pixels of the clip's picture, with inverse depths (n,); `line` (2,) is the
    slope and offset of `steadied`. Raises UserError if the map does not fit the features.

    Returns:
        (H, W) 1 / z in 1 / scene units at the clip's pixels; 0 is infinitely far, NaN unknown.
    """
    stored, inverse = _sampled(depth, xy, inverse_depth)
    u, y = (stored - clip.centre) / clip.span, inverse / clip.unit
    missed, constant = _missed(clip.kind, line, u, y)
    if len(u) >= FEWEST_POINTS and missed > max(EXPLAINS * constant, USUAL * clip.missed):
        raise _refusal(depth.frame, depth.name, missed, constant)
    stored = depth.values if clip.kind == "inverse" else np.where(depth.values == 0, np.nan, depth.values)
    whole = _inverse(clip.kind, line, (stored - clip.centre) / clip.span) * clip.unit
    if clip.kind == "inverse":
        # Noise puts far things behind infinity.
        whole = np.maximum(whole, 0.0)
    whole[~(whole <= NEAREST * max([clip.nearest, *inverse.tolist()]))] = np.nan
    return _resampled(whole, depth.width, depth.height)


def _sampled(depth: DepthMap, xy: Floats, inverse_depth: Floats) -> tuple[Floats, Floats]:
    """Stored values (k,) and inverse depths (k,) of the features whose pixel of the map is known."""
    inside = np.all((xy >= 0) & (xy <= [depth.width, depth.height]), axis=1)
    inside &= np.isfinite(inverse_depth) & (inverse_depth > 0)
    stored = depth.at(xy[inside])
    # 0 is far, farther, or nothing.
    known = np.isfinite(stored) & (stored != 0)
    return stored[known], inverse_depth[inside][known]


def _fit_clip(kind: str, seen: list[tuple[int, Floats, Floats]]) -> tuple[ClipFit, Floats]:
    """The fit of frames, their stored values and inverse depths; and (k, 2) what it and a constant miss."""
    everything = np.concatenate([stored for _, stored, _ in seen])
    low, centre, high = np.percentile(everything, [5, 50, 95])
    inverse_depths = np.concatenate([inverse for *_, inverse in seen])
    unit, nearest = float(np.median(inverse_depths)), float(inverse_depths.max())
    span = float(high - low) or 1.0
    scaled = [((stored - centre) / span, inverse / unit) for _, stored, inverse in seen]
    lines = np.array([_line(kind, u, y)[0] for u, y in scaled])
    misses = np.array([_missed(kind, line, u, y) for line, (u, y) in zip(lines, scaled, strict=True)])
    line = np.median(lines, axis=0)
    spread = 1.4826 * np.median(np.abs(lines - line), axis=0)
    missed = float(np.median(misses[:, 0]))
    return ClipFit(kind, float(centre), span, unit, nearest, line, spread, missed), misses


def _line(kind: str, u: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Slope and offset (2,) with their information matrix (2, 2), the inverse of the covariance."""
    # Errors are judged in inverse depth: an error of depth is divided by the square of depth.
    wanted, weight = (y, np.ones_like(y)) if kind == "inverse" else (1 / y, y * y)
    rows = weight[:, None] * np.stack([u, np.ones_like(u)], axis=1)
    wanted = weight * wanted
    line = _best_pair(kind, u, y)
    for _ in range(10):
        residual = np.abs(rows @ line - wanted)
        scale = max(1.4826 * float(np.median(residual)), 1e-9)
        huber = np.minimum(1.0, 1.345 * scale / np.maximum(residual, 1e-300))
        root = np.sqrt(np.where(residual < REACH * scale, huber, 0.0))[:, None]
        line = np.linalg.lstsq(root * rows, root[:, 0] * wanted)[0]
    return line, (root * rows).T @ (root * rows) / max(scale, 1e-4) ** 2


def _best_pair(kind: str, u: Floats, y: Floats) -> Floats:
    """(2,) slope and offset through two points, of many pairs those whose line misses all by the least."""
    rng = np.random.default_rng(0)
    few = rng.permutation(len(u))[:SCORED]
    u, y = u[few], y[few]
    wanted = y if kind == "inverse" else 1 / y
    one, other = rng.integers(len(u), size=(2, TRIALS))
    run = u[other] - u[one]
    apart = run != 0
    slope = np.where(apart, (wanted[other] - wanted[one]) / np.where(apart, run, 1.0), 0.0)
    lines = np.stack([slope, wanted[one] - slope * u[one]])
    off = np.abs(_inverse(kind, lines[:, :, None], u) - y)
    return np.asarray(lines[:, np.argmin(np.minimum(off, _cap(y)).mean(axis=1))])


def _inverse(kind: str, line: Floats, u: Floats) -> Floats:
    """Inverse depth that a line means; infinite behind the camera."""
    along = line[0] * u + line[1]
    if kind == "inverse":
        return np.asarray(along)
    with np.errstate(invalid="ignore"):
        ahead = along > 0
    return np.where(ahead, 1 / np.where(ahead, along, 1.0), np.where(np.isnan(along), np.nan, np.inf))


def _cap(y: Floats) -> float:
    """Largest influence of a point. The median fails if half of all points lie on one wall."""
    median = float(np.median(y))
    return max(CAP * float(np.median(np.abs(y - median))), LEAST_CAP * median)


def _missed(kind: str, line: Floats, u: Floats, y: Floats) -> tuple[float, float]:
    """Mean distance of inverse depths y (n,) from a line, and from the best constant."""
    if not len(y):
        return 0.0, 0.0
    off = np.abs(_inverse(kind, line, u) - y)
    levels = np.percentile(y, np.arange(5, 100, 5))
    constant = np.minimum(np.abs(levels[:, None] - y), _cap(y)).mean(axis=1).min()
    return float(np.minimum(off, _cap(y)).mean()), max(float(constant), 1e-12)


def _refusal(frame: int, name: str, missed: float, constant: float) -> UserError:
    return UserError(
        f"the depth map of frame {frame} ({name}) does not fit the clip: it misses the inverse depth of the"
        f" feature points by {100 * missed:.1f}%, one depth for all of them by {100 * constant:.1f}%;"
        " check that the maps belong to this clip, in its order and not mirrored"
    )


def _resampled(inverse: Floats, width: int, height: int) -> Floats:
    """(h, w) -> (height, width), linear, but nearest at jumps and at the rim of unknown pixels."""
    rows, columns = inverse.shape
    if (columns, rows) == (width, height):
        return inverse
    down = (np.arange(height) + 0.5) * rows / height - 0.5
    across = (np.arange(width) + 0.5) * columns / width - 0.5
    top, left = np.floor(down).astype(int), np.floor(across).astype(int)
    v, h = (down - top)[:, None], (across - left)[None, :]
    corners = [
        inverse[np.clip(top + i, 0, rows - 1)[:, None], np.clip(left + j, 0, columns - 1)[None, :]]
        for i in (0, 1) for j in (0, 1)
    ]  # fmt: skip
    weights = ((1 - v) * (1 - h), (1 - v) * h, v * (1 - h), v * h)
    smooth = sum(weight * corner for weight, corner in zip(weights, corners, strict=True))
    nearest = np.where(
        v < 0.5, np.where(h < 0.5, corners[0], corners[1]), np.where(h < 0.5, corners[2], corners[3])
    )
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(high - low <= DISCONTINUITY * high, smooth, nearest))
