"""Lengths and corners, as the figures measure them, where the answer is known."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize

from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction, rotation_matrix
from benchmarks.thesis import edges as thesis_edges
from benchmarks.thesis import lengths as measure
from sample_scenes import filming

from .stills import edge, still

Floats = NDArray[np.float64]

# Triangulation and lengths


def around(camera: Intrinsics, count: int, seed: int = 0) -> Reconstruction:
    """Cameras about the origin that look roughly along z."""
    rng = np.random.default_rng(seed)
    images = []
    for frame in range(1, count + 1):
        rotation = rotation_matrix(rng.normal(0, 0.08, 3))
        centre = rng.uniform(-1, 1, 3)
        images.append(Image(frame, rotation, -rotation @ centre, np.zeros((0, 2)), np.zeros(0, np.int32)))
    nothing = Points(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0))
    return Reconstruction((camera,), tuple(images), nothing)


def projected(rec: Reconstruction, world: Floats) -> Floats:
    return np.stack([rec.intrinsics(image).project(image.to_camera(world)) for image in rec.images])


def cloud(count: int = 20) -> Floats:
    return np.random.default_rng(5).uniform((-3, -2, 6), (3, 2, 14), (count, 3))


LENS = Intrinsics(640, 360, 610.0, 590.0, 322.0, 177.0)
BENT = replace(LENS, k1=-0.11, k2=0.02, p1=0.002, p2=-0.001)


@pytest.mark.parametrize("camera", [LENS, BENT], ids=["pinhole", "distorted"])
def test_exact_projections_give_the_points_back(camera: Intrinsics) -> None:
    rec, world = around(camera, 6), cloud()
    found, miss = measure.triangulated(rec, projected(rec, world))
    np.testing.assert_allclose(found, world, atol=1e-9)
    assert miss.max() < 1e-9


def test_two_views_give_opencvs_points() -> None:
    rec, world = around(LENS, 2), cloud()
    seen = projected(rec, world)
    found, _ = measure.triangulated(rec, seen)
    matrix = np.array([[LENS.fx, 0, LENS.cx], [0, LENS.fy, LENS.cy], [0, 0, 1]])
    cameras = [matrix @ np.column_stack([image.rotation, image.translation]) for image in rec.images]
    four = cv2.triangulatePoints(*cameras, seen[0].T, seen[1].T)
    np.testing.assert_allclose(found, (four[:3] / four[3]).T, atol=1e-6)


def robust_cost(rec: Reconstruction, point: Floats, seen: Floats) -> float:
    """Sum of Huber's loss of the distances in pixels."""
    away = np.linalg.norm(projected(rec, point[None])[:, 0] - seen, axis=1)
    bound = measure.TOLERANCE
    return float(np.where(away < bound, away**2 / 2, bound * (away - bound / 2)).sum())


def test_noisy_points_are_where_a_general_minimiser_puts_them() -> None:
    rec, world = around(LENS, 8), cloud(6)
    # A third of the misses are beyond the tolerance.
    seen = projected(rec, world) + np.random.default_rng(2).normal(0, 0.7, (8, 6, 2))
    found, miss = measure.triangulated(rec, seen)
    np.testing.assert_allclose(miss, np.linalg.norm(projected(rec, found) - seen, axis=2), atol=1e-6)
    for k, point in enumerate(found):
        best = minimize(lambda x, k=k: robust_cost(rec, x, seen[:, k]), world[k], tol=1e-12)
        # Reweighted equations stop beside the minimum, but not where it makes a difference.
        assert robust_cost(rec, point, seen[:, k]) < 1.001 * best.fun


def test_one_wild_observation_moves_a_point_by_less_than_the_tolerance() -> None:
    rec, world = around(LENS, 10), cloud()
    seen = projected(rec, world)
    seen[4] += [150, -90]
    found, miss = measure.triangulated(rec, seen)
    # Least squares would share out the 175 px among ten: 17 px for each.
    assert np.delete(miss, 4, axis=0).max() < measure.TOLERANCE
    np.testing.assert_allclose(miss[4], np.hypot(150, 90), atol=measure.TOLERANCE)
    assert np.linalg.norm(found - world, axis=1).max() < 0.02 * 14


def test_points_that_are_seen_too_seldom_are_no_numbers() -> None:
    rec, world = around(LENS, 4), cloud(3)
    seen = projected(rec, world)
    seen[1:, 0] = np.nan
    seen[:, 1] = np.nan
    seen[2:, 2] = np.nan
    found, miss = measure.triangulated(rec, seen)
    assert np.isnan(found[:2]).all()
    np.testing.assert_allclose(found[2], world[2], atol=1e-9)
    np.testing.assert_array_equal(np.isfinite(miss[:, 2]), [True, True, False, False])


@pytest.mark.parametrize("flat", [False, True])
def test_a_similarity_comes_back(flat: bool) -> None:
    source = cloud()
    if flat:
        source[:, 2] = 8
    turn, shift = rotation_matrix(np.array([2.0, -1.1, 0.7])), np.array([3.0, -40.0, 0.5])
    scale, rotation, translation = measure.similarity(source, 7.5 * source @ turn.T + shift)
    assert scale == pytest.approx(7.5)
    np.testing.assert_allclose(rotation, turn, atol=1e-12)
    np.testing.assert_allclose(translation, shift, atol=1e-10)


def test_a_mirrored_cloud_is_turned_but_never_mirrored() -> None:
    source = cloud()
    _, rotation, _ = measure.similarity(source, source * [1, 1, -1])
    assert np.linalg.det(rotation) == pytest.approx(1)


# Corners


def test_edges_share_their_corners() -> None:
    a, b, c = (0.0, 0.0, 1.0), (0.1, 0.0, 1.0), (0.1, 0.2, 1.0)
    edges = edge("AB", a, b), edge("BC", b, c), edge("long way", c, a)
    world, rows = measure.corners_of(edges)
    assert world.shape == (3, 3)
    for each, pair in zip(edges, rows, strict=True):
        np.testing.assert_array_equal(world[pair], each.ends)
    names = thesis_edges.letters(edges, rows)
    assert [names[row] for row in rows.ravel()] == ["A", "B", "B", "C", "C", "A"]


def test_corners_that_no_letter_pair_names_get_the_next_letters() -> None:
    edges = edge("height", (0, 0, 0), (0, 0, 1)), edge("BD", (1, 0, 0), (1, 0, 1))
    _, rows = measure.corners_of(edges)
    names = thesis_edges.letters(edges, rows)
    assert [names[row] for row in rows[1]] == ["B", "D"]
    assert sorted(names[row] for row in rows[0]) == ["A", "C"]


def test_the_boxes_edges_are_spelt_by_their_corners() -> None:
    stage = filming.load("boxes")
    world, rows = measure.corners_of(stage.edges)
    names = thesis_edges.letters(stage.edges, rows)
    assert sorted(names) == list(range(len(world)))
    assert len(set(names.values())) == len(world)
    for each, pair in zip(stage.edges, rows.tolist(), strict=True):
        if len(each.name) == 2:
            assert "".join(names[row] for row in pair) == each.name


def test_a_corner_behind_a_wall_is_hidden() -> None:
    stage = still(160, 120, 100.0)
    corner = np.array([[0.2, -0.1, 2.0]])  # at pixel (90, 55)
    empty = np.full((120, 160), np.inf)
    wall, own, far = empty.copy(), empty.copy(), empty.copy()
    wall[:] = 1.0
    own[55:, 90:] = 2.0  # the corner is the upper left one of its surface
    far[57:, 90:] = 2.0
    for depth, seen in ((wall, False), (own, True), (far, False), (empty, False)):
        assert measure.visible(stage, depth, 0, corner).tolist() == [seen]
    everywhere = np.full((120, 160), 2.0)
    away = np.array([[1.7, 0.0, 2.0], [0.0, -1.3, 2.0], [0.0, 0.0, -2.0]])
    assert not measure.visible(stage, everywhere, 0, away).any()


def box_depth(low: Floats, high: Floats, size: tuple[int, int], focal: float) -> Floats:
    """(H, W) of an upright box before a camera at the origin: Kay and Kajiya's slabs."""
    column, row = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    ray = np.stack([(column - size[0] / 2) / focal, (row - size[1] / 2) / focal, np.ones_like(row)], axis=-1)
    with np.errstate(divide="ignore"):
        planes_at = np.stack([low / ray, high / ray])
    enters, leaves = planes_at.min(axis=0).max(axis=-1), planes_at.max(axis=0).min(axis=-1)
    return np.where(enters < leaves, enters, np.inf)


def test_of_a_boxs_corners_all_but_the_hindmost_are_seen() -> None:
    low, high = np.array([0.8, 0.6, 3.0]), np.array([1.3, 1.0, 3.3])
    depth = box_depth(low, high, (640, 480), 600.0)
    world = np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1).reshape(-1, 3)
    # From above and the left of it: its far, lower, right corner is hidden.
    hidden = np.all(world == high, axis=1)
    stage = still(640, 480, 600.0)
    np.testing.assert_array_equal(measure.visible(stage, depth, 0, world), ~hidden)


def test_a_click_is_on_the_middle_of_the_corners_pixel() -> None:
    stage = still(160, 120, 100.0, frames=3)
    corners = np.array([[0.203, -0.106, 2.0], [0.0, 0.0, 4.0]])
    marks = measure.clicked(stage, {2: np.full((120, 160), 2.0)}, corners)
    assert marks.shape == (3, 2, 2)
    np.testing.assert_array_equal(marks[1, 0], [90.5, 54.5])
    assert np.isnan(marks[[0, 2]]).all() and np.isnan(marks[1, 1]).all()


def test_the_nearest_mark() -> None:
    marks = np.full((6, 3, 2), np.nan)
    marks[[0, 4], 0] = 1.0
    marks[5, 1] = 1.0
    assert measure.nearest_mark(marks, 3).tolist() == [4, 5, -1]
    assert measure.nearest_mark(marks, 1).tolist() == [0, 5, -1]
