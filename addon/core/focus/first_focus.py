"""What is put in focus before anybody has picked anything: the nearest large object near the centre."""

from __future__ import annotations

import numpy as np

from ..base.arrays import Floats, Ints
from ..camera.reconstruction import Reconstruction
from ..depth.sparse import frame_features
from .focus import Focus
from .picking import pick_features
from .place import Place

WINDOW = 0.6
"""Of the picture's width and height, around its middle, where the thing is looked for. Chosen by
inspection."""
CELLS = 12
"""Cells along each side of that window: a cell counts once, however many features its texture has."""
LARGE = 0.15
"""Share of the window's cells with features that a thing must have. Chosen by inspection."""
THICK = 0.12
"""Relative difference of inverse depths within which features are on one thing. Chosen by inspection."""


def first_place(reconstruction: Reconstruction, frame: int) -> Place | None:
    """The nearest large thing round the middle of a frame, focused through feature points on it; None where
    the frame shows too few features."""
    image, _ = reconstruction.image_at(frame)
    canvas = reconstruction.canvas(image)
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
    return Place(focus, frame, distance, "the nearest large object near the centre", xy=(x, y))


def _nearest_large(xy: Floats, inverse: Floats) -> Ints:
    """Rows of the features (n, 2), of inverse depth (n,), that are on the nearest thing that is large; on the
    largest, where none is."""
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
    # The run may begin with a few stray points before it: the one that has most of what it overlaps.
    rivals = np.arange(start, ends[start])
    start = int(rivals[np.argmax(np.array(shares)[rivals])])
    return np.asarray(order[start : ends[start]])
