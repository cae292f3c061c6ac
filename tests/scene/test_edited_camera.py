"""Changes of the clip's camera, which renders ignore: each is named, and all are brought back exactly."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from addon.core.camera.reconstruction import Reconstruction
from addon.core.media.clip import open_footage
from addon.scene.build import build
from addon.scene.ignored import ignored, unseen
from addon.ui.panels import notices

from ..recorder import draw
from ..scenes import LENS, slanted_plane, write_frames

FRAMES = (3, 4, 5, 6, 8, 9)
"""A gap, and no frame 1."""


def zooming(plane: Reconstruction) -> Reconstruction:
    """The same with a lens that zooms, and a principal point that moves."""
    lenses = tuple(
        replace(LENS, fx=140.0 + 9 * n, fy=(140.0 + 9 * n) * 1.25, cx=78.0 + n) for n in range(len(FRAMES))
    )
    return replace(
        plane, cameras=lenses, images=tuple(replace(i, camera=n) for n, i in enumerate(plane.images))
    )


@pytest.fixture
def solved(scene: bpy.types.Scene, tmp_path: Path) -> bpy.types.Scene:
    plane = zooming(slanted_plane(LENS, FRAMES))
    build(scene, open_footage(write_frames(tmp_path / "clip", LENS, FRAMES)), plane)
    scene.virtual_aperture.focus_distance = 8.0
    return scene


def key(owner: bpy.types.ID, path: str, value: Any, frame: int = 5) -> None:
    setattr(owner, path, value)
    owner.keyframe_insert(path, frame=frame)


def drive(owner: bpy.types.ID, path: str, index: int = -1) -> None:
    owner.driver_add(path, index).driver.expression = "0.1 * frame"


def shifted_key(owner: bpy.types.ID, path: str, index: int) -> None:
    """One key of the solve is dragged, as in the graph editor."""
    action = owner.animation_data.action
    curve = next(
        c for s in action.layers[0].strips for b in s.channelbags for c in b.fcurves
        if (c.data_path, c.array_index) == (path, index)
    )  # fmt: skip
    curve.keyframe_points[2].co[1] += 0.3
    curve.update()


def add_noise(owner: bpy.types.ID) -> None:
    action = owner.animation_data.action
    curve = action.layers[0].strips[0].channelbags[0].fcurves[0]
    curve.modifiers.new("NOISE").strength = 0.5


def mute(owner: bpy.types.ID) -> None:
    owner.animation_data.action.layers[0].strips[0].channelbags[0].fcurves[1].mute = True


def push_down(owner: bpy.types.ID) -> None:
    data = owner.animation_data
    action = data.action
    data.nla_tracks.new().strips.new("Strip", 1, action)
    data.action = None


def constrain(camera: bpy.types.Object) -> None:
    made = bpy.data.objects.new("Target", None)
    bpy.context.scene.collection.objects.link(made)
    camera.constraints.new("TRACK_TO").target = made


def reparent(camera: bpy.types.Object) -> None:
    made = bpy.data.objects.new("Dolly", None)
    bpy.context.scene.collection.objects.link(made)
    camera.parent = made


Edit = Callable[[bpy.types.Scene, bpy.types.Object, random.Random], None]
EDITS: dict[str, tuple[str, Edit]] = {
    "type": ("Type", lambda s, c, r: setattr(c.data, "type", r.choice(["ORTHO", "PANO"]))),
    "sensor": ("Sensor Width", lambda s, c, r: setattr(c.data, "sensor_width", r.uniform(5, 35.9))),
    "lens": ("Focal Length", lambda s, c, r: setattr(c.data, "lens", r.uniform(60, 200))),
    "shift_x": ("Shift X", lambda s, c, r: setattr(c.data, "shift_x", r.uniform(0.1, 1))),
    "key lens": ("Focal Length", lambda s, c, r: key(c.data, "lens", 90.0)),
    "drive lens": ("Focal Length", lambda s, c, r: drive(c.data, "lens")),
    "aspect": ("Pixel Aspect X", lambda s, c, r: setattr(s.render, "pixel_aspect_x", r.uniform(1.3, 2))),
    "location": ("Location", lambda s, c, r: setattr(c, "location", c.location.copy() * 0 + _off(r))),
    "scale": ("Scale", lambda s, c, r: setattr(c, "scale", (1, 1, -1))),
    "delta": ("Delta Location", lambda s, c, r: setattr(c, "delta_location", (0, 0, r.uniform(0.01, 3)))),
    "key": ("Location", lambda s, c, r: shifted_key(c, "location", r.randrange(3))),
    "noise": ("Location", lambda s, c, r: add_noise(c)),
    "mute": ("Location", lambda s, c, r: mute(c)),
    "strips": ("Nonlinear Animation", lambda s, c, r: push_down(c)),
    "constraint": ("Constraints", lambda s, c, r: constrain(c)),
    "parent": ("Parent", lambda s, c, r: reparent(c)),
    "inverse": (
        "Parent Inverse Matrix",
        lambda s, c, r: setattr(c, "matrix_parent_inverse", np.eye(4) + r.uniform(0.1, 1)),
    ),
    "clip place": (
        "Background Offset",
        lambda s, c, r: setattr(c.data.background_images[0], "offset", (0.2, 0)),
    ),
}


def _off(r: random.Random) -> Any:
    from mathutils import Vector  # the module's own, there only after bpy

    return Vector((r.uniform(2, 9), r.uniform(2, 9), 0))


def seen(scene: bpy.types.Scene) -> np.ndarray:
    """What the viewport shows: pose and projection of the evaluated camera at frames, solved or not."""
    camera, found = scene.virtual_aperture.camera, []
    now = scene.frame_current
    for frame in range(1, 12):
        scene.frame_set(frame)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        found.append(np.array(camera.evaluated_get(depsgraph).matrix_world))
        matrix = camera.calc_matrix_camera(
            depsgraph, x=scene.render.resolution_x, y=scene.render.resolution_y,
            scale_x=scene.render.pixel_aspect_x, scale_y=scene.render.pixel_aspect_y,
        )  # fmt: skip
        found.append(np.array(matrix))
    scene.frame_set(now)
    return np.array(found)


def edited(scene: bpy.types.Scene) -> str:
    return next((line for line in unseen(scene) if "camera are ignored" in line), "")


def restore() -> None:
    assert bpy.ops.virtual_aperture.restore_camera() == {"FINISHED"}


@pytest.mark.parametrize("name", EDITS)
def test_an_edit_is_named_and_restored(solved: bpy.types.Scene, name: str) -> None:
    before, camera = seen(solved), solved.virtual_aperture.camera
    word, edit = EDITS[name]
    for seed, frame in enumerate((3, 7)):
        solved.frame_set(frame)
        assert edited(solved) == ""
        edit(solved, camera, random.Random(seed))
        assert word in edited(solved).split(": ")[-1].split(", ")
        assert edited(solved) in ignored(solved)
        shown = draw(notices.VIRTUAL_APERTURE_PT_details)
        assert word in " ".join(shown.texts) and "virtual_aperture.restore_camera" in shown.operators
        restore()
        assert edited(solved) == ""
        np.testing.assert_array_equal(seen(solved), before)
        with pytest.raises(RuntimeError, match="The clip's camera is as it was solved"):
            bpy.ops.virtual_aperture.restore_camera()


def test_edits_together_are_all_named_and_restored(solved: bpy.types.Scene) -> None:
    before, r = seen(solved), random.Random(7)
    for _ in range(6):
        chosen = r.sample(sorted(set(EDITS) - {"strips", "noise", "mute", "key", "inverse"}), 4)
        for name in chosen:
            EDITS[name][1](solved, solved.virtual_aperture.camera, r)
        named = edited(solved).split(": ")[-1].split(", ")
        assert {EDITS[name][0] for name in chosen} - {"Location"} <= set(named), chosen
        restore()
        assert edited(solved) == ""
        np.testing.assert_array_equal(seen(solved), before)


def test_an_unedited_camera_is_never_named(solved: bpy.types.Scene, tmp_path: Path) -> None:
    settings = solved.virtual_aperture
    for frame in range(-2, 14):
        solved.frame_set(frame, subframe=0.4)
        assert edited(solved) == ""
    settings.root.location, settings.root.scale = (1, 2, 3), (0.3,) * 3
    settings.root.rotation_euler = (0.1, 2, 0.3)
    settings.camera.name = "Hero"
    # The user's own animation of what is no part of the view.
    key(settings.camera.data, "display_size", 3.0)
    settings.camera.data.clip_end = 50.0
    bpy.context.view_layer.update()
    assert edited(solved) == ""
    for kind in ("LINK_COPY", "FULL_COPY"):
        assert bpy.ops.scene.new(type=kind) == {"FINISHED"}
        copy = bpy.context.scene
        for scene, frame in ((copy, 4), (solved, 9), (copy, 6)):
            bpy.context.window.scene = scene
            scene.frame_set(frame)
            assert edited(copy) == edited(solved) == ""
        bpy.context.window.scene = solved
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    for scene in bpy.data.scenes:
        assert edited(scene) == ""


def test_a_solve_again_brings_a_camera_back(solved: bpy.types.Scene, tmp_path: Path) -> None:
    before, settings = seen(solved), solved.virtual_aperture
    for name in ("scale", "constraint", "drive lens", "inverse", "sensor"):
        EDITS[name][1](solved, settings.camera, random.Random(1))
    from addon.scene.sources.shot import reconstruction_of

    build(solved, open_footage(tmp_path / "clip"), reconstruction_of(settings))
    assert edited(solved) == ""
    np.testing.assert_array_equal(seen(solved), before)


def test_a_camera_of_1_0_is_not_named(registered: None) -> None:
    stored = Path(__file__).parent / "stored_focus" / "1.0.0.blend"
    bpy.ops.wm.open_mainfile(filepath=str(stored), load_ui=False)
    for scene in bpy.data.scenes:
        assert edited(scene) == ""


def test_a_render_reports_an_edit(
    solved: bpy.types.Scene, capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    settings = solved.virtual_aperture
    settings.views, settings.method = 4, "features"
    settings.camera.data.shift_x += 0.2
    bpy.ops.render.render()
    said = capfd.readouterr()
    assert "These changes of the clip's camera are ignored: Shift X" in said.out + said.err
