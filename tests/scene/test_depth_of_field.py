"""Scale, f-stop and what is sharp, and that Blender's own depth of field is the same."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.core.camera.reconstruction import Intrinsics
from addon.core.focus.focus import Focus
from addon.core.focus.focus import sharp_distances as core_sharp_distances
from addon.scene.base.exr import read
from addon.scene.build import build
from addon.scene.lens import depth_of_field
from addon.ui import panels
from addon.ui.footage.solve import build_scene

from ..foreign_models import write_model
from ..in_blender import choose_clip
from ..recorder import draw
from ..scenes import slanted_shot

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
"""31.5 mm on a full frame."""


def shot(scene: bpy.types.Scene, folder: Path) -> bpy.types.PropertyGroup:
    made = slanted_shot(folder, LENS)
    return build(scene, made.footage, made.reconstruction)


def test_f_stop_radius_and_blur_are_one_number(scene: bpy.types.Scene, tmp_path: Path) -> None:
    settings = shot(scene, tmp_path)
    settings.focus_distance = 8.0
    settings.metres_per_unit = 0.25
    settings.f_stop = 1.4
    # R = f / (2 N), 31.5 mm on a full frame's 36.
    assert settings.aperture_radius == pytest.approx(0.0315 / 2.8 / 0.25, rel=1e-5)
    blur = settings.blur
    settings.f_stop = 2.8
    assert settings.blur == pytest.approx(blur / 2, rel=1e-4)
    settings.blur = blur
    assert settings.f_stop == pytest.approx(1.4, rel=1e-4)
    settings.aperture_radius = 0.1
    assert settings.f_stop == pytest.approx(0.0315 / 0.05, rel=1e-5)
    # A crop of half a full frame has half the focal length for the same view.
    settings.lens, settings.sensor_mm = "SENSOR", 18.0
    assert settings.f_stop == pytest.approx(0.01575 / 0.05, rel=1e-5)


def test_an_f_stop_is_that_of_the_chosen_camera(scene: bpy.types.Scene, tmp_path: Path) -> None:
    settings = shot(scene, tmp_path)
    settings.focus_distance, settings.metres_per_unit, settings.f_stop = 8.0, 0.25, 1.8
    radius = settings.aperture_radius
    settings.f_stop_format = "FOUR_THIRDS"
    # The picture stays; half the focal length has half the f-stop for the same aperture.
    assert settings.aperture_radius == radius
    assert settings.f_stop == pytest.approx(1.8 * 17.3 / 36, rel=1e-5)
    settings.f_stop = 1.8
    assert settings.aperture_radius == pytest.approx(radius * 17.3 / 36, rel=1e-5)


def test_a_t_stop_is_of_the_light_that_passes(scene: bpy.types.Scene, tmp_path: Path) -> None:
    settings = shot(scene, tmp_path)
    assert depth_of_field.t_stop(settings) == 0
    settings.focus_distance, settings.metres_per_unit, settings.f_stop = 8.0, 0.25, 4.0
    assert depth_of_field.t_stop(settings) == pytest.approx(4.0, rel=2e-3)
    # A mirror of half the diameter takes a quarter of the light.
    settings.shape.obstruction = 0.5
    assert depth_of_field.t_stop(settings) == pytest.approx(4.0 / np.sqrt(0.75), rel=2e-3)
    # The mean of 0.1^(r^2) over a disc.
    settings.shape.obstruction, settings.shape.apodisation = 0.0, 0.9
    assert depth_of_field.t_stop(settings) == pytest.approx(4.0 / np.sqrt(0.9 / np.log(10)), rel=2e-3)


def test_the_scale_is_kept_by_the_same_clip_and_no_other(scene: bpy.types.Scene, tmp_path: Path) -> None:
    work = choose_clip(scene, tmp_path)
    bpy.ops.virtual_aperture.import_solve(filepath=str(write_model(tmp_path / "model")))
    settings = scene.virtual_aperture
    settings.metres_per_unit = 0.5
    from addon.core.media.clip import open_footage

    build_scene(scene, open_footage(tmp_path / "clip"), work)
    assert settings.metres_per_unit == pytest.approx(0.5)
    assert scene.unit_settings.scale_length == pytest.approx(0.5)
    shot(scene, tmp_path / "other")
    assert settings.metres_per_unit == 0
    assert scene.unit_settings.scale_length == 1


def test_sharp_distances_are_those_of_the_command_line(scene: bpy.types.Scene, tmp_path: Path) -> None:
    made = slanted_shot(tmp_path, LENS)
    settings = build(scene, made.footage, made.reconstruction)
    assert depth_of_field.sharp_distances(settings) is None and depth_of_field.sharp_words(settings) == ""
    settings.focus_distance = 8.0
    settings.aperture_radius = 0.05
    expected = core_sharp_distances(made.reconstruction, Focus(distance=8.0), 1, 0.05)
    assert depth_of_field.sharp_distances(settings) == pytest.approx(expected, rel=1e-6)
    assert depth_of_field.sharp_words(settings) == "Sharp: 7.48 units to 8.6 units"
    settings.guessed_scale = 0.5
    assert depth_of_field.sharp_words(settings) == "Sharp: ≈ 3.7 m to ≈ 4.3 m"
    settings.guessed_scale = 0.0
    assert depth_of_field.sharp_words(settings) in draw(panels.focus.VIRTUAL_APERTURE_PT_focus).texts
    # Whatever it depends on is seen at once.
    settings.aperture_radius = 1e-4
    assert depth_of_field.sharp_words(settings).endswith(" and farther")
    settings.aperture_radius, settings.focus_distance = 0.05, 6.0
    near, far = depth_of_field.sharp_distances(settings) or (0.0, 0.0)
    assert near < 6.0 < far < 7.0
    settings.metres_per_unit = 1.0
    assert depth_of_field.sharp_words(settings) == f"Sharp: {near:.3g} m to {far:.3g} m"
    scene.unit_settings.system = "NONE"
    assert depth_of_field.sharp_words(settings) == f"Sharp: {near:.3g} to {far:.3g}"


def test_f_stops_are_shown_once_the_scale_is_given(scene: bpy.types.Scene, tmp_path: Path) -> None:
    settings = shot(scene, tmp_path)
    main, scale = panels.main.VIRTUAL_APERTURE_PT_main, panels.lens.VIRTUAL_APERTURE_PT_scale
    settings.focus_distance = 8.0
    shown = draw(main)
    assert "blur_percent" in shown.props and not {"f_stop", "subject_metres"} & set(shown.props)
    assert "virtual_aperture.set_scale" in shown.operators
    assert "Distance to subject (guess)" in draw(scale).texts
    assert "focus_distance" in draw(panels.focus.VIRTUAL_APERTURE_PT_focus).props
    settings.metres_per_unit = 0.25
    # The stored number is a setting, the others are words.
    shown, amount = draw(main), {"blur_percent", "f_stop", "aperture_radius"}
    assert amount & set(shown.props) == {"blur_percent"} and "subject_metres" not in shown.props
    assert f"Gives f/{settings.f_stop:.2g}, faster than any lens" in shown.texts
    assert settings.blur_percent == pytest.approx(100 * settings.blur) == 3.0
    radius = settings.aperture_radius
    by = bpy.ops.virtual_aperture.set_amount_by
    for kind, name in (("F_STOP", "f_stop"), ("RADIUS", "aperture_radius"), ("BLUR", "blur_percent")):
        assert by(kind=kind) == {"FINISHED"}
        shown = draw(main)
        assert amount & set(shown.props) == {name}
        assert amount & set(draw(panels.lens.VIRTUAL_APERTURE_PT_lens).props) <= {name}
        assert settings.aperture_radius == pytest.approx(radius, rel=1e-6), "the picture stays"
    settings.f_stop = 2.0
    assert f"Gives background blur {settings.blur_percent:.3g} % here" in draw(main).texts
    assert by(kind="BLUR") == {"FINISHED"} and "Gives f/2" in draw(main).texts
    settings.blur_percent = 2.0
    assert settings.blur == pytest.approx(0.02, abs=1e-4)
    assert "focus_length" in draw(panels.focus.VIRTUAL_APERTURE_PT_focus).props
    shown = draw(scale)
    assert {"subject_metres", "metres_per_unit"} <= set(shown.props)
    assert "guess" not in " ".join(shown.texts) and "full-frame equivalent" in " ".join(shown.texts)
    settings.lens = "SENSOR"
    assert "full-frame equivalent" not in " ".join(draw(scale).texts)


def test_cycles_blurs_what_is_placed_in_the_scene_alike(scene: bpy.types.Scene, tmp_path: Path) -> None:
    """A small bright square behind the focus, by Cycles' thin lens of Blender's camera: its disc is ours."""
    scale = 3.0
    settings = shot(scene, tmp_path / "clip")
    settings.root.scale = (scale,) * 3
    bpy.context.view_layer.update()
    settings.focus_distance, settings.aperture_radius = 5.0, 0.4
    camera, half = settings.camera, 0.1 * scale
    far = 20.0
    mesh = bpy.data.meshes.new("lamp")
    corners = [(x * half, y * half, -far * scale) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    mesh.from_pydata(
        [camera.matrix_world.normalized() @ v for v in map(_vector, corners)], [], [(0, 1, 2, 3)]
    )
    material = bpy.data.materials.new("light")
    nodes = material.node_tree.nodes
    nodes.clear()
    light, out = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    light.inputs["Strength"].default_value = 1e4
    material.node_tree.links.new(light.outputs[0], out.inputs[0])
    mesh.materials.append(material)
    scene.collection.objects.link(bpy.data.objects.new("lamp", mesh))
    camera.data.dof.use_dof = True
    bpy.context.view_layer.update()
    assert camera.data.dof.focus_distance == pytest.approx(5.0 * scale)
    scene.world = None
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 256, False
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.filepath = str(tmp_path / "disc.exr")
    bpy.ops.render.render(write_still=True)
    seen = read(tmp_path / "disc.exr")[..., 0]
    down, across = np.indices(seen.shape) + 0.5
    share = seen / seen.sum()
    x, y = (share * across).sum(), (share * down).sum()
    spread = (share * ((across - x) ** 2 + (down - y) ** 2)).sum()
    # Of a disc it is D^2 / 8, of the square w^2 / 6.
    diameter = np.sqrt(8 * (spread - (0.2 * 140.0 / far) ** 2 / 6))
    assert diameter == pytest.approx(2 * 0.4 * 140.0 * (1 / 5.0 - 1 / far), rel=0.02)


def _vector(corner: tuple[float, float, float]) -> object:
    from mathutils import Vector  # the module's own, there only after bpy

    return Vector(corner)
