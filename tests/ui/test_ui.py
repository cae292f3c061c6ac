"""Operators and panels with the real module."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.core.camera.reconstruction import Intrinsics, rotation_matrix
from addon.core.media.clip import open_footage
from addon.core.sfm.process import Opening, SolveProcess
from addon.core.sfm.workspace import load_solve
from addon.render.viewport.overlay import lines
from addon.scene.build import build
from addon.ui import panels
from addon.ui.base.solving import Solving
from addon.ui.footage.solve import build_scene

from .. import foreign_models as foreign
from .. import planes
from ..foreign_models import write_clip, write_model
from ..in_blender import choose_clip, select
from ..recorder import draw
from ..scenes import slanted_shot, write_frames
from ..waiting import until

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)


def test_buttons_say_why_they_are_disabled(scene: bpy.types.Scene, tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="Choose a clip first"):
        bpy.ops.virtual_aperture.solve()
    for operator in (bpy.ops.virtual_aperture.set_focus, bpy.ops.virtual_aperture.render_frame):
        with pytest.raises(RuntimeError, match="Solve the clip first"):
            operator()
    shot = slanted_shot(tmp_path, LENS)
    build(scene, shot.footage, shot.reconstruction)
    with pytest.raises(RuntimeError, match="press Tab for Edit Mode"):
        bpy.ops.virtual_aperture.set_focus()
    with pytest.raises(RuntimeError, match="Pick what should be sharp first"):
        bpy.ops.virtual_aperture.render_clip()
    with pytest.raises(RuntimeError, match="Pick what should be sharp first"):
        bpy.ops.virtual_aperture.set_amount_by(kind="F_STOP")


def test_focus_from_selected_vertices(scene: bpy.types.Scene, tmp_path: Path) -> None:
    shot = slanted_shot(tmp_path, LENS)
    settings = build(scene, shot.footage, shot.reconstruction)
    scene.frame_set(2)
    select(settings.points, ())
    with pytest.raises(RuntimeError, match="no vertices are selected"):
        bpy.ops.virtual_aperture.set_focus()
    select(settings.points, (7,))
    assert bpy.ops.virtual_aperture.set_focus() == {"FINISHED"}
    assert settings.marks.points == (7,)
    select(settings.points, (7, 11, 30))
    assert bpy.ops.virtual_aperture.set_focus() == {"FINISHED"}
    assert settings.marks.points == (7, 11, 30)
    assert settings.marks.items[0].frame == 2
    assert settings.points.mode == "OBJECT"
    # IDs stay when vertices before them are deleted.
    select(settings.points, (0, 1, 2))
    bpy.ops.mesh.delete(type="VERT")
    select(settings.points, (4, 8))
    assert bpy.ops.virtual_aperture.set_focus() == {"FINISHED"}
    assert settings.marks.points == (7, 11)
    assert len(settings.aperture.data.vertices) > 0


def test_all_points_are_no_focus(scene: bpy.types.Scene, tmp_path: Path) -> None:
    shot = slanted_shot(tmp_path, LENS)
    settings = build(scene, shot.footage, shot.reconstruction)
    select(settings.points, tuple(range(150)))
    with pytest.raises(RuntimeError, match="all 150 vertices are selected"):
        bpy.ops.virtual_aperture.set_focus()
    assert settings.points.mode == "EDIT" and not settings.marks.points
    select(settings.points, tuple(range(149)))
    assert bpy.ops.virtual_aperture.set_focus() == {"FINISHED"}


def test_render_frame_and_clip_write_pictures(scene: bpy.types.Scene, tmp_path: Path) -> None:
    shot = slanted_shot(tmp_path / "clip", LENS)
    settings = build(scene, shot.footage, shot.reconstruction)
    settings.focus_distance = 8.0
    settings.views = 4
    settings.blur = -1
    assert settings.blur > 0
    scene.render.filepath = str(tmp_path / "out" / "####.png")
    scene.render.engine = "CYCLES"
    settings.render_as = "FRAMES"
    assert bpy.ops.virtual_aperture.render_frame() == {"FINISHED"}
    assert scene.render.engine == "VIRTUAL_APERTURE"
    assert bpy.ops.virtual_aperture.render_clip() == {"FINISHED"}
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["0001.png", "0002.png", "0003.png"]


def drawn(closed: bool) -> tuple[set[str], set[str], str]:
    """Properties, greyed ones in brackets, operators and texts of the panels that are closed, or not."""
    shown = [draw(p) for p in panels.CLASSES if ("DEFAULT_CLOSED" in getattr(p, "bl_options", ())) == closed]
    props, operators = ({n for s in shown for n in getattr(s, kind)} for kind in ("props", "operators"))
    return props, operators, " ".join(text for s in shown for text in s.texts)


def test_panels_show_the_next_step(scene: bpy.types.Scene, tmp_path: Path) -> None:
    in_sidebar = [panel for panel in panels.CLASSES if panel.bl_region_type == "UI"]
    assert {panel.bl_category for panel in in_sidebar} == {"Virtual Aperture"}
    props, operators, texts = drawn(closed=False)
    assert "Drop a video or an image of a sequence" in texts
    assert (props, operators) == (set(), {"virtual_aperture.choose_clip"})
    shot = slanted_shot(tmp_path, LENS)
    settings = scene.virtual_aperture
    settings.footage = str(shot.footage.path)
    _, operators, texts = drawn(closed=False)
    assert "Solve the clip to find" in texts
    assert operators == {"virtual_aperture.choose_clip", "virtual_aperture.solve"}
    build(scene, shot.footage, shot.reconstruction)
    _, operators, texts = drawn(closed=False)
    assert "Pick Focus, then click what should be sharp" in texts
    names = ("choose_clip", "preview", "pick_focus", "render_frame", "render_clip")
    assert operators == {f"virtual_aperture.{name}" for name in names}
    select(settings.points, (7, 11, 30))
    _, operators, texts = drawn(closed=False)
    assert "Select vertices" in texts and "virtual_aperture.set_focus" in operators
    bpy.ops.virtual_aperture.set_focus()
    props, operators, texts = drawn(closed=False)
    assert props == {"blur_percent"} and "virtual_aperture.set_scale" in operators
    assert "In focus: " in texts
    props, operators, _ = drawn(closed=True)
    assert {"focus_object", "(focus_distance)", "blur", "frame_start", "quality"} <= props
    assert {"virtual_aperture.hold_focus", "virtual_aperture.remove_focus_mark"} <= operators
    settings.focus_distance = 7.0
    assert "focus_distance" in drawn(closed=True)[0]
    scene.render.filepath = "//out/"
    # A long name is broken into lines.
    words = drawn(closed=False)[2].replace(" ", "")
    assert f"Frames1to3,to{tmp_path.name}_render.mp4" in words
    settings.render_as = "FRAMES"
    assert "Frames 1 to 3, to //out/ as PNG" in drawn(closed=False)[2]


def test_long_texts_are_wrapped_to_the_panel() -> None:
    words = "36 of 36 frames registered, 1554 points, reprojection error 0.13 px"
    narrow, wide = lines(words, 150), lines(words, 2000)
    assert wide == [words] and len(narrow) > 2
    assert " ".join(narrow) == words
    assert lines("", 100) == []
    path = "/home/somebody/clips/" + 10 * "somewhere/"
    broken = lines(f"no {path}", 150)
    assert len(broken) > 3 and "".join(broken) == f"no{path}"


def test_solving_brings_the_clip_into_its_scene(scene: bpy.types.Scene, tmp_path: Path) -> None:
    clip = planes.write_clip(tmp_path / "walk", planes.sideways(12))
    settings = scene.virtual_aperture
    settings.footage, settings.work_dir = str(clip), str(tmp_path / "work")
    # A known lens is solved in half the time.
    settings.lens, settings.equivalent = "GIVEN", 36.0
    assert bpy.ops.virtual_aperture.solve() == {"FINISHED"}
    assert len(settings.points.data.vertices) > 50 and scene.camera == settings.camera
    # 320x240 pixels lie on 34.6x26.0 mm of the 35 mm film's diagonal.
    assert settings.camera.data.lens == pytest.approx(36.0 * 36.0 / 34.61, rel=1e-3)
    before = (tmp_path / "work" / "solve.json").stat().st_mtime_ns
    assert bpy.ops.virtual_aperture.solve() == {"FINISHED"}
    assert (tmp_path / "work" / "solve.json").stat().st_mtime_ns == before
    assert bpy.ops.virtual_aperture.solve(again=True) == {"FINISHED"}
    assert (tmp_path / "work" / "solve.json").stat().st_mtime_ns > before
    settings.lens, settings.focal_mm, settings.sensor_mm = "SENSOR", 20.0, 18.0
    assert bpy.ops.virtual_aperture.solve() == {"FINISHED"}
    assert settings.camera.data.lens == pytest.approx(40.0, rel=1e-5)
    settings.footage = str(tmp_path / "gone")
    with pytest.raises(RuntimeError, match="does not exist"):
        bpy.ops.virtual_aperture.solve()
    assert settings.points is not None


@pytest.mark.parametrize("chosen", ["", "0/points3D.txt"])
def test_a_model_is_imported_by_its_folder_or_a_file_in_it(
    scene: bpy.types.Scene, tmp_path: Path, chosen: str
) -> None:
    work = choose_clip(scene, tmp_path)
    write_model(tmp_path / "sparse" / "0")
    chosen_path = tmp_path / "sparse" / chosen
    # As the file selector hands folders over.
    text = f"{chosen_path}/" if chosen_path.is_dir() else str(chosen_path)
    assert bpy.ops.virtual_aperture.import_solve(filepath=text) == {"FINISHED"}
    settings = scene.virtual_aperture
    assert len(settings.points.data.vertices) == 12
    assert scene.camera == settings.camera
    assert (scene.frame_start, scene.frame_end) == (1, 4)
    kept = load_solve(work)
    assert kept.quality.focal_from == "file"
    assert kept.reconstruction.cameras[0].fx == foreign.LENS.fx
    # A lens of 80 pixels on a picture of 96, on Blender's sensor of 36 mm.
    assert settings.camera.data.lens == pytest.approx(30.0)


def test_an_import_replaces_a_solve_only_when_told_to(scene: bpy.types.Scene, tmp_path: Path) -> None:
    work = choose_clip(scene, tmp_path)
    first, second = write_model(tmp_path / "one"), write_model(tmp_path / "two", 15)
    bpy.ops.virtual_aperture.import_solve(filepath=str(first))
    before = (work / "solve.json").read_text()
    with pytest.raises(RuntimeError, match="already holds a solve of this clip"):
        bpy.ops.virtual_aperture.import_solve(filepath=str(second))
    assert (work / "solve.json").read_text() == before
    points = scene.virtual_aperture.points
    assert len(points.data.vertices) == 12
    assert bpy.ops.virtual_aperture.import_solve(filepath=str(second), again=True) == {"FINISHED"}
    assert scene.virtual_aperture.points == points
    assert len(points.data.vertices) == len(load_solve(work).reconstruction.points) == 15
    # The import is not taken for a solve.
    with pytest.raises(RuntimeError, match=r"holds an imported solve \(COLMAP text\).*Solve Again"):
        bpy.ops.virtual_aperture.solve()


def test_edit_mode_is_left_for_a_new_solve(scene: bpy.types.Scene, tmp_path: Path) -> None:
    work = choose_clip(scene, tmp_path)
    bpy.ops.virtual_aperture.import_solve(filepath=str(write_model(tmp_path / "one")))
    points = scene.virtual_aperture.points
    select(points, (1, 2))
    bpy.context.window.scene = bpy.data.scenes.new("other")
    build_scene(scene, open_footage(tmp_path / "clip"), work)
    assert points.mode == "OBJECT"
    assert len(points.data.vertices) == 12


def test_an_import_that_fails_leaves_everything_as_it_was(scene: bpy.types.Scene, tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="no clip has been chosen"):
        bpy.ops.virtual_aperture.import_solve(filepath=str(tmp_path))
    work = choose_clip(scene, tmp_path)
    with pytest.raises(RuntimeError, match="no model has been chosen"):
        bpy.ops.virtual_aperture.import_solve()
    notes = tmp_path / "notes.txt"
    notes.write_text("Things to do")
    broken = write_model(tmp_path / "broken")
    (broken / "images.txt").write_text("nonsense\n")
    for path, said in (
        (notes, "not a model in a known format"),
        (tmp_path / "gone", "does not exist"),
        (broken, "images.txt"),
        (tmp_path / "a.blend", "Import Movie Clip"),
    ):
        with pytest.raises(RuntimeError, match=said):
            bpy.ops.virtual_aperture.import_solve(filepath=str(path), again=True)
    assert not work.exists()
    assert scene.virtual_aperture.points is None
    assert len(bpy.data.objects) == 0
    bpy.ops.virtual_aperture.import_solve(filepath=str(write_model(tmp_path / "good")))
    before = (work / "solve.json").read_text()
    with pytest.raises(RuntimeError, match=r"images\.txt"):
        bpy.ops.virtual_aperture.import_solve(filepath=str(broken), again=True)
    assert (work / "solve.json").read_text() == before
    assert len(scene.virtual_aperture.points.data.vertices) == 12


def test_what_the_reader_notes_is_a_warning(
    scene: bpy.types.Scene, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    choose_clip(scene, tmp_path)
    (tmp_path / "clip" / "shot_0004.png").unlink()
    bpy.ops.virtual_aperture.import_solve(filepath=str(write_model(tmp_path / "model")))
    assert "Warning: 1 image of the model is not in the clip: shot_0004.png" in capfd.readouterr().out


def solved_movie_clip(folder: Path) -> bpy.types.MovieClip:
    """A movie clip of the folder's pictures with exact tracks, solved by Blender."""
    width, height = foreign.SIZE
    clip = bpy.data.movieclips.load(str(folder / "shot_0001.png"))
    camera = clip.tracking.camera
    camera.units, camera.focal_length_pixels = "PIXELS", 80.0
    camera.principal_point_pixels = (width / 2, height / 2)
    target = clip.tracking.objects[0]
    target.keyframe_a, target.keyframe_b = 1, 4
    points = np.random.default_rng(1).uniform([-2, -1.5, 5], [2, 1.5, 9], (40, 3))
    for _ in points:
        target.tracks.new(frame=1)
    for frame in range(1, 5):
        turn = rotation_matrix(np.array([0.01, -0.02, 0.005]) * frame)
        local = (points - [0.3 * frame, 0.02 * frame**2, 0.05 * frame]) @ turn.T
        places = local[:, :2] / local[:, 2:] * [80 / width, -80 / height] + 0.5
        for track, place in zip(target.tracks, places, strict=True):
            track.markers.insert_frame(frame, co=place)
    area = bpy.context.screen.areas[0]
    kind, area.type = area.type, "CLIP_EDITOR"
    area.spaces.active.clip = clip
    window = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(area=area, region=window, space_data=area.spaces.active):
        assert bpy.ops.clip.solve_camera() == {"FINISHED"}
    area.type = kind
    return clip


def test_a_solved_movie_clip_of_this_file_is_imported(scene: bpy.types.Scene, tmp_path: Path) -> None:
    work = choose_clip(scene, tmp_path)
    folder = tmp_path / "clip"
    unsolved = bpy.data.movieclips.load(str(folder / "shot_0001.png"))
    unsolved.name = "unsolved"
    with pytest.raises(RuntimeError, match="No movie clip in this file is solved"):
        bpy.ops.virtual_aperture.import_movie_clip()
    clip = solved_movie_clip(folder)
    with pytest.raises(TypeError, match="unsolved"):
        bpy.ops.virtual_aperture.import_movie_clip(clip="unsolved")
    assert bpy.ops.virtual_aperture.import_movie_clip(clip=clip.name) == {"FINISHED"}
    settings = scene.virtual_aperture
    assert len(settings.points.data.vertices) == 40
    assert settings.camera.data.lens == pytest.approx(30.0)
    assert load_solve(work).quality.reprojection_error < 0.01
    with pytest.raises(RuntimeError, match="already holds a solve of this clip"):
        bpy.ops.virtual_aperture.import_movie_clip(clip=clip.name)
    assert bpy.ops.virtual_aperture.import_movie_clip(clip=clip.name, again=True) == {"FINISHED"}
    # Another clip's pictures are refused, and the scene stays.
    write_frames(tmp_path / "other", Intrinsics(64, 64, 80.0, 80.0, 32.0, 32.0))
    settings.footage, settings.work_dir = str(tmp_path / "other"), str(tmp_path / "elsewhere")
    with pytest.raises(RuntimeError, match="is 96x64, the chosen clip other is 64x64"):
        bpy.ops.virtual_aperture.import_movie_clip(clip=clip.name)
    assert not (tmp_path / "elsewhere").exists()
    assert len(settings.points.data.vertices) == 40


def test_a_clip_is_opened_meanwhile_and_cancelled_at_once(scene: bpy.types.Scene, tmp_path: Path) -> None:
    def begin() -> SolveProcess:
        raise AssertionError

    opening = Opening(write_clip(tmp_path / "clip"), False)
    solving = Solving(begin, "shot.mp4", opening)
    assert [step.text for step in solving.poll()] == ["Reading the clip"]
    assert not solving.finished and not solving.ended
    Solving.running = solving
    try:
        texts = draw(panels.main.VIRTUAL_APERTURE_PT_main).texts
    finally:
        Solving.running = None
    assert {"shot.mp4", "Reading the clip", "ESC cancels"} <= set(texts)
    solving.cancel()
    assert solving.ended
    until(lambda: opening._worker.process is not None and opening._worker.process.poll() is not None)


def test_a_solve_begins_once_its_clip_is_open(tmp_path: Path) -> None:
    begun = []

    def begin() -> SolveProcess:
        begun.append(True)
        return SolveProcess(tmp_path / "clip", tmp_path / "work")

    solving = Solving(begin, "clip", Opening(write_clip(tmp_path / "clip"), False))
    assert not begun
    until(lambda: solving.poll() is not None and begun)
    assert solving.process is not None and solving.process.clip.path == tmp_path / "clip"
    solving.cancel()
