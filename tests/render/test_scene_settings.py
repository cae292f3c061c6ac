"""Scene settings that the clip's pictures must not depend on, or that render more than one picture."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.core.focus.focus import Focus
from addon.render.output.background import written_files
from addon.render.output.frame_files import still_problem
from addon.scene.build import build
from addon.scene.focus.focus_marks import set_focus
from addon.scene.ignored import ignored

from ..command_line import done, here
from ..conftest import Shared
from ..pictures import channels
from ..scenes import LENS, slanted_plane, slanted_shot, write_plane
from ..slanted_clip import LENS_OPTIONS, keep

STEREO = "Stereoscopy is ignored: every view shows the clip as it is"


@pytest.fixture
def solved(scene: bpy.types.Scene, tmp_path: Path) -> bpy.types.Scene:
    shot = slanted_shot(tmp_path / "clip", LENS)
    settings = build(scene, shot.footage, shot.reconstruction)
    set_focus(settings, Focus(distance=8.0), 1)
    settings.views, settings.method = 4, "features"
    scene.render.image_settings.file_format = "PNG"
    return scene


def shown(path: Path) -> np.ndarray:
    return np.asarray(cv2.imread(str(path)))


def test_every_view_shows_the_clip(solved: bpy.types.Scene, tmp_path: Path) -> None:
    render, layer = solved.render, solved.view_layers[0]
    for out in ("plain", "views"):
        render.filepath = str(tmp_path / f"{out}.png")
        bpy.ops.render.render(write_still=True)
        render.use_multiview = True
    plain = shown(tmp_path / "plain.png")
    assert plain.any()
    for suffix in ("L", "R"):
        assert np.array_equal(shown(tmp_path / f"views_{suffix}.png"), plain), suffix
    assert ignored(solved) == (STEREO,)
    # Of passes, and of views that are not two eyes, too.
    render.views_format, render.filepath = "MULTIVIEW", str(tmp_path / "all.exr")
    render.views.new("top").file_suffix = "_top"
    layer.virtual_aperture_passes.use_in_focus = True
    render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    render.image_settings.views_format, render.image_settings.exr_codec = "INDIVIDUAL", "NONE"
    render.image_settings.use_exr_interleave = True
    bpy.ops.render.render(write_still=True)
    held = {path.name: channels(path) for path in tmp_path.glob("all*")}
    assert sorted(held) == ["all_L.exr", "all_R.exr", "all_top.exr"]
    for each in held.values():
        assert list(each) == list(held["all_L.exr"]) and len(each) == 5
        for name, values in each.items():
            assert np.array_equal(values, held["all_L.exr"][name]) and values.any(), name


def test_blenders_own_command_line_finds_the_files_of_all_views(
    solved: bpy.types.Scene, tmp_path: Path
) -> None:
    render = solved.render
    render.filepath = str(tmp_path / "out" / "####")
    for many, how, views in (
        (False, "INDIVIDUAL", "STEREO_3D"), (True, "INDIVIDUAL", "STEREO_3D"),
        (True, "STEREO_3D", "STEREO_3D"), (True, "INDIVIDUAL", "MULTIVIEW"),
    ):  # fmt: skip
        render.use_multiview, render.views_format, render.image_settings.views_format = many, views, how
        solved.frame_set(2)
        render.filepath = render.frame_path(frame=2)
        bpy.ops.render.render(write_still=True)
        render.filepath = str(tmp_path / "out" / "####")
        files = written_files(solved)
        assert sorted(files) == sorted((tmp_path / "out").iterdir())
        for path, size in files.items():
            assert still_problem(path, size) == ""
            path.unlink()


def override(scene: bpy.types.Scene) -> None:
    scene.render.image_settings.color_management = "OVERRIDE"
    scene.render.image_settings.view_settings.exposure = 1.0


def white_balance(scene: bpy.types.Scene) -> None:
    scene.view_settings.use_white_balance, scene.view_settings.white_balance_temperature = True, 3000


def side_by_side(scene: bpy.types.Scene) -> None:
    scene.render.use_multiview = True
    scene.render.image_settings.views_format = "STEREO_3D"
    scene.render.image_settings.stereo_3d_format.display_mode = "SIDEBYSIDE"


def between_frames(scene: bpy.types.Scene) -> None:
    scene.frame_set(2, subframe=0.5)


@pytest.fixture(scope="module")
def blend(registered: None, shared: Shared) -> Path:
    """A saved scene, and its frame 2 as the command line renders it."""

    def fill(folder: Path) -> None:
        keep(write_plane(folder / "clip", slanted_plane(LENS)), folder / "work")
        done("save", folder / "work", *LENS_OPTIONS, "--no-copy", "--blend", folder / "a.blend")
        done("render", folder / "a.blend", "--frames", 2, "--out", folder / "plain" / "####.png")

    return shared("scene_settings", fill) / "a.blend"


@pytest.mark.parametrize("change", [override, white_balance, side_by_side, between_frames])
def test_the_command_lines_pictures_do_not_depend_on_it(
    blend: Path, tmp_path: Path, change: Callable[[bpy.types.Scene], None]
) -> None:
    """A frame's key does not hold it: a run that goes on would mix frames."""
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    change(bpy.context.scene)
    bpy.ops.wm.save_as_mainfile(filepath=str(blend.with_name(f"{change.__name__}.blend")), copy=True)
    said = done(
        "render", blend.with_name(f"{change.__name__}.blend"), "--frames", 2, "--out", tmp_path / "####.png"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["0002.png"]
    assert (tmp_path / "0002.png").read_bytes() == (blend.parent / "plain" / "0002.png").read_bytes()
    assert (f"note: {STEREO}" in said) == (change is side_by_side)


def test_no_view_layer_is_an_error_of_its_own(blend: Path, tmp_path: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    bpy.context.scene.view_layers[0].use = False
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "off.blend"), copy=True)
    ended = here("render", tmp_path / "off.blend", "--out", tmp_path / "out" / "####.png")
    assert ended.returncode == 1 and "no view layer of Scene is rendered; enable" in ended.stderr
