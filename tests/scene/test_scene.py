"""What comes into the Blender scene."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector

from addon.core.base.errors import UserError
from addon.core.camera.reconstruction import Intrinsics, normalise
from addon.scene.build import build
from addon.scene.solve import point_cloud
from addon.scene.sources.shot import Shot, reconstruction_digest

from ..scenes import slanted_plane, slanted_shot

LENS = Intrinsics(320, 180, 270.0, 270.0, 160.0, 90.0)

PYCOLMAP = """
import json, sys, cv2, numpy as np, pycolmap
job = json.load(sys.stdin)
camera = pycolmap.Camera(model='PINHOLE', width=job['width'], height=job['height'], params=job['params'])
print(json.dumps(np.asarray(camera.img_from_cam(np.array(job['local']))).tolist()))
"""


def pycolmap_projection(camera: Intrinsics, local: np.ndarray) -> np.ndarray:
    """In a process of its own: pycolmap may not share one with Blender."""
    job = {
        "width": camera.width,
        "height": camera.height,
        "params": [camera.fx, camera.fy, camera.cx, camera.cy],
        "local": local.tolist(),
    }
    done = subprocess.run(
        [sys.executable, "-c", PYCOLMAP], input=json.dumps(job), capture_output=True, text=True, check=True
    )
    return np.array(json.loads(done.stdout))


@pytest.mark.parametrize(
    "camera",
    [
        replace(LENS, fx=250.0, cx=150.0),
        replace(LENS, fy=240.0, cy=99.5),
    ],
    ids=["tall pixels", "wide pixels"],
)
def test_the_blender_camera_projects_as_pycolmap_does(
    scene: bpy.types.Scene, tmp_path: Path, camera: Intrinsics
) -> None:
    shot = slanted_shot(tmp_path, camera, frames=(3, 4, 9))
    settings = build(scene, shot.footage, shot.reconstruction)
    size = np.array([camera.width, camera.height])
    for image in shot.reconstruction.images:
        scene.frame_set(image.frame)
        world = shot.reconstruction.points.xyz
        seen = np.array([world_to_camera_view(scene, settings.camera, Vector(p))[:2] for p in world])
        pixels = np.column_stack([seen[:, 0], 1 - seen[:, 1]]) * size
        assert np.abs(pixels - pycolmap_projection(camera, image.to_camera(world))).max() < 0.01


def test_the_scene_follows_the_clip(scene: bpy.types.Scene, tmp_path: Path) -> None:
    shot = slanted_shot(tmp_path, LENS, frames=(5, 6, 9))
    settings = build(scene, shot.footage, shot.reconstruction)
    assert (scene.frame_start, scene.frame_end) == (5, 9)
    assert (scene.render.resolution_x, scene.render.resolution_y) == (320, 180)
    assert scene.render.fps / scene.render.fps_base == pytest.approx(24)
    assert scene.camera == settings.camera and settings.camera.parent == settings.root
    background = settings.camera.data.background_images[0]
    assert background.image.filepath.endswith("clip_0005.png")
    assert (background.image_user.frame_start, background.image_user.frame_duration) == (5, 5)
    mesh = settings.points.data
    assert len(mesh.vertices) == len(shot.reconstruction.points)
    for name in ("colour", "reprojection_error", "frames", "point"):
        assert name in mesh.attributes
    frames = np.zeros(len(mesh.vertices), np.int32)
    mesh.attributes["frames"].data.foreach_get("value", frames)
    assert np.all(frames == 3)


def test_importing_again_replaces_and_leaves_the_users_things(scene: bpy.types.Scene, tmp_path: Path) -> None:
    mine = bpy.data.objects.new("Mine", bpy.data.meshes.new("Mine"))
    scene.collection.objects.link(mine)
    shot = slanted_shot(tmp_path, LENS)
    build(scene, shot.footage, shot.reconstruction)
    before = {len(bpy.data.objects), len(bpy.data.meshes)}, len(bpy.data.collections), len(bpy.data.cameras)
    images = len(bpy.data.images)
    for _ in range(2):
        build(scene, shot.footage, shot.reconstruction)
    assert before == (
        {len(bpy.data.objects), len(bpy.data.meshes)},
        len(bpy.data.collections),
        len(bpy.data.cameras),
    )
    assert len(bpy.data.images) == images
    assert "Mine" in scene.collection.objects


def test_the_reconstruction_in_the_blend_is_exact(scene: bpy.types.Scene, tmp_path: Path) -> None:
    shot = slanted_shot(tmp_path / "clip", replace(LENS, k1=-0.1))
    rec = normalise(shot.reconstruction)
    settings = build(scene, shot.footage, rec)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    back = point_cloud.read(bpy.context.scene.virtual_aperture.points.data)
    assert back.cameras == rec.cameras
    assert np.array_equal(back.points.xyz, rec.points.xyz)
    for a, b in zip(back.images, rec.images, strict=True):
        assert a.frame == b.frame and np.array_equal(a.rotation, b.rotation)
        assert np.array_equal(a.translation, b.translation)
        assert np.array_equal(a.xy, b.xy) and np.array_equal(a.points, b.points)
    del settings


def test_a_reconstruction_of_1_0_is_read_without_the_points_that_frames_did_not_track(
    scene: bpy.types.Scene, tmp_path: Path
) -> None:
    rec = slanted_shot(tmp_path / "clip", LENS).reconstruction
    mesh = bpy.data.meshes.new("points")
    point_cloud.write(mesh, rec)
    mesh["virtual_aperture_version"] = 3
    mesh["virtual_aperture_visible_counts"] = np.ones(len(rec.images), np.int32)
    mesh["virtual_aperture_visible_points"] = np.arange(len(rec.images), dtype=np.int32)
    back = point_cloud.read(mesh)
    assert reconstruction_digest(back) == reconstruction_digest(rec)
    point_cloud.write(mesh, back)
    assert "virtual_aperture_visible_points" not in mesh
    mesh["virtual_aperture_version"] = 2
    with pytest.raises(UserError, match="another version"):
        point_cloud.read(mesh)


def test_a_solve_may_replace_one_of_another_size(scene: bpy.types.Scene, tmp_path: Path) -> None:
    # Blender writes an array property over a shorter one past its end: the heap shows it at the third or so.
    footage = slanted_shot(tmp_path / "clip", LENS).footage
    for count in (100, 285, 137, 322, 174, 211):
        reconstruction = slanted_plane(LENS, count=count)
        settings = build(scene, footage, reconstruction)
        found = point_cloud.read(settings.points.data)
        np.testing.assert_array_equal(found.points.xyz, reconstruction.points.xyz)
        assert len(settings.points.data.vertices) == count


def test_a_large_world_loses_nothing_in_single_precision(scene: bpy.types.Scene, tmp_path: Path) -> None:
    shot = slanted_shot(tmp_path, LENS)
    far = np.array([4e6, -7e6, 1e6])
    rec = shot.reconstruction
    moved = replace(
        rec,
        points=replace(rec.points, xyz=rec.points.xyz * 1e3 + far),
        images=tuple(replace(i, translation=1e3 * i.translation - i.rotation @ far) for i in rec.images),
    )
    shot = Shot(shot.footage, normalise(moved))
    settings = build(scene, shot.footage, shot.reconstruction)
    image = shot.reconstruction.images[1]
    scene.frame_set(image.frame)
    vertices = np.array([v.co[:] for v in settings.points.data.vertices])
    seen = np.array([world_to_camera_view(scene, settings.camera, Vector(p))[:2] for p in vertices])
    pixels = np.column_stack([seen[:, 0], 1 - seen[:, 1]]) * [320, 180]
    assert np.abs(pixels - image.xy).max() < 0.01
