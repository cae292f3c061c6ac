"""What a render ignores is said."""

from __future__ import annotations

from pathlib import Path

import bpy
import pytest

from addon.cli.lens import lacking
from addon.core.camera.reconstruction import Intrinsics
from addon.core.media.clip import FrameRange, open_footage
from addon.render.views import frame_notes
from addon.scene.build import build
from addon.scene.cg_objects import cg_objects
from addon.scene.ignored import ignored

from ..scenes import slanted_plane, slanted_shot, write_frames

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
LINE = "These passes are not rendered: Mist"


@pytest.fixture
def solved(scene: bpy.types.Scene, tmp_path: Path) -> bpy.types.Scene:
    shot = slanted_shot(tmp_path / "clip", LENS, (5, 6, 7))
    settings = build(scene, shot.footage, shot.reconstruction)
    settings.focus_distance, settings.views, settings.method = 8.0, 4, "features"
    assert ignored(scene) == ()
    return scene


def add(scene: bpy.types.Scene, name: str) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    thing = bpy.data.objects.new(name, mesh)
    scene.collection.objects.link(thing)
    bpy.context.view_layer.update()
    return thing


def test_objects_are_drawn_but_those_that_cycles_would_not(solved: bpy.types.Scene) -> None:
    layer = solved.view_layers[0]
    light = bpy.data.objects.new("Light", bpy.data.lights.new("Light", "POINT"))
    solved.collection.objects.link(light)
    assert cg_objects(solved, layer) == []
    cube, duck, egg = (add(solved, name) for name in ("Cube", "Duck", "Egg"))
    assert ignored(solved) == ()
    assert cg_objects(solved, layer) == [cube, duck, egg]
    cube.hide_render, duck.visible_camera = True, False
    bpy.context.view_layer.update()
    assert cg_objects(solved, layer) == [egg]
    bpy.data.objects.remove(egg)
    assert cg_objects(solved, layer) == []


def test_another_camera_and_its_depth_of_field(solved: bpy.types.Scene) -> None:
    solved.camera.data.dof.use_dof = True
    ours = solved.camera.name
    assert ignored(solved) == (f"Depth of Field of {ours} is ignored; Focus and Lens are used instead",)
    other = bpy.data.objects.new("Other", bpy.data.cameras.new("Other"))
    solved.collection.objects.link(other)
    solved.camera = other
    assert ignored(solved) == ("The render shows the clip through its own camera, not through Other",)


def test_frames_outside_the_clip(solved: bpy.types.Scene) -> None:
    solved.frame_start, solved.frame_end = 1, 250
    assert ignored(solved) == (
        "Frames 1 to 4 come before the clip and repeat its frame 5",
        "Frames 8 to 250 come after the clip and repeat its frame 7",
    )


def test_passes(solved: bpy.types.Scene) -> None:
    layer = solved.view_layers[0]
    layer.use_pass_z = layer.use_pass_mist = layer.use_pass_cryptomatte_object = True
    assert ignored(solved) == ("These passes are not rendered: Cryptomatte Object, Mist",)


def test_a_render_warns_once(
    solved: bpy.types.Scene, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    solved.view_layers[0].use_pass_mist = True
    solved.render.filepath = str(tmp_path / "out" / "####.png")
    bpy.ops.render.render(animation=True)
    said = capfd.readouterr()
    assert (said.out + said.err).count(LINE) == 1
    assert len(list((tmp_path / "out").iterdir())) == 3
    solved.frame_set(7)
    bpy.ops.render.render()
    said = capfd.readouterr()
    assert LINE in said.out + said.err


@pytest.mark.parametrize(
    ("frame", "subframe", "said"),
    [
        (4, 0.9, "Frame 4 comes before the clip, which has frames 5 to 11"),
        (12, 0.0, "Frame 12 comes after the clip, which has frames 5 to 11"),
        (8, 0.0, "Frame 8 is missing in the clip, and repeats its frame 7"),
        (9, 0.0, "Frame 9 was not solved"),
        (6, 0.5, "Frame 6 is asked for at 6.50; there are no pictures between frames"),
        (5, 0.0, ""),
    ],
)
def test_a_frame_that_the_clip_has_not_is_named(
    scene: bpy.types.Scene,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    frame: int,
    subframe: float,
    said: str,
) -> None:
    solved, numbers = slanted_plane(LENS, (5, 6, 7, 10, 11)), (5, 6, 7, 9, 10, 11)
    settings = build(scene, open_footage(write_frames(tmp_path / "clip", LENS, numbers)), solved)
    settings.focus_distance, settings.views, settings.method = 8.0, 4, "features"
    scene.frame_set(frame, subframe=subframe)
    capfd.readouterr()
    bpy.ops.render.render()
    out = "".join(capfd.readouterr())
    words = ("before the clip", "after the clip", "is missing", "was not solved", "is asked for")
    assert said in out if said else not any(each in out for each in words)
    noted = [f"Frame {frame} {each.text}" for each in frame_notes.of(scene)]
    assert any(said in each for each in noted) if said else not noted


def test_frames_of_the_command_line_that_the_clip_has_not(tmp_path: Path) -> None:
    clip = open_footage(write_frames(tmp_path / "clip", LENS, (5, 6, 7, 9, 10, 11)))

    def absent(text: str) -> list[str]:
        return lacking(clip, FrameRange.parse(text))

    assert absent("5-7") == absent("9-11") == absent("5-11:2") == lacking(clip, None) == []
    assert absent("1-6") == ["1-4"] and absent("10-50") == ["12-50"] and absent("7-9") == ["8"]
    assert absent("0-999999999") == ["0-4", "8", "12-999999999"]
    # None at all is refused elsewhere.
    assert absent("50-60") == []
