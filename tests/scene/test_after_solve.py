"""What the user sees when a solve has come into the scene, and how a clip is chosen."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.core.camera.reconstruction import Intrinsics
from addon.scene.build import build
from addon.scene.cg_objects import cg_objects
from addon.scene.sources.shot import Shot
from addon.ui import panels
from addon.ui.footage import after_solve
from addon.ui.footage.file_import import clip_of

from .. import planes
from ..recorder import draw
from ..scenes import slanted_shot, write_frames

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)


@pytest.fixture
def default_scene(scene: bpy.types.Scene) -> bpy.types.Scene:
    """Blender's own start: a cube, a lamp, a camera, and a 3D viewport."""
    bpy.ops.wm.read_homefile(app_template="", use_factory_startup=True)
    return bpy.context.scene


def viewports() -> list[bpy.types.RegionView3D]:
    areas = bpy.context.window.screen.areas
    return [area.spaces.active.region_3d for area in areas if area.type == "VIEW_3D"]


def test_a_solve_is_looked_at_through_its_camera(default_scene: bpy.types.Scene, tmp_path: Path) -> None:
    scene = default_scene
    clip = planes.write_clip(tmp_path / "walk", planes.sideways(12))
    far = bpy.data.objects.new("Far", bpy.data.objects["Cube"].data)
    far.location = (0, 40, 0)
    scene.collection.objects.link(far)
    settings = scene.virtual_aperture
    settings.footage = str(clip)
    assert [view.view_perspective for view in viewports()] == ["PERSP"]
    assert bpy.ops.virtual_aperture.solve() == {"FINISHED"}
    assert [view.view_perspective for view in viewports()] == ["CAMERA"]
    assert scene.camera == settings.camera
    layer = bpy.context.view_layer
    assert layer.objects.active == settings.points
    assert not bpy.context.selected_objects
    assert tuple(scene.tool_settings.mesh_select_mode) == (True, False, False)
    # The cube stands where the camera is: hidden by the eye, not disabled, and the panel says so.
    cube = bpy.data.objects["Cube"]
    assert cube.hide_get() and not cube.hide_viewport and not cube.hide_render
    assert not far.hide_get()
    # Nor is it drawn with the clip, until it is shown.
    assert cg_objects(scene, layer) == [far]
    texts = " ".join(draw(panels.solve.VIRTUAL_APERTURE_PT_solve).texts)
    assert "12 of 12 frames registered" in texts
    assert "Cube blocked the camera and was hidden" in texts
    # Solving again, and bringing the kept solve back, leave it so.
    assert bpy.ops.virtual_aperture.solve() == {"FINISHED"}
    assert cg_objects(scene, layer) == [far]
    assert "Cube blocked the camera" in " ".join(draw(panels.solve.VIRTUAL_APERTURE_PT_solve).texts)
    cube.hide_set(False)
    assert set(cg_objects(scene, layer)) == {cube, far}
    assert "blocked the camera" not in " ".join(draw(panels.solve.VIRTUAL_APERTURE_PT_solve).texts)
    # Tab: nothing is selected.
    import bmesh  # the module's own, there only after bpy

    bpy.ops.object.mode_set(mode="EDIT")
    vertices = bmesh.from_edit_mesh(settings.points.data).verts
    assert len(vertices) > 50 and not any(vertex.select for vertex in vertices)


@pytest.mark.parametrize(
    ("place", "size", "hidden"),
    [((0.1, 0, 0.04), 0.01, True), ((3, 0, 0), 1, False), ((0, 0, 0), 0, False)],
)
def test_only_what_the_camera_goes_through_is_hidden(
    default_scene: bpy.types.Scene, tmp_path: Path, place: tuple[float, ...], size: float, hidden: bool
) -> None:
    shot = slanted_shot(tmp_path, LENS)
    cube = bpy.data.objects["Cube"]
    # A little thing that the third frame's camera stands in, at (0.1, -0.02, 0.04), counts too.
    cube.location, cube.scale = place, (size, 3 * size, size)
    build(default_scene, shot.footage, shot.reconstruction)
    bpy.context.view_layer.update()
    after_solve.show(default_scene, shot.reconstruction)
    assert cube.hide_get() == hidden
    assert after_solve.still_hidden(default_scene) == ([cube] if hidden else [])


def solve(scene: bpy.types.Scene, shot: Shot) -> list[str]:
    """What every solve and import does with the scene; names of the CG objects in any view layer."""
    build(scene, shot.footage, shot.reconstruction)
    after_solve.show(scene, shot.reconstruction)
    return drawn_names(scene)


def drawn_names(scene: bpy.types.Scene) -> list[str]:
    return sorted({thing.name for layer in scene.view_layers for thing in cg_objects(scene, layer)})


def elsewhere(shot: Shot, by: float) -> Shot:
    """The same clip solved with all cameras moved."""
    solved = shot.reconstruction
    moved = [replace(i, translation=i.translation - i.rotation @ np.full(3, by)) for i in solved.images]
    return replace(shot, reconstruction=replace(solved, images=tuple(moved)))


def test_what_blocked_one_solve_is_not_drawn_with_the_next(
    default_scene: bpy.types.Scene, tmp_path: Path
) -> None:
    scene, cube = default_scene, bpy.data.objects["Cube"]
    scene.view_layers.new("Second")
    shots = [slanted_shot(tmp_path / name, LENS) for name in "ab"]
    for shot in (*shots, shots[1], elsewhere(shots[0], 20.0), shots[0]):
        assert solve(scene, shot) == []
        assert after_solve.still_hidden(scene) == [cube]
    # A renamed one is no other, and neither are those of a copied scene and of an opened file.
    cube.name = "Box"
    assert drawn_names(scene) == []
    bpy.ops.scene.new(type="FULL_COPY")
    copied = bpy.context.scene
    assert copied != scene and drawn_names(copied) == [] == solve(copied, shots[0])
    assert [thing.name for thing in after_solve.still_hidden(copied)] == ["Box.001"]
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    assert [drawn_names(scene) for scene in bpy.data.scenes] == [[], []]
    # What the user shows is drawn, until the next solve.
    scene = bpy.data.scenes[0]
    cube = scene.objects["Box"]
    cube.hide_set(False, view_layer=scene.view_layers[1])
    assert drawn_names(scene) == ["Box"]
    cube.hide_set(False, view_layer=scene.view_layers[0])
    assert after_solve.still_hidden(scene) == []
    assert solve(scene, elsewhere(shots[0], 20.0)) == ["Box"]
    assert solve(scene, shots[1]) == []


def test_what_was_hidden_before_a_solve_and_blocks_it_is_not_drawn(
    default_scene: bpy.types.Scene, tmp_path: Path
) -> None:
    """Cycles draws what is hidden with the eye: a cube that the user pressed H on would fill the picture."""
    scene, cube = default_scene, bpy.data.objects["Cube"]
    for name, place in (("Hall", 0), ("Far", 40)):
        thing = bpy.data.objects.new(name, cube.data)
        thing.location.y = place
        collection = bpy.data.collections.new(name)
        scene.collection.children.link(collection)
        collection.objects.link(thing)
        bpy.context.view_layer.layer_collection.children[name].hide_viewport = True
    cube.hide_set(True)
    bpy.context.view_layer.update()
    assert solve(scene, slanted_shot(tmp_path, LENS)) == ["Far"]
    assert {thing.name for thing in after_solve.still_hidden(scene)} == {"Cube", "Hall"}


def drawn(points: bpy.types.Object) -> int:
    """Vertices that Blender itself draws."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    depsgraph.update()
    return len(points.evaluated_get(depsgraph).data.vertices)


def test_points_are_drawn_only_where_they_are_asked_for(scene: bpy.types.Scene, tmp_path: Path) -> None:
    shot = slanted_shot(tmp_path, LENS)
    settings = build(scene, shot.footage, shot.reconstruction)
    count = len(shot.reconstruction.points)
    assert (settings.show_points, drawn(settings.points)) == (False, 0)
    settings.show_points = True
    assert (settings.show_points, drawn(settings.points)) == (True, count)
    # Another solve leaves it as the user has set it.
    settings = build(scene, shot.footage, shot.reconstruction)
    assert settings.show_points and drawn(settings.points) == count
    assert len(settings.points.modifiers) == len(settings.points.vertex_groups) == 1


def test_points_of_an_older_version_can_be_hidden(scene: bpy.types.Scene, tmp_path: Path) -> None:
    shot = slanted_shot(tmp_path, LENS)
    settings = build(scene, shot.footage, shot.reconstruction)
    settings.points.modifiers.clear()
    settings.points.vertex_groups.clear()
    assert settings.show_points
    settings.show_points = False
    assert not settings.show_points and drawn(settings.points) == 0


def test_output_has_a_place_of_its_own(scene: bpy.types.Scene, tmp_path: Path) -> None:
    shot = slanted_shot(tmp_path / "walk", LENS)
    # Blender's default.
    assert scene.render.filepath == "/tmp/"
    build(scene, shot.footage, shot.reconstruction)
    assert scene.render.filepath == f"{tmp_path / 'walk_render'}{os.sep}"
    assert not (tmp_path / "walk_render").exists()
    scene.render.filepath = "/elsewhere/"
    build(scene, shot.footage, shot.reconstruction)
    assert scene.render.filepath == "/elsewhere/"
    (tmp_path / "project").mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "project" / "a.blend"))
    scene = bpy.context.scene
    scene.render.filepath = "/tmp/"
    build(scene, shot.footage, shot.reconstruction)
    assert scene.render.filepath == "//walk_render/"


def test_another_clip_has_an_output_of_its_own(scene: bpy.types.Scene, tmp_path: Path) -> None:
    walk, stairs, namesake = (
        slanted_shot(tmp_path / name, Intrinsics(width, 90, 140.0, 140.0, width / 2, 45.0))
        for name, width in (("walk", 160), ("stairs", 150), ("b/stairs", 140))
    )
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    scene = bpy.context.scene

    def output_of(shot: Shot) -> str:
        build(scene, shot.footage, shot.reconstruction)
        return str(scene.render.filepath)

    scene.render.filepath = "/tmp/"
    assert output_of(walk) == "//walk_render/"
    assert output_of(stairs) == "//stairs_render/"
    # The frames of a clip with the same name lie there.
    (tmp_path / "stairs_render").mkdir()
    (tmp_path / "stairs_render" / "0001.png").write_bytes(b"")
    assert output_of(stairs) == "//stairs_render/"
    assert output_of(namesake) == "//stairs_render_2/"
    scene.render.filepath = "//stairs_render_2/take_"
    assert output_of(walk) == "//stairs_render_2/take_"


def test_a_picture_means_its_sequence(scene: bpy.types.Scene, tmp_path: Path) -> None:
    folder = write_frames(tmp_path / "shot 3", LENS)
    video = tmp_path / "a.mp4"
    video.write_bytes(b"x")
    assert clip_of(video) == video
    assert clip_of(folder) == folder
    assert clip_of(folder / "clip_0002.png") == folder / "clip_####.png"
    (folder / "take2_007_left.png").write_bytes(b"x")
    assert clip_of(folder / "take2_007_left.png") == folder / "take2_###_left.png"
    (folder / "still.png").write_bytes(b"x")
    settings = scene.virtual_aperture
    for chosen, said in (
        ("still.png", "single image without a frame number"),
        ("gone.mp4", "does not exist"),
    ):
        with pytest.raises(RuntimeError, match=said):
            bpy.ops.virtual_aperture.choose_clip(filepath=str(folder / chosen))
    assert settings.footage == ""
    assert bpy.ops.virtual_aperture.choose_clip(filepath=str(folder / "clip_0002.png")) == {"FINISHED"}
    assert settings.footage == str(folder / "clip_####.png")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.virtual_aperture.choose_clip(filepath=f"{folder}/")
    assert bpy.context.scene.virtual_aperture.footage == "//shot 3"
