"""Focus that is pulled from place to place: eased in time, and linear in inverse depth, as blur is."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ..base.errors import UserError
from ..camera.reconstruction import Floats, Reconstruction
from .focus_place import Place


def pull(places: Sequence[Place], reconstruction: Reconstruction, frames: Sequence[int]) -> dict[int, float]:
    """Distance of the focal plane, in the reconstruction's unit, at each of some frames.

    At its own frame each place is in focus. Between two the inverse depth goes from that of the one to that
    of the other by the smoothstep s = t^2 (3 - 2 t) of the time t between them: it starts and stops without a
    jolt, and blur discs grow and shrink evenly. Both places are followed meanwhile; before the first and
    after the last that one is. UserError for two places at the same frame.
    """
    order = sorted(places, key=lambda place: place.frame)
    for one, other in pairwise(order):
        if one.frame == other.frame:
            raise UserError(f"two places are to be in focus at frame {one.frame}; give each its own frame")
    at = np.array(frames)
    inverse = inverse_depths(order[0], reconstruction, frames)
    for one, other in pairwise(order):
        share = smoothstep((at - one.frame) / (other.frame - one.frame))
        # Those before are done once this one begins.
        towards = inverse_depths(other, reconstruction, frames)
        inverse = np.where(at > one.frame, (1 - share) * inverse + share * towards, inverse)
    return dict(zip(map(int, frames), (1 / inverse).tolist(), strict=True))


def smoothstep(time: Floats) -> Floats:
    """Shares of any shape: 0 up to time 0, 1 from time 1 on, smooth between, with no slope at either end."""
    held = np.clip(time, 0, 1)
    return np.asarray(held**2 * (3 - 2 * held))


def inverse_depths(place: Place, reconstruction: Reconstruction, frames: Sequence[int]) -> Floats:
    """(n,) inverse depth of a place at frames (n,), greater than zero.

    Where it lies behind the camera, or is lost, it is that of the nearest frame where it is not.
    """
    found = np.array([_inverse_depth(place, reconstruction, frame) for frame in frames])
    known = np.flatnonzero(found > 0)
    if not len(known):
        return np.full(len(frames), 1 / place.distance)
    at = np.array(frames)
    nearest = known[np.abs(at[known] - at[:, None]).argmin(axis=1)]
    return np.asarray(found[nearest])


def _inverse_depth(place: Place, reconstruction: Reconstruction, frame: int) -> float:
    """At a frame; 0 where the place lies behind its camera, or is lost."""
    if place.followed:
        return 1 / place.followed[frame] if frame in place.followed else 0.0
    if place.world is not None:
        depth = float(reconstruction.image_at(frame)[0].to_camera(place.world)[2])
        return 1 / depth if depth > 0 else 0.0
    try:
        return place.focus.inverse_depth(reconstruction, frame)
    except UserError:
        return 0.0
