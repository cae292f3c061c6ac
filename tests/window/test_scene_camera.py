"""The scene's own camera for that of the clip: the panel's button, its question, and what comes of it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import bpy
import pytest
from mathutils import Matrix

from .. import camera_files as files
from .program import Program
from .screen import Screen
from .steps import SETTINGS, open_below, opened, running

DIALOG = 0.5
"""Seconds until Blender has drawn it."""

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module")
def program(screen: Screen, resources: Path, folder: Path) -> Iterator[Program]:
    clip = files.write_clip(folder / "filmed")
    with running(screen, resources, "scene_camera", _scene(folder / "filmed.blend")) as made:
        made.ask(f"{SETTINGS}.footage = {str(clip)!r}; None")
        yield made


def _scene(path: Path) -> Path:
    """A .blend with a camera that is animated as the clip was filmed."""
    bpy.ops.wm.read_homefile(app_template="", use_factory_startup=True)
    scene, known = bpy.context.scene, files.model()
    lens = known.cameras[0]
    scene.render.resolution_x, scene.render.resolution_y = lens.width, lens.height
    scene.frame_end = files.COUNT
    thing = scene.camera
    thing.name, data = "Filmed", thing.data
    data.sensor_width, data.lens = 36.0, lens.fx * 36 / lens.width
    data.shift_x = (lens.width / 2 - lens.cx) / lens.width
    data.shift_y = (lens.cy - lens.height / 2) / lens.width
    for image, matrix in zip(known.images, files.to_world(known, files.OPENGL), strict=True):
        thing.matrix_world = Matrix(matrix.tolist())
        thing.keyframe_insert("location", frame=image.frame)
        thing.keyframe_insert("rotation_euler", frame=image.frame)
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def test_the_button_asks_and_the_points_come(program: Program) -> None:
    with opened(program, "Clip"):
        open_below(program, "work_dir")
        program.shot("panel")
        program.press("use_scene_camera(")
        program.settle()
        program.shot("question")
        # A dialog ends where the mouse leaves it.
        program.screen.key("Return")
        program.wait(f"{SETTINGS}.points is not None", 120)
        program.settle()
        program.shot("done")
    said = program.ask("messages()")
    assert any("12 of 12 frames registered" in each for each in said), said
    assert program.ask("bpy.context.scene.camera.name") == "Virtual Aperture Camera"


def test_it_is_one_step_of_undo(program: Program) -> None:
    program.screen.move(*program.middle("VIEW_3D"))
    program.screen.key("ctrl+z")
    program.wait(f"{SETTINGS}.points is None")
    assert program.ask("bpy.context.scene.camera.name") == "Filmed"
