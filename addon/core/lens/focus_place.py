"""What is in focus at a place of the picture: the feature points there, or the dense depth where none are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..base.errors import UserError
from ..camera.canvas import Canvas
from ..camera.reconstruction import Floats, Reconstruction
from ..depth.multi_view_stereo import DenseDepth
from ..depth.sparse import frame_features
from .clip_context import ClipContext
from .focus import Focus, pick
from .focus_follow import follow
from .frame import NOTHING, SURE

NEAR = 0.06
"""Of the picture's width, how far from a place the farthest of its four points may be. Measured on the sample
clip with holes cut into its points: so near, nine picks of ten are within a tenth of the range of inverse
depths from the dense depth; at 0.1 one of four is not, at 0.2 every second one."""


@dataclass(frozen=True)
class Place:
    """What is in focus at a place of a frame."""

    focus: Focus
    frame: int
    distance: float
    """Depth along the frame's optical axis, in the reconstruction's unit."""
    source: str
    """What the distance was found from, for people."""
    world: Floats | None = None
    """(3,) where the place is, of one that no points follow and that stands still."""
    followed: Mapping[int, float] = field(default_factory=dict)
    """Distances by frame of a place on what moves by itself, as far as it could be followed."""

    def distances(self, reconstruction: Reconstruction) -> dict[int, float]:
        """By registered frame the depth of `world`, where it lies ahead of the camera, or what was
        followed."""
        if self.followed:
            return dict(self.followed)
        if self.world is None:
            return {}
        depths = {image.frame: float(image.to_camera(self.world)[2]) for image in reconstruction.images}
        return {frame: depth for frame, depth in depths.items() if depth > 0}


def find_place(clip: ClipContext, frame: int, x: float, y: float) -> Place:
    """What is in focus at fractions x, y of the picture (0, 0 = top left) of a registered frame.

    The points around, where four are near (`NEAR`); else the depth of the very pixel, the user's own or the
    clip's. Raises UserError where nothing is known of the place, and as `pick` does.
    """
    reconstruction = clip.reconstruction
    away = float("inf")
    try:
        focus = pick(reconstruction, frame, x, y)
    except UserError:
        # Without features the frame may have depth; any other reason stands.
        if not _has_no_features(reconstruction, frame):
            raise
    else:
        away = _farthest(reconstruction, frame, focus, x, y)
        if away <= NEAR * _width(reconstruction, frame):
            distance = 1 / focus.inverse_depth(reconstruction, frame)
            points = ", ".join(map(str, focus.points))
            return Place(focus, frame, distance, f"points {points}, within {away:.0f} px of the place")
    image, _ = reconstruction.image_at(frame)
    canvas = Canvas(reconstruction.intrinsics(image))
    click = canvas.features_from_source(np.array([[x * canvas.lens.width, y * canvas.lens.height]]))[0]
    beside = f"no four points are within {NEAR * canvas.lens.width:.0f} px of the place"
    given = _given(clip, frame, canvas, click)
    if given is not None:
        inverse, source, moves = given, f"your depth maps; {beside}", False
    else:
        inverse, confidence, moves = _dense(clip.stereo.at(frame), canvas, click)
        source = f"the clip's dense depth, {100 * confidence:.0f} % sure; {beside}"
        if not confidence > SURE:
            inverse = 0.0
    if not inverse > 0:
        nearest = f"its points are {away:.0f} px away" if np.isfinite(away) else "it has no points"
        raise UserError(
            f"nothing is known of the depth at {x:g},{y:g} of frame {frame}: {nearest}, and the clip's dense"
            " depth is not sure there; focus on a place with texture at the same distance, or give points or"
            " a distance"
        )
    distance = 1 / inverse
    if moves:
        at = np.array([x * canvas.lens.width, y * canvas.lens.height])
        followed = follow(clip, frame, at, inverse)
        first, last = min(followed), max(followed)
        told = f"and is followed from frame {first} to {last}" if last > first else "and cannot be followed"
        # With the others: one depth alone may be off.
        distance = followed[frame]
        where = f"{source}; it moves by itself {told}"
        return Place(Focus(distance=distance), frame, distance, where, followed=followed)
    pinhole = canvas.pinhole
    ray = np.append((click - pinhole.principal_point) / pinhole.focal, 1.0)
    world = image.rotation.T @ (distance * ray - image.translation)
    return Place(Focus(distance=distance), frame, distance, source, world)


def _has_no_features(reconstruction: Reconstruction, frame: int) -> bool:
    if frame not in reconstruction.frames:
        return False
    image, _ = reconstruction.image_at(frame)
    return len(frame_features(reconstruction, frame, Canvas(reconstruction.intrinsics(image))).points) < 2


def _farthest(reconstruction: Reconstruction, frame: int, focus: Focus, x: float, y: float) -> float:
    """Pixels of the source frame between a place and the farthest of the points in focus."""
    image, _ = reconstruction.image_at(frame)
    canvas = Canvas(reconstruction.intrinsics(image))
    features = frame_features(reconstruction, frame, canvas)
    seen = canvas.features_to_source(features.observed[np.isin(features.points, focus.points)])
    return float(np.linalg.norm(seen - [x * canvas.lens.width, y * canvas.lens.height], axis=1).max())


def _width(reconstruction: Reconstruction, frame: int) -> int:
    return reconstruction.intrinsics(reconstruction.image_at(frame)[0]).width


def _given(clip: ClipContext, frame: int, canvas: Canvas, place: Floats) -> float | None:
    """Inverse depth of the user's maps at a place (2,) of the canvas; None without a map of the frame."""
    given = clip.given_depth.at(frame, canvas, NOTHING) if clip.given_depth is not None else None
    if given is None:
        return None
    return float(given.inverse_depth[_pixel(place, given.inverse_depth.shape)])


def _dense(depth: DenseDepth, canvas: Canvas, place: Floats) -> tuple[float, float, bool]:
    """Inverse depth at a place (2,) of the canvas, the confidence in it, and whether it moves by itself."""
    shape = depth.inverse_depth.shape
    at = _pixel(place * [shape[1] / canvas.pinhole.width, shape[0] / canvas.pinhole.height], shape)
    return float(depth.inverse_depth[at]), float(depth.confidence[at]), bool(depth.moving[at])


def _pixel(place: Floats, shape: tuple[int, ...]) -> tuple[int, int]:
    column, row = np.clip(np.floor(place), 0, np.array(shape[1::-1]) - 1).astype(int)
    return int(row), int(column)
