"""The lens as a custom camera of Cycles: an independent reference for every shape of the aperture."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.core.base.arrays import LinearRGBA, in_channels
from addon.core.camera.reconstruction import Intrinsics
from addon.core.focus.focus import Focus
from addon.core.frame.frame import Frame
from addon.core.frame.plan import FrameOptions
from addon.core.frame.vignetting import light_left
from addon.core.media.light import to_linear
from addon.core.optics.aperture import Aperture
from addon.render.views import gpu_views
from addon.scene.build import build
from addon.scene.focus.focus_marks import set_focus
from addon.scene.lens import lens_camera
from addon.scene.lens.lens_camera import osl_problem
from sample_scenes import cycles_views

from ..scenes import painted, planned, psnr, slanted_plane, slanted_shot, texture

LENS = Intrinsics(160, 90, 140.0, 140.0, 84.0, 41.0)
RADIUS, FOCUS = 0.6, 6.0
needs_osl = pytest.mark.skipif(bool(osl_problem()), reason=f"no custom cameras: {osl_problem()}")
needs_gpu = pytest.mark.skipif(bool(gpu_views.gpu_problem()), reason="only CI is sure to have a GPU driver")


@pytest.fixture
def settings(scene: bpy.types.Scene, tmp_path: Path) -> bpy.types.PropertyGroup:
    shot = slanted_shot(tmp_path / "clip", LENS)
    made = build(scene, shot.footage, shot.reconstruction)
    set_focus(made, Focus(distance=FOCUS), 1)
    made.aperture_radius = RADIUS
    return made


def drawn_by_cycles(
    scene: bpy.types.Scene, camera: bpy.types.Object, plan: Frame, picture: LinearRGBA, folder: Path
) -> LinearRGBA:
    """(h, w, 4) the warp mesh of a plan as Cycles sees it through the camera."""
    pinhole, mesh = plan.canvas.pinhole, plan.mesh
    inverse = plan.lens.unrectified(mesh.inverse_depth, mesh.xy)
    warp = cycles_views.warp_object(
        mesh.xy, mesh.texture_xy, inverse, mesh.triangles, pinhole.focal, pinhole.principal_point, picture
    )
    cycles_views.set_up(scene, warp, (pinhole.width, pinhole.height), samples=1024)
    warp.matrix_world = scene.virtual_aperture.camera.matrix_world
    scene.camera = camera
    began = time.perf_counter()
    seen = cycles_views.render_to_array(scene, folder / "lens.exr")
    print(f"{camera.name}: {time.perf_counter() - began:.1f} s")
    return seen


ROUND = Aperture()


@needs_gpu
@needs_osl
@pytest.mark.parametrize(
    ("shape", "swing"),
    [
        pytest.param(ROUND, 0.0, marks=pytest.mark.long),
        pytest.param(ROUND, 0.6, marks=pytest.mark.long),
        pytest.param(Aperture(blades=5, rotation=0.3, roundness=0.3, ratio=1.4), 0.0, marks=pytest.mark.long),
        pytest.param(Aperture(obstruction=0.6, apodisation=0.3, spherical_aberration=0.6), 0.0,
                     marks=pytest.mark.long),
        pytest.param(Aperture(blades=6, vignetting=0.8), 0.0, marks=pytest.mark.long),
        pytest.param(Aperture(axial_colour=0.1), 0.0, marks=pytest.mark.long),
    ],
    ids=["disc", "tilted", "squeezed pentagon", "mirror", "cat's eyes", "fringes"],
)  # fmt: skip
def test_cycles_sees_through_our_lens(
    scene: bpy.types.Scene, settings: bpy.types.PropertyGroup, tmp_path: Path, shape: Aperture, swing: float
) -> None:
    settings.focus_swing = swing
    for name in lens_camera.SHAPE:
        setattr(settings.shape, name, getattr(shape, name))
    settings.root.scale = (2.0, 2.0, 2.0)
    bpy.context.view_layer.update()
    assert bpy.ops.virtual_aperture.add_lens_camera() == {"FINISHED"}
    scene.frame_set(2)
    plane = slanted_plane(LENS)
    options = FrameOptions(Focus(distance=FOCUS, swing=swing), RADIUS, 512, "features", aperture=shape)
    plan = planned(plane, 2, options, (160, 90))
    picture = plan.canvas.from_source(to_linear(texture(160, 90))) / 2
    for row, column in ((20, 30), (20, 130), (60, 30), (70, 120)):
        picture[row : row + 4, column : column + 4, :3] += 2.0
    ours = gpu_views.mean_of_views(*painted(plan, picture))
    ours = ours / in_channels(light_left(plan.views), 4) if shape.vignetting else ours
    camera = next(thing for thing in scene.objects if thing.get(lens_camera.NAME))
    theirs = drawn_by_cycles(scene, camera, plan, picture, tmp_path)
    if (shape, swing) == (ROUND, 0.0):
        plain = drawn_by_cycles(scene, settings.camera, plan, picture, tmp_path)
    else:
        disc = replace(options, focus=Focus(distance=FOCUS), aperture=ROUND)
        plain = gpu_views.mean_of_views(*painted(planned(plane, 2, disc, (160, 90)), picture))
    seen = [np.clip(each[12:-12, 12:-12, :3], 0, 1) for each in (theirs, ours, plain)]
    score, other = psnr(*seen[:2]), psnr(seen[0], seen[2])
    print(f"our views against Cycles' custom camera: {score:.1f} dB, of another lens {other:.1f} dB")
    assert score >= 45
    assert other < score - 6


@needs_osl
def test_a_pull_is_keyed_and_the_rest_is_not(
    scene: bpy.types.Scene, settings: bpy.types.PropertyGroup
) -> None:
    for frame, distance in ((1, 5.0), (3, 9.0)):
        scene.frame_set(frame)
        settings.focus_distance = distance
        settings.keyframe_insert("focus_distance", frame=frame)
    camera = lens_camera.add_lens_camera(scene)
    for frame in (1, 2, 3):
        scene.frame_set(frame)
        assert camera.data.cycles_custom["focus"] == pytest.approx(settings.focus_distance, rel=1e-6)
    assert keys_of(camera) == {'cycles_custom["focus"]'}
    assert camera.data.cycles_custom["radius"] == pytest.approx(RADIUS)
    # Renewed, not added again.
    scene.frame_set(1)
    assert lens_camera.add_lens_camera(scene) == camera
    assert sum(thing.type == "CAMERA" for thing in scene.objects) == 2


def keys_of(camera: bpy.types.Object) -> set[str]:
    """Paths of what is keyed of a camera's data."""
    from bpy_extras.anim_utils import action_get_channelbag_for_slot

    animation = camera.data.animation_data
    return {
        each.data_path
        for each in action_get_channelbag_for_slot(animation.action, animation.action_slot).fcurves
    }


@needs_osl
def test_a_lens_that_no_camera_has_is_refused(
    scene: bpy.types.Scene, settings: bpy.types.PropertyGroup
) -> None:
    settings.zone_front = 0.2
    with pytest.raises(RuntimeError, match="no camera has an in-focus zone"):
        bpy.ops.virtual_aperture.add_lens_camera()
    assert not any(thing.get(lens_camera.NAME) for thing in scene.objects)


def test_a_build_without_osl_is_named(
    scene: bpy.types.Scene, settings: bpy.types.PropertyGroup, monkeypatch: pytest.MonkeyPatch
) -> None:
    import _cycles

    monkeypatch.setattr(_cycles, "with_osl", False)
    with pytest.raises(RuntimeError, match="built without Open Shading Language"):
        bpy.ops.virtual_aperture.add_lens_camera()
