"""A regular grid that follows the features as stiffly as it can: the content-preserving warp.

Liu, Gleicher, Jin and Agarwala, "Content-preserving warps for 3D video stabilization", 2009, section 4.2.
They solve for the grid of each view: a feature in a cell should land where the view sees it, and every half
of a cell should only turn and grow. Both are linear in the vertices as complex numbers, and the motion of a
feature is its inverse depth times the virtual camera's position, so the grids of all views are one complex
number a vertex times this position.

Its real part is an inverse depth. Its imaginary part is motion across, and is left out: with it results
change by 0.02 dB at most. The rest is a membrane. The energy of triangles that should only turn and grow is
that of stretching, in either part, less the covered area, which depends on the border alone (Pinkall and
Polthier, "Computing discrete minimal surfaces and their conjugates", 1993). Weights by the variation of
colour in a cell, as in the paper, changed results by up to 0.16 dB, less than a softer membrane does, and are
left out, too.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..base.arrays import Floats, Ints, Mask
from ..base.errors import UserError
from ..camera.canvas import Canvas
from ..camera.reconstruction import Reconstruction
from ..depth.sparse import DepthSamples
from .mesh import WarpMesh

SOLVER_ACCURACY = 1e-9
"""Residual of conjugate gradients relative to the right hand side: far below a visible change."""
SOLVER_STEPS = 2000
"""Steps of conjugate gradients at most. Chosen by inspection."""
COLUMNS = 64
"""Cells across the picture. Chosen by inspection."""
STIFFNESS = 0.02
"""Cost of a step of inverse depth between two vertices, against missing a feature by as much. Chosen by
inspection."""
FADE = 10
"""Registered frames in which a feature comes and goes. Chosen by inspection."""
MARGIN_CELLS = 8
"""Cells past the border at most; a wide margin has large ones. Chosen by inspection."""
RANGE_MARGIN = 0.25
"""Share of the features' range of inverse depths by which vertices may leave it. Chosen by inspection."""
TALLEST = 4
"""Ratio of height to width above which cells are larger, or there would be thousands of rows. Chosen by
inspection."""
OUTLIER_NEIGHBOURS = 8
"""Features around one that it is compared with. Chosen by inspection."""


def grid_mesh(
    features: DepthSamples,
    weights: Floats,
    canvas: Canvas,
    margin: float,
    flat: float,
) -> WarpMesh:
    """The grid over the canvas and `margin` pixels past its border, two triangles a cell.

    `weights` (n,) in [0, 1] are those of the samples; `flat` is the inverse depth where there are none.
    UserError where the grid cannot be found.
    """
    width, height = canvas.pinhole.width, canvas.pinhole.height
    step = max(width, height / TALLEST) / COLUMNS
    x, y = (_lines(side, step, margin, MARGIN_CELLS) for side in (width, height))
    inside = np.all((features.observed >= 0) & (features.observed <= [width, height]), axis=1)
    inside &= np.isfinite(features.inverse_depth) & (features.inverse_depth > 0)
    known, inverse, weights = features.observed[inside], features.inverse_depth[inside], weights[inside]
    across, down = np.meshgrid(x, y)
    xy = np.column_stack([across.ravel(), down.ravel()])
    depth = np.full(len(xy), flat)
    if len(known):
        right = ~outliers(known, inverse, OUTLIER_NEIGHBOURS)
        depth = membrane(x, y, known[right], inverse[right], weights[right], STIFFNESS).ravel()
    low, high = allowed(features.inverse_depth, flat)
    first = (len(x) * np.arange(len(y) - 1)[:, None] + np.arange(len(x) - 1)).ravel()
    below = first + len(x)
    triangles = np.concatenate([
        np.column_stack([first, first + 1, below]), np.column_stack([first + 1, below + 1, below]),
    ])  # fmt: skip
    return WarpMesh(xy, xy, np.clip(depth, low, high), triangles.astype(np.int32))


def allowed(inverse_depth: Floats, flat: float) -> tuple[float, float]:
    """Return the least and largest inverse depth of a grid over features of inverse depths (n,).

    The grid's margin must suffice for both; without features it is twice `flat`.
    """
    usable = inverse_depth[np.isfinite(inverse_depth) & (inverse_depth > 0)]
    low, high = float(usable.min(initial=np.inf)), float(usable.max(initial=-np.inf))
    if not len(usable):
        return flat, flat
    spare = RANGE_MARGIN * (high - low)
    return max(low - spare, 0.0), high + spare


def outliers(xy: Floats, inverse_depth: Floats, neighbours: int) -> Mask:
    """Return the features (n,) that differ from all their neighbours by more than the frame's range.

    The range is the 2nd to 98th percentile of inverse depths (n,). Smaller differences are not certain
    errors: weights by the distance from the membrane, the common way against outliers, drew things in front
    into the background and cost a decibel in two scenes of three.
    """
    result = np.zeros(len(xy), bool)
    if len(xy) <= neighbours:
        return result
    low, high = np.percentile(inverse_depth, [2, 98])
    suspects = np.nonzero((inverse_depth < low) | (inverse_depth > high))[0]
    off = ((xy[suspects, None] - xy) ** 2).sum(axis=2)
    off[np.arange(len(suspects)), suspects] = np.inf
    near = np.argpartition(off, neighbours - 1, axis=1)[:, :neighbours]
    away = np.abs(inverse_depth[near] - inverse_depth[suspects, None]).min(axis=1)
    result[suspects] = away > high - low
    return result


def membrane(x: Floats, y: Floats, xy: Floats, values: Floats, weights: Floats, stiffness: float) -> Floats:
    """Return values (h, w) at vertices on lines x (w,) and y (h,), stretched over given values (n,).

    Minimises the weighted squared residuals of bilinear interpolation at places (n, 2), plus the stiffness
    times the squared steps between vertices, both relative to the best plane: planes are exact. (The paper
    warps by a homography first, for the same reason.)
    """
    slope = _plane(xy, values, weights)
    rest = values - np.column_stack([xy, np.ones(len(xy))]) @ slope
    vertex, share = _bilinear(x, y, xy)
    count = len(x) * len(y)
    pull = weights[:, None] * share
    # A cell's edge is as stiff as it is broad: the membrane is the same however the lines lie.
    stiff_x = stiffness * _breadth(y)[:, None] / np.diff(x)
    stiff_y = stiffness * _breadth(x) / np.diff(y)[:, None]

    def summed(parts: Floats) -> Floats:
        return np.bincount(vertex.ravel(), parts.ravel(), count).reshape(len(y), len(x))

    def applied(grid: Floats) -> Floats:
        result = summed(pull * (share * grid.ravel()[vertex]).sum(axis=1)[:, None])
        along, down = stiff_x * np.diff(grid, axis=1), stiff_y * np.diff(grid, axis=0)
        result[:, 1:] += along
        result[:, :-1] -= along
        result[1:] += down
        result[:-1] -= down
        return result

    diagonal = summed(pull * share)
    diagonal[:, 1:] += stiff_x
    diagonal[:, :-1] += stiff_x
    diagonal[1:] += stiff_y
    diagonal[:-1] += stiff_y
    found = conjugate_gradients(applied, summed(pull * rest[:, None]), diagonal)
    return np.asarray(found + slope[0] * x + slope[1] * y[:, None] + slope[2])


def conjugate_gradients(applied: Callable[[Floats], Floats], wanted: Floats, diagonal: Floats) -> Floats:
    """The grid (h, w) that a symmetric positive matrix, as a function, takes to `wanted`; its diagonal helps.

    Hestenes and Stiefel, "Methods of conjugate gradients for solving linear systems", 1952, with Jacobi's
    preconditioner. UserError where it does not get there.
    """
    found, left = np.zeros_like(wanted), wanted.copy()
    enough = SOLVER_ACCURACY * np.linalg.norm(wanted)
    ahead = left / diagonal
    product = float((left * ahead).sum())
    for _ in range(SOLVER_STEPS):
        if np.linalg.norm(left) <= enough:
            return found
        pushed = applied(ahead)
        bend = float((ahead * pushed).sum())
        if bend <= 0:
            break
        length = product / bend
        found += length * ahead
        left -= length * pushed
        turned = left / diagonal
        before, product = product, float((left * turned).sum())
        ahead = turned + product / before * ahead
    raise UserError(
        "the warp grid of a frame cannot be computed; solve the clip again or choose another method"
    )


def fading(reconstruction: Reconstruction, frame: int, points: Ints) -> Floats:
    """Return the weights (n,) in (0, 1] of a frame's points.

    They are low in the first and last frames that see a point, except at the clip's own ends, where a point
    does not disappear. Points -1, which no frame tracks, have 1.
    """
    frames, fade = reconstruction.frames, FADE
    before = reconstruction.images[: np.searchsorted(frames, frame)][: -fade - 1 : -1]
    after = reconstruction.images[np.searchsorted(frames, frame, side="right") :][:fade]
    weights = np.ones(len(points))
    for images in (before, after):
        run, alive = np.ones(len(points)), np.ones(len(points), bool)
        for image in images:
            alive &= np.isin(points, np.concatenate([image.points, image.visible]))
            run += alive
        # Past the clip's end whatever was seen goes on.
        run += (fade - len(images)) * alive
        weights = np.minimum(weights, run / (fade + 1))
    # A feature that has just come must not outweigh the stiffness at once: the ends are flat.
    return np.where(points < 0, 1.0, weights**2 * (3 - 2 * weights))


def _lines(side: float, cell: float, margin: float, margin_cells: int) -> Floats:
    """Coordinates of a grid's lines: about `cell` apart in the picture, and on to `margin` past it."""
    inside = np.linspace(0, side, max(round(side / cell), 1) + 1)
    steps = int(np.clip(np.ceil(margin / cell), 1, margin_cells))
    outside = margin * np.arange(1, steps + 1) / steps
    return np.concatenate([-outside[::-1], inside, side + outside])


def _breadth(lines: Floats) -> Floats:
    """(n,) half the way to the neighbours on either side."""
    return np.asarray(np.convolve(np.diff(lines), [0.5, 0.5]))


def _bilinear(x: Floats, y: Floats, xy: Floats) -> tuple[Ints, Floats]:
    """(n, 4) vertices of the cells that places (n, 2) lie in, and the places' shares of them."""
    column, row = (
        np.clip(np.searchsorted(lines, at, side="right") - 1, 0, len(lines) - 2)
        for lines, at in ((x, xy[:, 0]), (y, xy[:, 1]))
    )
    s = (xy[:, 0] - x[column]) / (x[column + 1] - x[column])
    t = (xy[:, 1] - y[row]) / (y[row + 1] - y[row])
    share = np.stack([(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t], axis=1)
    vertex = (row * len(x) + column)[:, None] + [0, 1, len(x), len(x) + 1]
    return vertex.astype(np.int32), share


def _plane(xy: Floats, values: Floats, weights: Floats) -> Floats:
    """(3,) a, b, c of the plane a x + b y + c nearest to values (n,); level where places leave it open."""
    centre = np.average(xy, axis=0, weights=weights)
    terms = np.sqrt(weights)[:, None] * np.column_stack([xy - centre, np.ones(len(xy))])
    slope = np.linalg.lstsq(terms, np.sqrt(weights) * values, rcond=1e-6)[0]
    return np.array([slope[0], slope[1], slope[2] - slope[:2] @ centre])
