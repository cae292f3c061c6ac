"""Every operator: what tests its success and its refusal, and whether it can be undone."""

from __future__ import annotations

import ast
from dataclasses import dataclass
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


@dataclass(frozen=True)
class Case:
    """What is known of one operator."""

    success: str
    """The test that calls it, as "folder/file.py::test"."""
    refusal: str
    """The test in which it refuses; empty with the reason in `why` where it refuses nothing."""
    message: str = ""
    """A part of the message with which it refuses there."""
    undo: str = "UNDO"
    """The flag with which it can be undone; empty where it changes no scene."""
    why: str = ""
    """Why there is no flag, or no refusal."""


UI = "ui/test_ui.py"
PICK = "ui/test_pick_focus.py"
SUBJECT = "ui/test_pick_subject.py"
CASES = {
    "choose_clip": Case(
        "scene/test_after_solve.py::test_a_picture_means_its_sequence",
        "scene/test_after_solve.py::test_a_picture_means_its_sequence",
        "single image without a frame number",
    ),
    "find_clip": Case(
        "media/test_clip_paths.py::test_the_user_shows_where_the_clip_is",
        "media/test_clip_paths.py::test_the_user_shows_where_the_clip_is",
        "not the clip that was solved",
    ),
    "solve": Case(
        f"{UI}::test_solving_brings_the_clip_into_its_scene",
        f"{UI}::test_buttons_say_why_they_are_disabled",
        "Choose a clip first",
    ),
    "restore_objects": Case(
        "scene/test_parts.py::test_what_was_deleted_is_restored",
        "scene/test_parts.py::test_what_cannot_be_restored_is_said",
        "the solve with it",
    ),
    "restore_camera": Case(
        "scene/test_edited_camera.py::test_an_edit_is_named_and_restored",
        "scene/test_edited_camera.py::test_an_edit_is_named_and_restored",
        "The clip's camera is as it was solved",
    ),
    "import_solve": Case(
        f"{UI}::test_a_model_is_imported_by_its_folder_or_a_file_in_it",
        f"{UI}::test_an_import_that_fails_leaves_everything_as_it_was",
        "no model has been chosen",
    ),
    "import_movie_clip": Case(
        f"{UI}::test_a_solved_movie_clip_of_this_file_is_imported",
        f"{UI}::test_a_solved_movie_clip_of_this_file_is_imported",
        "No movie clip in this file is solved",
    ),
    "use_scene_camera": Case(
        "ui/test_scene_camera.py::test_a_scenes_camera_is_used_where_it_stands",
        "ui/test_scene_camera.py::test_a_camera_at_other_frames_is_refused",
        "to other frames of the clip",
    ),
    "show_photo": Case(
        "ui/test_photos.py::test_photos_are_solved_and_shown_by_name", "",
        why="it lists the photos that can be shown, and without any it is disabled",
    ),
    "find_points": Case(
        "ui/test_scene_camera.py::test_cameras_without_points_are_imported",
        "ui/test_scene_camera.py::test_points_are_found_for_cameras_only",
        "there are no cameras",
    ),
    "import_clip": Case(
        "ui/test_file_import.py::test_a_clip_is_chosen_and_solved_by_any_of_its_pictures",
        "ui/test_file_import.py::test_what_is_no_clip_is_refused_and_nothing_chosen",
        "no clip has been chosen; choose a video",
    ),
    "drop_model": Case(
        "ui/test_file_import.py::test_a_model_is_imported_for_the_chosen_clip",
        "ui/test_file_import.py::test_a_model_is_imported_for_the_chosen_clip",
        "is a solve, but no clip has been chosen",
    ),
    "set_focus": Case(
        f"{UI}::test_focus_from_selected_vertices",
        f"{UI}::test_focus_from_selected_vertices",
        "no vertices are selected",
    ),
    "pick_focus": Case(
        f"{PICK}::test_a_pick_is_in_focus",
        f"{PICK}::test_a_pick_is_refused",
        "frame 40 is after the end of the clip",
    ),
    "pick_subject": Case(
        f"{SUBJECT}::test_strokes_mark_a_subject",
        f"{SUBJECT}::test_a_stroke_is_refused",
        "frame 40 is after the end of the clip",
    ),
    "focus_subject": Case(
        f"{SUBJECT}::test_a_subject_is_carried_and_in_focus",
        f"{SUBJECT}::test_a_stroke_is_refused",
        "No subject is marked",
    ),
    "paint_repair": Case(
        "ui/test_paint_repair.py::test_a_stroke_is_a_repair",
        "ui/test_paint_repair.py::test_a_repair_is_refused",
        "frame 40 is after the end of the clip",
    ),
    "remove_repair": Case(
        "ui/test_paint_repair.py::test_a_stroke_is_a_repair",
        "ui/test_paint_repair.py::test_a_repair_is_refused",
        "Nothing has been repaired",
    ),
    "follow_nearest": Case(
        "ui/test_first_person.py::test_focus_follows_the_nearest_person",
        f"{SUBJECT}::test_a_stroke_is_refused",
        "no person was found in the clip",
    ),
    "carry_subject": Case(
        f"{SUBJECT}::test_a_subject_is_carried_and_in_focus",
        f"{SUBJECT}::test_a_stroke_is_refused",
        "No subject is marked",
    ),
    "remove_subject": Case(
        f"{SUBJECT}::test_names_tell_subjects_from_each_other",
        f"{SUBJECT}::test_a_stroke_is_refused",
        "No subject is marked",
    ),
    "drag_focus_mark": Case(
        "ui/test_focus_strip.py::test_a_mark_is_moved",
        "ui/test_focus_strip.py::test_a_mark_is_moved",
        "already has a focus mark",
    ),
    "hold_focus": Case(
        f"{PICK}::test_the_list_is_edited", f"{PICK}::test_the_list_is_edited", "Frame 3 already has a mark"
    ),
    "move_focus_mark": Case(
        f"{PICK}::test_the_list_is_edited", f"{PICK}::test_the_list_is_edited", "remove that one first"
    ),
    "remove_focus_mark": Case(
        f"{PICK}::test_the_list_is_edited", f"{PICK}::test_the_list_is_edited", "There are no focus marks"
    ),
    "write_focus_marks": Case(
        f"{PICK}::test_keys_are_given_back_to_the_marks",
        f"{PICK}::test_keys_are_given_back_to_the_marks",
        "The keyframes are those of the focus marks",
    ),
    "jump_to_focus_mark": Case(
        f"{PICK}::test_the_list_is_edited", "", undo="UNDO_GROUPED", why="every frame can be shown"
    ),
    "set_scale": Case(
        "ui/test_set_scale.py::test_two_clicks_and_a_length_are_the_scale",
        "ui/test_set_scale.py::test_a_scale_is_refused",
        "both ends are in the same place",
    ),
    "set_amount_by": Case(
        "scene/test_depth_of_field.py::test_f_stops_are_shown_once_the_scale_is_given",
        f"{UI}::test_buttons_say_why_they_are_disabled",
        "Pick what should be sharp first",
    ),
    "use_lens_preset": Case(
        "ui/test_lens_presets.py::use",
        "ui/test_lens_presets.py::test_what_is_no_preset_is_refused",
        "no preset has been chosen",
    ),
    "add_lens_preset": Case(
        "ui/test_lens_presets.py::test_own_presets_are_kept_and_removed", "",
        undo="", why="Blender's own operator for presets: it writes a file, and a name that is taken is left",
    ),
    "add_grade_nodes": Case(
        "render/test_range_matte.py::test_nodes_grade_the_range_alone",
        "render/test_range_matte.py::test_nodes_take_a_solve",
        "Solve the clip first",
    ),
    "add_lens_camera": Case(
        "scene/test_lens_camera.py::test_cycles_sees_through_our_lens",
        "scene/test_lens_camera.py::test_a_lens_that_no_camera_has_is_refused",
        "no camera has an in-focus zone",
    ),
    "render_frame": Case(
        f"{UI}::test_render_frame_and_clip_write_pictures",
        f"{UI}::test_buttons_say_why_they_are_disabled",
        "Solve the clip first",
        undo="", why="pictures are not part of the scene; as Blender's own render",
    ),
    "render_clip": Case(
        f"{UI}::test_render_frame_and_clip_write_pictures",
        f"{UI}::test_buttons_say_why_they_are_disabled",
        "Pick what should be sharp first",
        undo="", why="it writes files; as Blender's own render",
    ),
    "use_clip_size": Case(
        "ui/test_panel_states.py::test_the_clip_size_is_the_way_out_of_another_shape",
        "ui/test_panel_states.py::test_the_clip_size_is_the_way_out_of_another_shape",
        "Solve the clip first",
    ),
    "close_blender": Case(
        "ui/test_operators.py::test_blender_is_not_closed_by_us_where_nothing_is_made",
        "ui/test_operators.py::test_blender_is_not_closed_by_us_where_nothing_is_made",
        "Nothing is being rendered or exported",
        undo="", why="it closes Blender; tests/window/test_movie.py does so",
    ),
    "cancel_movie": Case(
        "ui/test_movie.py::test_nothing_stays_of_a_movie_that_is_cancelled",
        "ui/test_movie.py::test_nothing_stays_of_a_movie_that_is_cancelled",
        "No movie is being rendered",
        undo="", why="it ends a process",
    ),
    "export": Case(
        "ui/test_export.py::test_files_are_exported_in_the_background",
        "ui/test_export.py::test_an_export_is_refused",
        "nothing is in focus",
        undo="", why="it writes files; as Blender's own exporters",
    ),
    "cancel_export": Case(
        "ui/test_export.py::test_an_export_is_cancelled",
        "ui/test_export.py::test_an_export_is_cancelled",
        "Nothing is being exported",
        undo="", why="it ends a process",
    ),
    "preview": Case(
        "ui/test_operators.py::test_the_preview_is_shown_and_ended",
        "ui/test_operators.py::test_the_preview_is_shown_and_ended",
        "The camera was deleted",
        undo="", why="it changes the viewport, which Blender never undoes",
    ),
    "jump_to_frame": Case(
        "ui/test_report_list.py::test_frames_without_a_camera_are_listed", "",
        undo="UNDO_GROUPED", why="any frame can be shown",
    ),
    "find_depth": Case(
        "ui/test_depth_ahead.py::test_what_is_found_in_the_background_is_what_the_scene_reads",
        "ui/test_depth_ahead.py::test_another_clip_has_no_part_in_it",
        "holds no solve to keep depth with",
        undo="", why="it writes files beside the solve",
    ),
    "pause_depth": Case(
        "ui/test_depth_ahead.py::test_pausing_ends_the_process_and_finding_goes_on_later",
        "ui/test_operators.py::test_nothing_is_paused_where_nothing_is_under_way",
        "Depth is not being found",
        undo="", why="it ends a process",
    ),
    "delete_depth": Case(
        "ui/test_preferences.py::test_kept_depth_is_shown_and_deleted",
        "ui/test_preferences.py::test_kept_depth_is_shown_and_deleted",
        "No depth is kept for this clip",
        undo="", why="files that are deleted do not come back, which its question says",
    ),
}  # fmt: skip
OPERATORS = {
    cls.bl_idname.removeprefix("virtual_aperture."): cls
    for cls in CLASSES
    if issubclass(cls, bpy.types.Operator)
}


@cache
def sources(file: str) -> dict[str, str]:
    """The tests of a file, by name."""
    text = (TESTS / file).read_text()
    nodes = [node for node in ast.parse(text).body if isinstance(node, ast.FunctionDef)]
    return {node.name: ast.get_source_segment(text, node) or "" for node in nodes}


def test_every_operator_has_a_case() -> None:
    assert set(CASES) == set(OPERATORS)


@pytest.mark.parametrize("name", CASES)
def test_an_operator_is_tested_and_can_be_undone(name: str) -> None:
    case, operator = CASES[name], OPERATORS[name]
    for where in filter(None, (case.success, case.refusal)):
        file, test = where.split("::")
        assert name in sources(file)[test], f"{where} does not call {name}"
    if case.refusal:
        file, test = case.refusal.split("::")
        assert case.message and case.message in sources(file)[test]
    flags = {flag for flag in getattr(operator, "bl_options", ()) if flag.startswith("UNDO")}
    assert flags == ({case.undo} if case.undo else set())
    assert case.why or (case.undo and case.refusal), "say why"
    assert operator.__doc__ and operator.bl_label


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
