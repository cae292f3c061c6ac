"""The content-preserving warp: a stiff regular grid that follows the features.

Liu, Gleicher, Jin and Agarwala, "Content-preserving warps for 3D video stabilization", 2009, section 4.2. The
paper solves a grid for each view: features in a cell should land at their positions in the view, and each
half of a cell should only rotate and scale. Both are linear in the vertices as complex numbers, and a feature
moves by its inverse depth times the virtual camera's position, so one complex number a vertex gives the grids
of all views. Its real part is an inverse depth. Its imaginary part, motion across, is left out: it changes
results by 0.02 dB at most.

The result is a membrane: the energy of triangles that only rotate and scale is that of stretching, in either
part, less the covered area, which depends on the border alone (Pinkall and Polthier, "Computing discrete
minimal surfaces and their conjugates", 1993). The paper's weights by colour variation changed results by up
to 0.16 dB, less than a softer membrane does, and are left out, too.
"""

from collections.abc import Callable

import numpy as np

from ....base.arrays import Floats, Ints, Mask
from ....base.errors import UserError
from ....camera.canvas import Canvas
from ....camera.reconstruction import Reconstruction
from ....depth.sparse import DepthSamples
from ....warp.mesh import WarpMesh

SOLVER_ACCURACY = 1e-9
"""Residual of conjugate gradients as a share of the right hand side, far below a visible difference."""
SOLVER_STEPS = 2000
"""Most steps of conjugate gradients. Chosen by inspection."""
COLUMNS = 64
"""Cells across the picture. Chosen by inspection."""
STIFFNESS = 0.02
"""Cost of a step of inverse depth between vertices, relative to a feature's error. Chosen by inspection."""
FADE = 10
"""Registered frames over which a feature fades in and out. Chosen by inspection."""
MARGIN_CELLS = 8
"""Most cells past the border; a wide margin has large ones. Chosen by inspection."""
RANGE_MARGIN = 0.25
"""Share of the features' range of inverse depths by which vertices may leave it. Chosen by inspection."""
TALLEST = 4
"""Ratio of height to width above which cells grow, to limit the number of rows. Chosen by inspection."""
OUTLIER_NEIGHBOURS = 8
"""Features around one with which it is compared. Chosen by inspection."""


def grid_mesh(
    features: DepthSamples, weights: Floats, canvas: Canvas, margin: float, flat: float
) -> WarpMesh:
    """Make the grid over the canvas and `margin` pixels past its border, two triangles a cell.

    `weights` (n,) in [0, 1] belong to the features. Without features, the grid has the inverse depth `flat`.
    Raises UserError if the solver does not converge.
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
    """Return the bounds of a grid's inverse depth for features (n,), or `flat` twice; they set its margin."""
    usable = inverse_depth[np.isfinite(inverse_depth) & (inverse_depth > 0)]
    low, high = float(usable.min(initial=np.inf)), float(usable.max(initial=-np.inf))
    if not len(usable):
        return flat, flat
    spare = RANGE_MARGIN * (high - low)
    return max(low - spare, 0.0), high + spare


def outliers(xy: Floats, inverse_depth: Floats, neighbours: int) -> Mask:
    """Mark (n,) features at (n, 2) whose inverse depths (n,) are outliers.

    An outlier differs from all its neighbours by more than the frame's range, 2nd to 98th percentile. Weights
    by the distance from the membrane drew foreground objects into the background: 1 dB less in two scenes of
    three.
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
    """Interpolate values (n,) at positions (n, 2) on lines x (w,) and y (h,), by a membrane (h, w).

    It minimises the weighted squared errors of bilinear interpolation, plus `stiffness` times the squared
    steps between vertices. The best plane is subtracted first, so that planes are exact (the paper first
    warps by a homography).
    """
    slope = _plane(xy, values, weights)
    rest = values - np.column_stack([xy, np.ones(len(xy))]) @ slope
    vertex, share = _bilinear(x, y, xy)
    count = len(x) * len(y)
    pull = weights[:, None] * share
    # An edge's stiffness grows with its cell's breadth, so that the spacing of lines has no effect.
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
    """Solve for the grid (h, w) that a symmetric positive matrix, given as a function, maps to `wanted`.

    Hestenes and Stiefel, "Methods of conjugate gradients for solving linear systems", 1952, preconditioned by
    the `diagonal` (Jacobi). Raises UserError if it does not converge.
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
    """Return (n,) weights in (0, 1] of a frame's points, low in the first and last frames that see them.

    The clip's ends do not count, because the points would go on. Untracked points, -1, have weight 1.
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
        # Past the clip's end, visible points go on.
        run += (fade - len(images)) * alive
        weights = np.minimum(weights, run / (fade + 1))
    # A new feature must not outweigh the stiffness at once, so the slopes at both ends are 0.
    return np.where(points < 0, 1.0, weights**2 * (3 - 2 * weights))


def _lines(side: float, cell: float, margin: float, margin_cells: int) -> Floats:
    """Return coordinates of lines about `cell` apart in the picture, and up to `margin` past it."""
    inside = np.linspace(0, side, max(round(side / cell), 1) + 1)
    steps = int(np.clip(np.ceil(margin / cell), 1, margin_cells))
    outside = margin * np.arange(1, steps + 1) / steps
    return np.concatenate([-outside[::-1], inside, side + outside])


def _breadth(lines: Floats) -> Floats:
    """Return (n,) half the distance between both neighbours."""
    return np.asarray(np.convolve(np.diff(lines), [0.5, 0.5]))


def _bilinear(x: Floats, y: Floats, xy: Floats) -> tuple[Ints, Floats]:
    """Return (n, 4) vertices of the cells that hold positions (n, 2), and bilinear weights."""
    column, row = (
        np.clip(np.searchsorted(lines, at, side="right") - 1, 0, len(lines) - 2)
        for lines, at in ((x, xy[:, 0]), (y, xy[:, 1]))
    )
    s = (xy[:, 0] - x[column]) / (x[column + 1] - x[column])
    t = (xy[:, 1] - y[row]) / (y[row + 1] - y[row])
    share = np.stack([(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t], axis=1)
    return ((row * len(x) + column)[:, None] + [0, 1, len(x), len(x) + 1]).astype(np.int32), share


def _plane(xy: Floats, values: Floats, weights: Floats) -> Floats:
    """Fit (3,) a, b, c of the plane a x + b y + c to values (n,); level if positions are degenerate."""
    centre = np.average(xy, axis=0, weights=weights)
    terms = np.sqrt(weights)[:, None] * np.column_stack([xy - centre, np.ones(len(xy))])
    slope = np.linalg.lstsq(terms, np.sqrt(weights) * values, rcond=1e-6)[0]
    return np.array([slope[0], slope[1], slope[2] - slope[:2] @ centre])
