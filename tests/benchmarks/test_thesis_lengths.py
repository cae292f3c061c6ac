"""Lengths and corners, as the figures measure them, where the answer is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction, rotation_matrix
from benchmarks.thesis import edges as thesis_edges
from benchmarks.thesis import lengths as measure
from sample_scenes import filming

from .stills import still

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


def test_one_wild_observation_moves_a_point_by_less_than_the_tolerance() -> None:
    rec, world = around(LENS, 10), cloud()
    seen = projected(rec, world)
    seen[4] += [150, -90]
    found, miss = measure.triangulated(rec, seen)
    # Least squares would share out the 175 px among ten: 17 px for each.
    assert np.delete(miss, 4, axis=0).max() < measure.TOLERANCE
    np.testing.assert_allclose(miss[4], np.hypot(150, 90), atol=measure.TOLERANCE)
    assert np.linalg.norm(found - world, axis=1).max() < 0.02 * 14


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


# Corners


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
