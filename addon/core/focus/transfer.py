"""A focus carried from one reconstruction of a clip to another one of the same clip."""

from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Floats
from ..camera.reconstruction import Reconstruction, seen_by
from ..depth.sparse import FrameFeatures, frame_features
from .focus import FEWEST_IN_PLANE, Focus
from .place import Place

NEAR = 0.006
"""Share of the picture's width around a point's new place: 4 pixels of 640. Chosen by inspection."""
UNLIKE = 0.2
"""Relative difference of inverse depths, scales brought together, above which a place close by is another
surface, past a silhouette."""
SAME = 0.002
"""Share of the picture's width within which features of both solves are the same: 1.3 pixels of 640."""
ENOUGH = 10
"""Features in both solves from which they give a better scale than the medians."""


@dataclass(frozen=True)
class Refocus:
    """A focus and a scale of lengths, carried to another solve."""

    focus: Focus
    """Focus with point IDs of the new reconstruction; none where their places are not seen there."""
    scale: float
    """New scene units for one old unit: a reconstruction has an arbitrary scale."""


def carry_focus(old: Reconstruction, new: Reconstruction, focus: Focus, frame: int) -> Refocus:
    """Return the focus on the same places of the pictures, for a clip that was solved again.

    The place of a picked point is its observation in the frame nearest to the pick. Two points at least must
    be found again, three of a plane, or all if fewer were picked.
    """
    common = np.intersect1d(old.frames, new.frames)
    if not len(common):
        return Refocus(Focus(distance=focus.distance), 1.0)
    order = common[np.argsort(np.abs(common - frame), kind="stable")]
    nearest = int(order[0])
    scale = depth_ratio(old, new, nearest)
    distance = None if focus.distance is None else focus.distance * scale
    found: list[int] = []
    features: dict[int, FrameFeatures] = {}
    for point in focus.points:
        for each in map(int, order):
            place = _place(old, each, point)
            if place is None:
                continue
            if each not in features:
                features[each] = frame_features(new, each, new.canvas(each))
            match = _match(features[each], new, each, place[0], place[1] / scale)
            found += [] if match is None or match in found else [match]
            break
    enough = len(found) >= min(FEWEST_IN_PLANE if focus.through_points else 2, len(focus.points))
    return Refocus(Focus(tuple(found) if enough else (), distance), scale)


def carry_place(old: Reconstruction, new: Reconstruction, place: Place) -> Place:
    """Return a picked place for a clip that was solved again.

    It is on the same points if they are found again; else at the depth of its pixel; else at its distance.
    """
    carried = carry_focus(old, new, place.focus, place.frame)
    distance, scale = place.distance * carried.scale, carried.scale
    if carried.focus.points:
        focus = Focus(carried.focus.points, through_points=place.focus.through_points)
        return replace(place, focus=focus, distance=distance)
    focus = Focus(distance=distance)
    if place.followed:
        followed = {frame: away * scale for frame, away in place.followed.items()}
        return replace(place, focus=focus, distance=distance, followed=followed)
    if place.xy is None or (place.world is None and not place.focus.points) or place.frame not in new.frames:
        return replace(place, focus=focus, distance=distance, world=None)
    image, canvas = new.image_at(place.frame)[0], new.canvas(place.frame)
    click = np.array([place.xy]) * [canvas.camera.width, canvas.camera.height]
    pinhole = canvas.pinhole
    ray = (canvas.features_from_source(click)[0] - pinhole.principal_point) / pinhole.focal
    world = image.rotation.T @ (distance * np.append(ray, 1.0) - image.translation)
    return replace(place, focus=focus, distance=distance, world=world)


def depth_ratio(old: Reconstruction, new: Reconstruction, frame: int) -> float:
    """Return the number of new units in one unit of the old solve, by the depths of a common frame."""
    ones, others = (frame_features(each, frame, each.canvas(frame)) for each in (old, new))
    if not (len(ones.points) and len(others.points)):
        return 1.0
    place = new.canvas(frame).features_to_source(others.observed)
    ratios = []
    for xy, inverse in zip(
        old.canvas(frame).features_to_source(ones.observed), ones.inverse_depth, strict=True
    ):
        away = np.linalg.norm(place - xy, axis=1)
        closest = int(np.argmin(away))
        if away[closest] < SAME * new.canvas(frame).camera.width:
            ratios.append(inverse / others.inverse_depth[closest])
    if len(ratios) >= ENOUGH:
        return float(np.median(ratios))
    return float(np.median(ones.inverse_depth) / np.median(others.inverse_depth))


def _place(old: Reconstruction, frame: int, point: int) -> tuple[Floats, float] | None:
    """(2,) pixels of the source frame where a point was tracked, and its inverse depth; else None."""
    image, _ = old.image_at(frame)
    row = np.flatnonzero(image.points == point)
    local, ahead = seen_by(image, old, np.array([point], np.int32))
    if not (len(row) and ahead[0]):
        return None
    return image.xy[row[0]], 1.0 / float(local[0, 2])


def _match(
    features: FrameFeatures, new: Reconstruction, frame: int, place: Floats, inverse_depth: float
) -> int | None:
    """The point of the feature nearest to a place (2,) in pixels, of those of about that inverse depth."""
    away = np.linalg.norm(new.canvas(frame).features_to_source(features.observed) - place, axis=1)
    like = np.abs(features.inverse_depth - inverse_depth) < UNLIKE * inverse_depth
    away[~like] = np.inf
    if not len(away) or away.min() > NEAR * new.canvas(frame).camera.width:
        return None
    return int(features.points[np.argmin(away)])
