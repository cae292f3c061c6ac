"""Every stage of the benchmark is the same each time, is what Blender films, and keeps to its own rules."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.core.media.light import encode_srgb
from benchmarks import store
from sample_scenes import filming, staging, truth
from sample_scenes.stage import HEIGHT, WIDTH, Stage


@pytest.fixture(scope="module", params=filming.STAGES)
def stage(request: pytest.FixtureRequest) -> Stage:
    return filming.load(request.param)


@pytest.fixture(scope="module")
def scene(stage: Stage) -> Iterator[bpy.types.Scene]:
    before = bpy.context.window.scene
    scene = staging.build(stage)
    yield scene
    bpy.context.window.scene = before
    bpy.data.scenes.remove(scene)


@pytest.fixture
def small(scene: bpy.types.Scene) -> Iterator[bpy.types.Scene]:
    """The scene with pictures of 128x72."""
    before = scene.render.resolution_x, scene.render.resolution_y
    scene.render.resolution_x, scene.render.resolution_y = 128, 72
    yield scene
    scene.render.resolution_x, scene.render.resolution_y = before


def test_two_builds_are_the_same(stage: Stage) -> None:
    assert store.digest(filming.load(stage.name)) == store.digest(stage)


def judged(stage: Stage) -> tuple[int, int, int]:
    """First, middle and last frame."""
    return 1, len(stage.cameras) // 2, len(stage.cameras)


def test_focus_is_on_a_surface_that_is_seen(stage: Stage, small: bpy.types.Scene) -> None:
    for frame in judged(stage):
        depth = truth.geometry(small, frame).depth
        column, row = np.floor(stage.focus_xy[frame - 1] * 128 / WIDTH).astype(int)
        around = depth[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
        # A picture point is a few millimetres off the focus point, on a surface that may slope.
        assert np.abs(around / stage.focus_depth[frame - 1] - 1).min() < 0.01, f"frame {frame}"


def test_blender_films_with_the_stages_cameras(stage: Stage, scene: bpy.types.Scene) -> None:
    # Blender's own projection, which knows nothing of our axes.
    from bpy_extras.object_utils import world_to_camera_view
    from mathutils import Vector

    vertices = np.concatenate([thing.shape.vertices for thing in stage.things])
    points = vertices[:: max(1, len(vertices) // 200)]
    for frame in judged(stage):
        scene.frame_set(frame)
        depth = stage.cameras.to_camera(points)[frame - 1, :, 2]
        places = stage.cameras.project(points)[frame - 1]
        seen = (depth > 0.3) & ((places > 0) & (places < [WIDTH, HEIGHT])).all(axis=1)
        assert seen.sum() > 20
        for point, place in zip(points[seen], places[seen], strict=True):
            u, v, _ = world_to_camera_view(scene, scene.camera, Vector(point))
            np.testing.assert_allclose((u * WIDTH, HEIGHT - v * HEIGHT), place, atol=1e-3)


def test_tiny_render_is_neither_black_nor_clipped(stage: Stage, small: bpy.types.Scene) -> None:
    small.render.resolution_x, small.render.resolution_y = 64, 36
    linear = truth.pinhole(small, 1, samples=2)
    picture = 255 * encode_srgb(np.clip(linear, 0, 1))
    assert picture.shape == (36, 64, 3)
    assert 30 < picture.mean() < 200
    assert (linear >= 1).all(axis=-1).mean() < 0.05


def test_a_sample_is_written_into_a_folder_that_is_not_there(tmp_path: Path) -> None:
    out = tmp_path / "sample" / "plain"
    subprocess.run([sys.executable, filming.__file__, "plain", "--blend-only", "--out", out], check=True)
    assert (out / "plain.blend").exists()
    assert (out / "cameras" / "cameras.txt").exists()
