"""Where the subjects of a clip stand on the ground."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..base.arrays import Mask
from ..camera.reconstruction import Image
from ..depth.moving_objects import MovingObjectOptions, standing_depth
from ..depth.object_tracks import ClipObjects
from .static_plate import StaticPlate

GROWN = 7
"""Pixels across the dilation of moving pixels, whose outline is no static scene."""


@dataclass(frozen=True)
class Standing:
    """The depth of subjects by their contact with the ground, seen in one frame at a time.

    The ground is known from a coarse depth of the static scene, in a tenth of the time of all pixels' depth.
    Errors as of `PlaneSweepStereo.at`.
    """

    plates: StaticPlate
    moving: Callable[[int], Mask]
    """All moving pixels (h, w) of a source frame, at any size."""

    def inverse_depth(self, subject: Callable[[int], Mask], frame: int) -> float | None:
        """Estimate the median inverse depth of a subject in a frame.

        Args:
            subject: Its pixels (h, w) in a source frame, at any size.
            frame: Number of a registered frame.

        Returns:
            In 1 / scene units; None where no ground is seen below it, or it is not seen.
        """
        plates = self.plates
        image, _ = plates.reconstruction.image_at(frame)

        def shown(other: Image) -> Mask:
            return plates.on_canvas(other, subject(other.frame))

        mask = shown(image)
        if not mask.any():
            return None
        inverse = plates.inverse_depth(frame, self._left_out)
        clip = ClipObjects(
            plates.reconstruction.images, lambda other: plates.canvas(other.frame).pinhole, shown, [shown]
        )
        (found,) = (each for each in clip.of(image, mask) if each.mask.any())
        options = replace(MovingObjectOptions(), sides=0)
        return standing_depth(found, inverse, plates.canvas(frame).pinhole, options)

    def _left_out(self, frame: int) -> Mask:
        image, _ = self.plates.reconstruction.image_at(frame)
        mask = self.plates.on_canvas(image, self.moving(frame))
        return np.asarray(cv2.dilate(mask.astype(np.uint8), np.ones((GROWN, GROWN), np.uint8)) > 0)
