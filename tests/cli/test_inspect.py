"""Inspecting a frame, and reports of a run: files of reports, the operator and the command line."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.base.progress import Cancelled, reporting
from addon.core.lens.inspection import NAMES
from addon.core.lens.report import FrameReport
from addon.core.media.clip import open_footage
from addon.core.readers.colmap_export import export_model
from addon.render.average import Drawn
from addon.render.run_report import RunReport, check_report
from addon.scene.build import build
from addon.ui import inspect as ui
from addon.ui import panels

from .. import planes
from ..command_line import done, here
from ..disc_and_wall import disc_and_wall
from ..disc_and_wall import scene as picture
from ..planes import CENTRES, clip, features, poses
from ..recorder import Recorder
from ..scenes import LENS as PLAIN
from ..scenes import slanted_shot

LENS = planes.LENS.scaled(160, 120)
"""Of the three planes at half their size."""

# Files of reports


def test_a_file_of_reports_goes_on(tmp_path: Path) -> None:
    warped, path = disc_and_wall(), tmp_path / "of" / "a.json"

    def draw(report: RunReport, *frames: int) -> None:
        for frame in frames:
            one_ = replace(warped, plan=replace(warped.plan, frame=frame))
            report.on_frame(Drawn(one_, picture(), 0.1))

    first = RunReport(path, "key")
    draw(first, 4, 2)
    held = json.loads(path.read_text())
    assert [entry["frame"] for entry in held["frames"]] == [2, 4]
    assert [p.name for p in path.parent.iterdir()] == ["a.json"]
    again = RunReport(path, "key")
    draw(again, 3)
    assert [entry["frame"] for entry in json.loads(path.read_text())["frames"]] == [2, 3, 4]
    assert again.lacks([1, 2, 3]) == [1] and "3 frames drawn by layers" in again.summary([2, 3, 4])
    with pytest.raises(UserError, match="other settings"):
        RunReport(path, "other")
    draw(RunReport(path, "other", overwrite=True), 9)
    assert [entry["frame"] for entry in json.loads(path.read_text())["frames"]] == [9]
    # Cancelled while the shares are drawn: nothing is said of the frame.
    stopped = RunReport(tmp_path / "b.json", "key")

    def stop(_stage: str, _share: float) -> None:
        raise Cancelled

    with pytest.raises(Cancelled), reporting(stop):
        stopped.on_frame(Drawn(warped, picture(), 0.1))
    assert not (tmp_path / "b.json").exists()


def test_another_file_is_left_alone(tmp_path: Path) -> None:
    for name, text in (("mine.json", '{"frames": []}'), ("list.json", "[]"), ("text.json", "not JSON")):
        (tmp_path / name).write_text(text)
        with pytest.raises(UserError, match="holds something else"):
            check_report(tmp_path / name, False)
        check_report(tmp_path / name, True)
    with pytest.raises(UserError, match=r"end it in \.json"):
        check_report(tmp_path / "report.txt", True)
    check_report(tmp_path / "new.json", False)


# In Blender


def test_inspecting_makes_images_and_uses_them_again(scene: bpy.types.Scene, tmp_path: Path) -> None:
    footage = open_footage(planes.write_clip(tmp_path / "clip", planes.halved(clip(CENTRES))))
    settings = build(scene, footage, poses(CENTRES, features(), LENS))
    with pytest.raises(RuntimeError, match="Pick what is to be sharp first"):
        bpy.ops.virtual_aperture.inspect_frame()
    settings.focus_distance, settings.views = 6.0, 4
    theirs = bpy.data.images.new("depth", 8, 8)
    assert bpy.ops.virtual_aperture.inspect_frame() == {"FINISHED"}
    images = ui.shown()
    assert tuple(images) == NAMES
    assert [image.name for image in images.values()] == [f"VA {name}" for name in NAMES]
    assert tuple(images["depth"].size) == (160, 120) and tuple(images["layers"].size) == (320, 120)
    assert not any(image.is_dirty for image in images.values())
    before = np.array(images["blur"].pixels)
    assert before.reshape(-1, 4)[:, 3].min() == 1 and np.ptp(before) > 0.5
    settings.focus_distance = 4.0
    scene.render.resolution_percentage = 50
    assert bpy.ops.virtual_aperture.inspect_frame() == {"FINISHED"}
    assert {name: image.as_pointer() for name, image in ui.shown().items()} == {
        name: image.as_pointer() for name, image in images.items()
    }
    assert tuple(images["depth"].size) == (80, 60) and len(images["blur"].pixels) == 80 * 60 * 4
    settings.method = "features"
    assert bpy.ops.virtual_aperture.inspect_frame() == {"FINISHED"}
    assert "confidence" not in ui.shown() and "layers" not in ui.shown()
    assert theirs.name == "depth" and tuple(theirs.size) == (8, 8)


def test_what_goes_wrong_leaves_the_images(scene: bpy.types.Scene, tmp_path: Path) -> None:
    shot = slanted_shot(tmp_path, PLAIN)
    settings = build(scene, shot.footage, shot.reconstruction)
    settings.focus_distance, settings.views, settings.method = 8.0, 4, "features"
    bpy.ops.virtual_aperture.inspect_frame()
    pixels = np.array(ui.shown()["depth"].pixels)
    scene.render.resolution_x = 500
    with pytest.raises(RuntimeError, match="another shape"):
        bpy.ops.virtual_aperture.inspect_frame()
    np.testing.assert_array_equal(np.array(ui.shown()["depth"].pixels), pixels)
    # Nobody listens any more.
    scene.render.resolution_x = 160
    scene.render.filepath = str(tmp_path / "a.png")
    settings.focus_distance = 5.0
    bpy.ops.render.render(write_still=True)
    np.testing.assert_array_equal(np.array(ui.shown()["depth"].pixels), pixels)


def test_the_button_is_in_a_closed_panel(scene: bpy.types.Scene) -> None:
    panel = panels.render.VIRTUAL_APERTURE_PT_debug
    assert panel.bl_parent_id == "VIRTUAL_APERTURE_PT_render" and "DEFAULT_CLOSED" in panel.bl_options
    ui.show({"blur": np.zeros((4, 6, 3), np.uint8)})
    layout = Recorder()
    panel.draw(type("Self", (), {"layout": layout})(), bpy.context)
    assert layout.operators[0] == "virtual_aperture.inspect_frame"
    assert "UNDO" in bpy.types.VIRTUAL_APERTURE_OT_inspect_frame.bl_options


def test_pictures_keep_their_way_up(registered: None) -> None:
    picture = np.zeros((4, 6, 3), np.uint8)
    picture[0, :, 0], picture[3, :, 2] = 255, 128
    assert ui.show({"depth": picture}) == ["VA depth"]
    pixels = np.array(ui.shown()["depth"].pixels).reshape(4, 6, 4)
    np.testing.assert_allclose(pixels[3, 0], [1, 0, 0, 1])
    np.testing.assert_allclose(pixels[0, 0], [0, 0, 128 / 255, 1], atol=1e-6)
    assert ui.show({}) == [] and not ui.shown()


# On the command line


@pytest.fixture(scope="module")
def work(registered: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three planes, whose cameras are known."""
    folder = tmp_path_factory.mktemp("known")
    planes.write_clip(folder / "clip", planes.halved(clip(CENTRES)))
    names = {n: f"shot_{n:04d}.png" for n in range(1, len(CENTRES) + 1)}
    (folder / "model").mkdir()
    export_model(folder / "model", poses(CENTRES, features(), LENS), names)
    done("import", folder / "model", "--footage", folder / "clip", "--work", folder / "work")
    return folder / "work"


LOOK = ("--focus-distance", 6, "--aperture-radius", 0.25, "--views", 8)


def test_inspect_writes_everything_and_overwrites_nothing(work: Path, tmp_path: Path) -> None:
    command = ("inspect", work, "--frame", 5, *LOOK, "--out", tmp_path / "seen")
    said = done(*command)
    files = [*(f"{name}.png" for name in NAMES), "report.json"]
    assert sorted(p.name for p in (tmp_path / "seen").iterdir()) == sorted(files)
    shapes = {name: cv2.imread(str(tmp_path / "seen" / f"{name}.png")).shape for name in NAMES}
    assert shapes.pop("layers") == (120, 320, 3) and set(shapes.values()) == {(120, 160, 3)}
    told = json.loads((tmp_path / "seen" / "report.json").read_text())
    assert (told["frame"], told["method"], told["views"]) == (5, "layers", 8)
    assert told["sure"] > 80 and told["own"] > 80
    assert told["borrowed"] > told["inpainted"] > 0
    # The planes' discs: 2 R f (1/4 - 1/6) and 2 R f (1/6 - 1/10).
    assert told["blur_largest"] == pytest.approx(2 * 0.25 * LENS.fx * (1 / 6 - 1 / 10 + 0.02), rel=0.5)
    assert f"{told['triangles']:,} triangles" in said and "% other frames'" in said
    (tmp_path / "seen" / "depth.png").unlink()
    again = here(*command)
    assert again.returncode == 1 and "pass --overwrite" in again.stderr
    assert not (tmp_path / "seen" / "depth.png").exists()
    done(*command, "--overwrite", "--method", "features")
    # What it does not have is not left from before.
    left = {
        "depth.png",
        "wireframe.png",
        "sources.png",
        "blur.png",
        "focus.png",
        "highlights.png",
        "report.json",
    }
    assert {p.name for p in (tmp_path / "seen").iterdir()} == left
    other = here("inspect", work, "--frame", 99, *LOOK, "--out", tmp_path / "none")
    assert other.returncode == 1 and "no frame 99; it has 1 to 9" in other.stderr
    assert not (tmp_path / "none").exists()


def test_a_sequence_and_its_report_go_on_together(work: Path, tmp_path: Path) -> None:
    render = ("render", work, *LOOK, "--out", tmp_path / "frames" / "####.png")
    report = tmp_path / "report.json"
    plain = done(*render, "--frames", "4")
    assert "1 frame drawn by layers: its depth is sure enough" in plain and "pixels:" not in plain
    said = done(*render, "--frames", "4-5", "--report", report)
    assert "1 frame drawn by layers: its depth is sure enough; pixels: " in said
    assert "no report of frames that were there already: 4" in said
    assert "2 frames drawn by layers" in done(*render, "--frames", "5-6", "--report", report)
    held = [FrameReport(**entry) for entry in json.loads(report.read_text())["frames"]]
    assert [one_.frame for one_ in held] == [5, 6]
    wider = (*LOOK[:3], 0.3, *LOOK[4:], "--frames", 6, "--report", report)
    other = here("render", work, *wider, "--out", tmp_path / "other" / "####.png")
    assert other.returncode == 1 and "other settings" in other.stderr
    assert [entry["frame"] for entry in json.loads(report.read_text())["frames"]] == [5, 6]
