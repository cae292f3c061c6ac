"""Triangles along the picture's edges: which edges, how deep, and that they are sides of triangles."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from addon.core.base.errors import UserError
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Intrinsics
from addon.core.depth.sparse import DepthSamples
from addon.core.focus.focus import Focus
from addon.core.frame.meshers.thesis import edge_constrained
from addon.core.frame.meshers.thesis.edge_constrained import (
    GAP,
    PIECE,
    TRIM,
    are_sides,
    conforming,
    detected,
    edge_mesh,
    edge_rows,
)
from addon.core.frame.plan import FrameOptions
from addon.core.warp.mesh import WarpMesh, feature_mesh
from benchmarks.displaced import displaced

from ...scenes import planned, slanted_plane

Floats = NDArray[np.float64]
Picture = NDArray[np.float32]
SIZE = (320, 180)
LENS = Intrinsics(320, 180, 270.0, 270.0, 160.0, 90.0)
CANVAS = Canvas(LENS)
LEFT, RIGHT, TOP, BOTTOM = 120, 200, 40, 140
NEAR, FAR, SCALE = 0.5, 0.1, 30.0


def outline(turn: float) -> NDArray[np.float32]:
    return cv2.boxPoints(((160.0, 90.0), (80.0, 100.0), turn)).astype(np.float32)


def card(turn: float = 0.0) -> Picture:
    """A grey card before a darker wall, (h, w, 4) linear, with smooth edges."""
    mask = np.zeros((8 * SIZE[1], 8 * SIZE[0]), np.float32)
    cv2.fillPoly(mask, [np.rint(8 * outline(turn)).astype(np.int32)], 1.0)
    grey = 0.05 + 0.5 * cv2.resize(mask, SIZE, interpolation=cv2.INTER_AREA)
    return np.dstack([grey, grey, grey, np.ones_like(grey)]).astype(np.float32)


def on_card(xy: Floats) -> NDArray[np.bool_]:
    return np.all((xy > [LEFT, TOP]) & (xy < [RIGHT, BOTTOM]), axis=1)


def features(count: int = 150, seed: int = 0) -> DepthSamples:
    xy = np.random.default_rng(seed).uniform([1, 1], np.array(SIZE) - 1, (count, 2))
    return DepthSamples(1, xy, np.where(on_card(xy), NEAR, FAR), False)


def drawn(mesh: WarpMesh, xy: Floats) -> Floats:
    """(n,) the mesh's inverse depth at places (n, 2)."""
    a, b, c = (mesh.xy[mesh.triangles[:, i]] for i in range(3))

    def cross(p: Floats, q: Floats) -> Floats:
        return np.asarray(p[..., 0] * q[..., 1] - p[..., 1] * q[..., 0])

    area = cross(b - a, c - a)
    place = xy[:, None]
    share = np.stack([cross(c - b, place - b), cross(a - c, place - c), cross(b - a, place - a)], -1)
    share /= area[:, None]
    at = share.min(axis=2).argmax(axis=1)
    corner = mesh.inverse_depth[mesh.triangles[at]]
    return np.asarray((share[np.arange(len(xy)), at] * corner).sum(axis=1))


def test_edges_are_found_where_they_are() -> None:
    found = detected(card())
    assert len(found) == 4
    upright = np.ptp(found[..., 0], axis=1) < 1
    assert upright.sum() == 2
    assert np.allclose(np.sort(found[upright].mean(axis=1)[:, 0]), [LEFT, RIGHT], atol=0.6)
    assert np.allclose(np.sort(found[~upright].mean(axis=1)[:, 1]), [TOP, BOTTOM], atol=0.6)


def test_a_flat_picture_has_no_edges() -> None:
    assert detected(np.full((90, 160, 4), 0.3, np.float32)).shape == (0, 2, 2)


@pytest.mark.parametrize("turn", [0.0, 17.0, 45.0])
def test_edges_are_sides_of_triangles(turn: float) -> None:
    """Every edge is followed by a row on either side, from end to end, without a gap."""
    found = features()
    edges = detected(card(turn))
    near = np.array(
        [cv2.pointPolygonTest(outline(turn), tuple(map(float, p)), False) > 0 for p in found.observed]
    )
    inverse = np.where(near, NEAR, FAR)
    rows = edge_rows(edges, found.observed, inverse, SIZE, SCALE)
    xy, depth, triangles, pieces = conforming(
        np.concatenate([rows.xy, found.observed]), np.concatenate([rows.inverse_depth, inverse]), rows.pieces
    )
    assert are_sides(pieces, triangles).all()
    length = np.linalg.norm(xy[pieces[:, 1]] - xy[pieces[:, 0]], axis=1)
    assert length.max() <= PIECE + 1e-9
    perimeter = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1).sum()
    assert length.sum() == pytest.approx(2 * (perimeter - 4 * 2 * TRIM))
    assert np.array_equal(depth[: len(rows.xy)], rows.inverse_depth)


def test_each_side_of_an_edge_has_its_own_depth() -> None:
    found = features()
    mesh = edge_mesh(found, CANVAS, 10.0, card(), SCALE)
    down = np.linspace(TOP + 5, BOTTOM - 5, 30)
    for x, before, behind in ((LEFT, -1, 1), (RIGHT, 1, -1)):
        off = 2 * GAP
        outside = drawn(mesh, np.column_stack([np.full(30, x + before * off), down]))
        within = drawn(mesh, np.column_stack([np.full(30, x + behind * off), down]))
        assert np.allclose(outside, FAR, atol=0.02) and np.allclose(within, NEAR, atol=0.02)


def test_it_beats_the_mesh_over_the_features_alone() -> None:
    found = features()
    place = np.stack(np.meshgrid(np.arange(3, 317, 4.0), np.arange(3, 177, 4.0)), -1).reshape(-1, 2)
    true = np.where(on_card(place), NEAR, FAR)
    off = [
        np.abs(drawn(mesh, place) - true).mean()
        for mesh in (edge_mesh(found, CANVAS, 10.0, card(), SCALE), feature_mesh(found, CANVAS, 10.0))
    ]
    assert off[0] < 0.15 * off[1]


def test_wrong_features_are_outvoted() -> None:
    right = []
    for seed in range(6):
        found = features(400, seed)
        inverse = found.inverse_depth.copy()
        inverse[::10] = 3.0
        rows = edge_rows(detected(card()), found.observed, inverse, SIZE, SCALE)
        right.append(np.mean(rows.inverse_depth == np.where(on_card(rows.xy), NEAR, FAR)))
    assert np.mean(right) > 0.9


def test_paint_is_left_out() -> None:
    """One depth everywhere, or a slope: the edges say nothing, and the mesh is that of the features."""
    found = features()
    for inverse in (np.full(150, 0.3), 0.3 + 1e-4 * found.observed[:, 0]):
        painted = replace(found, inverse_depth=inverse)
        mesh = edge_mesh(painted, CANVAS, 10.0, card(), SCALE)
        plain = feature_mesh(painted, CANVAS, 10.0)
        assert np.array_equal(mesh.xy, plain.xy) and np.array_equal(mesh.triangles, plain.triangles)
        assert np.allclose(mesh.inverse_depth, plain.inverse_depth, rtol=1e-12)


def test_a_hidden_feature_says_nothing() -> None:
    """A strip before a wall: the nearest features on a side may lie past the strip's other edge."""
    edges = np.array([[[100.0, 20.0], [100.0, 160.0]], [[110.0, 20.0], [110.0, 160.0]]])
    strip = np.column_stack([np.full(4, 105.0), np.linspace(30, 150, 4)])
    wall = np.stack(np.meshgrid([80.0, 95.0, 115.0, 130.0], np.linspace(20, 160, 15)), -1).reshape(-1, 2)
    xy = np.concatenate([strip, wall])
    inverse = np.concatenate([np.full(4, NEAR), np.full(len(wall), FAR)])
    rows = edge_rows(edges, xy, inverse, SIZE, SCALE)
    on_strip = np.abs(rows.xy[:, 0] - 105) < 5
    assert on_strip.sum() > 20 and (~on_strip).sum() > 20
    assert np.all(rows.inverse_depth[on_strip] == NEAR)
    assert np.all(rows.inverse_depth[~on_strip] == FAR)


def test_pieces_are_split_until_they_are_sides() -> None:
    """A long piece between close rows of other points is no Delaunay side; halves of halves are."""
    across = np.linspace(5, 95, 31)
    others = np.concatenate([np.column_stack([across, np.full(31, y)]) for y in (48.0, 52.5)])
    frame = np.array([[0.0, 0.0], [100, 0], [0, 100], [100, 100]])
    xy = np.concatenate([[[4.0, 50.0], [96.0, 50.0]], others, frame])
    depth = np.concatenate([[0.1, 0.3], np.full(len(others) + 4, 0.2)])
    whole = np.array([[0, 1]], np.int32)
    places, depths, triangles, pieces = conforming(xy, depth, whole)
    assert len(pieces) > 8 and are_sides(pieces, triangles).all()
    added = places[len(xy) :]
    assert np.all(added[:, 1] == 50)
    assert np.allclose(depths[len(xy) :], 0.1 + 0.2 * (added[:, 0] - 4) / 92)
    assert np.linalg.norm(places[pieces[:, 1]] - places[pieces[:, 0]], axis=1).sum() == pytest.approx(92)


def test_sides_are_known_in_either_direction() -> None:
    triangles = np.array([[0, 1, 2], [2, 1, 3]], np.int32)
    sides = np.array([[0, 1], [2, 1], [1, 2], [3, 1], [0, 3]], np.int32)
    assert are_sides(sides, triangles).tolist() == [True, True, True, True, False]
    assert are_sides(np.zeros((0, 2), np.int32), triangles).shape == (0,)


def test_the_mesh_covers_the_canvas_and_its_margin_once() -> None:
    mesh = edge_mesh(features(), CANVAS, 25.0, card(20.0), SCALE)
    a, b, c = (mesh.xy[mesh.triangles[:, i]] for i in range(3))
    area = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    assert area.sum() == pytest.approx(370 * 230, rel=1e-6)
    assert np.isfinite(mesh.inverse_depth).all()


def test_parts_make_the_same_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    found, edges = features(), detected(card(17.0))
    whole = edge_rows(edges, found.observed, found.inverse_depth, SIZE, SCALE)
    monkeypatch.setattr(edge_constrained, "CHUNK", 1000)
    parts = edge_rows(edges, found.observed, found.inverse_depth, SIZE, SCALE)
    assert np.array_equal(whole.xy, parts.xy) and np.array_equal(whole.inverse_depth, parts.inverse_depth)
    assert len(whole.xy) > 80


def test_too_few_features_are_refused() -> None:
    with pytest.raises(UserError, match="2 usable feature points"):
        edge_mesh(features(2), CANVAS, 10.0, card(), SCALE)


def test_the_plan_keeps_its_views_and_what_is_in_focus_stays() -> None:
    rec = slanted_plane(LENS)
    lens = FrameOptions(Focus(distance=7.0), 0.4, 16, "edges")
    plan = planned(rec, 1, replace(lens, method="features"), SIZE)
    edged = planned(rec, 1, lens, SIZE, picture=card())
    assert np.array_equal(edged.offsets, plan.offsets)
    moved = displaced(edged, edged.mesh.xy, edged.mesh.inverse_depth) - edged.mesh.xy
    still = np.abs(edged.mesh.inverse_depth - 1 / 7.0) < 1e-12
    assert still.any() and np.abs(moved[:, still]).max() < 1e-9
