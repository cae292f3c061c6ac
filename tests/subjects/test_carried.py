"""Subjects cut out of one frame and carried through a clip, on drawn pictures with known truth."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, partial

import cv2
import numpy as np
import pytest

from addon.core.subjects.carried import CarriedSubject
from addon.core.subjects.cut import carries
from addon.core.subjects.found_subjects import distinct, found_people
from addon.core.subjects.networks import Networks
from addon.core.subjects.odds import overlap
from addon.core.subjects.people import people
from addon.core.subjects.pictures import ClipPictures, small
from addon.core.subjects.standing import SubjectDistance
from addon.core.subjects.strokes import Stroke

from .figures import figure

WIDTH, HEIGHT, FRAMES = 512, 288, 9


@cache
def texture(seed: int, tint: tuple[float, float, float]) -> np.ndarray:
    """(h, w, 3) smooth noise around a colour."""
    rng = np.random.default_rng(seed)
    noise = sum(
        cv2.resize(
            rng.normal(0, 1, (HEIGHT // scale, WIDTH // scale)),
            (WIDTH, HEIGHT),
            interpolation=cv2.INTER_CUBIC,
        )
        for scale in (4, 8, 16)
    )
    return np.clip(np.array(tint) + 22 * np.asarray(noise)[..., None], 0, 255).astype(np.uint8)


def disc(frame: int, radius: float = 40.0) -> np.ndarray:
    """(h, w) a disc that moves 9 pixels a frame."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return np.asarray(np.hypot(x - 150 - 9 * frame, y - 140) < radius)


def picture(frame: int, tint: tuple[float, float, float] = (130, 120, 115)) -> np.ndarray:
    """(h, w, 3) the disc before a ground that moves 2 pixels a frame; by default of the same colours."""
    ground = np.roll(texture(1, (120, 120, 120)), 2 * frame, axis=1)
    thing = np.roll(texture(2, tint), 9 * frame, axis=1)
    return np.where(disc(frame)[..., None], thing, ground).astype(np.uint8)


@pytest.fixture(scope="module")
def pictures() -> ClipPictures:
    return ClipPictures(tuple(range(1, FRAMES + 1)), lambda frame: picture(frame - 1))


@pytest.fixture(scope="module")
def no_networks(tmp_path_factory: pytest.TempPathFactory) -> Networks:
    return Networks(tmp_path_factory.mktemp("none"))


def stroke(frame: int, adds: bool = True) -> Stroke:
    x = (150 + 9 * (frame - 1)) / WIDTH
    return Stroke(frame, ((x - 0.04, 0.42), (x + 0.04, 0.55)), adds)


def test_a_stroke_is_carried_both_ways_by_motion_alone(pictures: ClipPictures, no_networks: Networks) -> None:
    """No network knows a disc, and its colours are those of the ground."""
    subject = CarriedSubject(pictures, no_networks, (stroke(5),))
    found = [overlap(subject.mask(frame), disc(frame - 1)) for frame in pictures.frames]
    assert min(found) > 0.8, found


def test_a_first_cut_is_shown_before_frames_beside_it_settle_it(
    pictures: ClipPictures, no_networks: Networks
) -> None:
    subject = CarriedSubject(pictures, no_networks, (stroke(5),))
    first, settled = subject.masks(5)
    assert overlap(first, disc(4)) > 0.7 and np.array_equal(settled, subject.mask(5))
    assert len(list(subject.masks(6))) == len(list(subject.masks(5))) == 1


def test_a_later_stroke_corrects_and_keeps_the_rest(pictures: ClipPictures, no_networks: Networks) -> None:
    before = CarriedSubject(pictures, no_networks, (stroke(5),))
    corner = Stroke(7, ((0.9, 0.9), (0.95, 0.9)), adds=False)
    after = CarriedSubject(pictures, no_networks, (stroke(5), corner))
    assert after.marked_frames == [5, 7]
    for frame in (5, 6, 7, 9):
        assert overlap(after.mask(frame), before.mask(frame)) > 0.9


@pytest.mark.parametrize("way", [-1, 1])
@pytest.mark.parametrize(("picket", "pitch"), [(22, 90), (30, 110), (16, 70)])
def test_strips_that_come_from_behind_pickets_are_found(
    no_networks: Networks, way: int, picket: int, pitch: int
) -> None:
    """A wagon passes behind pickets; what is marked is the part in one gap."""
    x, y = np.arange(WIDTH), np.arange(HEIGHT)[:, None]

    def hidden(frame: int) -> np.ndarray:
        return np.asarray((x - WIDTH // 2 - pitch // 2 - 3 * (frame - 8)) % pitch < picket)

    def seen(frame: int) -> np.ndarray:
        middle = WIDTH // 2 + way * 9 * (frame - 8)
        return np.asarray((abs(y - 150) < 40) & (abs(x - middle) < 100) & ~hidden(frame))

    def shown(frame: int) -> np.ndarray:
        ground, wagon, pickets = (
            np.roll(texture(seed, tint), step * frame, axis=1)
            for seed, tint, step in (
                (1, (90, 130, 90), 2), (2, (200, 110, 60), way * 9), (3, (120, 115, 110), 3)
            )
        )  # fmt: skip
        scene = np.where(seen(frame)[..., None], wagon, ground)
        return np.where(hidden(frame)[:, None], pickets, scene).astype(np.uint8)

    clip = ClipPictures(tuple(range(1, 16)), shown)
    gap = (WIDTH // 2 + picket - pitch // 2 + np.array([8, pitch - picket - 8])) / WIDTH
    mark = Stroke(8, tuple((float(at), 150 / HEIGHT) for at in gap))
    subject = CarriedSubject(clip, no_networks, (mark,))
    found = [overlap(subject.mask(frame), seen(frame)) for frame in clip.frames]
    assert min(found) > 0.8, found


def test_a_subject_that_leaves_the_picture_is_not_seen(no_networks: Networks) -> None:
    """The picture is cut off on the right, so that the disc leaves it."""
    clip = ClipPictures(tuple(range(1, 16)), lambda frame: picture(2 * (frame - 1), (190, 90, 60))[:, :300])
    x = 150 / 300
    subject = CarriedSubject(clip, no_networks, (Stroke(1, ((x - 0.06, 0.42), (x + 0.06, 0.55))),))
    assert subject.cut(8).is_seen
    assert not subject.cut(15).is_seen


def test_a_vehicle_carries_its_rider_and_the_ground_carries_nobody() -> None:
    rider, vehicle, ground = (np.zeros((90, 120), np.uint8) for _ in range(3))
    cv2.circle(rider, (60, 30), 9, 1, -1)
    cv2.rectangle(vehicle, (40, 25), (80, 70), 1, -1)
    for corner in (10, 110):
        cv2.line(ground, (60, 30), (corner, 85), 1, 12)
    assert carries((vehicle | rider) > 0, rider > 0)
    assert not carries(vehicle > 0, vehicle > 0)
    assert not carries((ground | rider) > 0, rider > 0)
    assert not carries(None, rider > 0)


def test_distances_follow_size_and_ignore_a_wrong_contact() -> None:
    """A square that grows by 2 % a frame; one contact of five is three times too near."""
    count, growth = 16, 1.02
    base = texture(5, (140, 110, 100))

    def scaled(frame: int) -> np.ndarray:
        turned = cv2.getRotationMatrix2D((256, 144), 0, growth ** (frame - 1))
        return cv2.warpAffine(
            base, turned, (WIDTH, HEIGHT), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT
        )

    clip = ClipPictures(tuple(range(1, count + 1)), scaled)

    def square_in(frame: int) -> np.ndarray:
        x, y = np.meshgrid(np.arange(WIDTH) - 256, np.arange(HEIGHT) - 144)
        return np.asarray(np.maximum(abs(x), abs(y)) < 55 * growth ** (frame - 1))

    truth = {frame: 0.2 * growth ** (frame - 1) for frame in clip.frames}

    def contacts(frames: Sequence[int]) -> dict[int, float]:
        return {each: (3 if each == 8 else 1) * truth[each] for each in frames if each % 3 != 1}

    found = SubjectDistance(clip, lambda frame: square_in(frame), contacts)
    for frame in clip.frames:
        assert found.inverse_depth(frame) == pytest.approx(truth[frame], rel=0.02)


def test_people_are_found_and_followed_and_nobody_in_a_texture() -> None:
    networks = Networks()
    if not networks.exist:
        pytest.skip("the networks are not in addon/networks: run tools/networks.py")

    def walking(frame: int) -> np.ndarray:
        ground = cv2.resize(texture(1, (120, 150, 110)), (640, 480))
        drawn = cv2.resize(figure(), (640, 480))
        mask = np.abs(drawn.astype(int) - drawn[0, 0]).sum(axis=2) > 30
        shift = 12 * (frame - 1) - 60
        return np.where(np.roll(mask, shift, axis=1)[..., None], np.roll(drawn, shift, axis=1), ground)

    clip = ClipPictures(tuple(range(1, 8)), walking)
    assert not found_people(ClipPictures((1, 2), lambda frame: texture(1, (120, 120, 120))), networks)
    assert people(networks, small(walking(4)))
    (found,) = distinct(found_people(clip, networks), partial(CarriedSubject, clip, networks))
    middles = [np.argwhere(found.mask(frame)).mean(axis=0)[1] for frame in (1, 7)]
    assert middles[1] - middles[0] == pytest.approx(72 * 512 / 640, abs=6)
