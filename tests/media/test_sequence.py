"""Names of pictures: which are a clip's, and which frame each one is."""

from __future__ import annotations

import zipfile
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.camera.reconstruction import Intrinsics
from addon.core.depth.user_maps import open_depth
from addon.core.media.clip import Footage, FrameRange, open_footage
from addon.core.media.masks import open_masks
from addon.core.media.packed_pictures import open_packed
from addon.core.media.sequence import pattern_of
from addon.core.readers import read_reconstruction
from addon.scene.build import build
from addon.scene.sources.movieclip import _frame_numbers
from addon.ui.footage.file_import import clip_of

from .. import camera_files as files
from ..scenes import slanted_plane

LENS = Intrinsics(16, 12, 14.0, 14.0, 8.0, 6.0)


def pictures(folder: Path, names: Iterable[str]) -> Path:
    """Pictures whose grey level is their place."""
    folder.mkdir(parents=True, exist_ok=True)
    for place, name in enumerate(names):
        cv2.imwrite(str(folder / name), np.full((LENS.height, LENS.width, 3), place * 10, np.uint8))
    return folder


def shown(footage: Footage) -> list[int]:
    """Place of each frame's picture (see `pictures`)."""
    return [round(int(footage.read(frame)[0, 0, 0]) / 10) for frame in footage.frames]


def test_a_camera_counter_beyond_blenders_last_frame_begins_at_1_with_its_gaps(tmp_path: Path) -> None:
    numbers = (1100335, 1100336, 1100338, 1100339)
    footage = open_footage(pictures(tmp_path, [f"P{number}.png" for number in numbers]))
    assert footage.frames == (1, 2, 4, 5) and footage.file_numbers == numbers
    assert shown(footage) == [0, 1, 2, 3]
    assert "1100335 to 1100339" in footage.notes[0] and "frames 1 to 5 with 1 missing" in footage.notes[0]
    for some in (FrameRange(1100336, 1100338), FrameRange(2, 4), (2, 4)):
        part = open_footage(tmp_path, some)
        assert part.frames == (2, 4) and part.file_numbers == (1100336, 1100338) and shown(part) == [1, 2]


def test_times_of_day_have_no_gaps_and_no_number_is_rounded(tmp_path: Path) -> None:
    names = [f"{number}.png" for number in (20250101120000, 20250101120501, 2**63 + 10**6)]
    footage = open_footage(pictures(tmp_path, names))
    assert footage.frames == (1, 2, 3) and shown(footage) == [0, 1, 2]
    assert [footage.file(frame).name for frame in footage.frames] == names


@pytest.mark.parametrize("named", [(1100336, 1100338), (2, 4)])
def test_masks_belong_to_the_frames_of_the_same_file_numbers(tmp_path: Path, named: tuple[int, int]) -> None:
    clip = open_footage(pictures(tmp_path / "clip", [f"P{1100335 + at}.png" for at in range(5)]))
    masks = open_masks(pictures(tmp_path / "masks", [f"m{number}.png" for number in named]), clip)
    assert masks.frames == (2, 4)
    assert np.all(masks.at(4) == np.float32(10 / 255)) and masks.at(3) is None


def test_the_background_of_a_renumbered_clip_is_the_frames_own_picture(
    scene: bpy.types.Scene, tmp_path: Path
) -> None:
    footage = open_footage(pictures(tmp_path / "clip", [f"P{1100335 + at}.png" for at in range(5)]))
    settings = build(scene, footage, slanted_plane(LENS))
    assert (scene.frame_start, scene.frame_end) == (1, 5)
    background = settings.camera.data.background_images[0]
    for frame in (1, 4):
        scene.frame_set(frame)
        path = background.image.filepath_from_user(image_user=background.image_user)
        assert Path(bpy.path.abspath(path)) == footage.file(frame)


@pytest.mark.parametrize("path", ["", "desk_####_v02.png", "desk_%04d_v02.png", "desk_####_v##.png"])
def test_a_version_in_the_name_is_not_the_frame(tmp_path: Path, path: str) -> None:
    folder = pictures(tmp_path / "clip", [f"desk_{1001 + at}_v02.png" for at in range(3)])
    footage = open_footage(folder / path)
    assert footage.frames == (1001, 1002, 1003) and shown(footage) == [0, 1, 2]


def test_the_pattern_that_a_message_advises_is_read(tmp_path: Path) -> None:
    names = [f"desk_{number}_v0{version}.png" for version in (1, 2) for number in (1001, 1002, 1003)]
    folder = pictures(tmp_path / "clip", names)
    with pytest.raises(UserError, match=r"both frame 100\d; .*pattern like desk_####_v0\d.png") as caught:
        open_footage(folder)
    assert open_footage(folder / str(caught.value).split()[-1]).frames == (1001, 1002, 1003)


def test_one_picture_stands_for_its_sequence(tmp_path: Path) -> None:
    folder = pictures(tmp_path / "clip", [f"desk_{1001 + at}_v02.png" for at in range(3)])
    assert pattern_of(folder / "desk_1002_v02.png") == folder / "desk_####_v02.png"
    assert clip_of(folder / "desk_1002_v02.png") == folder / "desk_####_v02.png"
    clip = open_footage(folder)
    assert open_masks(folder / "desk_1002_v02.png", clip).frames == clip.frames
    assert pattern_of(folder / "shot2_0007.png") == folder / "shot2_####.png"
    assert pattern_of(folder / "desk.png") is None


LITTER = ("._0001.png", ".hidden0002.png", ".DS_Store", "Thumbs.db", "desktop.ini")


def test_hidden_files_are_no_pictures(tmp_path: Path) -> None:
    folder = pictures(tmp_path / "clip", ["0001.png", "0002.png"])
    for name in LITTER:
        (folder / name).write_bytes(b"\0\5\x16\7")
    (folder / "__MACOSX").mkdir()
    footage = open_footage(folder)
    assert footage.frames == (1, 2)
    assert open_masks(folder, footage).frames == (1, 2)
    arrays = tmp_path / "arrays"
    arrays.mkdir()
    np.savez(arrays / "0001.npz", depth=np.ones((4, 4)))
    (arrays / "._0001.npz").write_bytes(b"\0\5\x16\7")
    assert open_footage(arrays).frames == (1,)


def test_hidden_files_of_an_archive_are_no_pictures(tmp_path: Path) -> None:
    folder = pictures(tmp_path / "clip", ["0001.png", "0002.png"])
    with zipfile.ZipFile(tmp_path / "maps.zip", "w") as archive:
        for file in folder.iterdir():
            archive.write(file, f"maps/{file.name}")
            archive.writestr(f"__MACOSX/maps/._{file.name}", b"\0\5\x16\7")
            archive.writestr(f"maps/._{file.name}", b"\0\5\x16\7")
    maps = open_packed(tmp_path / "maps.zip", open_footage(folder))
    assert maps.frames == (1, 2) and maps.read(2).shape == (LENS.height, LENS.width, 3)


def test_large_numbers_in_an_archive_a_movie_clip_and_a_model_are_the_files(
    scene: bpy.types.Scene, tmp_path: Path
) -> None:
    folder = pictures(tmp_path / "clip", [f"P{1100335 + at}.png" for at in range(4)])
    footage = open_footage(folder)
    with zipfile.ZipFile(tmp_path / "maps.zip", "w") as archive:
        for number in (1100336, 1100338):
            archive.write(folder / f"P{number}.png", f"{number}.png")
    maps = open_depth(tmp_path / "maps.zip", footage)
    assert maps.frames == (2, 4)
    assert maps.stored(4)[0, 0, 0] == 30
    movie_clip = bpy.data.movieclips.load(str(folder / "P1100335.png"))
    assert _frame_numbers(movie_clip, footage, []) == {1: 1, 2: 2, 3: 3, 4: 4}
    known = files.model()
    half = replace(known, images=known.images[:3])
    model = files.transforms(tmp_path / "model.json", half, ("1100336.jpg", "1100337.jpg", "1100338.jpg"))
    reader = replace(footage, width=half.cameras[0].width, height=half.cameras[0].height)
    assert read_reconstruction(model, reader).reconstruction.frames.tolist() == [2, 3, 4]
