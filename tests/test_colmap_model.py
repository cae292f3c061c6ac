"""COLMAP text models: exact round trip, COLMAP's own reading of them, and damaged files."""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from addon.core.colmap_model import read_model, write_model
from addon.core.errors import UserError
from addon.core.reconstruction import Image, Intrinsics, Points, Reconstruction, rotation_matrix

PINHOLE = Intrinsics(640, 480, 500.1, 510.2, 325.3, 236.4)
DISTORTED = replace(PINHOLE, k1=-0.08, k2=0.02, p1=0.001, p2=-0.002)

# pycolmap must not be loaded into the same process as bpy.
PROJECT = """
import json, sys, numpy, pycolmap
model = pycolmap.Reconstruction(sys.argv[1])
out = {}
for image in model.images.values():
    seen = [(p.point3D_id, image.project_point(model.points3D[p.point3D_id].xyz)) for p in image.points2D]
    out[image.name] = [[int(i), *map(float, xy)] for i, xy in seen]
lengths = {int(i): p.track.length() for i, p in model.points3D.items()}
print(json.dumps([out, lengths]))
"""


def example(lens: Intrinsics) -> Reconstruction:
    """Three images, the second without a feature, and a point that nobody sees."""
    random = np.random.default_rng(5)
    xyz = random.uniform([-2, -2, 4], [2, 2, 9], (20, 3)) / 3
    images = []
    for frame, seen in ((3, 12), (7, 0), (1000012, 19)):
        rotation = rotation_matrix(random.normal(0, 0.1, 3))
        translation = random.normal(0, 0.1, 3)
        ids = random.permutation(19)[:seen].astype(np.int32)
        xy = lens.project(xyz[ids] @ rotation.T + translation)
        images.append(Image(frame, rotation, translation, xy, ids))
    points = Points(xyz, random.integers(0, 256, (20, 3)).astype(np.uint8), random.uniform(0, 1, 20))
    return Reconstruction((lens,), tuple(images), points)


@pytest.mark.parametrize("lens", [PINHOLE, DISTORTED])
def test_what_is_written_is_read(tmp_path: Path, lens: Intrinsics) -> None:
    before = example(lens)
    write_model(tmp_path, before)
    after = read_model(tmp_path)
    assert after.cameras == before.cameras
    for name in ("xyz", "rgb", "error"):
        np.testing.assert_array_equal(getattr(after.points, name), getattr(before.points, name))
    for old, new in zip(before.images, after.images, strict=True):
        assert (new.frame, new.camera) == (old.frame, old.camera)
        np.testing.assert_array_equal(new.xy, old.xy)
        np.testing.assert_array_equal(new.points, old.points)
        assert new.points.dtype == np.int32
        np.testing.assert_array_equal(new.translation, old.translation)
        np.testing.assert_allclose(new.rotation, old.rotation, atol=1e-15)


@pytest.mark.parametrize("lens", [PINHOLE, DISTORTED])
def test_colmap_reads_it_and_projects_alike(tmp_path: Path, lens: Intrinsics) -> None:
    model = example(lens)
    write_model(tmp_path, model)
    child = subprocess.run(
        [sys.executable, "-c", PROJECT, str(tmp_path)], capture_output=True, text=True, check=True
    )
    seen, lengths = json.loads(child.stdout)
    assert seen.keys() == {"frame_000003.png", "frame_000007.png", "frame_1000012.png"}
    for image in model.images:
        table = np.array(seen[f"frame_{image.frame:06d}.png"]).reshape(-1, 3)
        np.testing.assert_array_equal(table[:, 0], image.points)
        np.testing.assert_allclose(table[:, 1:], image.xy, atol=1e-6)
    assert [lengths[str(row)] for row in range(20)] == model.views_per_point.tolist()


@pytest.mark.parametrize(
    ("camera", "expected"),
    [
        ("SIMPLE_PINHOLE 640 480 500 320 240", Intrinsics(640, 480, 500, 500, 320, 240)),
        ("SIMPLE_RADIAL 640 480 500 320 240 0.1", Intrinsics(640, 480, 500, 500, 320, 240, k1=0.1)),
        ("RADIAL 640 480 500 320 240 0.1 0.2", Intrinsics(640, 480, 500, 500, 320, 240, k1=0.1, k2=0.2)),
    ],
)
def test_other_camera_models_are_read(tmp_path: Path, camera: str, expected: Intrinsics) -> None:
    write_model(tmp_path, example(PINHOLE))
    (tmp_path / "cameras.txt").write_text(f"# comment\n1 {camera}\n")
    assert read_model(tmp_path).cameras == (expected,)


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
        ("cameras.txt", 2, "PINHOLE", "FISHEYE"),
        ("cameras.txt", 2, "500.1", "nan"),
        ("cameras.txt", 2, "500.1", "-1"),
        ("cameras.txt", 2, " 640 ", " 0 "),
        ("images.txt", 3, "frame_000003", "frame"),
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


@pytest.mark.parametrize("text", ["1 2", "1 2 nan", "1 nan 3", "1 2 999", "1 2 -5", "1 2 x"])
def test_damaged_features_are_named(tmp_path: Path, text: str) -> None:
    write_model(tmp_path, example(PINHOLE))
    rows = (tmp_path / "images.txt").read_text().split("\n")
    rows[3] = text
    (tmp_path / "images.txt").write_text("\n".join(rows))
    with pytest.raises(UserError, match="line 4"):
        read_model(tmp_path)


def test_zero_quaternion_is_refused(tmp_path: Path) -> None:
    write_model(tmp_path, example(PINHOLE))
    rows = (tmp_path / "images.txt").read_text().split("\n")
    words = rows[2].split()
    rows[2] = " ".join([words[0], "0", "0", "0", "0", *words[5:]])
    (tmp_path / "images.txt").write_text("\n".join(rows))
    with pytest.raises(UserError, match="quaternion"):
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


def test_a_truncated_model_is_an_error_or_a_smaller_model(tmp_path: Path) -> None:
    write_model(tmp_path, example(PINHOLE))
    text = (tmp_path / "images.txt").read_text()
    for length in range(0, len(text), 97):
        (tmp_path / "images.txt").write_text(text[:length])
        with contextlib.suppress(UserError):
            assert len(read_model(tmp_path).images) <= 3
