"""Distortion and rolling shutter of a camera.

The lens bends a pinhole's picture, and rows and columns are read one after the other while the camera turns.
Brown, "Close-range camera calibration", 1971; Forssen and Ringaby, "Rectifying rolling shutter video from
hand-held devices", 2010.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ...base.arrays import Floats, Ints, Mask

SIGMA = np.array([0.03, 0.03, 0.1, 0.05, 0.5, 0.5])
"""Standard deviations of `Distortion.parameters` a priori. Chosen by inspection, and wide."""
LIMITS = np.array([0.2, 0.2, 0.5, 0.5, 1.0, 1.0])
"""Largest magnitudes of them: a frame is read before the next one is, and past the others no lens is one."""


@dataclass(frozen=True)
class Distortion:
    """Distortion and readout of all frames of a clip. Places are pixels from the middle of the picture."""

    parameters: Floats
    """(6,) principal point x, y in half diagonals; k1, k2: a place at m half diagonals from it is seen at m
    (1 + k1 |m|^2 + k2 |m|^4); time to read the width and the height, in frame intervals."""
    size: tuple[int, int]
    """Width and height of the picture in pixels."""
    speed: Floats
    """(F, 3) rotation vector from a frame to the next, in camera axes."""
    free: Mask = field(default_factory=lambda: np.ones(len(SIGMA), bool))
    """(6,) which of the parameters an adjustment may change."""

    @property
    def half_diagonal(self) -> float:
        """Pixels."""
        return float(np.hypot(*self.size)) / 2

    def turned(self, local: Floats, frame: Ints, xy: Floats) -> Floats:
        """Return points (m, 3) in the axes of cameras `frame` (m,), when the places xy (m, 2) are read."""
        when = xy @ (self.parameters[4:] / self.size)
        return np.asarray(local + np.cross(self.speed[frame] * when[:, None], local))

    def bent(self, place: Floats) -> Floats:
        """Return the distorted places (m, 2) of a pinhole's places."""
        place = place / self.half_diagonal
        square = (place**2).sum(axis=1, keepdims=True)
        k1, k2 = self.parameters[2:4]
        return np.asarray(
            self.half_diagonal * (self.parameters[:2] + place * (1 + k1 * square + k2 * square**2))
        )

    def derivatives(self, local: Floats, focal: Floats, frame: Ints, xy: Floats) -> tuple[Floats, Floats]:
        """Return derivatives of bent places by a pinhole's places (m, 2, 2) and by the parameters (m, 2, 6).

        Args:
            local: (m, 3) points after `turned`, ahead of the camera.
            focal: (m,) in pixels.
            frame: (m,) numbers.
            xy: (m, 2) observed places.
        """
        unit, (k1, k2) = self.half_diagonal, self.parameters[2:4]
        place = focal[:, None] / unit * local[:, :2] / local[:, 2:]
        square = (place**2).sum(axis=1)[:, None]
        outer = place[:, :, None] * place[:, None, :]
        by_place = (1 + k1 * square + k2 * square**2)[..., None] * np.eye(2)
        by_place = by_place + (2 * k1 + 4 * k2 * square)[..., None] * outer
        when = xy / self.size
        spin = np.cross(self.speed[frame], local)
        # The derivative of the turn, up to the third order.
        spin = spin - (when @ self.parameters[4:])[:, None] * np.cross(self.speed[frame], spin)
        slide = (focal[:, None] * spin[:, :2] - unit * place * spin[:, 2:]) / local[:, 2:]
        slide = np.einsum("mij,mj->mi", by_place, slide)
        by_parameters = np.empty((len(local), 2, len(SIGMA)))
        by_parameters[..., :2] = unit * np.eye(2)
        by_parameters[..., 2], by_parameters[..., 3] = unit * place * square, unit * place * square**2
        by_parameters[..., 4], by_parameters[..., 5] = slide * when[:, :1], slide * when[:, 1:]
        return by_place, by_parameters * self.free

    def changed(self, step: Floats) -> Distortion:
        """With the parameters (6,) that much larger, within what cameras have."""
        return replace(self, parameters=np.clip(self.parameters + step, -LIMITS, LIMITS))


def undistorted(size: tuple[int, int], speed: Floats) -> Distortion:
    """Return a pinhole that reads all rows at once; `size` and `speed` (F, 3) are as in `Distortion`."""
    return Distortion(np.zeros(len(SIGMA)), size, speed)
