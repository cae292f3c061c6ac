"""Clips whose pictures were shifted to keep something in mid-scene in place: they cannot be solved.

Rectified light fields and stabilised clips have a principal point that moves from frame to frame. For a
camera that slides without turning, a place is seen at x_ij = a_j + d_j m_i + s_i, with inverse depth d_j, the
camera's place m_i and the picture's shift s_i. The same pictures belong to depths -d_j and places -m_i: they
contain neither the order of depths nor infinity (as with affine cameras: Koenderink and van Doorn, "Affine
structure from motion", 1991). Solved with a principal point that is held, such shifts are taken for turns,
and depth is wrong with small errors.
"""

from dataclasses import dataclass

import numpy as np

from ...base.arrays import Floats, Ints
from ...base.errors import Remedy, UserError
from ..adjustment.bundle import Observations
from ..adjustment.normal_equations import summed
from ..adjustment.small_motion import long_tracks, rank_correlation
from ..adjustment.solution import CLOSE, Solution, closeness
from ..tracking.degeneracy import MIN_SHARED

# Chosen by inspection of solved clips.
ROUNDS = 40
"""Rounds of alternating least squares."""
MIN_GAIN = 1.2
"""Ratio of the scores of shifted pictures and of cameras that turn, past which a clip is refused."""
TELLING_SCORE = 0.5
"""Score of shifted pictures (1 explains all) from which they give the order of the tracks' motion."""
MIN_ORDER = 0.5
"""Absolute rank correlation of a solve's inverse depths with motion below which they contradict it."""


def fit_shifts(seen: Observations, frames: int, points: int, loss: float) -> tuple[Floats, Floats] | None:
    """Fit shifted pictures of a camera that slides to observations; None without enough connections.

    Args:
        seen: Observations.
        frames: Number of frames.
        points: Number of points.
        loss: In pixels.

    Returns:
        Inverse depths (P,), up to a scale, a shift and the sign, and errors (m,) in pixels.
    """
    frame, point, xy = seen.frame, seen.point, seen.xy
    place = np.full((frames, points, 2), np.nan)
    place[frame, point] = xy
    flow = place - place[0]
    spread = [
        float(np.nanmedian(np.abs(f - np.nanmedian(f, axis=0))))
        if np.isfinite(f[:, 0]).sum() >= MIN_SHARED else 0.0
        for f in flow
    ]  # fmt: skip
    widest = int(np.argmax(spread))
    if spread[widest] <= 0:
        return None
    both = np.isfinite(flow[widest, :, 0])
    away = flow[widest, both] - np.median(flow[widest, both], axis=0)
    along = np.linalg.eigh(away.T @ away)[1][:, 1]
    depth, at = np.full(points, np.nan), place[0].copy()
    depth[both] = away @ along
    weight = np.where(np.isfinite(depth), 1.0, 0.0)[point]
    move, shift = np.zeros((frames, 2)), np.zeros((frames, 2))
    error = np.zeros(len(xy))
    for _ in range(ROUNDS):
        move, shift = _slopes(depth[point], xy - at[point], weight, frame, frames)
        displacement = move[frame]
        depth, at = _common_slope(displacement, xy - shift[frame], _weight(error, loss), point, points)
        miss = xy - at[point] - depth[point, None] * displacement - shift[frame]
        error = np.linalg.norm(miss, axis=1)
        weight = _weight(error, loss)
    return depth, error


def _weight(error: Floats, loss: float) -> Floats:
    """(m,) Cauchy's weights of errors."""
    return np.asarray(1 / (1 + (error / loss) ** 2))


def _slopes(x: Floats, y: Floats, weight: Floats, group: Ints, count: int) -> tuple[Floats, Floats]:
    """Weighted least-squares slopes and offsets (count, 2) of y (m, 2) over x (m,), by group."""
    known = weight > 0
    x, y, weight, group = x[known], y[known], weight[known], group[known]
    total = np.maximum(np.bincount(group, weight, count), 1e-12)
    mean_x = np.bincount(group, weight * x, count) / total
    mean_y = summed(weight[:, None] * y, group, count) / total[:, None]
    away = x - mean_x[group]
    spread = np.maximum(np.bincount(group, weight * away**2, count), 1e-12)
    slope = summed((weight * away)[:, None] * (y - mean_y[group]), group, count) / spread[:, None]
    return slope, mean_y - slope * mean_x[:, None]


def _common_slope(x: Floats, y: Floats, weight: Floats, group: Ints, count: int) -> tuple[Floats, Floats]:
    """Slope (count,) and offset (count, 2) of y (m, 2) = slope x (m, 2) + offset (2,), in groups."""
    total = np.maximum(np.bincount(group, weight, count), 1e-12)
    mean_x, mean_y = (summed(weight[:, None] * z, group, count) / total[:, None] for z in (x, y))
    away = x - mean_x[group]
    spread = np.maximum(np.bincount(group, weight * (away**2).sum(axis=1), count), 1e-12)
    slope = np.bincount(group, weight * (away * (y - mean_y[group])).sum(axis=1), count) / spread
    return slope, mean_y - slope[:, None] * mean_x


@dataclass(frozen=True)
class Compared:
    """A solve beside shifted pictures, on the same observations."""

    solved: float
    shifted: float
    """How much is explained and how closely, by `closeness`."""
    order: float
    """Rank correlation of the inverse depths of the two, without its sign; 1 where it cannot be compared."""


def compare(made: Solution, keys: list[int]) -> Compared | None:
    """Return a solve of the keyframes `keys` beside shifts; None where too few tracks span them."""
    span = long_tracks(made.tracks, keys)
    if len(span.tracks) < MIN_SHARED:
        return None
    found = fit_shifts(span.seen, span.frames, len(span.tracks), span.loss)
    if found is None:
        return None
    inverse, error = found
    seen = span.seen
    own = made.errors_of(np.array(keys, np.int32)[seen.frame], span.tracks[seen.point], seen.xy)
    close = CLOSE * made.max_error
    middle = keys[len(keys) // 2]
    depth = (made.xyz[span.tracks] @ made.rotation[middle].T + made.translation[middle])[:, 2]
    good = np.isfinite(depth) & (depth > 0)
    enough = good.sum() >= MIN_SHARED
    order = rank_correlation(1 / depth[good], inverse[good]) if enough else 1.0
    return Compared(closeness(own, close), closeness(error, close), abs(order))


def refuse_shifted(made: Solution, keys: list[int]) -> None:
    """Check that a clip's pictures were not shifted.

    Raises:
        UserError: They were, or depths are not in the order of motion.
    """
    compared = compare(made, keys)
    if compared is None:
        return
    if compared.shifted > MIN_GAIN * compared.solved:
        raise UserError(
            "this clip was stabilized so that something in mid-scene stays in place, which makes near and"
            " far look alike; solve the clip as it was filmed, without stabilization"
        )
    if compared.shifted > TELLING_SCORE and compared.order < MIN_ORDER:
        raise UserError(
            "the depth found contradicts the occlusions in this clip; choose another range of frames, or"
            " film with more sideways movement",
            Remedy.FRAMES,
        )
