"""Cameras without points, written as the programs write them: axes, pixels, frames and units as they are."""

from __future__ import annotations

import json
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from addon.cli.options import IMPORT_WORDS
from addon.core.base.errors import Remedy, UserError
from addon.core.camera.reconstruction import Reconstruction, rotation_matrix
from addon.core.depth.user_maps import open_depth
from addon.core.focus.picking import check_place
from addon.core.media.clip import Footage, FrameRange, open_footage
from addon.core.readers import read_reconstruction, recorded_clip, recorded_depth

from .. import camera_files as files
from .. import planes

TURNED = rotation_matrix(np.array([0.4, -1.1, 0.7]))
"""A world that lies on its side, in no particular direction."""


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return files.write_clip(tmp_path_factory.mktemp("clip") / "shot")


@pytest.fixture(scope="module")
def footage(clip: Path) -> Footage:
    return open_footage(clip)


@pytest.fixture
def known() -> Reconstruction:
    return files.model(TURNED, 0.3)


def assert_same(found: Reconstruction, known: Reconstruction, pixels: float = 1e-3) -> None:
    """Poses as exact as single precision, lenses to a thousandth of a pixel."""
    assert found.frames.tolist() == known.frames.tolist()
    for one, other in zip(found.images, known.images, strict=True):
        np.testing.assert_allclose(one.rotation, other.rotation, atol=1e-6)
        np.testing.assert_allclose(one.translation, other.translation, atol=1e-6)
        mine, theirs = found.intrinsics(one), known.intrinsics(other)
        assert (mine.width, mine.height) == (theirs.width, theirs.height)
        place = [[*lens.focal, *lens.principal_point] for lens in (mine, theirs)]
        np.testing.assert_allclose(*place, atol=pixels)


def test_transforms_json(tmp_path: Path, footage: Footage, known: Reconstruction) -> None:
    imported = read_reconstruction(files.transforms(tmp_path / "transforms.json", known), footage)
    assert imported.lacks_points and imported.format == "transforms.json"
    assert_same(imported.reconstruction, known, 1e-9)
    # The folder that it lies in will do.
    assert_same(read_reconstruction(tmp_path, footage).reconstruction, known)


def test_transforms_json_of_instant_ngp_tells_an_angle(tmp_path: Path, footage: Footage) -> None:
    known = files.middled(files.model())
    path = files.transforms(tmp_path / "transforms.json", known)
    said = json.loads(path.read_text())
    kept = {"frames": said["frames"], "camera_angle_x": 2 * np.arctan(planes.WIDTH / 2 / planes.FOCAL)}
    for frame in kept["frames"]:
        # It leaves endings away.
        frame["file_path"] = "./" + frame["file_path"].removesuffix(".png")
    path.write_text(json.dumps(kept))
    assert_same(read_reconstruction(path, footage).reconstruction, known, 1e-9)


def test_transforms_json_has_lenses_of_frames_and_distortion(tmp_path: Path, footage: Footage) -> None:
    said = {"k1": -0.1, "k2": 0.02, "p1": 0.001, "p2": -0.002}
    path = files.transforms(tmp_path / "transforms.json", files.model(), **said)
    said = json.loads(path.read_text())
    said["frames"][3]["fl_x"] = said["frames"][3]["fl_y"] = 300.0
    path.write_text(json.dumps(said))
    model = read_reconstruction(path, footage).reconstruction
    lenses = [model.intrinsics(image) for image in model.images]
    assert [lens.fx for lens in lenses] == [300.0 if number == 3 else planes.FOCAL for number in range(12)]
    assert {(lens.k1, lens.k2, lens.p1, lens.p2) for lens in lenses} == {(-0.1, 0.02, 0.001, -0.002)}
    fisheye = files.transforms(path, files.model(), k1=0.01, k2=0.002, camera_model="OPENCV_FISHEYE")
    lens = read_reconstruction(fisheye, footage).reconstruction.cameras[0]
    assert (lens.model, lens.terms) == ("OPENCV_FISHEYE", (0.01, 0.002, 0.0, 0.0))


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"frames": []}, "a list of frames"),
        ({"frames": [{"file_path": "a.png"}]}, "frame 0: expected a transform_matrix"),
        ({"frames": [{"file_path": "a.png", "transform_matrix": (2 * np.eye(4)).tolist()}]}, "of a rotation"),
        ({"fl_x": None}, "a focal length as fl_x"),
        ({"camera_model": "EQUIRECTANGULAR"}, "a camera_model that is one of"),
    ],
)
def test_what_is_wrong_with_a_transforms_json_is_named(
    tmp_path: Path, footage: Footage, change: dict[str, object], expected: str
) -> None:
    path = files.transforms(tmp_path / "transforms.json", files.model())
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(UserError, match=expected):
        read_reconstruction(path, footage)


def test_megasam(tmp_path: Path, footage: Footage, known: Reconstruction) -> None:
    imported = read_reconstruction(files.megasam(tmp_path / "shot_sgd_cvd_hr.npz", known), footage)
    assert imported.lacks_points and imported.format == "MegaSaM"
    # Its scale is rounded to whole pixels on both sides.
    assert_same(imported.reconstruction, known, 0.3)


def test_vipe(tmp_path: Path, footage: Footage, known: Reconstruction) -> None:
    folder = files.vipe(tmp_path / "results", known)
    for path in (folder, folder / "pose" / "shot.npz"):
        imported = read_reconstruction(path, footage)
        assert imported.lacks_points and imported.format == "ViPE"
        assert_same(imported.reconstruction, known)
    (folder / "intrinsics" / "shot_camera.txt").write_text("0: PINHOLE\n1: MEI\n")
    with pytest.raises(UserError, match="expected PINHOLE cameras, not MEI"):
        read_reconstruction(folder, footage)


def test_depth_anything(tmp_path: Path, footage: Footage, known: Reconstruction) -> None:
    imported = read_reconstruction(files.depth_anything(tmp_path / "results.npz", known), footage)
    assert imported.lacks_points and imported.format == "Depth Anything 3"
    assert_same(imported.reconstruction, known)


def test_colmap_and_bundler_without_points(tmp_path: Path, footage: Footage, known: Reconstruction) -> None:
    imported = read_reconstruction(files.colmap(tmp_path / "colmap", known), footage)
    assert imported.lacks_points
    assert_same(imported.reconstruction, known)
    middled = files.middled(known)
    imported = read_reconstruction(files.bundler(tmp_path / "bundler", middled), footage)
    assert imported.lacks_points
    assert_same(imported.reconstruction, middled)


def test_stray_scanner(tmp_path: Path, clip: Path, known: Reconstruction) -> None:
    folder = files.stray(tmp_path / "recording", known, clip)
    own = recorded_clip(folder)
    assert own == folder / "rgb.mp4"
    imported = read_reconstruction(folder, open_footage(own))
    assert imported.lacks_points and imported.format == "Stray Scanner"
    assert_same(imported.reconstruction, known)


def test_the_lidar_of_a_recording_becomes_depth_maps(
    tmp_path: Path, clip: Path, known: Reconstruction
) -> None:
    """Of the video's frames, unknown where the phone was not sure."""
    folder = files.stray(tmp_path / "recording", known, clip)
    maps = recorded_depth(folder, tmp_path / "walk.aperture")
    assert maps == tmp_path / "walk_lidar"
    found = open_depth(maps, open_footage(folder / "rgb.mp4"))
    assert found.frames == tuple(range(1, 13))
    values = found.read(6).values
    assert np.isnan(values[:20]).all() and np.isnan(values[:, :64]).all()
    assert (values[20:, 64:] == 4000).all()
    # What is there is not written anew.
    (maps / "000001.png").write_bytes(b"mine")
    assert recorded_depth(folder, tmp_path / "walk.aperture") == maps
    assert (maps / "000001.png").read_bytes() == b"mine"
    assert recorded_depth(files.transforms(tmp_path / "a.json", known), tmp_path / "other.aperture") is None


def test_an_older_stray_scanner_has_no_names(tmp_path: Path, clip: Path, known: Reconstruction) -> None:
    folder = files.stray(tmp_path / "recording", known, clip)
    rows = (folder / "odometry.csv").read_text().splitlines()[1:]
    (folder / "odometry.csv").write_text("\n".join(row.split(", ", 2)[2] for row in rows))
    imported = read_reconstruction(folder, open_footage(folder / "rgb.mp4"))
    assert_same(imported.reconstruction, known)


def test_record3d_unpacks_its_pictures(tmp_path: Path, clip: Path, known: Reconstruction) -> None:
    path = files.record3d(tmp_path / "walk.r3d", known, clip)
    own = recorded_clip(path)
    assert own == tmp_path / "walk_frames"
    pictures = open_footage(own)
    assert pictures.frames == tuple(range(12))
    imported = read_reconstruction(path, pictures)
    assert imported.lacks_points and any("LZFSE" in note for note in imported.notes)
    found = imported.reconstruction
    assert found.frames.tolist() == list(range(12))
    for one, other in zip(found.images, known.images, strict=True):
        np.testing.assert_allclose(one.rotation, other.rotation, atol=1e-9)
        np.testing.assert_allclose(one.centre, other.centre, atol=1e-9)
    # Once is enough, and what else lies there is not touched, nor what the Finder puts beside it.
    (own / "._000003.jpg").write_bytes(b"")
    (own / ".DS_Store").write_bytes(b"")
    before = {file: file.stat().st_mtime_ns for file in own.iterdir()}
    assert recorded_clip(path) == own
    assert {file: file.stat().st_mtime_ns for file in own.iterdir()} == before
    (own / "000003.jpg").write_bytes(b"mine")
    with pytest.raises(UserError, match=r"is not what walk\.r3d unpacks to"):
        recorded_clip(path)
    assert (own / "000003.jpg").read_bytes() == b"mine"
    assert sorted(file.name for file in tmp_path.iterdir()) == ["walk.r3d", "walk_frames"]


def every_second(known: Reconstruction) -> Reconstruction:
    """The cameras of frames 1, 3, 5 and so on."""
    return replace(known, images=known.images[::2])


def test_cameras_of_every_second_frame_are_named_so(
    tmp_path: Path, clip: Path, footage: Footage, known: Reconstruction
) -> None:
    half = every_second(known)
    named = files.transforms(tmp_path / "named.json", half, files.NAMES[::2])
    found = read_reconstruction(named, footage)
    assert found.reconstruction.frames.tolist() == [1, 3, 5, 7, 9, 11]
    assert "6 frames of the clip have no camera: every 2nd frame from 2 to 12" in found.notes
    with pytest.raises(UserError, match="cameras for every 2nd frame from 1 to 11"):
        check_place(found.reconstruction, 2, 0.5, 0.5)
    arrays = files.megasam(tmp_path / "a_sgd_cvd_hr.npz", half)
    with pytest.raises(UserError, match="of every 2nd frame, import them for frames 1-12:2 alone") as caught:
        read_reconstruction(arrays, footage)
    assert "list.txt" not in str(caught.value) and Remedy.STEP in caught.value.remedies
    # Of those frames alone they are the cameras, however their pictures were numbered.
    part = open_footage(clip, FrameRange(1, 12, 2))
    numbered = tuple(f"frame_{number:05d}.png" for number in range(1, 7))
    for path in (arrays, files.transforms(tmp_path / "numbered.json", half, numbered)):
        assert_same(read_reconstruction(path, part).reconstruction, half)


@pytest.mark.parametrize("name", ["depth.npz", "depth.zip", "depth", "depth.onnx"])
def test_depth_without_cameras_is_told_from_a_solve(tmp_path: Path, footage: Footage, name: str) -> None:
    path = tmp_path / name
    if path.suffix == ".npz":
        np.savez(path, depths=np.ones((12, 4, 6), np.float32))
    elif path.suffix == ".zip":
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("0001.exr", b"")
    elif path.suffix:
        path.write_bytes(b"network")
    else:
        path.mkdir()
        (path / "0001.png").write_bytes(b"")
    with pytest.raises(UserError, match=rf"{name} holds .*, but no cameras.* as depth maps") as caught:
        read_reconstruction(path, footage)
    assert str(caught.value.worded(IMPORT_WORDS)).endswith("(render DIR --depth PATH)")


def test_a_folder_with_hidden_files_has_one_model(
    tmp_path: Path, footage: Footage, known: Reconstruction
) -> None:
    path = files.transforms(tmp_path / "transforms.json", known)
    path.with_name("._transforms.json").write_bytes(path.read_bytes())
    assert_same(read_reconstruction(tmp_path, footage).reconstruction, known)
