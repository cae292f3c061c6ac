"""Focus on something that moves by itself: a card that comes nearer before a still camera."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
import pytest

from addon.core.base.arrays import Bytes
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.depth.multi_view_stereo import DenseDepth
from addon.core.focus.focus import Focus
from addon.core.focus.follow import follow
from addon.core.focus.place import Place
from addon.core.focus.pull import FocusMark, inverse_depths, pull
from addon.core.frame.clip_context import ClipContext
from addon.core.subjects.networks import Networks

from ..scenes import texture
from ..subjects.walls import NONE, NoObjects

SIZE = (320, 180)
LENS = Intrinsics(*SIZE, 280.0, 280.0, 160.0, 90.0)
FRAMES = tuple(range(1, 29))
WALL, POST = 12.0, 2.0
PICKED = 10
SIDE = 1.2
"""Of the card, in scene units."""


def card(frame: int) -> tuple[float, float]:
    """Its distance, and how far it is to the right."""
    return 7.0 - 0.1 * frame, -1.3 + 0.11 * frame


def shown(frame: int, has_post: bool, gone: int = 99) -> tuple[Bytes, DenseDepth]:
    """What the camera sees, and the depth of it. From frame `gone` on the card is not there."""
    wall, print_, post = (texture(*SIZE, seed) for seed in (1, 2, 3))
    inverse = np.full(SIZE[::-1], 1 / WALL, np.float32)
    moving = np.zeros(SIZE[::-1], bool)
    picture = wall.copy()
    depth, right = card(frame)
    if frame < gone:
        scale = LENS.fx / depth
        left, top = LENS.principal_point + scale * (np.array([right, 0.0]) - SIDE / 2)
        zoom = scale * SIDE / 120
        matrix = np.array([[zoom, 0, left], [0, zoom, top]])
        size = {"dsize": SIZE, "flags": cv2.INTER_LINEAR}
        moving = cv2.warpAffine(np.full((120, 120), 255, np.uint8), matrix, **size) > 127
        picture[moving] = cv2.warpAffine(print_[:120, :120], matrix, **size)[moving]
        inverse[moving] = 1 / depth
    if has_post:
        # Half as wide as the card, about.
        before = slice(198, 222)
        picture[:, before], inverse[:, before], moving[:, before] = post[:, before], 1 / POST, False
    found = DenseDepth(frame, inverse, np.ones(SIZE[::-1], np.float32), moving, LENS)
    return picture, found


@dataclass
class TrueDepth:
    """What `ClipContext.stereo` is asked for."""

    clip: Filmed
    requests: int = 0

    def at(self, frame: int) -> DenseDepth:
        self.requests += 1
        found = shown(frame, self.clip.has_post, self.clip.gone)[1]
        if self.clip.is_sure:
            return found
        return replace(found, confidence=np.where(found.moving, 0, found.confidence).astype(np.float32))

    def kept(self, frame: int) -> DenseDepth | None:
        return None


@dataclass(frozen=True)
class Filmed(ClipContext):
    """A clip whose depth, and what moves in it, is the truth."""

    has_post: bool = False
    gone: int = 99
    is_sure: bool = True
    """Whether what moves has any confidence."""

    @cached_property
    def stereo(self) -> TrueDepth:  # type: ignore[override]
        return TrueDepth(self)


def filmed(has_post: bool = False, gone: int = 99) -> Filmed:
    nothing = np.zeros(0, np.int32)
    # It hardly moves; of one that stays in its place nothing would be asked of stereo.
    images = tuple(Image(f, np.eye(3), np.array([1e-5 * f, 0, 0]), np.zeros((0, 2)), nothing) for f in FRAMES)
    points = Points(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0))
    reconstruction = Reconstruction((LENS,), images, points)

    def read(frame: int) -> Bytes:
        return shown(frame, has_post, gone)[0]

    subjects = NoObjects(reconstruction, read, networks=Networks(NONE))
    return Filmed(reconstruction, read, known_subjects=subjects, has_post=has_post, gone=gone)


def followed(clip: Filmed) -> dict[int, float]:
    depth, right = card(PICKED)
    place = LENS.project(np.array([[right, 0.1, depth]]))[0]
    return follow(clip.reconstruction, clip.depth_source(), clip.read, PICKED, place, 1 / depth)


@pytest.mark.parametrize("has_post", [False, True], ids=["seen", "hidden for a while"])
def test_a_mover_is_followed_as_it_comes_nearer(has_post: bool) -> None:
    clip = filmed(has_post)
    if has_post:
        # In the frame of the pick it is seen, and the post passes over all of the place.
        hidden = [not shown(f, True)[1].moving[90, int(160 + 280 * card(f)[1] / card(f)[0])] for f in FRAMES]
        assert not hidden[PICKED - 1] and not hidden[-2] and sum(hidden) > 2
    distances = followed(clip)
    assert min(distances) <= FRAMES[2] and max(distances) >= FRAMES[-3]
    for frame, distance in distances.items():
        # What was hidden is interpolated in inverse depth.
        assert distance == pytest.approx(card(frame)[0], rel=0.02 if has_post else 0.01)
    # Depth is dear: every third frame's has to do.
    assert clip.stereo.requests < 0.6 * len(FRAMES)


def test_what_is_lost_keeps_its_last_distance() -> None:
    clip = filmed(gone=15)
    distances = followed(clip)
    assert 13 <= max(distances) < 15
    place = Place(Focus(distance=card(PICKED)[0]), PICKED, card(PICKED)[0], "a mover", followed=distances)
    inverse = inverse_depths(place, clip.reconstruction, FRAMES)
    assert 1 / inverse[PICKED - 1] == pytest.approx(card(PICKED)[0], rel=0.01)
    assert (inverse[max(distances) - 1 :] == inverse[-1]).all()


@pytest.mark.parametrize("is_sure", [True, False], ids=["sure", "unsure"])
def test_a_pick_on_a_mover_is_followed_and_can_be_pulled_to(is_sure: bool) -> None:
    clip = replace(filmed(), is_sure=is_sure)
    depth, right = card(PICKED)
    found = clip.places(PICKED).find((160 + 280 * right / depth) / SIZE[0], 0.5)
    assert "it moves on its own and is followed from frame" in found.source
    assert found.followed[5] == pytest.approx(card(5)[0], rel=0.01)
    wall = clip.places(3).find(0.95, 0.5)
    assert wall.distance == pytest.approx(WALL, rel=1e-3)
    pulled = pull([FocusMark.of(wall), FocusMark.of(found)], clip.reconstruction, FRAMES)
    assert pulled[2] == pytest.approx(WALL, rel=1e-3)
    for frame in FRAMES[PICKED - 1 : -2]:
        assert pulled[frame] == pytest.approx(card(frame)[0], rel=0.01)


def test_points_around_a_mover_are_not_what_is_picked() -> None:
    """Features on the wall a few pixels beside the card, as beside a face."""
    clip, (depth, right) = filmed(), card(PICKED)
    centre = np.array([right, 0.0]) * LENS.fx / depth + LENS.principal_point
    around = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    xy = centre + 18 * np.column_stack([np.cos(around), np.sin(around)])
    wall = np.column_stack([(xy - LENS.principal_point) * WALL / LENS.fx, np.full(12, WALL)])
    points = Points(wall, np.zeros((12, 3), np.uint8), np.zeros(12))
    images = tuple(
        Image(f, np.eye(3), np.array([1e-5 * f, 0, 0]), xy, np.arange(12, dtype=np.int32)) for f in FRAMES
    )
    clip = replace(clip, reconstruction=Reconstruction((LENS,), images, points))
    found = clip.places(PICKED).find(*centre / SIZE)
    assert found.distance == pytest.approx(depth, rel=0.01) and not found.focus.points
