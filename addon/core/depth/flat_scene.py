"""Depth of a clip without parallax: a level ground, a far wall, and subjects upright on the ground."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np

from ..base.arrays import Floats, LinearRGBA, Map, Mask
from ..base.lru_cache import LRUCache
from ..camera.canvas import Canvas
from ..camera.reconstruction import Image, Reconstruction, level_axes, typical_distance
from .matte import opacity_over, outlined
from .source import DepthSource, PixelDepth
from .sparse import COLUMNS, DepthSamples
from .subject_depth import Subject

ORIGIN = "an estimate from where its subjects stand: the clip shows no depth"
ADULT, CAMERA = 1.7, 1.5
"""Mean height of adults, and height of the camera above the ground, in metres. Assumed, as all constants here
that name no measurement: three real clips were looked at."""
PERSON, SHOULDERS = ADULT / CAMERA, 0.45 / CAMERA
"""Height and width of a person in heights of the camera."""
SPREAD, UNSURE, OUTLIER = 0.1, 0.2, 3.0
"""Standard deviations of the logarithm of people's heights within a clip, and of `PERSON`; and the multiple
of the first beyond which a height counts no more, as of people that bend down or sit."""
PITCHES = np.linspace(-1, 1, 401)
"""Tangents of the angle by which the horizon may be below the middle of the picture."""
LEVEL = 0.5
"""Standard deviation of this tangent among clips."""
INDEPENDENT = 10
"""Outlines that count: those of one person in several frames are alike."""
BEYOND, BEHIND = 4.0, 2.0
"""Distance of the wall, in those of the nearest and of the farthest subject, at least."""
BESIDE = 1.6
"""Ratio of widths within which subjects without visible feet are equally far: a turning person gets
narrower."""
SHALLOWEST = 0.02
"""Tangent below the horizon of the farthest feet whose distance is known."""
BORDER = 2
"""Pixels from the border of a mask within which it is cut off."""


@dataclass(frozen=True)
class Outline:
    """The extent of an upright subject in a frame. Rays (3,) are along world axes, of depth 1."""

    foot: Floats | None
    """Ray of the lowest place; None where the picture cuts it off."""
    head: Floats | None
    """The same of the highest one."""
    width: float
    """Width over depth, the median over rows."""


def outline(mask: Mask, image: Image, canvas: Canvas) -> Outline | None:
    """Measure the largest connected part of a mask (h, w) over a source frame; None where it is empty."""
    number, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    if number < 2:
        return None
    part = labels == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    rows = np.flatnonzero(part.any(axis=1))
    zoom = canvas.camera.width / mask.shape[1]

    def ray(row: int, edge: float) -> Floats:
        place = zoom * np.array([[np.flatnonzero(part[row]).mean() + 0.5, row + edge]])
        return np.asarray(canvas.pinhole.rays(canvas.features_from_source(place)[0]) @ image.rotation)

    top, bottom = int(rows[0]), int(rows[-1])
    return Outline(
        None if bottom >= len(mask) - BORDER else ray(bottom, 1.0),
        None if top < BORDER else ray(top, 0.0),
        float(np.median(part[rows].sum(axis=1))) * zoom / canvas.pinhole.fx,
    )


@dataclass(frozen=True)
class FlatScene:
    """A level ground and an upright wall all around the place of the camera."""

    up: Floats
    """(3,) unit vector along world axes."""
    height: float
    """Height of the camera above the ground, in scene units."""
    wall: float
    """Horizontal distance of the wall, in scene units."""
    cut_off: float
    """Inverse depth of subjects whose feet are not seen, in 1 / scene units."""

    def background(self, image: Image, canvas: Canvas) -> Floats:
        """Return the inverse depth (H, W) of the ground and the wall in a frame."""
        pinhole, (right, down, ahead) = canvas.pinhole, image.rotation @ self.up
        x = (np.arange(pinhole.width) + 0.5 - pinhole.cx) / pinhole.fx
        y = ((np.arange(pinhole.height) + 0.5 - pinhole.cy) / pinhole.fy)[:, None]
        rise = right * x + down * y + ahead
        level = np.sqrt(np.maximum(x**2 + y**2 + 1 - rise**2, 0))
        return np.asarray(np.maximum(level / self.wall, -rise / self.height))

    def standing(self, seen: Outline) -> float:
        """Return the inverse depth of a subject, in 1 / scene units: by its feet, else by its width."""
        drop = 0.0 if seen.foot is None else float(-seen.foot @ self.up)
        inverse = drop / self.height
        if drop < SHALLOWEST:
            own = seen.width / (SHOULDERS * self.height)
            inverse = self.cut_off if 1 / BESIDE < own / self.cut_off < BESIDE else own
        return max(inverse, BEHIND / self.wall)


def flat_scene(reconstruction: Reconstruction, people: Sequence[Sequence[Outline]]) -> FlatScene:
    """Estimate the scene around a static camera, by outlines of each person in several frames.

    The horizon is where people of one height stand on one ground, before a camera at 0.9 of their height; it
    is the camera's middle row if no whole person is seen. The wall is as far as the points of the
    reconstruction, which give the unit of length. Raises UserError if the reconstruction has no scale.
    """
    _, forward, up = level_axes(reconstruction.images)
    whole = [seen for each in people for seen in each if seen.foot is not None and seen.head is not None]
    ups = [(up + pitch * forward) / np.hypot(1, pitch) for pitch in PITCHES]
    misfits = [_misfit(whole, one) + (pitch / LEVEL) ** 2 for one, pitch in zip(ups, PITCHES, strict=True)]
    up = ups[int(np.argmin(misfits))]
    wall = typical_distance(reconstruction)
    widths = [seen.width for each in people for seen in each if seen.foot is None]
    cut_off = float(np.median(widths)) / SHOULDERS if widths else 0.5
    unit = FlatScene(up, 1.0, np.inf, cut_off)
    inverse = [float(np.median([unit.standing(seen) for seen in each])) for each in people if each] or [0.5]
    # In heights of the camera.
    far = max(BEYOND / max(inverse), BEHIND / max(min(inverse), SHALLOWEST))
    return FlatScene(up, wall / far, wall, cut_off * far / wall)


def _misfit(whole: Sequence[Outline], up: Floats) -> float:
    """Negative log-likelihood of the heights of people on the ground below a camera, `up` (3,) from it."""
    if not whole:
        return 0.0
    feet, heads = (np.array(rays) for rays in zip(*((each.foot, each.head) for each in whole), strict=True))
    drop = -feet @ up
    known = drop > SHALLOWEST
    if not known.any():
        return float("inf")
    # The point of the vertical above the feet that is nearest to the ray of the head.
    across = np.cross(up, heads[known])
    away = np.cross(feet[known] / drop[known, None], heads[known])
    tall = np.log(np.maximum(-(away * across).sum(axis=1) / (across**2).sum(axis=1), 1e-3))
    middle = float(np.median(tall))
    off = np.full(len(whole), OUTLIER)
    off[known] = np.minimum(np.abs(tall - middle) / SPREAD, OUTLIER)
    return float(min(len(whole), INDEPENDENT) * np.mean(off**2) + ((middle - np.log(PERSON)) / UNSURE) ** 2)


@dataclass(frozen=True)
class EstimatedDepth(DepthSource):
    """The subjects of a clip before an estimated ground and wall."""

    reconstruction: Reconstruction
    scene: Callable[[], FlatScene]
    subjects: Callable[[], Sequence[Subject]]
    opacity: Callable[[int], Map | Mask | None]
    """That of all subjects (H, W) in [0, 1], by source frame; None without any."""
    _seen: LRUCache[tuple[Map, Mask]] = field(
        default_factory=LRUCache[tuple[Map, Mask]], repr=False, compare=False
    )

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth | None:
        """Return the depth of all pixels of a canvas that shows `picture` (H, W, 4); None without subjects.

        With `NO_PICTURE` depth has the size of the subjects' masks. Raises UserError if a frame cannot be
        read.
        """
        if not self.subjects():
            return None
        found, moving = self._seen.get(frame, lambda: self._subjects_in(frame))
        if not picture.size:
            return PixelDepth(found.astype(np.float64), moving=moving, origin=ORIGIN)
        image, _ = self.reconstruction.image_at(frame)
        background, covered = self.scene().background(image, canvas), self.opacity(frame)
        opacity = None if covered is None else opacity_over(canvas, covered)
        inverse = outlined(background, found, moving, picture, opacity)
        return PixelDepth(inverse, moving=moving, origin=ORIGIN, opacity=opacity)

    def kept(self, frame: int, canvas: Canvas) -> PixelDepth | None:
        """Return `at` without a picture, for a frame whose subjects were found before; else None."""
        known = self._seen.known(frame)
        return known and PixelDepth(known[0].astype(np.float64), moving=known[1], origin=ORIGIN)

    def samples(self, frame: int, canvas: Canvas) -> DepthSamples | None:
        """Return a regular grid of samples, `COLUMNS` across the picture; None without subjects."""
        if not self.subjects():
            return None
        pinhole, (_, between) = canvas.pinhole, self.reconstruction.image_at(frame)
        found = self._seen.get(frame, lambda: self._subjects_in(frame))
        rows = max(round(COLUMNS * pinhole.height / pinhole.width), 2)
        across, down = (
            np.linspace(0.5, pinhole.width - 0.5, COLUMNS),
            np.linspace(0.5, pinhole.height - 0.5, rows),
        )
        at = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
        inverse, _, _ = PixelDepth(found[0].astype(np.float64)).at_places(at, canvas)
        return DepthSamples(frame, at, inverse, between)

    def _subjects_in(self, frame: int) -> tuple[Map, Mask]:
        """(h, w) inverse depth of a small picture of a frame, and where it is a subject's."""
        image, _ = self.reconstruction.image_at(frame)
        shown = [(each.mask(frame), each.inverse_depth(frame)) for each in self.subjects()]
        size = max((mask.shape[1::-1] for mask, _ in shown))
        canvas = self.reconstruction.canvas(image, size)
        found = self.scene().background(image, canvas).astype(np.float32)
        moving = np.zeros(found.shape, bool)
        for mask, inverse in sorted(((m, v) for m, v in shown if v is not None), key=lambda each: each[1]):
            own = opacity_over(canvas, mask) > 0.5
            found[own], moving[own] = inverse, True
        return found, moving
