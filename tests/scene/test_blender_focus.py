"""The depth of field that Blender's own camera has: its focus object and its focus distance."""

from __future__ import annotations

from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.camera.reconstruction import Intrinsics
from addon.core.focus.focus import Focus, radius_for_blur
from addon.core.focus.place import Place
from addon.core.focus.pull import FocusMark
from addon.render.output.frame_files import frame_keys
from addon.render.output.output import render_sequence
from addon.scene.build import build
from addon.scene.focus import focus_marks
from addon.scene.lens import lens
from addon.scene.sources.shot import Shot
from addon.ui.picking.pick_vertices import focus_on

from ..scenes import slanted_shot

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
FRAMES = tuple(range(1, 9))
WORLD = np.array([0.3, -0.2, 6.0])


@pytest.fixture
def shot(scene: bpy.types.Scene, tmp_path: Path) -> Shot:
    made = slanted_shot(tmp_path / "clip", LENS, FRAMES)
    build(scene, made.footage, made.reconstruction)
    return made


@pytest.fixture
def empty(scene: bpy.types.Scene) -> bpy.types.Object:
    made = bpy.data.objects.new("Target", None)
    scene.collection.objects.link(made)
    made.location = WORLD
    return made


def focused(scene: bpy.types.Scene, frame: int) -> float:
    """Distance that is in focus, as a render sees it: with the evaluated scene."""
    scene.frame_set(frame)
    evaluated = bpy.context.evaluated_depsgraph_get().scene_eval
    settings = lens.frame_options(evaluated.virtual_aperture, lens.reconstruction_of(scene.virtual_aperture))
    assert settings.focus.distance is not None
    return settings.focus.distance


def test_an_object_is_in_focus_at_each_frame(
    scene: bpy.types.Scene, shot: Shot, empty: bpy.types.Object
) -> None:
    settings = scene.virtual_aperture
    settings.camera.data.dof.focus_object = empty
    bpy.context.view_layer.update()
    away = shot.reconstruction.image_at(1)[0].to_camera(WORLD)[2]
    radius = radius_for_blur(shot.reconstruction, Focus(distance=away), 1, settings.blur)
    assert settings.aperture_radius == pytest.approx(radius, rel=1e-5)
    for frame in (1, 5, 8):
        true = shot.reconstruction.image_at(frame)[0].to_camera(WORLD)[2]
        assert focused(scene, frame) == pytest.approx(true, rel=1e-5)
        assert settings.aperture_radius == pytest.approx(radius, rel=1e-5)
    # Also where it is animated, and within a root that the user has scaled.
    empty.keyframe_insert("location", frame=1)
    empty.location = 1.5 * WORLD
    empty.keyframe_insert("location", frame=8)
    true = shot.reconstruction.image_at(8)[0].to_camera(1.5 * WORLD)[2]
    assert focused(scene, 8) == pytest.approx(true, rel=1e-5)
    settings.root.scale = (3, 3, 3)
    empty.animation_data_clear()
    empty.location = 3 * WORLD
    true = shot.reconstruction.image_at(5)[0].to_camera(WORLD)[2]
    assert focused(scene, 5) == pytest.approx(true, rel=1e-5)


def test_a_render_knows_the_frames_of_a_focus_object(
    scene: bpy.types.Scene, shot: Shot, empty: bpy.types.Object
) -> None:
    scene.virtual_aperture.camera.data.dof.focus_object = empty
    bpy.context.view_layer.update()
    before = frame_keys(scene, [1, 8])
    empty.location = 2 * WORLD
    after = frame_keys(scene, [1, 8])
    assert all(before[frame] != after[frame] for frame in (1, 8))


def test_a_render_is_that_of_the_objects_distance(
    scene: bpy.types.Scene, shot: Shot, empty: bpy.types.Object, tmp_path: Path
) -> None:
    settings = scene.virtual_aperture
    settings.method, settings.views = "features", 4
    settings.camera.data.dof.focus_object = empty
    bpy.context.view_layer.update()
    empty.keyframe_insert("location", frame=1)
    empty.location = 1.5 * WORLD
    empty.keyframe_insert("location", frame=8)

    def render(name: str) -> dict[int, np.ndarray]:
        render_sequence(scene, [1, 8], tmp_path / name / "####.png", False, lambda line: None)
        return {frame: cv2.imread(str(tmp_path / name / f"{frame:04d}.png")) for frame in (1, 8)}

    followed, distances = render("object"), {frame: focused(scene, frame) for frame in (1, 8)}
    settings.aperture_radius = settings.aperture_radius
    settings.camera.data.dof.focus_object = None
    focus_marks.clear(settings)
    for frame, away in distances.items():
        settings.focus_distance = away
        bpy.context.view_layer.update()
        fixed = render(f"at_{frame}")
        np.testing.assert_array_equal(fixed[frame], followed[frame])
    assert (fixed[1] != followed[1]).any()


def test_an_object_behind_the_camera_is_refused(
    scene: bpy.types.Scene, shot: Shot, empty: bpy.types.Object
) -> None:
    scene.virtual_aperture.camera.data.dof.focus_object = empty
    empty.location = -WORLD
    with pytest.raises(UserError, match="the focus object Target is not in front of the camera at frame 3"):
        focused(scene, 3)


def test_a_pick_takes_the_object_out(scene: bpy.types.Scene, shot: Shot, empty: bpy.types.Object) -> None:
    settings = scene.virtual_aperture
    settings.camera.data.dof.focus_object = empty
    said = focus_on(settings, 2, [Place(Focus(distance=4.0), 2, 4.0, "")])
    assert (
        said.endswith("Target is no longer the focus object")
        and settings.camera.data.dof.focus_object is None
    )
    assert focused(scene, 5) == pytest.approx(4.0)


def test_the_cameras_distance_follows(scene: bpy.types.Scene, shot: Shot) -> None:
    settings, dof = scene.virtual_aperture, scene.virtual_aperture.camera.data.dof
    settings.focus_distance = 6.0
    bpy.context.view_layer.update()
    assert dof.focus_distance == 6.0
    marks = [FocusMark.of(Place(Focus(distance=d), f, d, "")) for f, d in ((2, 4.0), (6, 12.0))]
    focus_marks.replace_all(settings, marks)
    for frame, away in ((1, 4.0), (4, 6.0), (8, 12.0)):
        scene.frame_set(frame)
        assert dof.focus_distance == pytest.approx(away) == settings.focus_distance
    # One way.
    dof.focus_distance = 2.0
    bpy.context.view_layer.update()
    assert settings.focus_distance == pytest.approx(12.0)
    # A scene that is built again has one driver.
    build(scene, shot.footage, shot.reconstruction)
    assert len(settings.camera.data.animation_data.drivers) == 1


def test_a_cameras_distance_that_is_animated_is_left_alone(scene: bpy.types.Scene, shot: Shot) -> None:
    settings, data = scene.virtual_aperture, scene.virtual_aperture.camera.data
    data.driver_remove("dof.focus_distance")
    for frame, away in ((1, 4.0), (8, 9.0)):
        data.dof.focus_distance = away
        data.keyframe_insert("dof.focus_distance", frame=frame)
    build(scene, shot.footage, shot.reconstruction)
    settings.focus_distance = 3.0
    assert focused(scene, 8) == pytest.approx(3.0) and data.dof.focus_distance == pytest.approx(9.0)


def test_a_pull_is_evaluated_for_a_render(scene: bpy.types.Scene, shot: Shot) -> None:
    marks = [FocusMark.of(Place(Focus(distance=d), f, d, "")) for f, d in ((2, 4.0), (6, 12.0))]
    focus_marks.replace_all(scene.virtual_aperture, marks)
    assert [focused(scene, frame) for frame in (1, 4, 8)] == pytest.approx([4.0, 6.0, 12.0])
