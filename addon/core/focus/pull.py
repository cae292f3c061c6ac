"""Focus that is pulled from mark to mark: eased in time, and linear in inverse depth, as blur is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..base.arrays import Floats
from ..base.errors import UserError
from ..camera.reconstruction import Reconstruction
from .place import Place, shown_at


@dataclass(frozen=True)
class FocusMark:
    """The focus at a frame."""

    frame: int
    places: tuple[Place, ...]
    """One or more, perhaps picked in other frames; the mean of their inverse depths is in focus."""
    easing: str = "SMOOTH"
    """How focus goes to this mark from the one before, a key of `EASINGS`."""
    pull: int = 0
    """Frames before the mark in which it goes there; 0 takes all since the mark before."""
    holds: bool = False
    """True if the distance at the mark's own frame is kept; otherwise its places are followed."""
    name: str = ""
    """Name for users; empty for one made from the places."""

    @classmethod
    def of(cls, place: Place) -> FocusMark:
        """Return a place at the frame that it was picked in."""
        return cls(place.frame, (place,))

    def inverse_depths(self, reconstruction: Reconstruction, frames: Sequence[int]) -> Floats:
        """Return the inverse depths (n,) at frames (n,); see the function of this name."""
        asked = [self.frame] if self.holds else frames
        found = np.mean([inverse_depths(place, reconstruction, asked) for place in self.places], axis=0)
        return np.asarray(np.broadcast_to(found, len(frames)) if self.holds else found)


def pull(
    marks: Sequence[FocusMark], reconstruction: Reconstruction, frames: Sequence[int]
) -> dict[int, float]:
    """Distance of the focal plane, in the reconstruction's unit, at each of some frames.

    At its own frame each mark is in focus. Between two the inverse depth goes from that of the one to that
    of the other by the easing of the time between them, or of its last frames where the mark has a pull of
    its own: it arrives on the mark. Both marks are followed meanwhile; before the first and after the last
    that one is. UserError for two marks at the same frame.
    """
    order = sorted(marks, key=lambda mark: mark.frame)
    for one, other in pairwise(order):
        if one.frame == other.frame:
            raise UserError(f"two focus marks are at frame {one.frame}; give each its own frame")
    at = np.array(frames)
    inverse = np.zeros(len(at))
    before = at <= order[0].frame
    inverse[before] = order[0].inverse_depths(reconstruction, at[before].tolist())
    for one, other in pairwise(order):
        between = (at > one.frame) & (at <= other.frame)
        now = at[between].tolist()
        begin = max(other.frame - other.pull, one.frame) if other.pull else one.frame
        time = np.clip((at[between] - begin) / (other.frame - begin), 0, 1)
        share = EASINGS[other.easing](time)
        from_one, to_other = (mark.inverse_depths(reconstruction, now) for mark in (one, other))
        inverse[between] = (1 - share) * from_one + share * to_other
    after = at > order[-1].frame
    inverse[after] = order[-1].inverse_depths(reconstruction, at[after].tolist())
    return dict(zip(map(int, frames), (1 / inverse).tolist(), strict=True))


def smoothstep(time: Floats) -> Floats:
    """Return shares of any shape: 0 up to time 0, 1 from time 1 on, with a smooth transition."""
    held = np.clip(time, 0, 1)
    return np.asarray(held**2 * (3 - 2 * held))


EASINGS: dict[str, Callable[[Floats], Floats]] = {
    "SMOOTH": smoothstep,
    "LINEAR": lambda time: time,
    "EASE_IN": np.square,
    "EASE_OUT": lambda time: 1 - (1 - time) ** 2,
    "CUT": lambda time: np.floor(time),
}
"""Shares (n,) of the way to a mark, by shares (n,) of the time from 0 to 1."""


def inverse_depths(place: Place, reconstruction: Reconstruction, frames: Sequence[int]) -> Floats:
    """Return (n,) inverse depth of a place at frames (n,), greater than zero.

    Where it lies behind the camera, or is lost, it is that of the nearest frame where it is not, of those and
    the one that it was picked in.
    """
    if not len(frames):
        return np.zeros(0)
    sampled = [*frames, place.frame]
    found = np.array([_inverse_depth(place, reconstruction, frame) for frame in sampled])
    known = np.flatnonzero(found > 0)
    if not len(known):
        return np.full(len(frames), 1 / place.distance)
    at = np.array(sampled)
    return np.asarray(found[known[np.abs(at[known] - at[:-1, None]).argmin(axis=1)]])


def unseen(marks: Sequence[FocusMark], reconstruction: Reconstruction, frames: Sequence[int]) -> list[int]:
    """Return the frames, of those given, that do not show any place of the mark that is followed there.

    A place is shown where a point of it is seen, where it lies within the picture, or where it could be
    followed. Between two marks both are followed. A distance, bare or held, is shown everywhere.
    """
    order = sorted(marks, key=lambda mark: mark.frame)
    at = np.array(frames)
    hidden = np.zeros(len(at), dtype=bool)
    for number, mark in enumerate(order):
        low = order[number - 1].frame if number else -np.inf
        high = order[number + 1].frame if number + 1 < len(order) else np.inf
        for row in () if mark.holds else np.flatnonzero((at > low) & (at < high)):
            shown = any(_is_shown(place, reconstruction, int(at[row])) for place in mark.places)
            hidden[row] |= not shown
    return [int(frame) for frame in at[hidden]]


def _is_shown(place: Place, reconstruction: Reconstruction, frame: int) -> bool:
    image, _ = reconstruction.image_at(frame)
    if place.followed:
        return frame in place.followed
    if place.world is not None:
        at = shown_at(place, reconstruction, frame)
        return at is not None and all(0 <= each <= 1 for each in at)
    if not place.focus.points:
        return True
    return bool(np.isin(image.points, place.focus.points).any())


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
