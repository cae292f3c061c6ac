"""EXR files with layers and windows: the channel that holds depth, in its place in the picture."""

from __future__ import annotations

import io
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.depth.user_maps import open_depth
from addon.core.media import picture_file
from addon.core.media.clip import open_footage
from addon.core.media.exr_parts import depth_channel, read_header
from addon.core.media.picture_file import decode_picture, open_picture, read_picture
from addon.scene.base import exr
from addon.scene.build import _background_problem, build

from ..pictures import channels, of_channels
from ..scenes import LENS, slanted_shot

VALUES = np.arange(12.0).reshape(3, 4) + 1


@pytest.fixture(autouse=True)
def decoder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(picture_file, "exr_decoder", exr.read)


@pytest.fixture
def blender(scene: bpy.types.Scene, tmp_path: Path) -> bpy.types.RenderSettings:
    """A scene that renders multi-layer files, of colours, depth and other passes."""
    shot = slanted_shot(tmp_path / "clip", LENS)
    settings = build(scene, shot.footage, shot.reconstruction)
    settings.focus_distance, settings.views, settings.method = 8.0, 4, "features"
    layer = scene.view_layers[0]
    layer.use_pass_z = layer.virtual_aperture_passes.use_in_focus = True
    image = scene.render.image_settings
    image.media_type, image.color_depth = "MULTI_LAYER_IMAGE", "32"
    return scene.render


def rendered(render: bpy.types.RenderSettings, file: Path, codec: str, interleaved: bool) -> Path:
    image = render.image_settings
    image.exr_codec, image.use_exr_interleave, render.filepath = codec, interleaved, str(file)
    bpy.ops.render.render(write_still=True)
    return file


def test_blenders_own_files_in_each_compression(blender: bpy.types.RenderSettings, tmp_path: Path) -> None:
    """In parts, as Blender 5 writes them, and interleaved, as it did before."""
    truth = channels(rendered(blender, tmp_path / "truth.exr", "NONE", True))["ViewLayer.Depth.Z"]
    assert np.ptp(truth) > 1
    for codec in ("NONE", "ZIP", "ZIPS", "RLE", "PIZ", "PXR24", "HTJ2K", "DWAA", "DWAB"):
        for interleaved in (False, True):
            file = rendered(blender, tmp_path / f"{codec}_{interleaved}.exr", codec, interleaved)
            if interleaved and codec.startswith("DWA"):
                with pytest.raises(UserError, match="are compressed together with DWA; save it with ZIP"):
                    open_picture(file, is_depth=True)
                continue
            found = open_picture(file, is_depth=True).pixels
            assert found.shape == (*truth.shape, 4)
            np.testing.assert_allclose(found[..., 0], truth, rtol=1e-4, err_msg=f"{codec} {interleaved}")


def test_a_clip_with_layers_is_refused_by_name(blender: bpy.types.RenderSettings, tmp_path: Path) -> None:
    for interleaved in (False, True):
        file = rendered(blender, tmp_path / "a_0001.exr", "ZIP", interleaved)
        with pytest.raises(UserError, match=r"a_0001\.exr has layers, ViewLayer\.Combined.* as OpenEXR, not"):
            read_picture(file)


@pytest.mark.parametrize(
    ("names", "wanted"),
    [
        (("ViewLayer.Combined.R", "ViewLayer.Depth.Z", "ViewLayer.Mist.Z"), "ViewLayer.Depth.Z"),
        (("A", "B", "G", "R", "Z"), "Z"),
        (("R", "G", "B", "N.X", "N.Y", "N.Z", "zDepth.R", "zDepth.G", "zDepth.B"), "zDepth.R"),
        (("V.Depth.Z", "V.Denoising Depth.Z", "V.Position.X", "V.Position.Y", "V.Position.Z"), "V.Depth.Z"),
        (("Front.Combined.R", "Front.Depth.Z", "Hidden.Combined.R", "Hidden.Depth.Z"), "Front.Depth.Z"),
        (("depth",), "depth"),
    ],
)
@pytest.mark.parametrize("tiled", [False, True])
def test_depth_is_found_by_names(names: tuple[str, ...], wanted: str, tiled: bool) -> None:
    values = {name: VALUES * (place + 1) for place, name in enumerate(names)}
    data = of_channels(values, tiled=tiled)
    channel = depth_channel(read_header(io.BytesIO(data)))
    assert channel is not None and channel.label == wanted
    found = decode_picture(data, "a.exr", is_depth=True)
    np.testing.assert_array_equal(found[..., :3], np.repeat(values[wanted][..., None], 3, axis=2))
    assert (found[..., 3] == 1).all()


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (("V.Combined.R", "V.Mist.Z"), r"no layer Depth and no channel Z, but V\.Combined\.R, V\.Mist\.Z"),
        (("A.Depth.Z", "B.Depth.Z"), r"depth in several layers, A\.Depth\.Z, B\.Depth\.Z; save one"),
    ],
)
def test_layers_that_are_not_clear_are_listed(names: tuple[str, ...], said: str) -> None:
    data = of_channels(dict.fromkeys(names, VALUES))
    with pytest.raises(UserError, match=rf"a\.exr cannot be used: it has {said}"):
        decode_picture(data, "a.exr", is_depth=True)


@pytest.mark.parametrize("names", [("V",), ("R", "G", "B", "A"), ("Y", "A")])
def test_files_of_one_layer_are_read_as_they_were(names: tuple[str, ...]) -> None:
    data = of_channels(dict.fromkeys(names, VALUES))
    np.testing.assert_array_equal(decode_picture(data, "a.exr", True), decode_picture(data, "a.exr"))


@pytest.mark.parametrize("names", [("Y",), ("L.Depth.Z", "L.Image.R")])
@pytest.mark.parametrize(
    ("place", "display"),
    [((2, 1), (0, 0, 7, 5)), ((-2, -1), (0, 0, 7, 5)), ((-1, -1), (0, 0, 1, 1)), ((9, 9), (5, 4, 11, 10))],
)
def test_the_data_window_lies_in_the_display_window(
    names: tuple[str, ...], place: tuple[int, int], display: tuple[int, int, int, int]
) -> None:
    data = of_channels(dict.fromkeys(names, VALUES), place, display)
    found = decode_picture(data, "a.exr", is_depth=True)
    assert found.shape == (display[3] - display[1] + 1, display[2] - display[0] + 1, 4)
    inside = 0
    for row, column in np.ndindex(found.shape[:2]):
        y, x = row + display[1] - place[1], column + display[0] - place[0]
        is_there = 0 <= y < 3 and 0 <= x < 4
        inside += is_there
        assert found[row, column].tolist() == ([VALUES[y, x]] * 3 + [1] if is_there else [0] * 4)
    assert inside


def test_maps_that_were_cropped_by_their_window_keep_their_place(tmp_path: Path) -> None:
    """As Nuke writes them: of each frame the part that is not empty, and so another size."""
    clip = slanted_shot(tmp_path / "clip", LENS).footage
    (tmp_path / "z").mkdir()
    for frame, (left, top, wide, high) in enumerate(((10, 5, 40, 30), (12, 6, 50, 40), (0, 0, 160, 90)), 1):
        values = np.full((high, wide), 1.0 + frame)
        whole = (0, 0, LENS.width - 1, LENS.height - 1)
        (tmp_path / "z" / f"z_{frame:04d}.exr").write_bytes(of_channels({"Z": values}, (left, top), whole))
        maps = open_depth(tmp_path / "z", clip) if frame == 3 else None
    assert maps is not None and not maps.notes
    first = maps.read(1).values
    assert first.shape == (90, 160)
    known = np.isfinite(first)
    assert known[5:35, 10:50].all() and known.sum() == 30 * 40


def test_frames_of_a_clip_are_their_display_windows(scene: bpy.types.Scene, tmp_path: Path) -> None:
    for frame, wide in ((1, 40), (2, 50)):
        colours = dict.fromkeys("RGB", np.full((9, wide), 0.5))
        (tmp_path / f"{frame}.exr").write_bytes(of_channels(colours, (0, 0), (0, 0, 63, 8)))
    clip = open_footage(tmp_path)
    assert (clip.width, clip.height) == (64, 9)
    assert [float(clip.read(frame)[..., 3].sum()) for frame in (1, 2)] == [9 * 40, 9 * 50]
    assert "its data window, are not all of its display window of 64x9" in clip.notes[0]
    # Blender's own background would be stretched.
    assert "data window" in _background_problem(scene.virtual_aperture, clip)


def test_damaged_files_are_errors(tmp_path: Path) -> None:
    names = ("L.Combined.R", "L.Depth.Z", "L.Depth.V")
    for tiled in (False, True):
        data = of_channels(dict.fromkeys(names, VALUES), tiled=tiled)
        rng = np.random.default_rng(0)
        for _ in range(300):
            broken = bytearray(data[: rng.integers(0, len(data) + 1)] if rng.random() < 0.3 else data)
            for place in rng.integers(0, max(len(broken), 1), rng.integers(0, 4)):
                if broken:
                    broken[place] = rng.integers(0, 256)
            try:
                decode_picture(bytes(broken), "a.exr", is_depth=True)
            except UserError as error:
                assert "\n" not in str(error)
