"""Bundle adjustment against scenes that are known, finite differences and repeated trials."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from addon.core.camera.reconstruction import rotation_matrix
from addon.core.sfm.adjustment import small_motion
from addon.core.sfm.adjustment.bundle import Bundle, Observations
from addon.core.sfm.adjustment.bundle_adjustment import adjust
from addon.core.sfm.adjustment.normal_equations import pose_derivatives
from addon.core.sfm.tracking.tracks import Tracks

Floats = NDArray[np.float64]
FOCAL = 500.0


def scene(
    frames: int = 12, points: int = 60, path: float = 0.5, turn: float = 0.05, seed: int = 0
) -> tuple[Bundle, Observations]:
    """Cameras on a path `path` long before points at 3 to 9, and their exact places; all are seen by all."""
    rng = np.random.default_rng(seed)
    share = np.linspace(-0.5, 0.5, frames)
    rotation = np.array([rotation_matrix(rng.normal(0, turn, 3)) for _ in range(frames)])
    centres = np.stack([path * share, 0.2 * path * share**2, 0.1 * path * rng.normal(size=frames)], axis=1)
    depth = rng.uniform(3, 9, points)
    places = np.column_stack([rng.uniform((-300, -170), (300, 170), (points, 2)) / FOCAL, np.ones(points)])
    world = np.column_stack([places * depth[:, None], np.ones(points)])
    bundle = Bundle(
        rotation, -np.einsum("fij,fj->fi", rotation, centres),
        world / np.linalg.norm(world, axis=1, keepdims=True), np.full(frames, FOCAL),
    )  # fmt: skip
    frame, point = (each.ravel().astype(np.int32) for each in np.mgrid[0:frames, 0:points])
    nowhere = Observations(frame, point, np.zeros((len(frame), 2)))
    return bundle, replace(nowhere, xy=bundle.residuals(nowhere))


def distances(bundle: Bundle) -> Floats:
    """Between points, over their mean: what a solve can know of a scene."""
    world = bundle.points[:, :3] / bundle.points[:, 3:]
    apart = np.linalg.norm(world[:, None] - world, axis=2)
    return np.asarray(apart / apart.mean())


def test_derivatives_are_those_of_finite_differences() -> None:
    bundle, seen = scene(frames=3, points=5)
    camera, point, basis = pose_derivatives(bundle, seen, bundle.in_camera(seen))
    step = 1e-6
    for k in range(3):
        turn = rotation_matrix(step * np.eye(3)[k])
        turned = replace(bundle, rotation=turn @ bundle.rotation, translation=bundle.translation @ turn.T)
        moved = replace(bundle, translation=bundle.translation + step * np.eye(3)[k])
        slid = replace(bundle, points=bundle.points + step * basis[:, :, k])
        for other, derived in ((turned, camera[..., k]), (moved, camera[..., 3 + k]), (slid, point[..., k])):
            change = (other.residuals(seen) - bundle.residuals(seen)) / step
            np.testing.assert_allclose(derived, change, atol=1e-2)
    grown = replace(bundle, focal=bundle.focal * np.exp(step))
    change = (grown.residuals(seen) - bundle.residuals(seen)) / step
    np.testing.assert_allclose(camera[..., 6], change, atol=1e-3)


@pytest.mark.parametrize("wrong", [0.7, 1.4])
def test_the_focal_length_is_found_from_far_off(wrong: float) -> None:
    bundle, seen = scene(turn=0.1)
    start = adjust(replace(bundle, focal=wrong * bundle.focal), seen, loss=1.0).bundle
    found = adjust(start, seen, 1.0, "common")
    np.testing.assert_allclose(found.bundle.focal, FOCAL, rtol=1e-5)


def test_a_lens_that_zooms_is_found_frame_by_frame() -> None:
    bundle, seen = scene(turn=0.03, path=1.0)
    true = FOCAL * np.linspace(0.9, 1.3, len(bundle.focal))
    seen = replace(seen, xy=seen.xy * true[seen.frame, None] / FOCAL)
    found = adjust(bundle, seen, 1.0, "each", tie=1e-3, steps=200)
    np.testing.assert_allclose(found.bundle.focal / found.bundle.focal.mean(), true / true.mean(), rtol=2e-3)


def test_a_wild_sighting_moves_little() -> None:
    bundle, seen = scene()
    xy = seen.xy.copy()
    xy[7] += [80.0, -30.0]
    found = adjust(bundle, replace(seen, xy=xy), loss=0.5)
    np.testing.assert_allclose(distances(found.bundle), distances(bundle), atol=2e-2)


@pytest.mark.parametrize("lasting", [False, True], ids=["every frame", "whole tracks"])
def test_the_focal_lengths_uncertainty_is_that_of_repeated_trials(lasting: bool) -> None:
    """Whether each observation errs by itself, or a track errs alike in all frames that follow each other."""
    bundle, seen = scene(turn=0.08)
    found, said = [], []
    for trial in range(40):
        rng = np.random.default_rng(trial)
        noise = rng.normal(0, 0.2, (len(bundle.focal), len(bundle.points), 2))
        if lasting:
            noise = np.cumsum(noise, axis=0) / 3
        error = noise[seen.frame, seen.point]
        result = adjust(bundle, replace(seen, xy=seen.xy + error), 3.0, "common", steps=20)
        found.append(np.log(result.bundle.focal[0] / FOCAL))
        said.append(result.focal_sigma)
    spread, typical = float(np.std(found)), float(np.mean(said))
    print(f"focal length: spread {100 * spread:.2f} %, said {100 * typical:.2f} %")
    assert 0.6 < typical / spread < 1.6


def test_cameras_that_only_turn_tell_the_focal_length_of_points_infinitely_far() -> None:
    bundle, seen = scene(turn=0.1)
    far = bundle.points * [1, 1, 1, 0]
    far /= np.linalg.norm(far, axis=1, keepdims=True)
    still = replace(bundle, points=far, translation=np.zeros_like(bundle.translation))
    seen = replace(seen, xy=still.residuals(replace(seen, xy=np.zeros_like(seen.xy))))
    found = adjust(replace(still, focal=1.1 * still.focal), seen, 1.0, "common")
    np.testing.assert_allclose(found.bundle.focal, FOCAL, rtol=1e-4)
    assert np.isfinite(found.focal_sigma)


# From nothing


def tracks_of(seen: Observations, frames: int, points: int, noise: float, seed: int = 0) -> Tracks:
    rng = np.random.default_rng(seed)
    order = np.lexsort([seen.point, seen.frame])
    xy = seen.xy[order] + rng.normal(0, noise, seen.xy.shape) + [320, 180]
    return Tracks(
        tuple(range(1, frames + 1)), 640, 360, seen.frame[order], seen.point[order], xy,
        np.zeros((points, 3), np.uint8),
    )  # fmt: skip


def at_once(path: float, noise: float, turn: float = 0.01) -> tuple[Bundle, small_motion.Spanning, Bundle]:
    frames, points = 30, 300
    bundle, seen = scene(frames, points, path, turn)
    span = small_motion.long_tracks(tracks_of(seen, frames, points, noise), list(range(frames)))
    turned = small_motion.rotation_only(span, FOCAL)
    return bundle, span, small_motion.general_motion(span, turned.bundle).bundle


def test_a_trembling_hand_tells_depth() -> None:
    true, span, found = at_once(path=0.03, noise=0.1)
    agreement = small_motion.agreement(span.seen, found) or 0.0
    depth = [each.points[:, 3] / np.linalg.norm(each.points[:, :3], axis=1) for each in (true, found)]
    correlation = np.corrcoef(depth[0], depth[1])[0, 1]
    print(f"agreement {agreement:.2f}, correlation with the truth {correlation:.3f}")
    assert agreement > 0.8
    assert correlation > 0.97


@pytest.mark.long
def test_depths_of_a_camera_that_only_turns_do_not_agree() -> None:
    _, span, found = at_once(path=0.0, noise=0.1, turn=0.03)
    agreement = small_motion.agreement(span.seen, found) or 0.0
    print(f"agreement {agreement:.2f}")
    assert agreement < 0.4
