"""The unit of length is arbitrary: every stage gives the same in units a billion times smaller or larger."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import cv2
import numpy as np
import pytest

from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.depth.map_fusion import past_border
from addon.core.depth.multi_view_stereo import PlaneSweepStereo
from addon.core.depth.sparse import frame_features
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.frame import Frame
from addon.core.frame.frame_path import mesh_frame
from addon.core.frame.plan import FrameOptions
from addon.core.media.light import to_linear
from addon.render.views.average import draw_mean, render_frame
from sample_scenes import cycles_views

from .. import planes
from ..scenes import psnr
from ..variants import variants

SIZE = 160, 120
COUNT, FRAME = 8, 4
SCALES = variants((1e-9, 1e9, 1e-6, 1e5), 2)
FOCUS, RADIUS = 6.0, 0.5
"""Scene units."""
PICKED = (302, 305, 310, 320)
"""Points of the plane nearest to the camera."""
EQUAL = 90.0
"""dB."""
DIGITS = 1e-4
"""Relative difference of numbers that are equal but for single precision."""
KEPT = 1e-3
"""The same of depth as it is kept, in steps of which either neighbour may be the nearest one."""


@cache
def pictures() -> list[np.ndarray]:
    """(120, 160, 3) of three planes, from a camera that walks to the side."""
    return planes.halved(planes.sideways(COUNT))


@cache
def truth() -> Reconstruction:
    """The cameras of the clip, and points that they see on its planes."""
    camera = Intrinsics(*SIZE, planes.FOCAL / 2, planes.FOCAL / 2, SIZE[0] / 2, SIZE[1] / 2)
    rng = np.random.default_rng(5)
    points = np.concatenate(
        [
            rng.uniform([max(left, -7), -5, z], [min(right, 7), 5, z], (150, 3))
            for z, (left, right) in planes.PLANES.items()
        ]
    )
    images = []
    for frame, s in enumerate(np.linspace(-0.5, 0.5, COUNT), 1):
        centre = np.array([s, 0.2 * s * s, 0.1 * s])
        rotation = cv2.Rodrigues(np.array([0.01 * s, 0.04 * s, 0.0]))[0]
        local = (points - centre) @ rotation.T
        xy = camera.project(local)
        seen = np.all((xy > 0) & (xy < SIZE), axis=1)
        for z, (left, right) in planes.PLANES.items():
            # What lies behind this plane is hidden by it.
            reach = (z - centre[2]) / (points[:, 2] - centre[2])
            across = centre[0] + reach * (points[:, 0] - centre[0])
            seen &= ~((points[:, 2] > z) & (across > left) & (across < right))
        rows = np.flatnonzero(seen).astype(np.int32)
        images.append(Image(frame, rotation, -rotation @ centre, xy[rows], rows))
    grey = np.full((len(points), 3), 128, np.uint8)
    return Reconstruction((camera,), tuple(images), Points(points, grey, np.full(len(points), 0.1)))


def scaled(scale: float) -> Reconstruction:
    """The same in units so many times smaller: its numbers are so many times larger."""
    made = truth()
    images = tuple(replace(image, translation=scale * image.translation) for image in made.images)
    return replace(made, images=images, points=replace(made.points, xyz=scale * made.points.xyz))


@dataclass(frozen=True)
class Stages:
    """What a frame comes to in every stage, lengths in the truth's own unit."""

    sparse: np.ndarray
    swept: np.ndarray
    fused: np.ndarray
    frame: Frame
    vertices: np.ndarray
    views: np.ndarray
    picture: np.ndarray


@cache
def stages(scale: float, method: str = "layers") -> Stages:
    model = scaled(scale)
    clip = ClipContext(model, lambda frame: pictures()[frame - 1])
    settings = FrameOptions(Focus(distance=FOCUS * scale), RADIUS * scale, 16, method)
    features = frame_features(model, FRAME, Canvas(model.cameras[0]))
    swept = PlaneSweepStereo(model, clip.read).at(FRAME)
    fused = clip.stereo.at(FRAME)
    frame = mesh_frame(clip, FRAME, settings, SIZE, to_linear(clip.read(FRAME))).through(16)
    mesh = frame.mesh
    return Stages(
        features.inverse_depth * scale, swept.inverse_depth * scale, fused.inverse_depth * scale,
        frame, mesh.inverse_depth * scale,
        draw_mean(frame),
        render_frame(clip, FRAME, settings, SIZE, lambda note: None),
    )  # fmt: skip


@pytest.mark.parametrize("scale", SCALES)
def test_depth_is_the_same_in_any_unit(scale: float) -> None:
    one, other = stages(1.0), stages(scale)
    for stage, digits in (("sparse", DIGITS), ("swept", DIGITS), ("fused", KEPT)):
        np.testing.assert_allclose(getattr(other, stage), getattr(one, stage), rtol=digits, err_msg=stage)


@pytest.mark.parametrize("scale", SCALES)
def test_depth_past_the_border_is_the_same_in_any_unit(scale: float) -> None:
    rng = np.random.default_rng(1)
    inverse = np.full((3, 60, 80), 0.2, np.float32) + rng.normal(0, 1e-4, (3, 60, 80)).astype(np.float32)
    weight, nearest = np.ones_like(inverse), np.full_like(inverse, np.inf)
    found = [
        by * past_border(list(zip(each, weight, nearest, strict=True)), each[0, 10:-10, 10:-10], 0.01 / by)
        for by, each in ((by, inverse / np.float32(by)) for by in (1.0, scale))
    ]
    assert np.isfinite(found[0]).sum() > 1000
    np.testing.assert_allclose(*found, rtol=DIGITS)


@pytest.mark.parametrize("scale", SCALES)
def test_layers_and_mesh_are_the_same_in_any_unit(scale: float) -> None:
    one, other = stages(1.0), stages(scale)
    # Triangles of one depth may be drawn in any order.
    one_by_one, others = ({*map(frozenset, each.frame.mesh.triangles.tolist())} for each in (one, other))
    assert one_by_one == others
    np.testing.assert_allclose(other.vertices, one.vertices, rtol=KEPT)
    for mine, theirs in zip(one.frame.layers, other.frame.layers, strict=True):
        assert psnr(mine.picture, theirs.picture) > EQUAL


@pytest.mark.parametrize("scale", SCALES)
def test_pictures_are_the_same_in_any_unit(scale: float) -> None:
    one, other = stages(1.0), stages(scale)
    discs = [each.frame.lens.largest_disc(each.frame.mesh.inverse_depth) for each in (one, other)]
    assert discs[1] == pytest.approx(discs[0], rel=KEPT)
    assert psnr(one.views, other.views) > EQUAL
    assert psnr(one.picture, other.picture) > EQUAL


@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_views_by_cycles_are_the_same_in_any_unit(scale: float) -> None:
    one, other = (
        cycles_views.mean_of_views(each.frame.views, each.frame.layers)
        for each in (stages(1.0), stages(scale))
    )
    assert psnr(one, other) > EQUAL


@pytest.mark.parametrize("method", ["features", "thesis"])
@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_other_methods_are_the_same_in_any_unit(scale: float, method: str) -> None:
    drawn = [
        render_frame(
            ClipContext(scaled(each), lambda frame: pictures()[frame - 1]), FRAME,
            FrameOptions(Focus(PICKED), RADIUS * each, 4, method), SIZE, lambda note: None,
        )
        for each in (1.0, scale)
    ]  # fmt: skip
    assert psnr(*drawn) > EQUAL
