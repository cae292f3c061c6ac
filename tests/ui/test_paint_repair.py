"""Repairs of depth that are painted, listed, kept in the .blend, and given on the command line."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import bpy
import pytest

from addon.core.camera.reconstruction import Intrinsics
from addon.core.focus.focus import Focus
from addon.core.frame.frame_path import mesh_frame
from addon.core.frame.plan import FrameOptions
from addon.core.frame.repairs import Repair
from addon.core.media.light import to_linear
from addon.render.output.frame_files import frame_keys
from addon.scene.build import build
from addon.scene.focus.focus_marks import set_focus
from addon.scene.lens.lens import frame_options
from addon.scene.lens.repairs import repairs_of
from addon.scene.sources.shot import shot_of
from addon.ui import panels
from addon.ui.picking.paint_repair import VIRTUAL_APERTURE_UL_repairs

from ..cli.solved_clips import run, work
from ..recorder import Recorder, draw
from ..scenes import slanted_shot

__all__ = ["work"]
LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
OPERATORS = bpy.ops.virtual_aperture


@pytest.fixture
def settings(scene: bpy.types.Scene, tmp_path: Path) -> bpy.types.PropertyGroup:
    """A solved clip of a slanted plane."""
    shot = slanted_shot(tmp_path / "clip", LENS)
    return build(scene, shot.footage, shot.reconstruction)


def test_a_stroke_is_a_repair(scene: bpy.types.Scene, settings: bpy.types.PropertyGroup) -> None:
    scene.frame_set(2)
    brush = settings.repairs
    brush.kind, brush.radius, brush.amount = "NEARER", 0.0625, 0.5
    assert OPERATORS.paint_repair(places="0.25,0.5 0.5,0.5") == {"FINISHED"}
    brush.kind = "SAME"
    assert OPERATORS.paint_repair(places="0.5,0.75", reference="0.125,0.125") == {"FINISHED"}
    assert repairs_of(settings) == (
        Repair("nearer", 2, ((0.25, 0.5), (0.5, 0.5)), 0.0625, 0.5),
        Repair("same", 2, ((0.5, 0.75),), 0.0625, 0.5, (0.125, 0.125)),
    )
    shown = draw(panels.focus.VIRTUAL_APERTURE_PT_repair)
    assert shown.operators == ["virtual_aperture.paint_repair", "virtual_aperture.remove_repair"]
    row = Recorder()
    VIRTUAL_APERTURE_UL_repairs.draw_item(None, bpy.context, row, brush, brush.items[1], 0, brush, "active")
    assert row.texts == ["Same as Here", "frame 2"]
    assert OPERATORS.remove_repair() == {"FINISHED"}
    assert [each.kind for each in repairs_of(settings)] == ["nearer"]


def test_a_repair_is_refused(scene: bpy.types.Scene, settings: bpy.types.PropertyGroup) -> None:
    scene.frame_set(2)
    for places, said in (
        ("0.5", "is not valid; write places such as"),
        ("0.5,1.5", "is outside the picture"),
        ("", "places must be pairs of numbers"),
    ):
        with pytest.raises(RuntimeError, match=said):
            OPERATORS.paint_repair(places=places)
    settings.repairs.kind = "SAME"
    with pytest.raises(RuntimeError, match="needs a reference"):
        OPERATORS.paint_repair(places="0.5,0.5")
    scene.frame_set(40)
    with pytest.raises(RuntimeError, match="frame 40 is after the end of the clip"):
        OPERATORS.paint_repair(places="0.5,0.5", reference="0.5,0.5")
    assert not repairs_of(settings)
    with pytest.raises(RuntimeError, match="Nothing has been repaired"):
        OPERATORS.remove_repair()


def test_a_repair_is_in_the_picture_its_key_and_the_file(
    scene: bpy.types.Scene, settings: bpy.types.PropertyGroup, tmp_path: Path
) -> None:
    set_focus(settings, Focus(distance=5.0), 1)
    shot = shot_of(scene)
    before = frame_options(settings, shot.reconstruction)
    key = frame_keys(scene, [2])
    scene.frame_set(2)
    settings.repairs.kind = "NEARER"
    OPERATORS.paint_repair(places="0.5,0.5")
    after = frame_options(settings, shot.reconstruction)
    source = to_linear(shot.clip.read(2))
    depths = [mesh_frame(shot.context, 2, options, (160, 90), source).depth for options in (before, after)]
    assert depths[0] is not None and depths[1] is not None
    nearer = depths[1].inverse_depth / depths[0].inverse_depth
    assert nearer[45, 80] == pytest.approx(1.25, rel=1e-3) and nearer[5, 5] == 1
    assert frame_keys(scene, [2]) != key
    file = str(tmp_path / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=file)
    OPERATORS.remove_repair()
    bpy.ops.wm.open_mainfile(filepath=file)
    kept = repairs_of(bpy.context.scene.virtual_aperture)
    assert kept == after.repairs and len(kept) == 1


@pytest.mark.parametrize("frame", [2, 3], ids=["painted", "carried"])
def test_a_click_focuses_on_the_repaired_depth(
    scene: bpy.types.Scene, settings: bpy.types.PropertyGroup, frame: int
) -> None:
    for x in (0.5, 0.1):
        scene.frame_set(frame)
        assert OPERATORS.pick_focus(x=x, y=0.5) == {"FINISHED"}
        before = settings.focus_distance
        scene.frame_set(2)
        settings.repairs.kind, settings.repairs.amount = "NEARER", 1.0
        OPERATORS.paint_repair(places="0.5,0.5")
        scene.frame_set(frame)
        assert OPERATORS.pick_focus(x=x, y=0.5) == {"FINISHED"}
        nearer = 2.0 if x == 0.5 else 1.0
        assert settings.focus_distance == pytest.approx(before / nearer, rel=0.02)
        OPERATORS.remove_repair()


@pytest.mark.parametrize("is_ordered", [True, False], ids=["clip", "photos"])
def test_a_repair_is_carried_through_a_clip_but_not_to_other_photos(tmp_path: Path, is_ordered: bool) -> None:
    shot = slanted_shot(tmp_path / "clip", LENS)
    context = replace(shot.context, reconstruction=replace(shot.reconstruction, is_ordered=is_ordered))
    plain = FrameOptions(Focus(distance=5.0), 0.1)
    mended = replace(plain, repairs=(Repair("nearer", 2, ((0.5, 0.5),), 0.05),))
    for frame, is_changed in ((2, True), (3, is_ordered)):
        source = to_linear(shot.clip.read(frame))
        one, other = (
            mesh_frame(context, frame, options, (160, 90), source).depth for options in (plain, mended)
        )
        assert one is not None and other is not None
        assert bool((one.inverse_depth != other.inverse_depth).any()) == is_changed


def test_the_command_line_takes_a_file_of_repairs(
    work: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "mend.json"
    stroke = {"kind": "farther", "frame": 3, "places": [[0.5, 0.5]]}
    file.write_text(json.dumps([stroke]))
    lens = ("--focus-distance", 8, "--aperture-radius", 0.05, "--repair", file)
    blend = ("--blend", tmp_path / "a.blend")
    assert run("save", work, *blend, *lens) == 0
    (kept,) = repairs_of(bpy.context.scene.virtual_aperture)
    assert (kept.kind, kept.frame) == ("farther", 3)
    for held, said in (
        (stroke | {"frame": 99}, "frame 99"),
        (stroke | {"kind": "x"}, "no kind of repair 'x'"),
    ):
        file.write_text(json.dumps([held]))
        assert run("save", work, *blend, *lens, "--overwrite") == 1
        assert said in capsys.readouterr().err
