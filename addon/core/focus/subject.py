"""A whole subject in focus: its distance in every frame that shows it."""

from collections.abc import Callable, Iterable

import cv2
import numpy as np

from ..base.arrays import Mask
from ..base.errors import UserError
from ..base.progress import checkpoint
from ..camera.reconstruction import Reconstruction
from ..depth.source import NO_PICTURE, DepthSource
from .focus import Focus
from .follow import EVERY, smoothed
from .picking import unsolved
from .place import Place

LEAST_PIXELS = 12
"""Least pixels of a subject with a depth."""


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
        found = dict(inverse_depths(reconstruction, depth, mask, asked))
        found = dict(zip(found, smoothed(list(found.values())).tolist(), strict=True)) if found else {}
    if not found:
        raise UserError(f"the subject {name} is not seen in any frame; mark it with a stroke where it is")
    known = sorted(found)
    values = [found[each] for each in known]
    followed = dict(zip(frames, (1 / np.interp(frames, known, values)).tolist(), strict=True))
    source = f"the subject {name}, seen from frame {known[0]} to {known[-1]}"
    distance = followed[frame]
    return Place(Focus(distance=distance), frame, distance, source, followed=followed, subject=name)


def inverse_depths(
    reconstruction: Reconstruction, depth: DepthSource, mask: Callable[[int], Mask], frames: Iterable[int]
) -> Iterable[tuple[int, float]]:
    """Yield the frames that show a subject, and the median inverse depth of its pixels, in 1 / scene units.

    Passes checkpoints.

    Args:
        reconstruction: Solve of the clip.
        depth: Source of the depth of all pixels.
        mask: Returns the subject (h, w) over a source frame, at any size.
        frames: The frames.

    Raises:
        UserError: As of `DepthSource.at`.
    """
    for frame in frames:
        checkpoint()
        shown = mask(frame)
        if np.count_nonzero(shown) < LEAST_PIXELS:
            continue
        canvas = reconstruction.canvas(frame)
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
