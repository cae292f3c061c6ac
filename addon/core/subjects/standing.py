"""Where the subjects of a clip stand on the ground."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ..base.arrays import Mask
from ..base.progress import checkpoint
from ..depth.ground_contact import Plane, contact, ground_below, rays_of, upright
from ..depth.view_selection import relative_pose
from .static_plate import StaticPlate

GROWN = 7
"""Pixels across the dilation of moving pixels, whose outline is no static scene."""


@dataclass(frozen=True)
class Standing:
    """The depth of subjects by their contact with the ground.

    The ground is known from a coarse depth of the static scene, in a tenth of the time of all pixels' depth.
    Errors as of `PlaneSweepStereo.at`.
    """

    plates: StaticPlate
    moving: Callable[[int], Mask]
    """All moving pixels (h, w) of a source frame, at any size."""

    def inverse_depths(self, subject: Callable[[int], Mask], frames: Sequence[int]) -> dict[int, float]:
        """Estimate the median inverse depth of a subject that stands upright where it touches the ground.

        A frame in which the ground around the subject is no plane takes that of the frame nearest in time.

        Args:
            subject: Its pixels (h, w) in a source frame, at any size.
            frames: Numbers of registered frames.

        Returns:
            In 1 / scene units, by frame; without those in which no contact is seen.
        """
        masks = {frame: self._shown(subject, frame) for frame in frames}
        shown = [frame for frame in frames if masks[frame].any()]
        planes = {frame: plane for frame in shown if (plane := self._ground(frame, masks[frame])) is not None}
        found = dict[int, float]()
        for frame in shown if planes else ():
            nearest = min(planes, key=lambda other: abs(other - frame))
            plane = self._seen_from(planes[nearest], nearest, frame)
            pinhole = self.plates.canvas(frame).pinhole
            touch = None if plane is None else contact(masks[frame], plane, pinhole)
            if plane is not None and touch is not None and (base := touch.inverse_depth(0.0, plane)) > 0:
                rows, columns = np.nonzero(masks[frame])
                rays = rays_of(pinhole, np.column_stack([columns, rows]).astype(float) + 0.5)
                found[frame] = float(np.median(upright(base, touch.column, 0.0, plane, rays)))
        return found

    def _shown(self, subject: Callable[[int], Mask], frame: int) -> Mask:
        image, _ = self.plates.reconstruction.image_at(frame)
        return self.plates.on_canvas(image, subject(frame))

    def _ground(self, frame: int, mask: Mask) -> Plane | None:
        """The ground around a subject (h, w) in a frame, in its camera's space."""
        checkpoint()
        inverse = self.plates.inverse_depth(frame, self._left_out)
        return ground_below(mask, inverse, ~self._left_out(frame), self.plates.canvas(frame).pinhole)

    def _seen_from(self, plane: Plane, frame: int, other: int) -> Plane | None:
        """A plane in a frame's camera space, in that of another frame."""
        here, there = (self.plates.reconstruction.image_at(each)[0] for each in (frame, other))
        return plane if here is there else plane.seen_from(*relative_pose(here, there))

    def _left_out(self, frame: int) -> Mask:
        mask = self._shown(self.moving, frame).astype(np.uint8)
        return np.asarray(cv2.dilate(mask, np.ones((GROWN, GROWN), np.uint8)) > 0)
