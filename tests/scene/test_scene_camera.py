"""A scene's own camera is taken as Blender would render with it, however its lens and pose came about."""

from __future__ import annotations

import math
from pathlib import Path

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Euler, Vector

from addon.core.base.errors import UserError
from addon.core.media.clip import Footage, open_footage
from addon.core.readers.matching import Imported
from addon.scene.sources.scene_camera import read_scene_camera

from ..scenes import LENS, write_frames

FRAMES = (1, 2, 3, 4)


@pytest.fixture
def footage(tmp_path: Path) -> Footage:
    return open_footage(write_frames(tmp_path / "clip", LENS, FRAMES))


@pytest.fixture
def filmed(scene: bpy.types.Scene) -> bpy.types.Object:
    """A camera that goes and turns about all axes, in a scene that renders the clip's shape."""
    scene.render.resolution_x, scene.render.resolution_y = 2 * LENS.width, 2 * LENS.height
    scene.frame_start, scene.frame_end = 1, 4
    thing = bpy.data.objects.new("Filmed", bpy.data.cameras.new("Filmed"))
    scene.collection.objects.link(thing)
    for frame in (1, 4):
        thing.location = (0.3 * frame, -5 + 0.1 * frame, 1.5)
        thing.rotation_euler = Euler((1.4, 0.05 * frame, 0.1 * frame))
        thing.keyframe_insert("location", frame=frame)
        thing.keyframe_insert("rotation_euler", frame=frame)
    return thing


def check(scene: bpy.types.Scene, filmed: bpy.types.Object, found: Imported, offset: int = 0) -> None:
    """Points land where Blender itself says that the camera sees them."""
    assert found.placed and found.lacks_points
    images = {image.frame: image for image in found.reconstruction.images}
    random = np.random.default_rng(3)
    world = random.uniform([-1, 0, 0.5], [2, 6, 2.5], (20, 3))
    for frame in FRAMES:
        scene.frame_set(frame + offset)
        layer = scene.view_layers[0]
        evaluated = filmed.evaluated_get(layer.depsgraph)
        seen = [world_to_camera_view(scene, evaluated, Vector(point)) for point in world]
        image = images[frame]
        local = image.to_camera(world)
        place = found.reconstruction.intrinsics(image).project(local)
        wanted = [(x * LENS.width, (1 - y) * LENS.height) for x, y, _ in seen]
        np.testing.assert_allclose(place, wanted, atol=2e-3)
        np.testing.assert_allclose(local[:, 2], [depth for *_, depth in seen], atol=1e-5)


@pytest.mark.parametrize("fit", ["AUTO", "HORIZONTAL", "VERTICAL"])
def test_sensor_shift_and_zoom(
    scene: bpy.types.Scene, filmed: bpy.types.Object, footage: Footage, fit: str
) -> None:
    data = filmed.data
    data.sensor_fit, data.sensor_width, data.sensor_height = fit, 23.5, 15.6
    data.shift_x, data.shift_y = 0.11, -0.07
    for frame, focal in ((1, 24.0), (4, 40.0)):
        data.lens = focal
        data.keyframe_insert("lens", frame=frame)
    found = read_scene_camera(scene, filmed, footage)
    assert len(found.reconstruction.cameras) == 4
    check(scene, filmed, found)


def test_pixels_of_the_scene_need_not_be_square(
    scene: bpy.types.Scene, filmed: bpy.types.Object, footage: Footage
) -> None:
    """The clip's are: a squeezed 80x90 with pixels twice as wide has its shape."""
    scene.render.resolution_x, scene.render.pixel_aspect_x = LENS.width, 2.0
    scene.render.resolution_y = 2 * LENS.height
    check(scene, filmed, read_scene_camera(scene, filmed, footage))


def test_parents_constraints_and_scale(
    scene: bpy.types.Scene, filmed: bpy.types.Object, footage: Footage
) -> None:
    """As FBX and Alembic bring cameras: below a scaled and turned empty, aimed at something."""
    parent, aim = bpy.data.objects.new("Rig", None), bpy.data.objects.new("Aim", None)
    for thing in (parent, aim):
        scene.collection.objects.link(thing)
    parent.scale = (0.01, 0.01, 0.01)
    parent.rotation_euler = (math.pi / 2, 0, 0)
    filmed.animation_data_clear()
    filmed.parent = parent
    aim.location = (0.5, 3.0, 1.5)
    for frame in (1, 4):
        filmed.location = (100.0 * frame, 150.0, 500.0)
        filmed.keyframe_insert("location", frame=frame)
    constraint = filmed.constraints.new("TRACK_TO")
    constraint.target, constraint.track_axis, constraint.up_axis = aim, "TRACK_NEGATIVE_Z", "UP_Y"
    check(scene, filmed, read_scene_camera(scene, filmed, footage))


def test_an_offset_and_what_lies_beyond(
    scene: bpy.types.Scene, filmed: bpy.types.Object, footage: Footage
) -> None:
    """Frame f of the clip has the scene's frame f + offset; the animation beyond is there to be compared."""
    for layer in filmed.animation_data.action.layers:
        for bag in layer.strips[0].channelbags:
            for curve in bag.fcurves:
                for key in curve.keyframe_points:
                    key.co_ui.x += 1000
    scene.frame_start, scene.frame_end = 995, 1010
    found = read_scene_camera(scene, filmed, footage, 1000)
    check(scene, filmed, found, 1000)
    assert found.reconstruction.frames[[0, -1]].tolist() == [-5, 10]
    # Without it, they are there all the same.
    frames = read_scene_camera(scene, filmed, footage).reconstruction.frames
    assert {1, 4, 1001, 1004} <= set(frames.tolist())


def test_lengths_are_the_scenes(scene: bpy.types.Scene, filmed: bpy.types.Object, footage: Footage) -> None:
    scene.unit_settings.scale_length = 0.01
    found = read_scene_camera(scene, filmed, footage)
    assert found.notes == ("lengths are in scene units of 0.01 m",)
    check(scene, filmed, found)


def test_a_scene_of_another_shape_is_said(
    scene: bpy.types.Scene, filmed: bpy.types.Object, footage: Footage
) -> None:
    scene.render.resolution_x, scene.render.resolution_y = 1000, 1000
    found = read_scene_camera(scene, filmed, footage)
    assert "renders pictures of 1000x1000, the clip has 160x90" in found.notes[0]
    lens = found.reconstruction.cameras[0]
    assert lens.fx == pytest.approx(filmed.data.lens / filmed.data.sensor_width * LENS.width)


def test_what_cannot_have_filmed_is_refused(
    scene: bpy.types.Scene, filmed: bpy.types.Object, footage: Footage
) -> None:
    filmed.scale = (-1, 1, 1)
    with pytest.raises(UserError, match="Filmed is mirrored or skewed at frame 1"):
        read_scene_camera(scene, filmed, footage)
    filmed.scale = (1, 1, 1)
    filmed.hide_viewport = True
    with pytest.raises(UserError, match="Filmed does not move because it is disabled in viewports"):
        read_scene_camera(scene, filmed, footage)
    filmed.data.type = "ORTHO"
    with pytest.raises(UserError, match="is ortho; only a perspective camera"):
        read_scene_camera(scene, filmed, footage)
