"""Default focus before a pick: the nearest large object near the centre."""

import numpy as np

from ..base.arrays import Floats, Ints
from ..camera.reconstruction import Reconstruction
from ..depth.sparse import frame_features
from .focus import Focus
from .picking import pick_features
from .place import Place

NEAREST = "the nearest large object near the centre"
"""Source of the distance."""
WINDOW = 0.6
"""Share of the picture's width and height, around its middle, that is searched. Chosen by inspection."""
CELLS = 12
"""Cells along each side of the window; a cell counts once, however many features it has."""
LARGE = 0.15
"""Share of the window's cells with features that a thing must have. Chosen by inspection."""
THICK = 0.12
"""Relative difference of inverse depths within which features are on one thing. Chosen by inspection."""


def first_place(reconstruction: Reconstruction, frame: int) -> Place | None:
    """Return the nearest large thing near the middle of a frame, focused through its feature points.

    None where the frame shows too few features.
    """
    canvas = reconstruction.canvas(frame)
    features = frame_features(reconstruction, frame, canvas)
    size = np.array([canvas.camera.width, canvas.camera.height])
    xy = canvas.features_to_source(features.observed) / size
    inside = np.flatnonzero((np.abs(xy - 0.5) < WINDOW / 2).all(axis=1))
    if len(inside) < 2:
        inside = np.arange(len(xy))
    if len(inside) < 2:
        return None
    thing = inside[_nearest_large(xy[inside], features.inverse_depth[inside])]
    # A place on it, as near to the middle as can be; the points as of a click there, where those are its own.
    middle = thing[np.argsort(np.linalg.norm(xy[thing] - 0.5, axis=1), kind="stable")]
    x, y = (float(value) for value in np.clip(xy[middle[0]], 0, 1))
    focus = pick_features(features, canvas, x, y)
    if not np.isin(focus.points, features.points[thing]).all():
        around = np.argsort(np.linalg.norm(xy[thing] - [x, y], axis=1), kind="stable")[:4]
        focus = Focus(points=tuple(int(point) for point in features.points[thing[around]]))
    distance = 1 / focus.inverse_depth(reconstruction, frame)
    return Place(focus, frame, distance, NEAREST, xy=(x, y))


def _nearest_large(xy: Floats, inverse: Floats) -> Ints:
    """Rows of the features (n, 2), of inverse depth (n,), on the nearest large thing, or the largest."""
    cells = (np.clip((xy - 0.5) / WINDOW + 0.5, 0, 1 - 1e-9) * CELLS).astype(int) @ [1, CELLS]
    order = np.argsort(-inverse, kind="stable")
    # Nearest first, inverse depths fall: a thing is a run of them.
    falling = -inverse[order]
    ends = np.searchsorted(falling, falling * (1 - THICK), side="right")
    shares = [
        len(np.unique(cells[order[start:end]])) / len(np.unique(cells)) for start, end in enumerate(ends)
    ]
    large = np.flatnonzero(np.array(shares) >= LARGE)
    start = int(large[0]) if len(large) else int(np.argmax(shares))
    # A run may begin with stray points in front of the object: take the run with most overlap.
    rivals = np.arange(start, ends[start])
    start = int(rivals[np.argmax(np.array(shares)[rivals])])
    return np.asarray(order[start : ends[start]])
