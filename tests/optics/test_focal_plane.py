"""The geometry of a tilted focal plane and of a curved field."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction, rotation_matrix
from addon.core.focus.focus import Focus, radius_for_blur, sharp_distances
from addon.core.optics.thin_lens import ACCEPTABLE, ThinLens

LENS = Intrinsics(192, 108, 180.0, 170.0, 99.0, 51.0)
XYZ = np.array([[-1.0, -0.5, 6.0], [1.2, -0.4, 4.0], [0.1, 0.9, 5.0], [0.5, -1.0, 5.2], [0.2, 0.2, 9.0]])
THROUGH = Focus((0, 1, 2), through_points=True)


def clip(xyz: np.ndarray = XYZ) -> Reconstruction:
    """Two cameras, the second one beside the first and turned."""
    images = []
    for frame, (turn, centre) in enumerate(
        (([0, 0, 0], [0, 0, 0]), ([0.05, -0.1, 0.1], [0.5, -0.2, 0.3])), 1
    ):
        rotation = rotation_matrix(np.array(turn, float))
        local = (xyz - centre) @ rotation.T
        ids = np.arange(len(xyz), dtype=np.int32)
        images.append(Image(frame, rotation, -rotation @ np.array(centre, float), LENS.project(local), ids))
    points = Points(xyz, np.zeros((len(xyz), 3), np.uint8), np.zeros(len(xyz)))
    return Reconstruction((LENS,), tuple(images), points)


def lens_of(focus: Focus, frame: int = 1, xyz: np.ndarray = XYZ) -> ThinLens:
    return focus.lens(clip(xyz), frame, LENS, 0.2)


@pytest.mark.parametrize("frame", [1, 2])
def test_points_of_the_plane_have_no_blur_in_any_frame(frame: int) -> None:
    lens, image = lens_of(THROUGH, frame), clip().images[frame - 1]
    local = image.to_camera(XYZ)
    discs = lens.blur_disc(lens.rectified(1 / local[:, 2], LENS.project(local)))
    np.testing.assert_allclose(discs[:3], 0, atol=1e-10)
    assert abs(discs[4]) > 1


def test_angles_lean_the_upper_and_the_right_part_away() -> None:
    lens = lens_of(Focus(distance=5.0, tilt=0.3, swing=0.4))
    on_axis, above, right = LENS.principal_point + np.array([[0, 0], [0, -50], [50, 0]])
    plane = lens.unrectified(np.full(3, lens.focus), np.array([on_axis, above, right]))
    assert 1 / plane[0] == pytest.approx(5)
    for inverse, angle, ray in ((plane[1], 0.3, 50 / LENS.fy), (plane[2], 0.4, 50 / LENS.fx)):
        # From (0, 5) on, at such an angle, to where the ray meets it.
        depth = 1 / inverse
        assert (depth - 5) / (depth * ray) == pytest.approx(np.tan(angle))


def test_points_that_make_no_plane_are_refused() -> None:
    with pytest.raises(UserError, match="takes 3 or more; 2 are picked"):
        lens_of(Focus((0, 1), through_points=True))
    row = np.array([[0, 0, 4.0], [1, 0.5, 5.0], [2, 1.0, 6.0]])
    with pytest.raises(UserError, match="lie on a line"):
        lens_of(THROUGH, xyz=row)
    edge_on = np.array([[0, 0, 4.0], [1, 0, 5.0], [-1, 0, 7.0]])
    with pytest.raises(UserError, match="camera lies in the plane"):
        lens_of(THROUGH, xyz=edge_on)
    with pytest.raises(UserError, match="comes within 2 radii"):
        lens_of(THROUGH, xyz=edge_on + np.array([0, 0.1, 0])).check(1, np.ones(1))


def test_discs_at_the_limits_of_what_is_sharp_are_acceptable() -> None:
    for focus in (Focus(distance=5.0), Focus(distance=5.0, swing=-0.5)):
        near, far = sharp_distances(clip(), focus, 1, 0.2)
        lens = lens_of(focus)
        on_axis = np.broadcast_to(LENS.principal_point, (2, 2))
        discs = lens.blur_disc(lens.rectified(1 / np.array([near, far]), on_axis))
        assert discs == pytest.approx(np.hypot(LENS.width, LENS.height) / ACCEPTABLE * np.array([1, -1]))
    assert sharp_distances(clip(), Focus(distance=5.0), 1, 1e-4)[1] == np.inf


def test_a_blur_is_measured_from_the_tilted_plane() -> None:
    focus = Focus(distance=5.0, swing=-0.5)
    radius = radius_for_blur(clip(), focus, 1, 0.03)
    lens = focus.lens(clip(), 1, LENS, radius)
    discs = lens.blur_disc(lens.rectified(1 / XYZ[:, 2], LENS.project(XYZ)))
    assert -np.percentile(discs, 2) / LENS.width == pytest.approx(0.03)


def test_a_few_points_close_to_the_camera_do_not_take_the_blur_of_the_background() -> None:
    """Points on a person who moves are triangulated close to the camera."""
    spread = np.random.default_rng(0).uniform([-1, -0.5, 0], [1, 0.5, 0], (100, 3))
    rays = spread + np.array([0, 0, 1])
    depths = np.linspace(6, 15, 100)
    plain = radius_for_blur(clip(rays * depths[:, None]), Focus(distance=8.0), 1, 0.03)
    depths[:6] = 0.25
    assert radius_for_blur(clip(rays * depths[:, None]), Focus(distance=8.0), 1, 0.03) == pytest.approx(
        plain, rel=0.05
    )


def test_a_pull_to_the_background_of_a_static_camera_keeps_the_lens() -> None:
    """Its points have no depth: a person in front of them gets the blur that the background had."""
    rays = np.random.default_rng(0).uniform([-0.1, -0.05, 1], [0.1, 0.05, 1], (100, 3))
    moved = clip(10 * rays / np.linalg.norm(rays, axis=1, keepdims=True))
    still = replace(moved, images=(moved.images[0], replace(moved.images[0], frame=2)))
    assert still.stays and not moved.stays
    person, wall = (radius_for_blur(still, Focus(distance=away), 1, 0.03) for away in (2.5, 10.0))
    assert wall == pytest.approx(person, rel=0.02)
    assert radius_for_blur(moved, Focus(distance=10.0), 1, 0.03) > 100 * wall


@pytest.mark.parametrize("tilt", [0.0, 0.2])
@pytest.mark.parametrize("curvature", [0.4, -0.4])
def test_a_curved_field_focuses_nearer_with_the_square_of_the_radius(curvature: float, tilt: float) -> None:
    flat = lens_of(Focus(distance=5.0, tilt=tilt))
    lens = flat.curved(curvature)
    assert lens.axis == pytest.approx(1 / 5) and not lens.is_plain and flat.curved(0.0) is flat
    half = np.hypot(LENS.width, LENS.height) / 2
    places = LENS.principal_point + half * np.array([[0.0, 0.0], [0.5, 0.0], [0.0, -0.5], [0.6, 0.8]])
    in_focus = lens.unrectified(np.full(4, lens.focus), places)
    plane = flat.unrectified(np.full(4, flat.focus), places)
    np.testing.assert_allclose(in_focus - plane, np.array([0, 0.25, 0.25, 1]) * curvature / 5, atol=1e-12)
    inverse = np.array([0.0, 0.3, 0.1, 0.5])
    rectified = lens.rectified(inverse, places)
    assert (rectified >= 0).all()
    np.testing.assert_allclose(lens.unrectified(rectified, places), inverse, atol=1e-12)
    pixels = np.stack(np.meshgrid(np.arange(LENS.width) + 0.5, np.arange(LENS.height) + 0.5), axis=-1)
    raster = np.full(pixels.shape[:2], 0.3)
    np.testing.assert_allclose(lens.rectified_raster(raster), lens.rectified(raster, pixels))
