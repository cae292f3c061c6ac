"""COLMAP text models: exact round trip, names, and damaged files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction, rotation_matrix
from addon.core.readers import colmap
from addon.core.readers.colmap_export import read_model, write_model

from ..foreign_models import assert_same

PINHOLE = Intrinsics(640, 480, 500.1, 510.2, 325.3, 236.4)
DISTORTED = replace(PINHOLE, k1=-0.08, k2=0.02, p1=0.001, p2=-0.002)
TEXT = ("cameras.txt", "images.txt", "points3D.txt")
SIZE = (640, 480)


def example(camera: Intrinsics) -> Reconstruction:
    """Three images, the second without a feature, and a point that nobody sees."""
    random = np.random.default_rng(5)
    xyz = random.uniform([-2, -2, 4], [2, 2, 9], (20, 3)) / 3
    images = []
    for frame, seen in ((3, 12), (7, 0), (1000012, 19)):
        rotation = rotation_matrix(random.normal(0, 0.1, 3))
        translation = random.normal(0, 0.1, 3)
        ids = random.permutation(19)[:seen].astype(np.int32)
        xy = camera.project(xyz[ids] @ rotation.T + translation)
        images.append(Image(frame, rotation, translation, xy, ids))
    points = Points(xyz, random.integers(0, 256, (20, 3)).astype(np.uint8), random.uniform(0, 1, 20))
    return Reconstruction((camera,), tuple(images), points)


@pytest.mark.parametrize("camera", [PINHOLE, DISTORTED])
def test_what_is_written_is_read(tmp_path: Path, camera: Intrinsics) -> None:
    before = example(camera)
    write_model(tmp_path, before)
    assert_same(read_model(tmp_path), before)


def test_features_without_a_point_and_ids_with_gaps(tmp_path: Path) -> None:
    (tmp_path / "cameras.txt").write_text("7 PINHOLE 640 480 500 500 320 240\n")
    (tmp_path / "images.txt").write_text(
        "9 1 0 0 0 0 0 0 7 my shot 0012.png\n1 2 -1 3 4 50\n2 1 0 0 0 1 0 0 7 a5.png\n\n"
    )
    (tmp_path / "points3D.txt").write_text("20 0 0 1 1 2 3 0.5\n50 0 0 2 4 5 6 0.5 9 1\n")
    model = read_model(tmp_path)
    assert model.frames.tolist() == [5, 12]
    assert model.images[1].points.tolist() == [1]
    assert model.images[1].xy.tolist() == [[3.0, 4.0]]
    assert len(model.images[0].points) == 0


@pytest.mark.parametrize(
    ("file", "line", "old", "new"),
    [
        ("cameras.txt", 2, "PINHOLE", "PINHOL"),
        ("cameras.txt", 2, "500.1", "nan"),
        ("images.txt", 3, "frame_000003.png", ""),
        ("images.txt", 3, " 1 frame", " 8 frame"),
        ("points3D.txt", 2, "0 ", "x "),
    ],
)
def test_damage_is_named_with_file_and_line(tmp_path: Path, file: str, line: int, old: str, new: str) -> None:
    write_model(tmp_path, example(PINHOLE))
    rows = (tmp_path / file).read_text().split("\n")
    assert old in rows[line - 1]
    rows[line - 1] = rows[line - 1].replace(old, new, 1)
    (tmp_path / file).write_text("\n".join(rows))
    with pytest.raises(UserError, match=f"{file}.*line {line}") as error:
        read_model(tmp_path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("text", ["1 2", "1 2 nan", "1 2 999"])
def test_damaged_features_are_named(tmp_path: Path, text: str) -> None:
    write_model(tmp_path, example(PINHOLE))
    rows = (tmp_path / "images.txt").read_text().split("\n")
    rows[3] = text
    (tmp_path / "images.txt").write_text("\n".join(rows))
    with pytest.raises(UserError, match="line 4"):
        read_model(tmp_path)


@pytest.mark.parametrize("file", ["cameras.txt", "images.txt", "points3D.txt"])
def test_missing_and_binary_files_are_named(tmp_path: Path, file: str) -> None:
    write_model(tmp_path, example(PINHOLE))
    (tmp_path / file).write_bytes(b"\xff\xfe\x00\x9c")
    with pytest.raises(UserError, match=file):
        read_model(tmp_path)
    (tmp_path / file).unlink()
    with pytest.raises(UserError, match=file):
        read_model(tmp_path)


@pytest.mark.parametrize("names", [("frame.png", "frame_7.png"), ("a7.png", "b7.png")])
def test_our_own_images_are_called_by_their_frames(tmp_path: Path, names: tuple[str, str]) -> None:
    write_model(tmp_path, example(PINHOLE), {3: names[0], 7: names[1]})
    with pytest.raises(UserError, match=r"images.txt.*frame"):
        read_model(tmp_path)


def test_names_of_others_are_kept(tmp_path: Path) -> None:
    write_model(tmp_path, example(PINHOLE), {3: "my clip 0003.jpg", 7: "b/\u00e4 #7.png"})
    assert colmap.read(tmp_path, SIZE).names == ("my clip 0003.jpg", "b/\u00e4 #7.png", "frame_1000012.png")
    for name in ("", " a.png", "a\nb.png"):
        with pytest.raises(UserError, match="rename"):
            write_model(tmp_path, example(PINHOLE), {3: name})


def test_line_ends_byte_order_mark_and_code_page(tmp_path: Path) -> None:
    before = example(DISTORTED)
    write_model(tmp_path, before, {3: "caf\u00e9 3.png"})
    for name in TEXT:
        text = (tmp_path / name).read_bytes().replace(b"\n", b"\r\n")
        (tmp_path / name).write_bytes(b"\xef\xbb\xbf" + text.replace(b"\xc3\xa9", b"\xe9"))
    foreign = colmap.read(tmp_path, SIZE)
    assert foreign.names[0] == "caf\u00e9 3.png"
    assert_same(read_model(tmp_path), before)


def test_tracks_may_name_anything(tmp_path: Path) -> None:
    write_model(tmp_path, example(PINHOLE))
    rows = (tmp_path / "points3D.txt").read_text().split("\n")
    rows[1:-1] = [" ".join([*row.split()[:8], "99 4 77 1000000"]) for row in rows[1:-1]]
    (tmp_path / "points3D.txt").write_text("\n".join(rows))
    assert_same(read_model(tmp_path), example(PINHOLE))


@pytest.mark.parametrize("name", TEXT)
def test_a_key_given_twice_is_named(tmp_path: Path, name: str) -> None:
    write_model(tmp_path, replace(example(PINHOLE), images=example(PINHOLE).images[1:2]))
    text = (tmp_path / name).read_text()
    (tmp_path / name).write_text(text + "".join(f"{row}\n" for row in text.splitlines() if row[:1] != "#"))
    with pytest.raises(UserError, match=f"{name}, line .*_ID that no other"):
        read_model(tmp_path)
