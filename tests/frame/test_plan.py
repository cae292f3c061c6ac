"""The geometry of views: limit cases, invariances, round trips."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.depth.sparse import frame_features
from addon.core.focus.focus import Focus, radius_for_blur
from addon.core.frame.plan import FrameOptions
from benchmarks.displaced import displaced
from benchmarks.picked import pick

from ..scenes import planned, slanted_plane, texture

LENS = Intrinsics(320, 180, 270.0, 270.0, 160.0, 90.0)
SIZE = (320, 180)


def test_displacement_is_a_projection_from_a_moved_camera() -> None:
    """Against a projection written out in three dimensions, without inverse depths."""
    rec = slanted_plane(LENS)
    plan = planned(rec, 2, FrameOptions(Focus(distance=8.0), 0.3, 16), SIZE)
    features = frame_features(rec, 2, plan.canvas)
    image, _ = rec.image_at(2)
    local = image.to_camera(rec.points.xyz[features.points])
    on_plane = np.column_stack([(features.observed - [160, 90]) / 270 * 8.0, np.full(len(local), 8.0)])
    for view, offset in enumerate(plan.views.offsets):
        eye = np.append(offset, 0.0)
        seen = LENS.project(local - eye)
        # Where the focal plane's point at the same pixel went is where registration brings it back from.
        slip = LENS.project(on_plane - eye) - features.observed
        expected = seen - slip
        got = displaced(plan.views, features.observed, features.inverse_depth)[view]
        assert np.abs(got - expected).max() < 1e-6


def test_blur_is_the_disc_of_the_farthest_background() -> None:
    rec = slanted_plane(LENS)
    focus = Focus(points=(5, 6, 7, 8))
    for blur in (0.01, 0.05):
        radius = radius_for_blur(rec, focus, 1, blur)
        features = frame_features(rec, 1, Canvas(LENS))
        contrast = np.abs(features.inverse_depth - focus.inverse_depth(rec, 1))
        discs = 2 * radius * LENS.fx * contrast / LENS.width
        far = features.inverse_depth < np.percentile(features.inverse_depth, 4)
        near = features.inverse_depth > np.percentile(features.inverse_depth, 96)
        assert min(abs(np.median(discs[far]) - blur), abs(np.median(discs[near]) - blur)) < 0.05 * blur


def test_the_thesis_registration_is_the_least_squares_one() -> None:
    rec = slanted_plane(LENS)
    focus = Focus(points=(1, 40, 80, 120))
    plan = planned(rec, 1, FrameOptions(focus, 0.3, 8, "thesis", 5), SIZE)
    features = frame_features(rec, 1, plan.canvas)
    at = np.isin(features.points, focus.points)
    start, inverse = features.observed[at], features.inverse_depth[at]

    def error(registration: np.ndarray) -> np.ndarray:
        other = replace(plan, views=replace(plan.views, registration=registration))
        return ((displaced(other.views, features.projected[at], inverse) - start) ** 2).sum(axis=(1, 2))

    best = error(plan.views.registration)
    for change in ((0, 0, 2, 0.01), (1, 1, 2, 0.01), (0, 0, 0, 1e-4)):
        row, row2, column, step = change
        for sign in (1, -1):
            other = plan.views.registration.copy()
            other[:, row, column] += sign * step
            if column < 2:
                other[:, 1, 1] = other[:, 0, 0]
            assert np.all(error(other) >= best - 1e-12), row2


def test_canvas_round_trip_under_distortion() -> None:
    for k1 in (-0.12, 0.08):
        lens = replace(LENS, k1=k1, p1=0.001)
        canvas = Canvas(lens)
        picture = np.ones((180, 320, 4), np.float32)
        picture[..., :3] = texture(320, 180, seed=2) / 255
        smooth = picture.copy()
        for _ in range(3):
            smooth[1:-1, 1:-1] = (
                smooth[:-2, 1:-1] + smooth[2:, 1:-1] + smooth[1:-1, :-2] + smooth[1:-1, 2:]
            ) / 4
        back = canvas.to_source(canvas.from_source(smooth))
        assert back.shape == smooth.shape
        assert np.abs(back - smooth)[4:-4, 4:-4].mean() < 0.004
        corners = np.array([[0.0, 0.0], [320, 180], [0, 180], [320, 0]])
        inside = canvas.features_from_source(corners)
        assert np.all(inside >= -1e-6) and np.all(inside <= [canvas.pinhole.width, canvas.pinhole.height])


def test_picking_on_a_slope_focuses_where_it_was_clicked() -> None:
    rng = np.random.default_rng(2)
    xy = rng.uniform([10, 10], [310, 170], (700, 2))
    # A floor; what the features say is a little noisy, and a few of them are wrong.
    inverse = (xy[:, 1] - 5) / 500
    noisy = inverse * rng.normal(1, 0.002, 700)
    noisy[::15] *= 1.5
    xyz = np.column_stack([(xy - [160, 90]) / 270, np.ones(700)]) / noisy[:, None]
    image = Image(7, np.eye(3), np.zeros(3), xy, np.arange(700, dtype=np.int32))
    rec = Reconstruction((LENS,), (image,), Points(xyz, np.zeros((700, 3), np.uint8), np.zeros(700)))
    clicks = rng.uniform([30, 30], [290, 150], (60, 2))
    focus = [pick(rec, 7, x / 320, y / 180).inverse_depth(rec, 7) for x, y in clicks]
    rows_off = np.abs(np.array(focus) * 500 + 5 - clicks[:, 1])
    nearest = [np.argsort(np.linalg.norm(xy - click, axis=1))[:4] for click in clicks]
    plain = np.abs(noisy[nearest].mean(axis=1) * 500 + 5 - clicks[:, 1])
    assert np.median(rows_off) < 0.6 * np.median(plain)
    assert rows_off.max() < 0.5 * plain.max()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"radius": 0.0}, "aperture radius is 0; it must be greater than zero"),
        ({"radius": float("nan")}, "aperture radius is nan"),
        ({"method": "magic"}, "no method 'magic'"),
        ({"focus": Focus(distance=-2.0)}, "focus distance is -2"),
        ({"focus": Focus()}, "nothing is in focus"),
        ({"focus": Focus(points=(1, 999))}, "no focus point 999"),
        ({"method": "thesis", "focus": Focus(distance=8.0)}, "at least two focus points"),
    ],
)
def test_settings_that_mean_nothing_are_refused(change: dict, message: str) -> None:
    lens = replace(FrameOptions(Focus(distance=8.0), 0.1, 8), **change)
    with pytest.raises(UserError, match=message):
        planned(slanted_plane(LENS), 1, lens, SIZE)


def test_an_unregistered_frame_gets_a_camera_between_its_neighbours() -> None:
    rec = slanted_plane(LENS, frames=(1, 5))
    plan = planned(rec, 3, FrameOptions(Focus(distance=8.0), 0.1, 8), SIZE)
    assert plan.samples.pose_interpolated and len(plan.mesh.triangles) > 50
    middle, _ = rec.image_at(3)
    assert np.allclose(middle.centre, (rec.images[0].centre + rec.images[1].centre) / 2)
