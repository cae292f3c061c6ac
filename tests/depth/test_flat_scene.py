"""Depth of a clip without parallax, from the people who stand in it."""

from __future__ import annotations

import numpy as np
import pytest

from addon.core.base.arrays import Mask
from addon.core.camera.intrinsics import Intrinsics
from addon.core.camera.reconstruction import Image, Points, Reconstruction, rotation_matrix
from addon.core.depth.flat_scene import EstimatedDepth, FlatScene, flat_scene, outline
from addon.core.depth.source import NO_PICTURE
from addon.core.depth.subject_depth import Subject

CAMERA = Intrinsics(360, 480, 400.0, 400.0, 180.0, 240.0)
AWAY = 10.0
"""Distance of all points."""
LEVEL = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""World, z up, to a camera that looks along y."""


def filmed(pitch: float, turns: tuple[float, ...] = (-0.1, 0.0, 0.1)) -> Reconstruction:
    """A camera that looks down by `pitch` radians and turns, in a world whose z is its own mean up."""
    images, nobody = list[Image](), (np.zeros((0, 2)), np.zeros(0, np.int32))
    down = rotation_matrix(np.array([pitch, 0, 0]))
    for number, turn in enumerate(turns, 1):
        rotation = down @ LEVEL @ rotation_matrix(np.array([0, 0, turn])) @ LEVEL.T @ down.T @ LEVEL
        images.append(Image(number, rotation, np.zeros(3), *nobody))
    points = AWAY * np.array([[0.0, 1, 0], [0.1, 0.9, 0], [-0.1, 0.9, 0.1]])
    points *= AWAY / np.linalg.norm(points, axis=1, keepdims=True)
    return Reconstruction((CAMERA,), tuple(images), Points(points, np.zeros((3, 3), np.uint8), np.zeros(3)))


def true_up(pitch: float) -> np.ndarray:
    """(3,) in that world."""
    return np.asarray(LEVEL.T @ rotation_matrix(np.array([pitch, 0, 0])) @ np.array([0, -1.0, 0]))


def person(
    clip: Reconstruction,
    pitch: float,
    frame: int,
    metres: float,
    eye: float = 1.5,
    tall: float = 1.7,
    side: float = 0.0,
) -> Mask:
    """(h, w) someone who stands so far away on the ground below a camera at the height of `eye`."""
    image, _ = clip.image_at(frame)
    up = true_up(pitch)
    ahead = np.cross(up, [1.0, 0, 0])
    mask = np.zeros((CAMERA.height, CAMERA.width), np.uint8)
    corners = [
        CAMERA.project(image.to_camera((metres * ahead + (side + x) * np.array([1.0, 0, 0]) + y * up)[None]))[
            0
        ]
        for x, y in ((-0.22, -eye), (0.22, tall - eye))
    ]
    (left, bottom), (right, top) = corners
    rows, columns = np.arange(CAMERA.height) + 0.5, np.arange(CAMERA.width) + 0.5
    mask[np.ix_((rows > top) & (rows < bottom), (columns > left) & (columns < right))] = 1
    return mask > 0


def scene_of(
    clip: Reconstruction, pitch: float, *metres: float, eye: float = 1.5, tall: float = 1.7
) -> FlatScene:
    """The scene that people at some distances tell."""
    people = [
        [seen for image in clip.images
         if (seen := outline(person(clip, pitch, image.frame, each, eye, tall), image, clip.canvas(image)))]
        for each in metres
    ]  # fmt: skip
    return flat_scene(clip, people)


@pytest.mark.parametrize("pitch", [-0.2, 0.0, 0.2, 0.4])
@pytest.mark.parametrize(("metres", "near"), [((5.0,), 5), ((4.0, 9.0), 4), ((5.0, 6.0, 12.0), 5)])
def test_whole_people_tell_the_horizon(pitch: float, metres: tuple[float, ...], near: float) -> None:
    clip = filmed(pitch)
    scene = scene_of(clip, pitch, *metres)
    assert np.degrees(np.arccos(scene.up @ true_up(pitch))) < 2.5
    assert scene.wall == pytest.approx(AWAY)
    # In metres, of which the camera's height is 1.5.
    far = scene.wall / scene.height * 1.5
    assert far == pytest.approx(max(4 * near, 2 * max(metres)), rel=0.15)


@pytest.mark.parametrize("eye", [1.0, 2.4])
def test_several_people_tell_the_horizon_of_a_camera_at_another_height(eye: float) -> None:
    """By their own rows and heights, against what is assumed of a camera's height."""
    clip = filmed(0.15)
    scene = scene_of(clip, 0.15, 5.0, 8.0, 14.0, eye=eye)
    assert np.degrees(np.arccos(scene.up @ true_up(0.15))) < 3


def test_a_person_keeps_their_distance_while_the_camera_turns() -> None:
    clip = filmed(0.1)
    scene = scene_of(clip, 0.1, 5.0)
    for image in clip.images:
        seen = outline(person(clip, 0.1, image.frame, 5.0), image, clip.canvas(image))
        assert seen is not None
        depth = image.to_camera(5.0 * np.cross(true_up(0.1), [1.0, 0, 0])[None] - 1.5 * true_up(0.1))[0, 2]
        assert scene.standing(seen) * scene.height * depth / 1.5 == pytest.approx(1, rel=0.08)


def test_people_whose_feet_are_cut_off_are_as_far_as_they_are_wide() -> None:
    """The one who turns is narrower, and as far; the one behind is farther."""
    clip = filmed(0.0)
    scene = scene_of(clip, 0.0, 2.0)
    assert scene.wall / scene.height * 1.5 == pytest.approx(8, rel=0.1)
    image = clip.images[1]

    def distance(mask: Mask) -> float:
        seen = outline(mask, image, clip.canvas(image))
        assert seen is not None and seen.foot is None
        return 1.5 / (scene.standing(seen) * scene.height)

    front = person(clip, 0.0, 2, 2.0)
    turned = front.copy()
    turned[:, : CAMERA.width // 2 - 30] = False
    assert distance(front) == pytest.approx(2.0, rel=0.1)
    assert distance(turned) == distance(front)
    narrow = front.copy()
    narrow[:, : CAMERA.width // 2 + 20] = False
    assert distance(narrow) == pytest.approx(2 * distance(front), rel=0.2)


@pytest.mark.parametrize("frame", [1, 2, 3])
def test_the_background_is_the_nearer_of_ground_and_wall(frame: int) -> None:
    clip, up = filmed(0.3), true_up(0.3)
    scene, image = FlatScene(up, 1.5, 8.0, 0.5), clip.images[frame - 1]
    inverse = scene.background(image, clip.canvas(image))
    rows, columns = np.mgrid[: CAMERA.height, : CAMERA.width] + 0.5
    rays = np.dstack([(columns - CAMERA.cx) / CAMERA.fx, (rows - CAMERA.cy) / CAMERA.fy, np.ones_like(rows)])
    with np.errstate(divide="ignore"):
        places = (rays / inverse[..., None]) @ image.rotation
    above, level = places @ up, np.linalg.norm(places - (places @ up)[..., None] * up, axis=-1)
    ground = np.abs(above + 1.5) < 1e-6
    wall = np.abs(level - 8) < 1e-6
    assert (ground | wall).all() and ground.any() and wall.any()
    assert above.min() > -1.5 - 1e-6 and level.max() < 8 + 1e-6


def test_a_subject_stands_before_the_background() -> None:
    clip = filmed(0.0)
    mask = person(clip, 0.0, 2, 4.0)
    scene = FlatScene(np.array([0, 0, 1.0]), 1.5, 12.0, 0.5)
    depth = EstimatedDepth(
        clip, lambda: scene, lambda: [Subject(lambda frame: mask, lambda frame: 0.25)], lambda frame: mask
    )
    canvas = clip.canvas(clip.images[1])
    assert depth.kept(2, canvas) is None
    known = depth.at(2, canvas, np.ones((CAMERA.height, CAMERA.width, 4), np.float32))
    assert known is not None
    np.testing.assert_array_equal(known.inverse_depth[mask], 0.25)
    background = scene.background(clip.images[1], canvas)
    np.testing.assert_allclose(known.inverse_depth[~mask], background[~mask], rtol=1e-6)
    coarse = depth.at(2, canvas, NO_PICTURE)
    assert coarse is not None and depth.kept(2, canvas) is not None
    inverse, sure, moves = coarse.at_places(np.array([[180.5, 240.5], [20.5, 20.5]]), canvas)
    assert (
        inverse == pytest.approx([0.25, 1 / 12], rel=0.25) and sure.all() and moves.tolist() == [True, False]
    )
    samples = depth.samples(2, canvas)
    assert samples is not None and np.isclose(samples.inverse_depth, 0.25).any()
