"""The figures of the table of motions, each on a case worked by hand; nothing is rendered or solved."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from benchmarks.solving import __main__ as motions
from benchmarks.solving import ground_truth, scenes
from benchmarks.solving.ground_truth import Figures, Truth
from sample_scenes.stage import Cameras

FOCAL, WIDTH, HEIGHT = 200.0, 160, 120
NEAR, FAR = 4.0, 8.0
STEPS = np.linspace(0, 1, 5)


@pytest.fixture(scope="module")
def truth() -> Truth:
    """Two walls, at 4 m left of the middle and 8 m right of it, and a camera that walks straight at them.

    The walls' edge is in the middle column of every frame.
    """
    count = len(STEPS)
    translation = np.column_stack([0 * STEPS, 0 * STEPS, -STEPS])
    cameras = Cameras(WIDTH, HEIGHT, FOCAL, np.tile(np.eye(3), (count, 1, 1)), translation)
    walls = np.where(np.arange(WIDTH) < WIDTH // 2, NEAR, FAR)
    depth = {frame: np.tile(walls - STEPS[frame - 1], (HEIGHT, 1)) for frame in (1, 3, 5)}
    still = {frame: np.zeros((HEIGHT, WIDTH), bool) for frame in depth}
    return Truth(cameras, np.full(count, FOCAL), depth, still)


@pytest.fixture(scope="module")
def solved(truth: Truth) -> Reconstruction:
    """The perfect solve: 60 points on each wall, seen in every frame."""
    rng = np.random.default_rng(0)
    left = np.column_stack([rng.uniform((-1.0, -0.7), (-0.2, 0.7), (60, 2)), np.full(60, NEAR)])
    right = np.column_stack([rng.uniform((0.2, -1.5), (2.0, 1.5), (60, 2)), np.full(60, FAR)])
    return seen_by(truth, np.concatenate([left, right]))


def seen_by(truth: Truth, xyz: np.ndarray) -> Reconstruction:
    cameras = truth.cameras
    camera = Intrinsics(WIDTH, HEIGHT, FOCAL, FOCAL, WIDTH / 2, HEIGHT / 2)
    rows = np.arange(len(xyz), dtype=np.int32)
    images = tuple(
        Image(frame + 1, cameras.rotation[frame], cameras.translation[frame], xy, rows)
        for frame, xy in enumerate(cameras.project(xyz))
    )
    nothing = np.zeros(len(xyz))
    return Reconstruction((camera,), images, Points(xyz, np.zeros((len(xyz), 3), np.uint8), nothing))


def moved(shot: Reconstruction, scale: float, turn: np.ndarray, shift: np.ndarray) -> Reconstruction:
    """The same solve in another world: x -> scale turn x + shift."""
    images = tuple(
        replace(
            image,
            rotation=image.rotation @ turn.T,
            translation=scale * image.translation - image.rotation @ turn.T @ shift,
        )
        for image in shot.images
    )
    points = replace(shot.points, xyz=scale * shot.points.xyz @ turn.T + shift)
    return replace(shot, images=images, points=points)


def stretched(shot: Reconstruction, factor: float) -> Reconstruction:
    """Depths and focal length too large by a factor.

    A camera that walks straight ahead has one such solve for every factor, all with the same reprojections.
    """
    deeper = np.array([1, 1, factor])
    camera = replace(shot.cameras[0], fx=FOCAL * factor, fy=FOCAL * factor)
    images = tuple(replace(image, translation=image.translation * deeper) for image in shot.images)
    return Reconstruction((camera,), images, replace(shot.points, xyz=shot.points.xyz * deeper))


def rotated(degrees: float, axis: tuple[float, float, float]) -> np.ndarray:
    return np.asarray(cv2.Rodrigues(np.radians(degrees) * np.asarray(axis))[0], np.float64)


def errors(figures: Figures) -> np.ndarray:
    names = (
        "rotation_max",
        "position_path",
        "position_depth",
        "focal",
        "lengths",
        "stretch",
        "inverse_depth",
    )
    return np.array([getattr(figures, name) for name in (*names, "inverse_depth_90", "disc", "track_px")])


def test_a_perfect_solve_has_no_error(solved: Reconstruction, truth: Truth) -> None:
    figures = ground_truth.measure(solved, truth)
    assert np.abs(errors(figures)).max() < 1e-4
    assert figures.registered == 1 and figures.on_moving_object == 0
    assert figures.points_median == figures.points_least == figures.measured == 120


def test_a_world_of_its_own_is_no_error(solved: Reconstruction, truth: Truth) -> None:
    away = moved(solved, 7.3, rotated(130, (0.6, 0.0, 0.8)), np.array([3.0, -20.0, 0.4]))
    assert np.abs(errors(ground_truth.measure(away, truth))).max() < 1e-4


def test_a_focal_length_off_by_a_tenth(solved: Reconstruction, truth: Truth) -> None:
    wrong = stretched(solved, 1.1)
    for image in wrong.images:
        seen = wrong.cameras[0].project(image.to_camera(wrong.points.xyz))
        assert np.abs(seen - image.xy).max() < 1e-9  # nothing that a solver could see
    figures = ground_truth.measure(wrong, truth)
    assert figures.focal == pytest.approx(10)
    # The walls are 4 m apart and at most 3 m wide: lengths from one to the other lean over a little.
    assert figures.stretch == pytest.approx(figures.lengths) == pytest.approx(10, abs=1.5)
    # The tracks are not to blame.
    assert figures.lengths_floor == pytest.approx(0, abs=1e-4)
    # All depths are too large by the same factor: blur is right.
    assert figures.inverse_depth == pytest.approx(0, abs=1e-4) == figures.rotation_max


def test_depths_that_are_wrong_on_one_wall(solved: Reconstruction, truth: Truth) -> None:
    # The far wall's points 10 % too far along their rays from the first camera.
    xyz = solved.points.xyz * np.where(np.arange(120) < 60, 1.0, 1.1)[:, None]
    shot = seen_by(truth, xyz)
    shot = replace(shot, images=shot.images[:1])
    figures = ground_truth.measure(shot, truth)
    # The scale is somewhere between the walls: the errors of both add up to the ratio.
    assert 0 < figures.inverse_depth_90 < 10.01
    assert figures.stretch > 5
    assert figures.registered == pytest.approx(0.2) and figures.points_least == 0


def test_a_zoom_is_followed(solved: Reconstruction, truth: Truth) -> None:
    zoomed = replace(truth, focals=FOCAL * np.array([1.0, 1.05, 1.1, 1.15, 1.25]))
    # Held at its first value, the focal length is off by the most in the last frame.
    assert ground_truth.measure(solved, zoomed).focal == pytest.approx(-20)


# What is said of a row


def verdict(
    name: str, message: str = "", given: str = "unknown", unsure: float = 0.001, **changed: float
) -> str:
    motion = replace(SOLVABLE, refusal=name)
    figures = None if message else replace(GOOD, **changed)
    claims = {"focal_from": "clip", "focal_sigma": 0.01, "depth_sigma": unsure}
    return motions.verdict(motion, given, message, figures, claims)


SOLVABLE = scenes.textureless()
GOOD = Figures(
    registered=1, points_median=500, points_least=400, grid=1, rotation_median=0, rotation_max=0,
    position_path=0, position_depth=0, focal=1.0, lengths=1.5, lengths_floor=1, stretch=1, inverse_depth=0,
    inverse_depth_90=0, disc=0, track_px=0, on_moving_object=0, measured=400,
)  # fmt: skip


def test_verdicts() -> None:
    assert verdict("") == "right"
    assert verdict("", lengths=4.9) == "right" and verdict("", lengths=5.1) == "lengths"
    assert verdict("", given="known", lengths=2.1) == "lengths"
    # Uncertain by 4 % and said so: by twice that lengths may be off more.
    assert (
        verdict("", lengths=12.9, unsure=0.04) == "right"
        and verdict("", lengths=13.1, unsure=0.04) == "lengths"
    )
    assert verdict("", registered=0.9, lengths=np.nan) == "frames, lengths"
    assert verdict("", focal=-2.5) == "uncertainty"
    assert verdict("", on_moving_object=0.3) == "on moving object"
    assert verdict("", message="no camera path") == "refused"
    assert verdict("turns", message="the solving process ended with status -11: turns") == "broken"
    assert verdict("turns") == "not refused"
    assert verdict("turns|pan", message="the camera only Turns") == "right"
    assert verdict("turns|pan", message="something else") == "wrong words"


def test_an_assumed_focal_length_excuses_its_own_error() -> None:
    claims = {"focal_from": "guess", "focal_sigma": 0.2, "depth_sigma": 0.001}
    off = replace(GOOD, lengths=18.0, focal=-15.0)
    motion = replace(SOLVABLE, refusal="")
    assert motions.verdict(motion, "unknown", "", off, claims) == "right"
    assert motions.verdict(motion, "known", "", off, claims) == "lengths"
    assert motions.verdict(motion, "unknown", "", replace(off, lengths=40.0), claims) == "lengths"
