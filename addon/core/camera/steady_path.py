"""A steadier path for the camera of a clip: smoothed turns and positions, and the crop that it needs.

Re-cinematography (Gleicher and Liu, 2008): views of the rebuilt scene are synthesized from the steadier
camera, which removes a shake of the hand with its parallax. Positions and quaternions are smoothed by
Whittaker's method, with the least sum of squared distances to the path and of squared accelerations; a
dolly's path stays unchanged. Smoothing is limited by the pixels that the clip shows.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..base.arrays import Floats, Ints
from ..base.errors import UserError
from .intrinsics import Intrinsics
from .reconstruction import Image, Reconstruction, matrix_from_quaternion, quaternion_from_matrix, seen_by
from .rolling_shutter import turned

PERIOD = 60.0
"""Frames of the period of a shake that is halved by a strength of 1/2: two seconds, as steps and breath take
less and moves that are meant take more. Chosen by inspection."""
LONGEST = 3000.0
"""Frames of the longest such period: beyond it the normal equations lose their last digits."""
MOST_ZOOM = 1.25
"""Largest enlargement that keeps the border outside: editors crop as much. Chosen by inspection."""
MOST_PARALLAX = 0.03
"""Change of the parallax between near and far things, as a share of the picture's width: the background it
uncovers was mostly seen by frames around. Chosen by inspection."""
FILLED = 0.08
"""Share of the picture's width past the border that a filled view may show: other frames' depth reaches a
tenth (`map_fusion.BEYOND`), and blur discs need a part of it."""
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
    """Strength of the smoothing in [0, 1]: less than the wished one where the clip does not show enough."""

    def seen_from(self, image: Image) -> tuple[Floats, Floats]:
        """Return rotation (3, 3) and translation (3,) from a frame's camera space into the steadier one.

        Translation is in scene units. Frames beyond the path have those of its end.
        """
        at = int(np.clip(image.frame - self.frames[0], 0, len(self.frames) - 1))
        return _between(image.rotation, image.centre, self.rotations[at], self.centres[at])


def _between(rotation: Floats, centre: Floats, steady: Floats, there: Floats) -> tuple[Floats, Floats]:
    """Rotations (..., 3, 3) and translations (..., 3) from camera spaces into those of steadier cameras."""
    return steady @ np.swapaxes(rotation, -1, -2), np.einsum("...ij,...j->...i", steady, centre - there)


def steady_path(reconstruction: Reconstruction, strength: float, fills: bool = False) -> SteadyPath:
    """Smooth the path of a clip.

    At strength 1 the camera moves on a line at a constant speed, or stands, and turns evenly.

    Args:
        reconstruction: Solve of the clip.
        strength: In (0, 1], reduced to the limit of visible pixels.
        fills: True if other frames fill the border up to `FILLED`; else it is cropped.

    Raises:
        UserError: Photos, fewer than three frames, or poses that are not finite.
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
    """The path of a clip, and the fields of view of its frames."""

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
        """Return the path smoothed by a strength; None where the clip does not show what it would see."""
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
        """Least zoom at which a frame covers the view of its steadier path; infinite if that is too much."""
        camera, own = self._rec.cameras[number], self._camera == number
        spread = self._levels[own, -1] - self._levels[own, 0]
        apart = camera.fx * np.linalg.norm(move[own, :2], axis=1) * spread
        if not apart.max(initial=0.0) <= MOST_PARALLAX * camera.width:
            return float(np.inf)
        if self._is_shown(number, turn[own], move[own], 1.0):
            return 1.0
        low, high = 1.0, MOST_ZOOM
        if not self._is_shown(number, turn[own], move[own], high):
            return float(np.inf)
        for _ in range(TRIES):
            middle = (low + high) / 2
            is_shown = self._is_shown(number, turn[own], move[own], middle)
            low, high = (low, middle) if is_shown else (middle, high)
        return high

    def _is_shown(self, number: int, turn: Floats, move: Floats, zoom: float) -> bool:
        """Return whether the frames of a camera cover the border of the zoomed views (n) of steadier ones."""
        camera, own, readout = self._rec.cameras[number], self._camera == number, self._rec.readout
        size = np.array([camera.width, camera.height])
        along = np.linspace(0, 1, ALONG)
        sides = [np.column_stack([along, np.full(ALONG, end)]) for end in (0.0, 1.0)]
        border = np.concatenate([*sides, *(side[:, ::-1] for side in sides)]) * size
        plane = camera.undistort((border - camera.principal_point) / (camera.focal * zoom))
        rays = np.column_stack([plane, np.ones(len(plane))])
        # X' = R X + t, of points at 1/d along the steadier camera's rays.
        back = rays[None, None] - (move[:, None] * self._levels[own][..., None])[:, :, None]
        local = np.einsum("nji,nkbj->nkbi", turn, back)
        seen = camera.project(local)
        for _ in range(READINGS if any(readout) else 0):
            when = (seen / size - 0.5) @ np.asarray(readout)
            seen = camera.project(turned(local, self._turns[own][:, None, None], when))
        # A hundredth of a pixel is rounding.
        beyond = self._beyond * camera.width + 0.01
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
    """(n, k) smooth values z of least |z - values|^2 + weight |second differences of z|^2.

    Whittaker, "On a new method of graduation", 1923. The normal equations have five diagonals, and are solved
    by L D L^T (Eilers, "A perfect smoother", 2003).
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
    """Return a camera with a longer focal length and a global shutter.

    Distortion and principal point of its lens are unchanged.
    """
    return replace(camera.read_at_once(), fx=camera.fx * zoom, fy=camera.fy * zoom)
