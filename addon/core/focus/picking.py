"""The feature points for a click on the picture."""

from itertools import combinations

import numpy as np

from ..base.arrays import Floats, Ints
from ..base.errors import UserError
from ..camera.canvas import Canvas
from ..camera.reconstruction import Reconstruction
from ..depth.sparse import FrameFeatures
from ..media.clip import describe
from .focus import Focus

POINTS = 4
"""Points that are chosen: the thesis averages four."""
RANGE_WEIGHT = 0.1
"""Cost of the range of the chosen points' inverse depths, relative to the distance of their mean from the
clicked surface. Chosen by inspection, at silhouettes of the sample clip."""
SOFTENING = 2.0
"""Pixels from the click within which features count alike: about their accuracy."""
FRONTAL = 0.1
"""Weight of a frontal surface against the tilt that features around the click show. Chosen by inspection,
where features lie in a row."""


def check_place(reconstruction: Reconstruction, frame: int, x: float, y: float) -> None:
    """Check a place of a frame.

    Raises:
        UserError: The fractions x, y are outside of the picture, or the frame has no camera.
    """
    if not (0 <= x <= 1 and 0 <= y <= 1):
        raise UserError(f"focus at {x:g},{y:g} is outside the picture; both must be between 0 and 1")
    if frame not in reconstruction.frames:
        raise UserError(unsolved(reconstruction, frame))


def unsolved(reconstruction: Reconstruction, frame: int) -> str:
    """Describe why a frame has no camera: where it lies beside the clip, or which frames have one."""
    if not reconstruction.images:
        return "the reconstruction has no registered frames; solve the clip again"
    first, last = int(reconstruction.frames.min()), int(reconstruction.frames.max())
    if not first <= frame <= last:
        where = "before the start" if frame < first else "after the end"
        return f"frame {frame} is {where} of the clip ({first} to {last})"
    return f"frame {frame} has no camera; there are cameras for {describe(reconstruction.frames.tolist())}"


def pick_features(features: FrameFeatures, canvas: Canvas, x: float, y: float) -> Focus:
    """Return the focus points for a click in a frame.

    The four nearest features are taken whose mean depth is that of the clicked surface and whose depths
    differ little. A click beside a silhouette then does not focus between subject and background, and a click
    on a slope not in front of the place or behind it.

    Args:
        features: Features of the frame on its canvas.
        canvas: The canvas.
        x: Fraction of the picture's width, from the left.
        y: Fraction of its height, from the top.

    Raises:
        UserError: There are fewer than two features.
    """
    if len(features.points) < 2:
        raise UserError(
            f"frame {features.frame} has fewer than two feature points; pick the focus in another frame"
        )
    click = canvas.features_from_source(np.array([[x * canvas.camera.width, y * canvas.camera.height]]))
    near = _nearest(features.observed, click[0], 3 * POINTS)
    distance = np.linalg.norm(features.observed[near] - click, axis=1)
    # A neighbour at twice the distance of the fourth is little evidence for the clicked place.
    near = near[distance <= 2 * distance[min(POINTS, len(near)) - 1]]
    inverse = features.inverse_depth[near]
    under = _surface(features.observed[near] - click, inverse)
    agree = np.argsort(np.abs(inverse - under), kind="stable")[: 2 * POINTS]
    fours = np.array(list(combinations(agree, min(POINTS, len(agree)))))
    chosen = inverse[fours]
    cost = np.abs(chosen.mean(axis=1) - under) + RANGE_WEIGHT * np.ptp(chosen, axis=1)
    return Focus(points=tuple(int(p) for p in features.points[near[fours[np.argmin(cost)]]]))


def _nearest(places: Floats, place: Floats, count: int) -> Ints:
    """Indices (up to count,) of the places (n, 2) nearest to one (2,), in order, without sorting all."""
    away = np.square(places[:, 0] - place[0])
    away += np.square(places[:, 1] - place[1])
    near = np.argpartition(away, count - 1)[:count] if count < len(away) else np.arange(len(away))
    near.sort()
    return np.asarray(near[np.argsort(away[near], kind="stable")])


def _surface(offsets: Floats, inverse: Floats) -> float:
    """Inverse depth at a click of the surface that most features (n, 2), in pixels beside it, are on.

    A plane's inverse depth (n,) is linear over the picture: weighted least squares with Cauchy's weights,
    from the weighted median on (Holland and Welsch, "Robust regression using iteratively reweighted
    least-squares", 1977). Close features count more; a few features in a row hardly determine the tilt.
    """
    distance = np.linalg.norm(offsets, axis=1)
    closeness = 1 / (distance + SOFTENING)
    order = np.argsort(inverse, kind="stable")
    half = np.searchsorted(np.cumsum(closeness[order]), closeness.sum() / 2)
    across = np.column_stack([np.ones(len(inverse)), offsets / (distance.max() + SOFTENING)])
    plane = np.array([inverse[order[half]], 0.0, 0.0])
    for _ in range(5):
        miss = np.abs(inverse - across @ plane)
        weight = closeness / (1 + (miss / (2 * max(float(np.median(miss)), 1e-9 * inverse.max()))) ** 2)
        flat = np.diag([0.0, 1.0, 1.0]) * FRONTAL * weight.sum()
        plane = np.linalg.solve(across.T @ (across * weight[:, None]) + flat, across.T @ (weight * inverse))
    return float(plane[0])
