"""A camera of the scene, and cameras without points, taken for the clip's by the panel's operators."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from addon.core.sfm.workspace import load_solve

from .. import camera_files as files


@pytest.fixture
def filmed(scene: bpy.types.Scene, tmp_path: Path) -> bpy.types.Object:
    """The clip is chosen, and a camera is animated as it was filmed, 1000 frames later, in a turned world."""
    clip = files.write_clip(tmp_path / "shot")
    scene.virtual_aperture.footage = str(clip)
    lens = files.camera()
    scene.render.resolution_x, scene.render.resolution_y = lens.width, lens.height
    scene.frame_start, scene.frame_end = 1001, 1000 + files.COUNT
    data = bpy.data.cameras.new("Filmed")
    data.lens = lens.fx * data.sensor_width / lens.width
    data.shift_x = (lens.width / 2 - lens.cx) / lens.width
    data.shift_y = (lens.cy - lens.height / 2) / lens.width
    thing = bpy.data.objects.new("Filmed", data)
    scene.collection.objects.link(thing)
    known = files.model()
    for image, matrix in zip(known.images, files.to_world(known, files.OPENGL), strict=True):
        thing.matrix_world = Matrix.Translation((30, -20, 5)) @ Matrix(matrix.tolist())
        thing.keyframe_insert("location", frame=1000 + image.frame)
        thing.keyframe_insert("rotation_euler", frame=1000 + image.frame)
    return thing


def test_a_scenes_camera_is_used_where_it_stands(
    scene: bpy.types.Scene, filmed: bpy.types.Object, tmp_path: Path
) -> None:
    poses = {}
    for frame in range(1, files.COUNT + 1):
        scene.frame_set(1000 + frame)
        poses[frame] = np.array(filmed.matrix_world)
    assert bpy.ops.virtual_aperture.use_scene_camera(camera="Filmed", offset=1000) == {"FINISHED"}
    settings = scene.virtual_aperture
    kept = load_solve(tmp_path / "shot.aperture")
    assert kept.quality.registered == files.COUNT and len(settings.points.data.vertices) > 150
    assert kept.figures.method == "Blender camera"
    # Its camera is ours now, frame by frame, and the points lie before it in the same world.
    assert scene.camera == settings.camera != filmed
    assert settings.camera.data.lens == pytest.approx(filmed.data.lens, rel=1e-5)
    for frame, pose in poses.items():
        scene.frame_set(frame)
        np.testing.assert_allclose(np.array(settings.camera.matrix_world), pose, atol=1e-4)
    height = [vertex.co.z - 5 for vertex in settings.points.data.vertices]
    assert np.quantile(height, 0.95) == pytest.approx(10.0, abs=0.2)


def test_a_camera_at_other_frames_is_refused(
    scene: bpy.types.Scene, filmed: bpy.types.Object, tmp_path: Path
) -> None:
    with pytest.raises(RuntimeError, match=r"to other frames of the clip.*\(offset \+1000"):
        bpy.ops.virtual_aperture.use_scene_camera(camera="Filmed")
    assert scene.virtual_aperture.points is None
    assert not (tmp_path / "shot.aperture").exists()
    assert scene.camera is None


def test_there_must_be_a_camera_and_a_clip(scene: bpy.types.Scene, tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="Choose a clip first"):
        bpy.ops.virtual_aperture.use_scene_camera()
    scene.virtual_aperture.footage = str(files.write_clip(tmp_path / "shot"))
    with pytest.raises(RuntimeError, match="The scene has no other camera"):
        bpy.ops.virtual_aperture.use_scene_camera()
    other = bpy.data.objects.new("Another", bpy.data.cameras.new("Another"))
    scene.collection.objects.link(other)
    with pytest.raises(RuntimeError, match="the scene has no camera 'Filmed'; choose one of Another"):
        bpy.ops.virtual_aperture.use_scene_camera(camera="Filmed")


def test_cameras_without_points_are_imported(
    scene: bpy.types.Scene, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    clip = files.write_clip(tmp_path / "shot")
    scene.virtual_aperture.footage = str(clip)
    path = files.transforms(tmp_path / "transforms.json", files.model())
    assert bpy.ops.virtual_aperture.import_solve(filepath=str(path)) == {"FINISHED"}
    assert "points were tracked for them" in capfd.readouterr().out
    assert len(scene.virtual_aperture.points.data.vertices) > 150
    before = (tmp_path / "shot.aperture" / "solve.json").read_bytes()
    with pytest.raises(RuntimeError, match="already holds a solve of this clip"):
        bpy.ops.virtual_aperture.import_solve(filepath=str(path))
    assert (tmp_path / "shot.aperture" / "solve.json").read_bytes() == before
    assert bpy.ops.virtual_aperture.import_solve(filepath=str(path), again=True) == {"FINISHED"}
    # They are not there for another clip.
    with pytest.raises(RuntimeError, match="there are no cameras"):
        bpy.ops.virtual_aperture.find_points()


@pytest.mark.parametrize("name", ["import_solve", "drop_model"])
def test_a_recording_brings_its_clip(scene: bpy.types.Scene, tmp_path: Path, name: str) -> None:
    """Chosen by a file in its folder, for the file browser shows files; its depth is kept, too."""
    clip = files.write_clip(tmp_path / "shot")
    folder = files.stray(tmp_path / "recording", files.model(), clip)
    path = str(folder / "odometry.csv")
    assert getattr(bpy.ops.virtual_aperture, name)(filepath=path) == {"FINISHED"}
    assert Path(bpy.path.abspath(scene.virtual_aperture.footage)) == folder / "rgb.mp4"
    assert (folder / "rgb_lidar").is_dir()


def test_points_are_found_for_cameras_only(scene: bpy.types.Scene) -> None:
    with pytest.raises(RuntimeError, match="there are no cameras to find points for"):
        bpy.ops.virtual_aperture.find_points()
