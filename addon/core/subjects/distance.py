"""Distance of a subject through a clip: its size over time, and one factor from where it stands."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.arrays import Floats, Mask
from ..base.progress import checkpoint
from ..base.store import NOT_KEPT, Store, numbers
from ..depth.ground_contact import HIDDEN
from .cut import LEAST
from .flow import change_of_size
from .pictures import ClipPictures

CONTACTS = 12
"""Frames of a clip in which the place where a subject stands is looked for."""
HEIGHTS, SURE_DRIFT = 60, 8
"""Frames by whose outlines the drift of sizes is estimated, at most and at least."""


@dataclass(frozen=True)
class SubjectDistance:
    """Inverse depth of a subject in every frame.

    An object of constant size has an inverse depth proportional to its size in the picture. Sizes come from
    flow within the subject, frame by frame; their drift, linear in time, is corrected by the height of the
    subject's outline. One factor for the clip is the median over the frames in which the subject is seen to
    stand on the ground.
    """

    pictures: ClipPictures
    mask: Callable[[int], Mask]
    """The subject (h, w) in a frame, at the size of the pictures."""
    standing: Callable[[Sequence[int]], Mapping[int, float]]
    """Its inverse depth in 1 / scene units by its contact with the ground, for those frames that show it."""
    bounds: Callable[[Sequence[int]], Mapping[int, float]] = lambda frames: {}
    """Its least inverse depth by frame, for a subject that no frame shows to stand anywhere."""
    store: Store = NOT_KEPT
    """Storage of its sizes."""
    name: str = ""
    """Name of its sizes in the storage."""

    def inverse_depth(self, frame: int) -> float | None:
        """Return the inverse depth in 1 / scene units; None where no frame shows where the subject stands."""
        factor = self._factor
        return None if factor is None else float(factor * self._sizes[self.pictures.frames.index(frame)])

    @cached_property
    def _sizes(self) -> Floats:
        """(n,) size in each frame, relative to the first."""
        return self.store.once(numbers(self.name, len(self.pictures.frames)), self._measured_sizes)

    def _measured_sizes(self) -> Floats:
        frames, flow = self.pictures.frames, self.pictures.flow
        changes, heights = list[float](), list[float]()
        for number, frame in enumerate(frames):
            checkpoint()
            mask, scale = self.mask(frame), None
            heights.append(_height(mask))
            if np.count_nonzero(mask) >= LEAST and number + 1 < len(frames):
                scale = change_of_size(flow.step(frame, 1), flow.there(frame, 1)[1], mask)
            changes.append(np.log(scale) if scale else 0.0)
        sizes = np.concatenate([[0.0], np.cumsum(changes[:-1])])
        known = np.flatnonzero(np.isfinite(heights))
        known = known[:: max(len(known) // HEIGHTS, 1)]
        if len(known) >= SURE_DRIFT:
            one, other = np.triu_indices(len(known), 1)
            off = np.log(np.array(heights)[known]) - sizes[known]
            # Theil, "A rank-invariant method of linear and polynomial regression analysis", 1950.
            drift = np.median((off[other] - off[one]) / (known[other] - known[one]))
            sizes = sizes + drift * np.arange(len(sizes))
        return np.asarray(np.exp(sizes))

    @cached_property
    def _factor(self) -> float | None:
        """Inverse depth over size."""
        frames = self.pictures.frames
        shown = [at for at in range(len(frames)) if np.count_nonzero(self.mask(frames[at])) >= LEAST]
        chosen = np.linspace(0, len(shown) - 1, min(CONTACTS, len(shown)))
        looked_at = sorted({shown[round(each)] for each in chosen})
        found = self.standing([frames[at] for at in looked_at])

        def factors(inverse: Mapping[int, float]) -> list[float]:
            return [inverse[frames[at]] / self._sizes[at] for at in looked_at if frames[at] in inverse]

        if found:
            return float(np.median(factors(found)))
        bounds = factors(self.bounds([frames[at] for at in looked_at]))
        return float(np.quantile(bounds, HIDDEN)) if bounds else None


def _height(mask: Mask) -> float:
    """Pixels; NaN of a subject that is cut by the picture's upper or lower border, or not seen."""
    rows = np.flatnonzero(mask.any(axis=1))
    if np.count_nonzero(mask) < LEAST or rows[0] == 0 or rows[-1] == len(mask) - 1:
        return np.nan
    return float(len(rows))
