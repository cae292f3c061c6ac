"""Distance of subjects that touch no ground in the picture: those that its lower border cuts off."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.base.arrays import Bytes, Floats, Mask
from addon.core.camera.reconstruction import Reconstruction
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.highlights import HighlightSettings
from addon.core.media.clip import open_footage
from addon.core.subjects.clip_subjects import ClipSubject
from addon.core.subjects.cut import Cut
from addon.core.subjects.networks import Networks
from addon.core.subjects.standing import Standing

from ..scenes import texture
from ..solving import solve
from . import walls
from .street import CAMERA, EYE, Street, person


def walker(distance: float, speed: float) -> tuple[Callable[[int], Mask], Callable[[int], Bytes]]:
    """A textured upright card at a distance before the walls of `walls`, cut off by the lower border.

    It moves by `speed` scene units a frame, and the camera by its own way. Its mask and pictures by frame.
    """
    own = cv2.GaussianBlur(texture(walls.WIDTH, walls.HEIGHT, 7), (0, 0), 1.0)
    times = walls.LENS.fx / distance

    def left(frame: int) -> float:
        return walls.LENS.cx + (speed * (frame - 16) - walls.camera(frame) - 0.15) * times

    def mask(frame: int) -> Mask:
        column = np.arange(walls.WIDTH)[None] - left(frame)
        row = np.arange(walls.HEIGHT)[:, None]
        return np.asarray((column >= 0) & (column < 0.5 * times) & (row >= 50))

    def picture(frame: int) -> Bytes:
        shift = np.array([[1, 0, left(frame)], [0, 1, 0.0]])
        moved = cv2.warpAffine(own, shift, (walls.WIDTH, walls.HEIGHT), borderMode=cv2.BORDER_REFLECT)
        return np.where(mask(frame)[..., None], moved, walls.still(frame)).astype(np.uint8)

    return mask, picture


@pytest.mark.parametrize(("distance", "speed"), [(2.0, 0.0), pytest.param(3.0, 0.09, marks=pytest.mark.long)])
def test_one_that_the_lower_border_cuts_off_is_nearer_than_all_that_it_hides(
    distance: float, speed: float
) -> None:
    mask, picture = walker(distance, speed)
    clip = replace(walls.filmed(picture), masks=lambda frame: mask(frame).astype(np.float32))
    found = clip.depth(16, clip.canvas(16), clip.picture(16, HighlightSettings(gain=0)))
    away = 1 / float(np.median(found.inverse_depth[mask(16)]))
    assert walls.NEAR / 2 < away < walls.NEAR


def test_one_that_is_cut_off_is_nearer_than_the_ground_at_the_border() -> None:
    ground = CAMERA.fy * EYE / (CAMERA.height - CAMERA.cy)
    for blind in ((), (0, 1)):
        street = Street(frozenset(blind))
        standing = Standing(street, lambda frame: person(2.0, frame))  # type: ignore[arg-type]
        found = standing.bounds(lambda frame: person(2.0, frame), [0, 1])
        least = 0.05 if blind else 1 / ground
        assert all(least < value < 1.4 * least for value in found.values())
        assert set(found) == {0, 1}


@pytest.mark.parametrize("distance", [1.6, 2.2])
def test_a_person_cut_off_by_the_border_stands_on_the_ground_below_the_picture(distance: float) -> None:
    street = Street()

    def feet(frame: int, subject: Mask) -> Floats:
        return np.array([0.5 - 0.2 * frame * CAMERA.fx / distance / CAMERA.width,
                         (CAMERA.cy + CAMERA.fy * EYE / distance) / CAMERA.height])  # fmt: skip

    standing = Standing(street, lambda frame: person(distance, frame), feet)  # type: ignore[arg-type]
    assert person(distance, 0)[-1].any()
    found = standing.inverse_depths(lambda frame: person(distance, frame), [0, 1])
    assert found == {frame: pytest.approx(1 / distance, rel=0.03) for frame in (0, 1)}


def cropped(solved: Reconstruction, rows: int) -> Reconstruction:
    """A reconstruction of the upper rows of each picture."""
    seen = [(image, image.xy[:, 1] < rows) for image in solved.images]
    return replace(
        solved,
        cameras=tuple(replace(camera, height=rows) for camera in solved.cameras),
        images=tuple(replace(image, xy=image.xy[on], points=image.points[on]) for image, on in seen),
    )


@pytest.mark.long
@pytest.mark.parametrize(
    "name",
    [
        "person_walk_away_1",
        # No ground is in the picture above the waist.
        pytest.param("person_ball_portrait_1", marks=pytest.mark.xfail(strict=True)),
        pytest.param("person_dance_davis_1", marks=pytest.mark.xfail(strict=True)),
    ],
)
def test_a_real_person_is_as_far_away_when_seen_from_the_waist_up(
    data: Path, tmp_path: Path, name: str
) -> None:
    if not Networks().exist:
        pytest.skip("the networks are not in addon/networks: run tools/networks.py")
    footage = open_footage(data / "clips" / f"{name}.mp4")
    solved = solve(footage.path, tmp_path / "work").reconstruction
    whole = ClipContext(solved, footage.read)
    person = whole.parts.people[0]
    masks = [mask for frame in map(int, solved.frames[::8]) if (mask := person.mask(frame)).any()]
    rows = [np.flatnonzero(mask.any(axis=1)) / len(mask) for mask in masks]
    waist = round(float(np.median([(each[0] + each[-1]) / 2 for each in rows])) * solved.cameras[0].height)
    upper = ClipContext(cropped(solved, waist), lambda frame: footage.read(frame)[:waist])
    pictures = upper.parts.subjects.pictures

    def mask(frame: int) -> Mask:
        there = person.mask(frame).astype(np.uint8)
        there = there[: round(len(there) * waist / solved.cameras[0].height)]
        size = pictures.picture(frame).shape[1::-1]
        return np.asarray(cv2.resize(there, size, interpolation=cv2.INTER_NEAREST) > 0)

    def cut(frame: int) -> Cut:
        return Cut.known(pictures.picture(frame), mask(frame).astype(np.float32), 1.0)

    subject = ClipSubject("person", "person", cut)
    upper.parts.subjects.__dict__.update(people=[subject], objects=[])
    one, other = (context.parts.distance(each) for context, each in ((whole, person), (upper, subject)))
    pairs = [(one.inverse_depth(frame), other.inverse_depth(frame)) for frame in map(int, solved.frames[::8])]
    ratios = [a / b for a, b in pairs if a and b]
    assert len(ratios) > 4 and min(ratios) > 0.85 and max(ratios) < 1.15
