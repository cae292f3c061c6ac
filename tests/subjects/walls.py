"""A wall behind a lower one, filmed by a camera that moves sideways, and a disc that moves before them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from addon.core.base.arrays import Bytes, Floats, Mask
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.frame.clip_context import ClipContext
from addon.core.subjects.clip_subjects import ClipSubject, ClipSubjects
from addon.core.subjects.networks import Networks

from ..scenes import texture
from .figures import figure

WIDTH, HEIGHT = 240, 160
LENS = Intrinsics(WIDTH, HEIGHT, 220.0, 220.0, 120.0, 80.0)
FRAMES = tuple(range(1, 33))
FAR, NEAR, EDGE = 8.0, 4.0, 118
"""Distances of the two walls, and the row from which on the near one is seen."""
NONE = Path("none")
"""Folder without networks: textures deceive them."""
RADIUS = 20


@cache
def _wall(seed: int) -> Bytes:
    return cv2.GaussianBlur(texture(640, HEIGHT, seed), (0, 0), 1.0)


def camera(frame: int) -> float:
    """How far it is to the right."""
    return 0.06 * (frame - 16)


def still(frame: int) -> Bytes:
    """(h, w, 3) the frame without the disc."""
    picture = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    for seed, depth, rows in ((1, FAR, np.s_[:EDGE]), (2, NEAR, np.s_[EDGE:])):
        left = 200 + camera(frame) * LENS.fx / depth
        shift = np.array([[1, 0, -left], [0, 1, 0]])
        picture[rows] = cv2.warpAffine(_wall(seed), shift, (WIDTH, HEIGHT), flags=cv2.INTER_CUBIC)[rows]
    return picture


def place(frame: int) -> tuple[float, float]:
    """The middle of the disc, pixels: it swings."""
    return 40 + 5 * frame, 70 + 22 * np.sin(frame / 5)


def disc(frame: int) -> Mask:
    """(h, w) where the disc is."""
    x, y = place(frame)
    across, down = np.meshgrid(np.arange(WIDTH) - x, np.arange(HEIGHT) - y)
    return np.asarray(np.hypot(across, down) < RADIUS)


def with_disc(frame: int) -> Bytes:
    """(h, w, 3) the frame with a textured disc."""
    x, y = place(frame)
    shift = np.array([[1, 0, x - 30], [0, 1, y - 30]])
    own = cv2.warpAffine(texture(60, 60, 3), shift, (WIDTH, HEIGHT), borderMode=cv2.BORDER_REFLECT)
    return np.where(disc(frame)[..., None], own, still(frame)).astype(np.uint8)


def _walked(frame: int) -> Floats:
    """(2, 3) from the drawn person to the frame."""
    return np.array([[0.6, 0, 3 * (frame - 16) + 24], [0, 0.6, 10]])


def person(frame: int) -> Mask:
    """(h, w) where the drawn person is."""
    drawn = figure()
    there = (np.abs(drawn.astype(int) - drawn[0, 0]).sum(axis=2) > 30).astype(np.uint8)
    return np.asarray(cv2.warpAffine(there, _walked(frame), (WIDTH, HEIGHT)) > 0)


def with_person(frame: int) -> Bytes:
    """(h, w, 3) the frame with a drawn person who walks."""
    own = cv2.warpAffine(figure(), _walked(frame), (WIDTH, HEIGHT), flags=cv2.INTER_AREA)
    return np.where(person(frame)[..., None], own, still(frame))


def with_shadow(frame: int) -> Bytes:
    """(h, w, 3) the frame with a shadow as large as the disc."""
    dark = (0.55 * still(frame)).astype(np.uint8)
    return np.where(disc(frame)[..., None], dark, still(frame)).astype(np.uint8)


POLE, WIDE = 1.5, 6
"""Distance of a pole that the camera passes at the beginning of the clip, and its width in pixels."""


def _left(frame: int) -> int:
    """The pole's first column."""
    return round(LENS.cx + (-1.4 - camera(frame)) * LENS.fx / POLE)


def pole(frame: int) -> Mask:
    """(h, w) where the pole is."""
    column = np.arange(WIDTH) - _left(frame)
    return np.broadcast_to((column >= 0) & (column < WIDE), (HEIGHT, WIDTH))


def with_pole(frame: int) -> Bytes:
    """(h, w, 3) the frame with the pole, which the left border cuts and seven frames show."""
    own = cv2.resize(texture(4 * WIDE, HEIGHT, 9), (WIDE, HEIGHT)) // 4 + np.array((10, 30, 150), np.uint8)
    shown = own[:, np.clip(np.arange(WIDTH) - _left(frame), 0, WIDE - 1)]
    return np.where(pole(frame)[..., None], shown, still(frame)).astype(np.uint8)


@dataclass(frozen=True)
class Filmed(ClipContext):
    """A clip of that scene."""


@dataclass(frozen=True)
class NoObjects(ClipSubjects):
    """Subjects of a clip in which no moving object is found."""

    @property
    def objects(self) -> list[ClipSubject]:  # type: ignore[override]
        return []


def filmed(shown: Callable[[int], Bytes], frames: tuple[int, ...] = FRAMES) -> Filmed:
    """A clip of pictures, with its true cameras and features of both walls where these are seen."""
    rng = np.random.default_rng(4)
    rows = []
    for depth, low, high in ((FAR, 4, EDGE - 4), (NEAR, EDGE + 4, HEIGHT - 4)):
        x, y = rng.uniform(-3.2, 3.2, 80), (rng.uniform(low, high, 80) - LENS.cy) * depth / LENS.fy
        rows.append(np.column_stack([x, y, np.full(80, depth)]))
    points, images = np.vstack(rows), []
    for frame in frames:
        centre = np.array([camera(frame), 0, 0])
        xy = LENS.project(points - centre)
        seen = np.flatnonzero(np.all((xy > 0) & (xy < [WIDTH, HEIGHT]), axis=1)).astype(np.int32)
        columns, rows = xy[seen].astype(int).T
        wall = np.all(shown(frame) == still(frame), axis=2)
        seen = seen[wall[rows, columns]]
        images.append(Image(frame, np.eye(3), -centre, xy[seen], seen))
    grey = np.full((len(points), 3), 128, np.uint8)
    cloud = Points(points, grey, np.full(len(points), 0.1))
    found = Reconstruction((LENS,), tuple(images), cloud)
    return Filmed(found, shown, known_subjects=ClipSubjects(found, shown, networks=Networks(NONE)))


def moving(clip: ClipContext, frame: int) -> Mask:
    """(h, w) what is found to move in a frame."""
    found = clip.parts.mask(frame)
    return np.zeros((HEIGHT, WIDTH), bool) if found is None else found


def sized(mask: Mask, shape: tuple[int, ...]) -> Mask:
    """A mask at another size (h, w)."""
    return np.asarray(cv2.resize(mask.astype(np.uint8), shape[::-1], interpolation=cv2.INTER_NEAREST) > 0)


def overlap(one: Mask, other: Mask) -> float:
    """Intersection over union, at the size of the first."""
    other = sized(other, one.shape)
    return np.count_nonzero(one & other) / max(np.count_nonzero(one | other), 1)
