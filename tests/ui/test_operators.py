"""Every operator: that a test quotes its refusal, and whether it can be undone."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

import bpy
import pytest

from addon.core.camera.reconstruction import Intrinsics
from addon.scene.build import build
from addon.ui import CLASSES

from ..scenes import slanted_shot

TESTS = Path(__file__).resolve().parents[1]
LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)


REFUSALS = {
    "choose_clip": "single image without a frame number",
    "find_clip": "not the clip that was solved",
    "solve": "Choose a clip first",
    "restore_objects": "the solve with it",
    "restore_camera": "The clip's camera is as it was solved",
    "import_solve": "no model has been chosen",
    "import_movie_clip": "No movie clip in this file is solved",
    "use_scene_camera": "to other frames of the clip",
    "find_points": "there are no cameras",
    "import_clip": "no clip has been chosen; choose a video",
    "drop_model": "is a solve, but no clip has been chosen",
    "set_focus": "no vertices are selected",
    "pick_focus": "frame 40 is after the end of the clip",
    "pick_subject": "frame 40 is after the end of the clip",
    "focus_subject": "No subject is marked",
    "paint_repair": "frame 40 is after the end of the clip",
    "remove_repair": "Nothing has been repaired",
    "suggest_marks": "no person was found in the clip",
    "take_suggestion": "nothing is suggested at frame 4",
    "dismiss_suggestions": "There are no suggestions; Suggest Focus Marks makes some",
    "carry_subject": "No subject is marked",
    "remove_subject": "No subject is marked",
    "drag_focus_mark": "already has a focus mark",
    "hold_focus": "Frame 3 already has a mark",
    "move_focus_mark": "remove that one first",
    "remove_focus_mark": "There are no focus marks",
    "write_focus_marks": "The keyframes are those of the focus marks",
    "set_scale": "both ends are in the same place",
    "set_amount_by": "Pick what should be sharp first",
    "use_lens_preset": "no preset has been chosen",
    "add_grade_nodes": "Solve the clip first",
    "add_lens_camera": "no camera has an in-focus zone",
    "render_frame": "Solve the clip first",
    "render_clip": "Pick what should be sharp first",
    "use_clip_size": "Solve the clip first",
    "close_blender": "Nothing is being rendered or exported",
    "cancel_movie": "No movie is being rendered",
    "export": "nothing is in focus",
    "cancel_export": "Nothing is being exported",
    "preview": "The camera was deleted",
    "find_depth": "holds no solve to keep depth with",
    "pause_depth": "Depth is not being found",
    "delete_depth": "No depth is kept for this clip",
}
"""A part of the message with which an operator refuses, as a test that calls it quotes it."""
NEVER_REFUSED = {
    "show_photo": "it lists the photos that can be shown, and without any it is disabled",
    "add_lens_preset": "Blender's own operator for presets: a name that is taken is left",
    "jump_to_frame": "any frame can be shown",
}
"""Why."""
NO_UNDO = {
    "add_lens_preset": "it writes a file",
    "render_frame": "pictures are not part of the scene; as Blender's own render",
    "render_clip": "it writes files; as Blender's own render",
    "close_blender": "it closes Blender; tests/window/test_movie.py does so",
    "cancel_movie": "it ends a process",
    "export": "it writes files; as Blender's own exporters",
    "cancel_export": "it ends a process",
    "preview": "it changes the viewport, which Blender never undoes",
    "find_depth": "it writes files beside the solve",
    "pause_depth": "it ends a process",
    "delete_depth": "files that are deleted do not come back, which its question says",
}
"""Why an operator cannot be undone: it changes no scene."""
GROUPED = {"jump_to_frame"}
"""Those that are undone together where several follow each other."""
OPERATORS = {
    cls.bl_idname.removeprefix("virtual_aperture."): cls
    for cls in CLASSES
    if issubclass(cls, bpy.types.Operator)
}


@cache
def functions() -> list[str]:
    """The sources of all functions of tests."""
    found = []
    for path in TESTS.rglob("test_*.py"):
        text = path.read_text()
        nodes = [node for node in ast.parse(text).body if isinstance(node, ast.FunctionDef)]
        found += [ast.get_source_segment(text, node) or "" for node in nodes]
    return found


def test_every_operator_is_listed() -> None:
    assert set(REFUSALS) | set(NEVER_REFUSED) == set(OPERATORS) and set(NO_UNDO) | GROUPED <= set(OPERATORS)


def test_operators_are_tested_and_can_be_undone() -> None:
    for name, operator in OPERATORS.items():
        calls = [text for text in functions() if name in text]
        assert calls, f"no test calls {name}"
        assert name in NEVER_REFUSED or any(REFUSALS[name] in text for text in calls), name
        flags = {flag for flag in getattr(operator, "bl_options", ()) if flag.startswith("UNDO")}
        expected = set() if name in NO_UNDO else {"UNDO_GROUPED" if name in GROUPED else "UNDO"}
        assert flags == expected and operator.__doc__ and operator.bl_label, name


def test_the_preview_is_shown_and_ended(scene: bpy.types.Scene, tmp_path: Path) -> None:
    preview = bpy.ops.virtual_aperture.preview
    with pytest.raises(RuntimeError, match="Solve the clip first"):
        preview()
    shot = slanted_shot(tmp_path, LENS)
    settings = build(scene, shot.footage, shot.reconstruction)
    area = next(area for area in bpy.context.screen.areas if area.type == "VIEW_3D")
    space = area.spaces.active
    space.shading.type = "SOLID"
    scene.render.engine = "CYCLES"
    with bpy.context.temp_override(area=area):
        assert preview() == {"FINISHED"}
        assert (space.shading.type, scene.render.engine) == ("RENDERED", "VIRTUAL_APERTURE")
        assert space.region_3d.view_perspective == "CAMERA" and scene.camera == settings.camera
        assert preview() == {"FINISHED"}
        assert space.shading.type == "SOLID"
        bpy.data.objects.remove(settings.camera)
        with pytest.raises(RuntimeError, match="The camera was deleted"):
            preview()


def test_blender_is_not_closed_by_us_where_nothing_is_made(scene: bpy.types.Scene) -> None:
    with pytest.raises(RuntimeError, match="Nothing is being rendered or exported"):
        bpy.ops.virtual_aperture.close_blender()


def test_nothing_is_paused_where_nothing_is_under_way(scene: bpy.types.Scene) -> None:
    with pytest.raises(RuntimeError, match="Depth is not being found"):
        bpy.ops.virtual_aperture.pause_depth()
