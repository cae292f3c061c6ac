"""The content-preserving warp: limit cases of the membrane, the solver, and features that come and go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from addon.core.base.errors import UserError
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Intrinsics, Reconstruction
from addon.core.depth.sparse import DepthSamples, frame_features
from addon.core.focus.focus import Focus
from addon.core.frame.meshers.thesis import content_preserving
from addon.core.frame.meshers.thesis.content_preserving import (
    OUTLIER_NEIGHBOURS,
    STIFFNESS,
    allowed,
    conjugate_gradients,
    fading,
    grid_mesh,
    membrane,
    outliers,
)
from addon.core.frame.plan import FrameOptions

from ...scenes import planned, slanted_plane

Floats = NDArray[np.float64]
LENS = Intrinsics(320, 180, 270.0, 270.0, 160.0, 90.0)
SIZE = (320, 180)
STIFFNESS = STIFFNESS
CANVAS = Canvas(LENS)
X, Y = np.linspace(-20, 340, 37), np.linspace(-20, 200, 23)


def scattered(count: int, seed: int = 0) -> Floats:
    return np.random.default_rng(seed).uniform([0, 0], SIZE, (count, 2))


def features(xy: Floats, inverse: Floats) -> DepthSamples:
    return DepthSamples(1, xy, inverse, False)


def inside(xy: Floats) -> NDArray[np.bool_]:
    return np.all((xy >= 0) & (xy <= SIZE), axis=1)


# The membrane


def test_a_plane_is_reproduced_exactly() -> None:
    xy = scattered(40)
    plane = np.array([2e-4, -3e-4])
    mesh = grid_mesh(features(xy, 0.3 + xy @ plane), np.ones(40), CANVAS, 30.0, 0.1)
    within = inside(mesh.xy)
    assert np.abs(mesh.inverse_depth - 0.3 - mesh.xy @ plane)[within].max() < 1e-12
    assert mesh.inverse_depth.min() >= 0


def test_the_whole_way_from_a_plane_in_space_to_a_view() -> None:
    """Every vertex moves as the plane itself does, apart from what is so little blurred that it is sharp."""
    rec = slanted_plane(LENS)
    plan = planned(rec, 1, FrameOptions(Focus(distance=20.0), 0.3, 8, "grid"), SIZE)
    share = plan.mesh.xy[:, 0] / 320
    found = frame_features(rec, 1, plan.canvas)
    slope = np.polyfit(found.observed[:, 0], found.inverse_depth, 1)
    assert np.abs(np.polyval(slope, plan.mesh.xy[:, 0]) - plan.mesh.inverse_depth)[
        (share >= 0) & (share <= 1)
    ].max() < 1e-6  # fmt: skip


def test_one_depth_gives_one_shift() -> None:
    xy = scattered(30)
    mesh = grid_mesh(features(xy, np.full(30, 0.25)), np.ones(30), CANVAS, 12.0, 0.1)
    assert np.ptp(mesh.inverse_depth) < 1e-12
    assert mesh.inverse_depth.mean() == pytest.approx(0.25)


def test_without_features_it_is_flat() -> None:
    mesh = grid_mesh(features(np.zeros((0, 2)), np.zeros(0)), np.zeros(0), CANVAS, 12.0, 0.125)
    assert np.all(mesh.inverse_depth == 0.125)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_features_are_enough(count: int) -> None:
    xy = np.array([[50.0, 60.0], [200.0, 60.0], [90.0, 150.0]])[:count]
    values = np.array([0.2, 0.3, 0.1])[:count]
    mesh = grid_mesh(features(xy, values), np.ones(count), CANVAS, 5.0, 0.1)
    assert np.isfinite(mesh.inverse_depth).all()
    low, high = allowed(values, 0.1)
    assert mesh.inverse_depth.min() >= low and mesh.inverse_depth.max() <= high


def test_a_features_depth_is_met_and_a_stiff_grid_misses_it() -> None:
    xy = scattered(25)
    values = np.random.default_rng(1).uniform(0.1, 0.5, 25)
    missed = []
    for stiffness in (1e-6, 1e-2, 1e4):
        grid = membrane(X, Y, xy, values, np.ones(25), stiffness)
        vertex, share = content_preserving._bilinear(X, Y, xy)
        missed.append(np.abs((share * grid.ravel()[vertex]).sum(axis=1) - values).max())
    assert missed[0] < 1e-4 and missed[0] < missed[1] < missed[2]
    # Stiff beyond all measure, nothing but the plane is left.
    plane = np.column_stack([xy, np.ones(25)])
    fitted = plane @ np.linalg.lstsq(plane, values)[0]
    assert missed[2] == pytest.approx(np.abs(fitted - values).max(), rel=1e-3)


def test_the_membrane_is_the_least_of_its_energy() -> None:
    xy, rng = scattered(12), np.random.default_rng(2)
    values, weights = rng.uniform(0.1, 0.5, 12), rng.uniform(0.1, 1, 12)
    found = membrane(X, Y, xy, values, weights, STIFFNESS)
    slope = content_preserving._plane(xy, values, weights)
    level = slope[0] * X + slope[1] * Y[:, None] + slope[2]
    vertex, share = content_preserving._bilinear(X, Y, xy)

    def energy(grid: Floats) -> float:
        missed = (share * grid.ravel()[vertex]).sum(axis=1) - values
        bent = grid - level
        # Cells are square, and half as many meet at the border.
        half_x, half_y = np.ones(len(Y)), np.ones(len(X))
        half_x[[0, -1]] = half_y[[0, -1]] = 0.5
        steps = (half_x[:, None] * np.diff(bent, axis=1) ** 2).sum()
        steps += (half_y * np.diff(bent, axis=0) ** 2).sum()
        return float((weights * missed**2).sum() + STIFFNESS * steps)

    best = energy(found)
    for _ in range(20):
        assert energy(found + 1e-3 * rng.standard_normal(found.shape)) > best


def test_it_does_not_matter_where_the_lines_lie() -> None:
    """Twice as many lines across: the same membrane, but for what a finer grid can do more."""
    xy = scattered(12)
    values = 0.3 + 0.1 * np.sin(xy[:, 0] / 60) * np.cos(xy[:, 1] / 50)
    coarse = membrane(X, Y, xy, values, np.ones(12), STIFFNESS)
    fine = membrane(np.linspace(-20, 340, 73), Y, xy, values, np.ones(12), STIFFNESS)[:, ::2]
    assert np.abs(coarse - fine).mean() < 0.03 * np.ptp(coarse)


def test_a_wild_feature_is_left_out_and_a_thin_thing_is_not() -> None:
    xy = scattered(60)
    values = np.where(xy[:, 0] < 160, 0.1, 0.2) + 1e-4 * xy[:, 1]
    values[7] = 3.0
    assert np.nonzero(outliers(xy, values, OUTLIER_NEIGHBOURS))[0].tolist() == [7]
    clean = grid_mesh(features(np.delete(xy, 7, 0), np.delete(values, 7)), np.ones(59), CANVAS, 9.0, 0.1)
    spoilt = grid_mesh(features(xy, values), np.ones(60), CANVAS, 9.0, 0.1)
    within = inside(clean.xy)
    assert np.abs(clean.inverse_depth - spoilt.inverse_depth)[within].max() < 0.02
    # One feature alone before a wall, as deep as others elsewhere.
    values[7] = 0.1 if xy[7, 0] > 160 else 0.2
    assert not outliers(xy, values, OUTLIER_NEIGHBOURS).any()


def test_no_triangle_flips_in_mild_discs() -> None:
    xy = scattered(60)
    values = 0.2 + 0.1 * np.random.default_rng(4).random(60)
    mesh = grid_mesh(features(xy, values), np.ones(60), CANVAS, 20.0, 0.1)
    corner = mesh.xy[mesh.triangles]
    for offset in 20.0 * np.array([[1, 0], [0, 1], [-0.7, 0.7], [-0.7, -0.7]]):
        moved = corner - offset * mesh.inverse_depth[mesh.triangles][..., None]
        for each in (corner, moved):
            a, b = each[:, 1] - each[:, 0], each[:, 2] - each[:, 0]
            assert np.all(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] > 0)


@pytest.mark.parametrize("margin", [0.5, 40.0, 5000.0])
def test_the_canvas_and_its_margin_are_covered_once(margin: float) -> None:
    mesh = grid_mesh(features(scattered(9), np.full(9, 0.2)), np.ones(9), CANVAS, margin, 0.1)
    corner = mesh.xy[mesh.triangles]
    a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    area = (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2
    assert area.min() > 0
    assert area.sum() == pytest.approx((320 + 2 * margin) * (180 + 2 * margin))
    assert len(mesh.xy) < 5000


# The solver


def test_conjugate_gradients_solve_a_known_system() -> None:
    rng = np.random.default_rng(0)
    root = rng.standard_normal((12, 12))
    matrix = root @ root.T + 0.1 * np.eye(12)
    wanted = rng.standard_normal((3, 4))
    found = conjugate_gradients(
        lambda grid: (matrix @ grid.ravel()).reshape(3, 4), wanted, np.diag(matrix).reshape(3, 4)
    )
    assert np.allclose(found.ravel(), np.linalg.solve(matrix, wanted.ravel()), rtol=1e-6)


def test_a_system_without_an_answer_is_refused() -> None:
    singular = np.array([[1.0, -1.0], [-1.0, 1.0]])
    with pytest.raises(UserError, match="cannot be computed"):
        conjugate_gradients(
            lambda grid: (singular @ grid.ravel()).reshape(1, 2), np.array([[1.0, 1.0]]), np.ones((1, 2))
        )


# Coming and going


def clip_of(first: int, last: int, frames: int = 60, visible: bool = False) -> Reconstruction:
    """A camera that stands still; point 5 is seen from one frame to another, all others always."""
    rec = slanted_plane(LENS)
    images = []
    for image in (replace(rec.images[0], frame=frame) for frame in range(1, frames + 1)):
        gone = (image.points == 5) & (visible or not first <= image.frame <= last)
        seen = visible and first <= image.frame <= last
        images.append(
            replace(
                image, xy=image.xy[~gone], points=image.points[~gone],
                visible=np.array([5] if seen else [], np.int32),
            )
        )  # fmt: skip
    return replace(rec, images=tuple(images))


@pytest.mark.parametrize("visible", [False, True])
def test_weights_are_a_share_and_continuous_over_a_clip(visible: bool) -> None:
    rec = clip_of(14, 45, visible=visible)
    own = np.array([5], np.int32)
    weight = np.array([fading(rec, frame, own)[0] for frame in range(14, 46)])
    assert np.all((weight > 0) & (weight <= 1))
    assert weight[0] < 0.03 and weight[-1] < 0.03
    assert np.abs(np.diff(np.concatenate([[0], weight, [0]]))).max() < 0.15
    assert np.all(weight[10:-10] == 1)
    assert np.allclose(weight, weight[::-1])


def test_a_clips_own_ends_are_no_ends() -> None:
    rec = clip_of(1, 30)
    points = np.array([3, 5], np.int32)
    for frame in (1, 2, 15):
        assert np.all(fading(rec, frame, points) == 1)
    late = fading(rec, 28, points)
    assert late[0] == 1 and late[1] < 0.3
    assert np.all(fading(rec, 60, points[:1]) == 1)


def test_places_of_a_depth_map_and_single_frames_do_not_fade() -> None:
    rec = clip_of(14, 45)
    assert np.all(fading(rec, 20, np.full(4, -1, np.int32)) == 1)
    alone = replace(rec, images=rec.images[19:20])
    assert np.all(fading(alone, 20, np.arange(150, dtype=np.int32)) == 1)


def test_a_coming_feature_does_not_jerk_the_grid() -> None:
    """One feature in front of a wall: the mesh swells to it step by step, over as many frames as it fades."""
    rec = clip_of(14, 60)
    xyz = rec.points.xyz.copy()
    xyz[5] *= 0.8
    rec = replace(rec, points=replace(rec.points, xyz=xyz))
    lens = FrameOptions(Focus(distance=30.0), 0.3, 4, "grid")
    place = rec.images[20].xy[5]

    def depth(frame: int) -> float:
        mesh = planned(rec, frame, lens, SIZE).mesh
        return float(mesh.inverse_depth[np.linalg.norm(mesh.xy - place, axis=1).argmin()])

    seen = np.array([depth(frame) for frame in range(12, 28)])
    swelling = seen[-1] - seen[0]
    assert swelling > 0.02
    assert np.all(np.diff(seen) >= -1e-9) and np.diff(seen).max() < 0.4 * swelling
