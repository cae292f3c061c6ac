"""A steadier path for the camera of a clip: smoothed turns and positions, and how far the picture is cropped.

Re-cinematography (Gleicher and Liu, 2008): views of the rebuilt scene are synthesized from the steadier
camera, so a shake of the hand goes, its parallax with it. Positions and quaternions are smoothed by
Whittaker's method, which takes the least sum of squared distances to the path and of squared accelerations;
so a path that a dolly could have gone on stays as it is. Smoothing is limited by what the clip shows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..base.arrays import Floats, Ints
from ..base.errors import UserError
from .distortion import turned
from .intrinsics import Intrinsics
from .reconstruction import (
    Image,
    Reconstruction,
    matrix_from_quaternion,
    quaternion_from_matrix,
    seen_by,
)

PERIOD = 60.0
"""Frames of the period of a shake that is halved by a strength of 1/2: two seconds, as steps and breath take
less and moves that are meant take more. Chosen by inspection."""
LONGEST = 3000.0
"""Frames of the longest such period: beyond it the normal equations lose their last digits."""
MOST_ZOOM = 1.25
"""By which the picture is enlarged at most, so that its border stays outside: editors crop as much. Chosen by
inspection."""
MOST_PARALLAX = 0.03
"""Of the picture's width, by which near and far things are seen apart from where the clip has them: what
shows behind them then, frames around have mostly seen. Chosen by inspection."""
FILLED = 0.08
"""Of the picture's width, how far past the border a steadier camera sees at most where that is filled: other
frames' depth is brought in for a tenth (`map_fusion.BEYOND`), and blur discs reach into it, too."""
TRIES = 12
"""Bisections, by which strengths and zooms are found to a thousandth."""
ALONG = 9
"""Places on each side of the picture's border at which it is looked whether the clip shows them."""
READINGS = 3
"""Repetitions by which the time is found at which a rolling shutter reads a place: a turn of 3 degrees within
one leaves 0.02 pixels."""
LEVELS = 2.0, 50.0, 98.0
"""Percentiles of a frame's inverse depths, at which they are looked at; single points are wrong."""


@dataclass(frozen=True)
class SteadyPath:
    """Where the camera of a clip would have been, had it been held more steadily."""

    frames: Ints
    """(n,) frame numbers, one after the other."""
    rotations: Floats
    """(n, 3, 3) world-to-camera rotations."""
    centres: Floats
    """(n, 3) projection centres in world coordinates."""
    zoom: float
    """By which its focal length is longer than the clip's, so that it sees nothing past the clip's border, or
    no more than can be filled."""
    strength: float
    """In [0, 1], by which it was smoothed: less than what was wished, where the clip does not show enough."""

    def seen_from(self, image: Image) -> tuple[Floats, Floats]:
        """(3, 3) rotation and (3,) translation, in scene units, from the camera space of a frame into that of
        the steadier camera; of frames beyond the path, those of its end."""
        at = int(np.clip(image.frame - self.frames[0], 0, len(self.frames) - 1))
        return _between(image.rotation, image.centre, self.rotations[at], self.centres[at])


def _between(rotation: Floats, centre: Floats, steady: Floats, there: Floats) -> tuple[Floats, Floats]:
    """Rotations (..., 3, 3) and translations (..., 3) from camera spaces into steadier ones, by both cameras'
    world-to-camera rotations (..., 3, 3) and centres (..., 3)."""
    return steady @ np.swapaxes(rotation, -1, -2), np.einsum("...ij,...j->...i", steady, centre - there)


def steady_path(reconstruction: Reconstruction, strength: float, fills: bool = False) -> SteadyPath:
    """The path of a clip smoothed by a strength in (0, 1], at most as far as the clip shows.

    What it would see past the border of the clip's frames is cropped, or where it `fills`, left to what other
    frames have seen there, as far as `FILLED`. At 1 the camera moves on a line at a constant speed, or
    stands, and turns so. UserError for photos, fewer than three frames, and poses that are not finite.
    """
    if not reconstruction.is_ordered:
        raise UserError("photos have no camera path that could be stabilized; turn Stabilize off")
    own = _Path(reconstruction, FILLED if fills else 0.0)
    if len(own.frames) < 3:
        raise UserError("a path of fewer than three frames cannot be stabilized; turn Stabilize off")
    found = own.smoothed(strength)
    low, high = 0.0, strength
    for _ in range(TRIES if found is None else 0):
        middle = (low + high) / 2
        tried = own.smoothed(middle)
        low, high = (middle, high) if tried else (low, middle)
        found = tried or found
    return found or SteadyPath(own.frames, own.rotations, own.centres, 1.0, 0.0)


class _Path:
    """The path of a clip, and what its frames show."""

    def __init__(self, reconstruction: Reconstruction, beyond: float) -> None:
        self._rec, self._beyond = reconstruction, beyond
        self.frames = np.arange(reconstruction.frames[0], reconstruction.frames[-1] + 1).astype(np.int32)
        self._images = [reconstruction.image_at(int(frame))[0] for frame in self.frames]
        self.rotations = np.array([image.rotation for image in self._images])
        self.centres = np.array([image.centre for image in self._images])
        self._levels = np.array([self._inverse_depths(image) for image in self._images])
        self._camera = np.array([image.camera for image in self._images])
        self._turns = np.array([reconstruction.turn_at(int(frame)) for frame in self.frames])

    def _inverse_depths(self, image: Image) -> Floats:
        local, ahead = seen_by(image, self._rec, image.points)
        return np.percentile(1 / local[ahead, 2], LEVELS) if ahead.any() else np.zeros(len(LEVELS))

    @cached_property
    def _quaternions(self) -> Floats:
        """(n, 4), each nearer to the one before than its opposite is."""
        found = np.array([quaternion_from_matrix(rotation) for rotation in self.rotations])
        flips = np.where(np.sum(found[1:] * found[:-1], axis=1) < 0, -1.0, 1.0)
        return np.asarray(found * np.cumprod(np.append(1.0, flips))[:, None])

    def smoothed(self, strength: float) -> SteadyPath | None:
        """The path smoothed by a strength; None where the clip does not show what it would see."""
        both = np.column_stack([self.centres - self.centres[0], self._quaternions])
        smooth = _on_a_line(both) if strength >= 1 else _whittaker(both, _weight(strength))
        centres = smooth[:, :3] + self.centres[0]
        rotations = np.array([matrix_from_quaternion(each) for each in smooth[:, 3:]])
        turn, move = _between(self.rotations, self.centres, rotations, centres)
        zoom = max(self._zoom(number, turn, move) for number in np.unique(self._camera))
        if not zoom <= MOST_ZOOM:
            return None
        return SteadyPath(self.frames, rotations, centres, float(zoom), strength)

    def _zoom(self, number: int, turn: Floats, move: Floats) -> float:
        """Least zoom at which a clip's camera shows all that its steadier path sees; infinite where that is
        too much, or near and far things come too far apart."""
        camera, own = self._rec.cameras[number], self._camera == number
        spread = self._levels[own, -1] - self._levels[own, 0]
        apart = camera.fx * np.linalg.norm(move[own, :2], axis=1) * spread
        if not apart.max(initial=0.0) <= MOST_PARALLAX * camera.width:
            return float(np.inf)
        steady = _Steady(
            turn[own], move[own], self._levels[own], self._turns[own], self._rec.readout,
            self._beyond * camera.width,
        )  # fmt: skip
        if steady.is_shown(camera, 1.0):
            return 1.0
        low, high = 1.0, MOST_ZOOM
        if not steady.is_shown(camera, high):
            return float(np.inf)
        for _ in range(TRIES):
            middle = (low + high) / 2
            low, high = (low, middle) if steady.is_shown(camera, middle) else (middle, high)
        return high


@dataclass(frozen=True)
class _Steady:
    """Steadier cameras (n) beside those of a clip's frames."""

    turn: Floats
    """(n, 3, 3) from the frames' camera spaces into theirs."""
    move: Floats
    """(n, 3)"""
    levels: Floats
    """(n, k) inverse depths that they see."""
    turns: Floats
    """(n, 3) rotation vectors from the frames to the next."""
    readout: tuple[float, float]
    """As of `Reconstruction`."""
    beyond: float
    """Pixels past the border that count as shown."""

    def is_shown(self, camera: Intrinsics, zoom: float) -> bool:
        """Whether the frames of a camera show the whole border of what these see with a zoom."""
        size = np.array([camera.width, camera.height])
        along = np.linspace(0, 1, ALONG)
        sides = [np.column_stack([along, np.full(ALONG, end)]) for end in (0.0, 1.0)]
        border = np.concatenate([*sides, *(side[:, ::-1] for side in sides)]) * size
        plane = camera.undistort((border - camera.principal_point) / (camera.focal * zoom))
        rays = np.column_stack([plane, np.ones(len(plane))])
        # X' = R X + t, of points at 1/d along the steadier camera's rays.
        back = rays[None, None] - (self.move[:, None] * self.levels[..., None])[:, :, None]
        local = np.einsum("nji,nkbj->nkbi", self.turn, back)
        seen = camera.project(local)
        for _ in range(READINGS if any(self.readout) else 0):
            when = (seen / size - 0.5) @ np.asarray(self.readout)
            seen = camera.project(turned(local, self.turns[:, None, None], when))
        # A hundredth of a pixel is rounding.
        beyond = self.beyond + 0.01
        return bool(np.all((seen >= -beyond) & (seen <= size + beyond)))


def _weight(strength: float) -> float:
    """Weight of squared accelerations at which the wished period is halved: 1 / (1 + weight omega^4)."""
    period = min(PERIOD * strength / (1 - strength), LONGEST)
    return float((period / (2 * np.pi)) ** 4)


def _on_a_line(values: Floats) -> Floats:
    """(n, k) values as linear functions of their row, of least squares."""
    at = np.linspace(-1, 1, len(values))
    return np.asarray(values.mean(axis=0) + at[:, None] * (at @ values / (at @ at)))


def _whittaker(values: Floats, weight: float) -> Floats:
    """(n, k) smooth values z of least |z - values|^2 + weight |second differences of z|^2; Whittaker, "On a
    new method of graduation", 1923.

    The normal equations have five diagonals, and are solved by L D L^T (Eilers, "A perfect smoother", 2003).
    """
    count = len(values)
    second = np.array([1.0, -2.0, 1.0])
    diagonals = np.zeros((3, count))
    diagonals[0] = 1
    for away in range(3):
        for n in range(3 - away):
            diagonals[away, n : n + count - 2] += weight * second[n] * second[n + away]
    lower, pivot = np.zeros((3, count)), np.zeros(count)
    result = np.array(values, dtype=np.float64)
    for n in range(count):
        one, two = lower[1, n - 1] if n else 0.0, lower[2, n - 2] if n > 1 else 0.0
        before, first = pivot[n - 1], pivot[n - 2]
        pivot[n] = diagonals[0, n] - one**2 * before - two**2 * first
        lower[1, n] = (diagonals[1, n] - (lower[2, n - 1] * one * before if n else 0.0)) / pivot[n]
        lower[2, n] = diagonals[2, n] / pivot[n]
        result[n] -= one * result[n - 1] + two * result[n - 2]
    result /= pivot[:, None]
    for n in range(count - 2, -1, -1):
        result[n] -= lower[1, n] * result[n + 1]
        if n + 2 < count:
            result[n] -= lower[2, n] * result[n + 2]
    return result


def zoomed(camera: Intrinsics, zoom: float) -> Intrinsics:
    """A camera with a longer focal length that takes its picture at once, its lens's distortion and principal
    point as they are."""
    return replace(camera.read_at_once(), fx=camera.fx * zoom, fy=camera.fy * zoom)
