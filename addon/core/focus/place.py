"""Focus at a place of the picture: the surface of its pixel, by feature points if they are near."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..base.arrays import Floats, Ints
from ..base.errors import UserError
from ..camera.reconstruction import Reconstruction
from ..depth.source import NO_PICTURE, SURE, DepthSource, PixelDepth
from ..depth.sparse import FrameFeatures, frame_features
from ..media.picture_file import Pixels
from ..subjects.strokes import MarkedSubject
from .focus import Focus, check_points
from .follow import follow
from .picking import check_place, pick_features

NEAR = 0.06
"""Share of the picture's width within which the farthest of a place's four points lies. On the sample clip
with holes cut into its points, nine of ten picks are within a tenth of the range of inverse depths from the
dense depth; at 0.1 one of four is not, at 0.2 every second one."""
SAME = 0.05
"""Share of a frame's range of inverse depths by which the mean of the points around a pixel may differ from
the pixel: about a twentieth of the largest blur. Chosen by inspection."""
OTHER = 0.1
"""Share of this range from which one of the points is on another surface. Relative to the depth itself, all
far things are alike. Chosen by inspection, at silhouettes of the sample clip."""
NEAREST = "the nearest large object near the centre"
"""Source of the distance."""
WINDOW = 0.6
"""Share of the picture's width and height, around its middle, that is searched. Chosen by inspection."""
CELLS = 12
"""Cells along each side of the window; a cell counts once, however many features it has."""
LARGE = 0.15
"""Share of the window's cells with features that a thing must have. Chosen by inspection."""
THICK = 0.12
"""Relative difference of inverse depths within which features are on one thing. Chosen by inspection."""


@dataclass(frozen=True)
class Place:
    """The thing in focus at a place of a frame."""

    focus: Focus
    frame: int
    distance: float
    """Depth along the frame's optical axis, in the reconstruction's unit."""
    source: str
    """Source of the distance, in words for users."""
    world: Floats | None = None
    """(3,) where the place is, of one that no points follow and that stands still."""
    followed: Mapping[int, float] = field(default_factory=dict)
    """Distances by frame of a place on a moving object, as far as it could be followed."""
    xy: tuple[float, float] | None = None
    """Fractions of the picture at which it was picked, (0, 0) top left."""
    subject: str = ""
    """Kind of the subject in focus: "person", "face", "object", or the name of a marked subject."""
    marks: MarkedSubject | None = None
    """New subject of the clip that the place is on."""
    is_estimated: bool = False
    """True if the distance is uncertain: that at which the renderer draws the pixel."""
    is_automatic: bool = False
    """True if nobody picked the place."""

    @property
    def is_bare(self) -> bool:
        """Whether it is a distance alone, without points or a position in the picture."""
        return self.xy is None and not self.focus.points


@dataclass(frozen=True)
class Glance:
    """Immediate knowledge of a place, while the mouse moves."""

    distance: float | None
    """Depth along the optical axis, in the reconstruction's unit; None where it would have to be found."""
    places: Floats
    """(n, 2) fractions of the picture at which the features are seen that the depth comes from; none
    where it is the depth of the pixel."""


@dataclass(frozen=True)
class _Pixel:
    """The depth of the pixel at a place."""

    inverse_depth: float
    confidence: float
    moves: bool

    @property
    def is_sure(self) -> bool:
        """Return whether the pixel's depth is used before that of points."""
        return self.inverse_depth > 0 and self.confidence > SURE

    @property
    def is_known(self) -> bool:
        """Return whether the depth may be put in focus; moving objects are drawn at theirs, sure or not."""
        return self.inverse_depth > 0 and (self.moves or self.confidence > SURE)


class PlaceFinder:
    """Places of one registered frame; its features and its depth are read once."""

    def __init__(
        self,
        reconstruction: Reconstruction,
        depth: DepthSource,
        read: Callable[[int], Pixels],
        frame: int,
        subject_at: Callable[[float, float], Place | None] = lambda x, y: None,
        is_repaired: Callable[[float, float], bool] = lambda x, y: False,
    ) -> None:
        """Prepare for picks in a frame.

        Args:
            reconstruction: Solve of the clip.
            depth: Source of the depth of pixels.
            read: Returns a frame's picture (H, W, 3 or 4), in which moving objects are followed.
            frame: Number of the frame.
            subject_at: Returns the whole subject at fractions of the picture.
            is_repaired: Returns whether the user has repaired the depth at fractions of the picture, which
                comes before points and subjects there.

        Raises:
            UserError: The frame has no camera.
        """
        self.frame = frame
        self._rec, self._depth, self._read = reconstruction, depth, read
        self._subject_at, self.is_repaired = subject_at, is_repaired
        check_place(self._rec, frame, 0.5, 0.5)
        self._image, _ = self._rec.image_at(frame)
        self._canvas = self._rec.canvas(self._image)

    def glance(self, x: float, y: float) -> Glance:
        """Return immediate knowledge of fractions x, y of the picture."""
        nothing = np.zeros((0, 2))
        if self._known is None:
            return Glance(None, nothing)
        pixel = self._pixel(self._known, x, y)
        points, _ = self._points(x, y)
        if points is not None and (not pixel.is_sure or self._is_on(pixel, points)):
            return Glance(1 / self._inverse_depth(points), self._seen_at(points))
        return Glance(1 / pixel.inverse_depth if pixel.inverse_depth > 0 else None, nothing)

    def find(self, x: float, y: float, new_subject: Callable[[], Place | None] = lambda: None) -> Place:
        """Find what is in focus at a place of the picture, and its depth if it is not known yet.

        The whole of a subject that is there; else the surface that the very pixel shows: through the four
        points around that are near (`NEAR`) and on it, else by the pixel's own depth. Where that is not sure,
        the points that are near come first; without them, the place is estimated.

        Args:
            x: Share of the picture's width from the left.
            y: Share of its height from the top.
            new_subject: Returns the whole of a subject that is not known yet, or None. It is called where the
                depth is unknown or the pixel moves by itself, and comes first there.

        Returns:
            The place.

        Raises:
            UserError: The frame has neither depth nor points, or the place is outside of the picture.
        """
        check_place(self._rec, self.frame, x, y)
        is_repaired = self.is_repaired(x, y)
        if not is_repaired and (subject := self._subject_at(x, y)) is not None:
            return subject
        if self._known is None:
            self._known = self._depth.at(self.frame, self._canvas, NO_PICTURE)
        known = self._known
        pixel = _Pixel(0.0, 0.0, False) if known is None else self._pixel(known, x, y)
        points, away = (None, math.inf) if is_repaired else self._points(x, y)
        is_on_points = points is not None and (not pixel.is_sure or self._is_on(pixel, points))
        is_unknown = not (is_on_points or pixel.is_known)
        may_be_new = not is_repaired and (pixel.moves or is_unknown)
        if may_be_new and (subject := new_subject()) is not None:
            return subject
        if points is not None and is_on_points:
            numbers = ", ".join(map(str, points.points))
            source = f"points {numbers}, within {away:.0f} px of the place"
            return Place(points, self.frame, 1 / self._inverse_depth(points), source, xy=(x, y))
        origin = "nothing else" if known is None else known.origin
        if is_unknown:
            return self._estimated(x, y, pixel, origin)
        if known is not None and known.confidence is not None:
            origin += f", {100 * pixel.confidence:.0f}% sure"
        if pixel.moves:
            return self._followed(x, y, pixel.inverse_depth, origin)
        width = self._canvas.camera.width
        beside = (
            "repaired"
            if is_repaired
            else f"no four points are within {NEAR * width:.0f} px of the place"
            if points is None
            else "the points around it lie on something else"
        )
        distance = 1 / pixel.inverse_depth
        world = self._world(x, y, distance)
        return Place(Focus(distance=distance), self.frame, distance, f"{origin}; {beside}", world, xy=(x, y))

    def _estimated(self, x: float, y: float, pixel: _Pixel, origin: str) -> Place:
        """A place of uncertain depth, at the distance of its pixel as drawn, or of the features."""
        inverse = pixel.inverse_depth
        if not inverse > 0:
            if len(self._features.points) < 2:
                raise UserError(f"frame {self.frame} shows no depth at {x:g},{y:g}; pick in another frame")
            nearest = pick_features(self._features, self._canvas, x, y)
            inverse, origin = self._inverse_depth(nearest), "the nearest feature points"
        distance = 1 / inverse
        return Place(
            Focus(distance=distance), self.frame, distance, f"{origin}, estimated",
            self._world(x, y, distance), xy=(x, y), is_estimated=True,
        )  # fmt: skip

    def world(self, place: Place) -> Floats:
        """Return (3,) where a place of this frame is that was picked in the picture, at its distance."""
        assert place.xy is not None and place.frame == self.frame
        return self._world(*place.xy, place.distance)

    def _world(self, x: float, y: float, distance: float) -> Floats:
        pinhole = self._canvas.pinhole
        ray = pinhole.rays(self._click(x, y))
        return np.asarray(self._image.rotation.T @ (distance * ray - self._image.translation))

    def _followed(self, x: float, y: float, inverse: float, origin: str) -> Place:
        """A place on a moving object of an inverse depth, followed through the frames that show it."""
        at = np.array([x * self._canvas.camera.width, y * self._canvas.camera.height])
        followed = follow(self._rec, self._depth, self._read, self.frame, at, inverse)
        first, last = min(followed), max(followed)
        how_far = f"is followed from frame {first} to {last}" if last > first else "cannot be followed"
        # With the others: one depth alone may be off.
        distance = followed[self.frame]
        source = f"{origin}; it moves on its own and {how_far}"
        return Place(Focus(distance=distance), self.frame, distance, source, followed=followed, xy=(x, y))

    @cached_property
    def _features(self) -> FrameFeatures:
        return frame_features(self._rec, self.frame, self._canvas)

    @cached_property
    def _known(self) -> PixelDepth | None:
        return self._depth.kept(self.frame, self._canvas)

    def _pixel(self, depth: PixelDepth, x: float, y: float) -> _Pixel:
        """The depth of the pixel at fractions x, y of the picture."""
        (inverse,), (confidence,), (moves,) = depth.at_places(self._click(x, y)[None], self._canvas)
        return _Pixel(float(inverse), float(confidence), bool(moves))

    def _click(self, x: float, y: float) -> Floats:
        """(2,) pixels of the canvas."""
        camera = self._canvas.camera
        return np.asarray(
            self._canvas.features_from_source(np.array([[x * camera.width, y * camera.height]]))[0]
        )

    def _points(self, x: float, y: float) -> tuple[Focus | None, float]:
        """The points for a place, None if too far from it, and the distance (px) of the farthest one."""
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

    def _is_on(self, pixel: _Pixel, points: Focus) -> bool:
        """Whether points lie on the surface that a pixel of known depth shows, none across a silhouette."""
        inverse = self._features.inverse_depth[np.isin(self._features.points, points.points)]
        off = (inverse - pixel.inverse_depth) / self._range
        return not pixel.moves and bool(abs(off.mean()) <= SAME and np.abs(off).max() <= OTHER)

    @cached_property
    def _range(self) -> float:
        """From the 1st to the 99th percentile of the inverse depths that are known."""
        assert self._known is not None
        low, high = np.percentile(self._known.inverse_depth, [1, 99])
        return max(float(high - low), float(np.finfo(float).tiny))

    def _inverse_depth(self, focus: Focus) -> float:
        return focus.inverse_depth(self._rec, self.frame)


def shown_at(place: Place, reconstruction: Reconstruction, frame: int) -> tuple[float, float] | None:
    """Return the fractions of the picture, (0, 0) top left, where a frame shows a place.

    Occlusion is ignored, and places past the border have fractions outside [0, 1]. None where the position is
    not known, or behind the camera.
    """
    if place.frame == frame and place.xy is not None:
        return place.xy
    image, _ = reconstruction.image_at(frame)
    world = place.world
    if world is None and place.focus.points:
        world = reconstruction.points.xyz[check_points(reconstruction, place.focus.points)].mean(axis=0)
    if world is None or not (local := image.to_camera(world))[2] > 0:
        return None
    canvas = reconstruction.canvas(image)
    x, y = canvas.features_to_source(canvas.pinhole.project(local[None]))[0]
    return float(x / canvas.camera.width), float(y / canvas.camera.height)


def first_place(reconstruction: Reconstruction, frame: int) -> Place | None:
    """Return the nearest large thing near the middle of a frame, focused through its feature points.

    None where the frame shows too few features.
    """
    canvas = reconstruction.canvas(frame)
    features = frame_features(reconstruction, frame, canvas)
    size = np.array([canvas.camera.width, canvas.camera.height])
    xy = canvas.features_to_source(features.observed) / size
    inside = np.flatnonzero((np.abs(xy - 0.5) < WINDOW / 2).all(axis=1))
    if len(inside) < 2:
        inside = np.arange(len(xy))
    if len(inside) < 2:
        return None
    thing = inside[_nearest_large(xy[inside], features.inverse_depth[inside])]
    # A place on it, as near to the middle as can be; the points as of a click there, where those are its own.
    middle = thing[np.argsort(np.linalg.norm(xy[thing] - 0.5, axis=1), kind="stable")]
    x, y = (float(value) for value in np.clip(xy[middle[0]], 0, 1))
    focus = pick_features(features, canvas, x, y)
    if not np.isin(focus.points, features.points[thing]).all():
        around = np.argsort(np.linalg.norm(xy[thing] - [x, y], axis=1), kind="stable")[:4]
        focus = Focus(points=tuple(int(point) for point in features.points[thing[around]]))
    distance = 1 / focus.inverse_depth(reconstruction, frame)
    return Place(focus, frame, distance, NEAREST, xy=(x, y))


def _nearest_large(xy: Floats, inverse: Floats) -> Ints:
    """Rows of the features (n, 2), of inverse depth (n,), on the nearest large thing, or the largest."""
    cells = (np.clip((xy - 0.5) / WINDOW + 0.5, 0, 1 - 1e-9) * CELLS).astype(int) @ [1, CELLS]
    order = np.argsort(-inverse, kind="stable")
    # Nearest first, inverse depths fall: a thing is a run of them.
    falling = -inverse[order]
    ends = np.searchsorted(falling, falling * (1 - THICK), side="right")
    shares = [
        len(np.unique(cells[order[start:end]])) / len(np.unique(cells)) for start, end in enumerate(ends)
    ]
    large = np.flatnonzero(np.array(shares) >= LARGE)
    start = int(large[0]) if len(large) else int(np.argmax(shares))
    # A run may begin with stray points in front of the object: take the run with most overlap.
    rivals = np.arange(start, ends[start])
    start = int(rivals[np.argmax(np.array(shares)[rivals])])
    return np.asarray(order[start : ends[start]])
