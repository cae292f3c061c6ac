"""What is in focus at a place of the picture: the feature points there, or the dense depth where none are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..base.arrays import Floats
from ..base.errors import UserError
from ..camera.canvas import Canvas
from ..camera.reconstruction import Reconstruction
from ..depth.source import NO_PICTURE, SURE, DepthSource, PixelDepth
from ..depth.sparse import FrameFeatures, frame_features
from ..media.picture_file import Pixels
from .focus import Focus, check_points
from .follow import follow
from .picking import check_place, pick_features

NEAR = 0.06
"""Of the picture's width, how far from a place the farthest of its four points may be. Measured on the sample
clip with holes cut into its points: so near, nine picks of ten are within a tenth of the range of inverse
depths from the dense depth; at 0.1 one of four is not, at 0.2 every second one."""

OTHER = 0.1
"""Relative difference of inverse depths from which on points around a pixel are not on what it shows. By eye,
at silhouettes of the sample clip."""


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
    xy: tuple[float, float] | None = None
    """Fractions of the picture at which it was picked, (0, 0) top left."""


@dataclass(frozen=True)
class Glance:
    """What is known of a place at once, while the mouse moves."""

    distance: float | None
    """Depth along the optical axis, in the reconstruction's unit; None where it would have to be found."""
    places: Floats
    """(n, 2) fractions of the picture at which the features are seen that the depth comes from; none
    where it is the depth of the pixel."""


class PlaceFinder:
    """Places of one registered frame; its features and the depth that is known of it are read once.

    `use_known` lets depth of the pixel that need not be found, where it is sure, count before features around
    that lie on something else. The result then depends on what was found before.
    """

    def __init__(
        self,
        reconstruction: Reconstruction,
        depth: DepthSource,
        read: Callable[[int], Pixels],
        frame: int,
        use_known: bool = False,
    ) -> None:
        """`read` gives a frame's picture (H, W, 3 or 4), by which what moves is followed. UserError for a
        frame without a camera of its own."""
        self.frame = frame
        self._rec, self._depth, self._read, self._use_known = reconstruction, depth, read, use_known
        check_place(self._rec, frame, 0.5, 0.5)
        self._image, _ = self._rec.image_at(frame)
        self._canvas = Canvas(self._rec.intrinsics(self._image))

    def glance(self, x: float, y: float) -> Glance:
        """What is known of fractions x, y of the picture without finding anything."""
        known = self._known_depth(x, y) if self._use_known else None
        points, _ = self._points(x, y)
        if points is not None and not self._is_other(points, known):
            return Glance(1 / self._inverse_depth(points), self._seen_at(points))
        return Glance(1 / known if known else None, np.zeros((0, 2)))

    def find(self, x: float, y: float) -> Place:
        """What is in focus at fractions x, y of the picture (0, 0 = top left).

        The points around, where four are near (`NEAR`); else the depth of the very pixel. Raises UserError
        where nothing is known of the place, and outside of the picture.
        """
        check_place(self._rec, self.frame, x, y)
        canvas, frame = self._canvas, self.frame
        points, away = self._points(x, y)
        known = self._known_depth(x, y) if self._use_known else None
        if points is not None and not self._is_other(points, known):
            numbers = ", ".join(map(str, points.points))
            source = f"points {numbers}, within {away:.0f} px of the place"
            return Place(points, frame, 1 / self._inverse_depth(points), source, xy=(x, y))
        if points is not None:
            beside = "the points around lie on something else"
        else:
            beside = f"no four points are within {NEAR * canvas.camera.width:.0f} px of the place"
        click = self._click(x, y)
        found = self._depth.at(frame, canvas, NO_PICTURE)
        inverse, confidence, moves, source = 0.0, 0.0, False, ""
        if found is not None:
            at_click = found.at_places(click[None], canvas)
            inverse, confidence, moves = float(at_click[0][0]), float(at_click[1][0]), bool(at_click[2][0])
            sure = "" if found.confidence is None else f", {100 * confidence:.0f} % sure"
            source = f"{found.origin}{sure}; {beside}"
        if not confidence > SURE:
            inverse = 0.0
        if not inverse > 0:
            nearest = f"its points are {away:.0f} px away" if np.isfinite(away) else "it has no points"
            unsure = found.origin if found is not None else "nothing else"
            raise UserError(
                f"nothing is known of the depth at {x:g},{y:g} of frame {frame}: {nearest}, and {unsure} is"
                " not sure there; focus on a place with texture at the same distance, or give points or a"
                " distance"
            )
        distance = 1 / inverse
        if moves:
            at = np.array([x * canvas.camera.width, y * canvas.camera.height])
            followed = follow(self._rec, self._depth, self._read, frame, at, inverse)
            first, last = min(followed), max(followed)
            followed_text = (
                f"and is followed from frame {first} to {last}" if last > first else "and cannot be followed"
            )
            # With the others: one depth alone may be off.
            distance = followed[frame]
            where = f"{source}; it moves by itself {followed_text}"
            return Place(Focus(distance=distance), frame, distance, where, followed=followed, xy=(x, y))
        pinhole = canvas.pinhole
        ray = np.append((click - pinhole.principal_point) / pinhole.focal, 1.0)
        world = self._image.rotation.T @ (distance * ray - self._image.translation)
        return Place(Focus(distance=distance), frame, distance, source, world, xy=(x, y))

    @cached_property
    def _features(self) -> FrameFeatures:
        return frame_features(self._rec, self.frame, self._canvas)

    @cached_property
    def _known(self) -> PixelDepth | None:
        return self._depth.kept(self.frame, self._canvas)

    def _click(self, x: float, y: float) -> Floats:
        """(2,) pixels of the canvas."""
        camera = self._canvas.camera
        return np.asarray(
            self._canvas.features_from_source(np.array([[x * camera.width, y * camera.height]]))[0]
        )

    def _points(self, x: float, y: float) -> tuple[Focus | None, float]:
        """The points for a place where they are near, and how far, in pixels of the source frame, the
        farthest of them, or of those that are too far, is."""
        # Without features the frame may have depth.
        if len(self._features.points) < 2:
            return None, float("inf")
        focus = pick_features(self._features, self._canvas, x, y)
        width, height = self._canvas.camera.width, self._canvas.camera.height
        seen = self._seen_at(focus) * [width, height]
        away = float(np.linalg.norm(seen - [x * width, y * height], axis=1).max())
        return (focus if away <= NEAR * width else None), away

    def _seen_at(self, focus: Focus) -> Floats:
        """(n, 2) fractions of the picture at which the frame shows the points in focus."""
        camera = self._canvas.camera
        observed = self._features.observed[np.isin(self._features.points, focus.points)]
        return np.asarray(self._canvas.features_to_source(observed) / [camera.width, camera.height])

    def _inverse_depth(self, focus: Focus) -> float:
        return focus.inverse_depth(self._rec, self.frame)

    def _is_other(self, points: Focus, known: float | None) -> bool:
        """Whether depth that is known of the pixel says that points around it are on something else."""
        return known is not None and abs(self._inverse_depth(points) - known) > OTHER * known

    def _known_depth(self, x: float, y: float) -> float | None:
        """Inverse depth of a place that need not be found; None where it is not sure."""
        if self._known is None:
            return None
        (inverse,), (confidence,), _ = self._known.at_places(self._click(x, y)[None], self._canvas)
        return float(inverse) if confidence > SURE and inverse > 0 else None


def shown_at(place: Place, reconstruction: Reconstruction, frame: int) -> tuple[float, float] | None:
    """Fractions of the picture at which a frame would show a place, (0, 0) top left, whether something is
    before it or not and also past the picture's border; None where that is not known, or behind the camera.
    """
    if place.frame == frame and place.xy is not None:
        return place.xy
    image, _ = reconstruction.image_at(frame)
    world = place.world
    if world is None and place.focus.points:
        world = reconstruction.points.xyz[check_points(reconstruction, place.focus.points)].mean(axis=0)
    if world is None or not (local := image.to_camera(world))[2] > 0:
        return None
    canvas = Canvas(reconstruction.intrinsics(image))
    x, y = canvas.features_to_source(canvas.pinhole.project(local[None]))[0]
    return float(x / canvas.camera.width), float(y / canvas.camera.height)
