"""A whole subject in focus: its distance in every frame that shows it."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import cv2
import numpy as np

from ..base.arrays import Mask
from ..base.errors import UserError
from ..base.progress import checkpoint
from ..camera.reconstruction import Reconstruction
from ..depth.source import NO_PICTURE, DepthSource
from .focus import Focus
from .picking import unsolved
from .place import Place

EVERY = 3
"""Frames between two whose depth is asked for; those between are interpolated, in inverse depth."""
LEAST_PIXELS = 12
"""Least pixels of a subject with a depth."""
SMOOTH = 3
"""Depths, `EVERY` frames apart, of which the median is taken."""


def subject_place(
    reconstruction: Reconstruction,
    depth: DepthSource,
    mask: Callable[[int], Mask],
    frame: int,
    name: str,
    standing: Callable[[int], float | None] = lambda frame: None,
) -> Place:
    """Return a subject as a place in focus, followed through the clip by the median of its inverse depths.

    Between frames that show the subject, and where it is hidden, distances are interpolated in inverse depth.

    Args:
        reconstruction: Solve of the clip.
        depth: Source of the depth of all pixels.
        mask: Returns the subject (h, w) over a source frame, at any size.
        frame: Frame of the place.
        name: Name of the subject.
        standing: Returns its inverse depth in 1 / scene units where it is known without `depth`, which takes
            ten times as long.

    Raises:
        UserError: No frame shows the subject; else as of `DepthSource.at`.
    """
    frames = [int(each) for each in reconstruction.frames]
    if frame not in frames:
        raise UserError(unsolved(reconstruction, frame))
    found = {each: inverse for each in frames if (inverse := standing(each)) is not None}
    if not found:
        asked = sorted({*frames[::EVERY], frames[-1], frame})
        found = _smooth(dict(_inverse_depths(reconstruction, depth, mask, asked)))
    if not found:
        raise UserError(f"the subject {name} is not seen in any frame; mark it with a stroke where it is")
    known = sorted(found)
    values = [found[each] for each in known]
    followed = dict(zip(frames, (1 / np.interp(frames, known, values)).tolist(), strict=True))
    source = f"the subject {name}, seen from frame {known[0]} to {known[-1]}"
    distance = followed[frame]
    return Place(Focus(distance=distance), frame, distance, source, followed=followed, subject=name)


def _inverse_depths(
    reconstruction: Reconstruction,
    depth: DepthSource,
    mask: Callable[[int], Mask],
    frames: Iterable[int],
) -> Iterable[tuple[int, float]]:
    """Frames that show a subject, and the median inverse depth of its pixels there, in 1 / scene units."""
    for frame in frames:
        checkpoint()
        shown = mask(frame)
        if np.count_nonzero(shown) < LEAST_PIXELS:
            continue
        image, _ = reconstruction.image_at(frame)
        canvas = reconstruction.canvas(image)
        # Pixels of the outline may show the background.
        inner = cv2.erode(shown.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        rows, columns = np.nonzero(inner if np.count_nonzero(inner) >= LEAST_PIXELS else shown)
        size = np.array([canvas.camera.width, canvas.camera.height]) / np.array(shown.shape[::-1])
        places = canvas.features_from_source((np.column_stack([columns, rows]) + 0.5) * size)
        known = depth.at(frame, canvas, NO_PICTURE)
        if known is None:
            continue
        inverse = float(np.median(known.at_places(places, canvas)[0]))
        if inverse > 0:
            yield frame, inverse


def _smooth(found: dict[int, float]) -> dict[int, float]:
    """The running median of `SMOOTH` values, by ascending frames."""
    wide = np.pad(list(found.values()), SMOOTH // 2, mode="edge") if found else np.zeros(SMOOTH - 1)
    medians = np.median(np.lib.stride_tricks.sliding_window_view(wide, SMOOTH), axis=1)
    return dict(zip(found, medians.tolist(), strict=True))
