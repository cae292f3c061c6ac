"""Where a moving object stands: the ground around it, and the line along which it touches that.

Coordinates are those of a pinhole camera: x right, y down, z forward, in scene units; a ray is (x / z, y / z,
1). Constants are chosen by inspection on scenes with true depth, where no other reason is given.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ..base.arrays import Floats, Map, Mask
from ..camera.intrinsics import Intrinsics

BESIDE = 0.5
"""Width, as a share of an object's larger side, of the area around its lowest part searched for ground."""
ABOVE = 0.15
"""The same upwards: ground behind feet."""
BELOW = 0.3
"""The same downwards."""
GAP = 3
"""Pixels around what moves whose depth may be a mixture."""
TOLERANCE = 0.03
"""Share of its inverse depth by which a pixel of the ground may leave the plane."""
TRIES = 64
"""Samples of RANSAC: with half of the pixels on the plane, all fail once in 5,000 objects."""
LEAST_PIXELS = 60
"""Least pixels of a plane."""
LEAST_SHARE = 0.5
"""Share of the pixels there that must lie on the plane."""
LEAST_RISE = 0.8
"""Cosine between the plane's normal and the picture's vertical from which on it is a ground, 37 degrees. With
0.5 a cow, a scooter and a dog leaned by 40 to 58 degrees: details were 0.72 to 0.85, with this 0.95 to 1."""
MOST_ROLL = 0.35
"""Sine of the largest roll of a ground, 20 degrees: guessed depth of a dark floor rolls by more."""
STEEPEST = 1.0
"""Depth over width of a line of contact, 45 degrees at most: a lifted paw seems to be on the ground far
behind. With 1.7 an animal's depth is off by up to 0.3 from single frames, with this by 0.02."""
LEAST_WIDTH = 0.5
"""Share of an object's width along which it must touch the ground for its sides to be at different depths."""
FOOT = 4
"""Pixels below an object's outline, past `GAP`, that show what it stands on. Chosen by inspection."""
SEEN_THROUGH = 0.5
"""Share of the pixels below an object that may lie behind a ground, by twice `TOLERANCE`: ground hides things
behind it. The low, wide rail of the bench's fence is a plane that leans by any angle, and was sometimes the
ground of the tram behind it: 28.4 instead of 34.0 dB (32 px, from the video alone)."""
DOMINANT = 0.75
"""Share of the pixels around an object on a plane from which it is a ground even if pixels below the object
lie behind it: depth is wrong beneath the feet of a man walking away, which frames around hide."""
BORDER = 3
"""Pixels from the picture's lower border within which an object may go on beyond."""
HIDDEN, NEARER = 0.9, 1.25
"""Quantile of inverse depths behind an object, as single ones are errors, and the ratio by which it is
nearer, assumed: at least a person cut off at the knees is, where the ground at the border is the nearest."""


@dataclass(frozen=True)
class Plane:
    """A plane in a camera's space: `normal` @ X = 1."""

    normal: Floats
    """(3,) in 1 / scene units; away from the camera."""

    def inverse_depth(self, rays: Floats) -> Floats:
        """Return 1 / z (...) where rays (..., 3) meet the plane; not positive where they do not."""
        return np.asarray(rays @ self.normal)

    def seen_from(self, rotation: Floats, translation: Floats) -> Plane | None:
        """Return the plane in another camera's space; None if that camera lies in it.

        The other camera's X is rotation (3, 3) @ X + translation (3,).
        """
        turned = rotation @ self.normal
        distance = 1 + turned @ translation
        return Plane(turned / distance) if distance > 1e-6 else None

    def directions(self, column: float) -> tuple[Floats, Floats, Floats]:
        """Return the plane's axes for a column x / z of the picture, unit vectors (3,).

        They point off the plane towards the camera; along it away from the camera; along it to the right.
        """
        up = -self.normal / np.linalg.norm(self.normal)
        ray = np.array([column, 0.0, 1.0])
        forward = ray - (ray @ up) * up
        forward = forward / np.linalg.norm(forward)
        return up, forward, np.cross(forward, up)


@dataclass(frozen=True)
class Contact:
    """The contact of an object with the ground."""

    place: Floats
    """(3,) nearest place of contact, in the camera's space."""
    column: float
    """x / z of the middle of the object."""
    slope: float
    """Slope of the line of contact: distance along the ground away from the camera over that to the right."""

    def inverse_depth(self, slope: float, ground: Plane) -> float:
        """Return 1 / z of the ground below the object's middle, on a line through the place with a slope."""
        _, forward, right = ground.directions(self.column)
        along = right + slope * forward
        x, _, z = self.place
        share = (self.column * z - x) / (along[0] - self.column * along[2])
        return float(1 / (z + share * along[2]))


def ground_below(mask: Mask, inverse: Map, known: Mask, pinhole: Intrinsics) -> Plane | None:
    """Find the plane of the ground around the lowest part of an object.

    RANSAC (Fischler and Bolles, 1981) and least squares over the inliers: a plane's inverse depth is linear
    in the picture.

    Args:
        mask: (h, w) the object.
        inverse: (h, w) inverse depths.
        known: (h, w) pixels with a depth.
        pinhole: That of the picture.

    Returns:
        The plane; None if no plane there is a ground.
    """
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    side, bottom = max(np.ptp(rows), np.ptp(columns)) + 1, rows[-1]
    top, end = max(bottom - int(ABOVE * side), 0), bottom + int(BELOW * side) + GAP + 2
    left = max(columns[0] - int(BESIDE * side), 0)
    part = np.s_[top:end, left : columns[-1] + int(BESIDE * side)]
    row, column = np.nonzero(known[part])
    if len(row) < LEAST_PIXELS:
        return None
    rays = pinhole.rays(np.column_stack([column + left + 0.5, row + top + 0.5]))
    values = inverse[part][row, column].astype(np.float64)
    random = np.random.default_rng(0)
    chosen = random.integers(len(rays), size=(TRIES, 3))
    samples = rays[chosen]
    flat = np.abs(np.linalg.det(samples)) > 1e-9
    if not flat.any():
        return None
    normals = np.linalg.solve(samples[flat], values[chosen][flat][..., None])[..., 0]
    few = random.integers(len(rays), size=min(len(rays), 1500))
    agree = _agree(rays[few] @ normals.T, values[few, None])
    foot = _foot(mask[part])[row, column]
    # The larger part may be an upright surface behind, or a rail in front.
    possible = np.array([_is_ground(normal) for normal in normals])
    share = agree.mean(axis=0)
    possible &= ~_seen_through(rays[foot] @ normals.T, values[foot, None]) | (share >= DOMINANT)
    agree = np.where(possible, share, 0)
    best = normals[int(agree.argmax())]
    for _ in range(2):
        inside = _agree(rays @ best, values)
        if np.count_nonzero(inside) < LEAST_PIXELS:
            return None
        best = np.linalg.lstsq(rays[inside], values[inside], rcond=None)[0]
    whole = float(_agree(rays @ best, values).mean())
    hides = whole >= DOMINANT or not _seen_through(rays[foot] @ best, values[foot])
    return Plane(best) if whole >= LEAST_SHARE and hides and _is_ground(best) else None


def _foot(mask: Mask) -> Mask:
    """(h, w) what is seen just below an object's (h, w) lower outline."""
    height = len(mask)
    bottoms = height - np.argmax(mask[::-1], axis=0)
    below = np.arange(height)[:, None] - bottoms
    return np.asarray(mask.any(axis=0) & (below >= 0) & (below < GAP + FOOT))


def _seen_through(plane: Floats, values: Floats) -> Mask:
    """(...) whether inverse depths (n, ...) are mostly behind planes (n, ...) that would hide them."""
    if not len(values):
        return np.zeros(plane.shape[1:], bool)
    behind = values < plane * (1 - 2 * TOLERANCE)
    return np.asarray(behind.mean(axis=0) > SEEN_THROUGH)


def _agree(plane: Floats, values: Floats) -> Mask:
    """Return whether inverse depths agree with a plane's."""
    return np.abs(plane - values) <= TOLERANCE * values


def _is_ground(normal: Floats) -> bool:
    length = np.linalg.norm(normal)
    return bool(normal[1] > LEAST_RISE * length and abs(normal[0]) < MOST_ROLL * length)


def contact(mask: Mask, ground: Plane, pinhole: Intrinsics) -> Contact | None:
    """Return the contact of an object (h, w) with the ground; None if it is out of the picture.

    The lower convex hull of the outline touches the ground at its corners and along the lines between them:
    at wheels, paws, feet. Beyond the corners that can be one side of the object, the hull leads up to
    hovering parts.
    """
    columns = np.flatnonzero(mask.any(axis=0))
    height = mask.shape[0]
    bottoms = height - np.argmax(mask[::-1, columns], axis=0)
    if not len(columns) or bottoms.max() >= height - BORDER:
        return None
    outline = np.column_stack([columns + 0.5, bottoms]).astype(np.float32)
    hull = cv2.convexHull(outline).reshape(-1, 2).astype(np.float64)
    hull = hull[np.argsort(hull[:, 0], kind="stable")]
    chord = np.interp(hull[:, 0], hull[[0, -1], 0], hull[[0, -1], 1])
    rays = pinhole.rays(hull[hull[:, 1] >= chord - 1e-6])
    inverse = ground.inverse_depth(rays)
    if inverse.max() <= 0:
        return None
    # Rays above the horizon meet no ground.
    seen = inverse > 1e-3 * inverse.max()
    places = rays[seen] / inverse[seen, None]
    nearest = int(inverse[seen].argmax())
    column = float(pinhole.rays(np.array([columns.mean() + 0.5, 0.0]))[0])
    _, forward, right = ground.directions(column)
    across, along = places @ right, places @ forward
    gentle = np.abs(np.diff(along)) <= STEEPEST * np.abs(np.diff(across))
    first = nearest - int(np.argmin(np.append(gentle[:nearest][::-1], False)))
    last = nearest + int(np.argmin(np.append(gentle[nearest:], False)))
    own = rays[seen][[first, last], 0]
    width = np.ptp(pinhole.rays(outline[[0, -1]].astype(np.float64))[:, 0])
    if np.ptp(own) < LEAST_WIDTH * width or first == last:
        return Contact(places[nearest], column, 0.0)
    slope = (along[last] - along[first]) / (across[last] - across[first])
    return Contact(places[nearest], column, float(slope))


def beside(mask: Mask, inverse: Map, known: Mask) -> float:
    """Return the inverse depth beside an object (h, w) at the picture's lower border; 0 if it ends above.

    It is that of the farther side: on the other one something may stand before the object. Arguments as of
    `ground_below`.
    """
    columns = np.flatnonzero(mask[-BORDER:].any(axis=0))
    if not len(columns):
        return 0.0
    first, end = columns[0], columns[-1] + 1
    sides = slice(max(2 * first - end, 0), first), slice(end, 2 * end - first)
    seen = [inverse[-BORDER:, side][known[-BORDER:, side]] for side in sides]
    return min((float(np.median(each)) for each in seen if len(each)), default=0.0)


def upright(base: float, column: float, slope: float, ground: Plane, rays: Floats) -> Floats:
    """Return the inverse depth (...) along rays (..., 3) of an upright plane on the ground.

    Below its `column` x / z the ground has the inverse depth `base`; `slope` is that of `Contact`.
    """
    normal = ground.normal
    foot = np.array([column, (base - normal[0] * column - normal[2]) / normal[1], 1.0])
    up, forward, right = ground.directions(column)
    facing = np.cross(up, right + slope * forward)
    return np.asarray(rays @ facing * (base / (facing @ foot)))
