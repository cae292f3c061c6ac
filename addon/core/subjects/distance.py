"""Distance of a subject through a clip: its size over time, and one factor from where it stands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from ..base.arrays import Floats, Map, Mask
from ..base.progress import checkpoint
from .cut import LEAST
from .pictures import ClipPictures

INLIER = 1.0
"""Pixels within which flow in a subject agrees with one similarity."""
LEAST_FLOW = 30
"""Pixels of a subject whose flow there and back agrees, from which on flow gives its change of size."""
LARGEST_CHANGE = 1.15
"""Ratio of sizes in consecutive frames beyond which flow is wrong."""
CONTACTS = 12
"""Frames of a clip in which the place where a subject stands is looked for."""
SURE_DRIFT = 4
"""Contacts from which on a drift of the size, linear in time, is corrected."""


def change_of_size(flow: Map, agrees: Map, mask: Mask) -> float | None:
    """Estimate how much larger a subject is in the next frame.

    Args:
        flow: (h, w, 2) pixels to the next frame.
        agrees: (h, w) in [0, 1], how far flow back returns.
        mask: (h, w) the subject.

    Returns:
        The scale of the similarity that most flow within it agrees with (RANSAC), None where too little is
        known.
    """
    inner = cv2.erode(mask.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    rows, columns = np.nonzero(inner & (agrees > 0.5))
    if len(rows) < LEAST_FLOW:
        return None
    at = np.column_stack([columns, rows]).astype(np.float32)
    cv2.setRNGSeed(0)
    similarity, _ = cv2.estimateAffinePartial2D(
        at, at + flow[rows, columns], method=cv2.RANSAC, ransacReprojThreshold=INLIER
    )
    if similarity is None:
        return None
    scale = float(np.hypot(similarity[0, 0], similarity[0, 1]))
    return scale if 1 / LARGEST_CHANGE < scale < LARGEST_CHANGE else None


@dataclass(frozen=True)
class SubjectDistance:
    """Inverse depth of a subject in every frame that shows it.

    An object of constant size has an inverse depth proportional to its size in the picture. Sizes come from
    flow within the subject, frame by frame; their unknown factor is the median over the frames in which the
    subject is seen to stand on the ground. From four such frames on, a drift of the size that is linear in
    time is corrected, too.
    """

    pictures: ClipPictures
    mask: Callable[[int], Mask]
    """The subject (h, w) in a frame, at the size of the pictures."""
    standing: Callable[[int], float | None]
    """Its inverse depth in 1 / scene units by its contact with the ground; None where that is not seen."""

    def inverse_depth(self, frame: int) -> float | None:
        """Return the inverse depth in 1 / scene units; None where no frame shows where the subject stands."""
        frames = self.pictures.frames
        return (
            None
            if self._factors is None
            else float(self._sizes[frames.index(frame)] * self._factors[frames.index(frame)])
        )

    @cached_property
    def _sizes(self) -> Floats:
        """(n,) size in each frame, relative to the first."""
        frames, flow = self.pictures.frames, self.pictures.flow
        changes = list[float]()
        for frame in frames[:-1]:
            checkpoint()
            mask, scale = self.mask(frame), None
            if np.count_nonzero(mask) >= LEAST:
                scale = change_of_size(flow.step(frame, 1), flow.there(frame, 1)[1], mask)
            changes.append(np.log(scale) if scale else 0.0)
        return np.exp(np.concatenate([[0.0], np.cumsum(changes)]))

    @cached_property
    def _factors(self) -> Floats | None:
        """(n,) inverse depth over size in each frame."""
        frames = self.pictures.frames
        known = [(at, found) for at in self._looked_at if (found := self.standing(frames[at])) is not None]
        if not known:
            return None
        at = np.array([each[0] for each in known])
        off = np.log([each[1] for each in known]) - np.log(self._sizes[at])
        return np.exp(_line(at, off, len(frames)))

    @property
    def _looked_at(self) -> list[int]:
        """Numbers of frames that show the subject, spread over the clip."""
        frames = self.pictures.frames
        shown = [at for at in range(len(frames)) if np.count_nonzero(self.mask(frames[at])) >= LEAST]
        chosen = np.linspace(0, len(shown) - 1, min(CONTACTS, len(shown)))
        return sorted({shown[round(each)] for each in chosen})


def _line(at: Floats, values: Floats, count: int) -> Floats:
    """(count,) a line through most of some values: Theil, "A rank-invariant method of linear and polynomial
    regression analysis", 1950; their median where there are too few."""
    slope = 0.0
    if len(at) >= SURE_DRIFT:
        one, other = np.triu_indices(len(at), 1)
        slope = float(np.median((values[other] - values[one]) / (at[other] - at[one])))
    return np.asarray(np.median(values - slope * at) + slope * np.arange(count))
