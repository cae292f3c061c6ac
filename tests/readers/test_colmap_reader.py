"""What COLMAP itself writes, read by us; our models, read by COLMAP; damaged binary files."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.camera.reconstruction import Image, Points, Reconstruction, rotation_matrix
from addon.core.readers import colmap
from addon.core.readers.colmap_binary import FILES as BINARY
from addon.core.readers.colmap_export import write_model
from addon.core.readers.colmap_text import FILES as TEXT

from ..foreign_models import assert_same
from ..lenses import TERMS, lens_of

SIZE = (640, 480)

# pycolmap must not be loaded into the same process as bpy.
COLMAP = """
import json, pathlib, sys, pycolmap
folder = pathlib.Path(sys.argv[1])
model = pycolmap.Reconstruction(folder / "ours")
(folder / "bin").mkdir(); (folder / "txt").mkdir()
model.write_binary(folder / "bin"); model.write_text(folder / "txt")
out = {"seen": {}, "lengths": {int(i): p.track.length() for i, p in model.points3D.items()}}
for image in model.images.values():
    seen = [(p.point3D_id, image.project_point(model.points3D[p.point3D_id].xyz)) for p in image.points2D]
    out["seen"][image.name] = [[int(i), *map(float, xy)] for i, xy in seen]
options = pycolmap.SyntheticDatasetOptions(
    num_rigs=2, num_cameras_per_rig=2, num_frames_per_rig=3, num_points3D=40, num_points2D_without_point3D=7)
rigs = pycolmap.synthesize_dataset(options)
rigs.deregister_frame(2)
(folder / "rigs" / "sparse" / "0").mkdir(parents=True); (folder / "rigs" / "sparse" / "1").mkdir()
rigs.write_binary(folder / "rigs" / "sparse" / "0"); rigs.write_text(folder / "rigs" / "sparse" / "1")
registered = [i for i in rigs.images.values() if i.has_pose]
out["poses"] = {i.name: i.cam_from_world().matrix().tolist() for i in registered}
out["observations"] = {i.name: [
    [*map(float, p.xy), *map(float, rigs.points3D[p.point3D_id].xyz)] for p in i.points2D if p.has_point3D()
] for i in registered}
print(json.dumps(out))
"""


@dataclass(frozen=True)
class FromColmap:
    """Models that COLMAP wrote, and what it says of them."""

    folder: Path
    """ours: what it read; bin, txt: the same as it writes it; rigs/sparse: 0 binary and 1 text."""
    said: dict[str, Any]


@pytest.fixture(scope="module")
def from_colmap(tmp_path_factory: pytest.TempPathFactory) -> FromColmap:
    folder = tmp_path_factory.mktemp("colmap")
    (folder / "ours").mkdir()
    write_model(folder / "ours", all_lenses())
    child = subprocess.run(
        [sys.executable, "-c", COLMAP, str(folder)], capture_output=True, text=True, check=True
    )
    # COLMAP logs to the same stream.
    return FromColmap(folder, json.loads(child.stdout.splitlines()[-1]))


def all_lenses() -> Reconstruction:
    """An image through a lens of every camera model that is read, twelve features each."""
    random = np.random.default_rng(6)
    xyz = random.uniform([-1, -1, 4], [1, 1, 9], (30, 3)) / 3
    lenses, images = tuple(lens_of(model) for model in TERMS), []
    for number, lens in enumerate(lenses):
        rotation, translation = rotation_matrix(random.normal(0, 0.1, 3)), random.normal(0, 0.1, 3)
        ids = random.permutation(30)[:12].astype(np.int32)
        xy = lens.project(xyz[ids] @ rotation.T + translation)
        images.append(Image(number, rotation, translation, xy, ids, number))
    points = Points(xyz, random.integers(0, 256, (30, 3)).astype(np.uint8), random.uniform(0, 1, 30))
    return Reconstruction(lenses, tuple(images), points)


def test_colmap_reads_every_lens_and_projects_alike(from_colmap: FromColmap) -> None:
    model = all_lenses()
    assert len(model.cameras) == 11
    assert from_colmap.said["seen"].keys() == {f"frame_{number:06d}.png" for number in range(11)}
    for image in model.images:
        table = np.array(from_colmap.said["seen"][f"frame_{image.frame:06d}.png"])
        np.testing.assert_array_equal(table[:, 0], image.points)
        np.testing.assert_allclose(table[:, 1:], image.xy, rtol=0, atol=1e-9)
    assert [from_colmap.said["lengths"][str(row)] for row in range(30)] == model.views_per_point.tolist()


@pytest.mark.parametrize("kind", ["ours", "bin", "txt"])
def test_text_and_binary_hold_the_same(from_colmap: FromColmap, kind: str) -> None:
    foreign = colmap.read(from_colmap.folder / kind, SIZE)
    assert foreign.format == ("COLMAP binary" if kind == "bin" else "COLMAP text")
    assert foreign.names == tuple(f"frame_{number:06d}.png" for number in range(11))
    # COLMAP keeps points in a table without an order.
    model, before = foreign.reconstruction, all_lenses()
    order = np.lexsort(model.points.xyz.T)
    wanted = np.lexsort(before.points.xyz.T)
    rows = np.empty(30, np.int32)
    rows[order] = wanted
    points = Points(*(getattr(model.points, n)[order[np.argsort(wanted)]] for n in ("xyz", "rgb", "error")))
    images = tuple(replace(image, points=rows[image.points]) for image in model.images)
    assert_same(Reconstruction(model.cameras, images, points), before)


def test_rigs_and_frames(from_colmap: FromColmap) -> None:
    """Two rigs of two cameras, one frame not registered, features without a point."""
    sparse, poses = from_colmap.folder / "rigs" / "sparse", from_colmap.said["poses"]
    assert (sparse / "0" / "rigs.bin").is_file() and (sparse / "1" / "frames.txt").is_file()
    for folder in (sparse / "0", sparse / "1"):
        foreign = colmap.read(folder, SIZE)
        model = foreign.reconstruction
        assert set(foreign.names) == poses.keys() and len(foreign.names) == 10
        assert len(model.cameras) == 4 and [image.frame for image in model.images] == list(range(10))
        for image, name in zip(model.images, foreign.names, strict=True):
            pose = np.column_stack([image.rotation, image.translation])
            np.testing.assert_allclose(pose, poses[name], atol=1e-12)
            table = np.array(from_colmap.said["observations"][name])
            np.testing.assert_array_equal(image.xy, table[:, :2])
            np.testing.assert_array_equal(model.points.xyz[image.points], table[:, 2:])
            seen = model.intrinsics(image).project(image.to_camera(table[:, 2:]))
            np.testing.assert_allclose(seen, image.xy, rtol=0, atol=1e-6)


def test_the_model_is_found(from_colmap: FromColmap, tmp_path: Path) -> None:
    rigs = from_colmap.folder / "rigs"
    for path in (rigs, rigs / "sparse", rigs / "sparse" / "0", *(rigs / "sparse" / "0").iterdir()):
        assert colmap.recognises(path)
        foreign = colmap.read(path, SIZE)
        assert foreign.format == "COLMAP binary"
        assert len(foreign.notes) == 1 and "0 was read, not 1" in foreign.notes[0]
    for path in (tmp_path, tmp_path / "none", Path(__file__), Path("a\0b")):
        assert not colmap.recognises(path)
    for path in (tmp_path, Path(__file__)):
        with pytest.raises(UserError, match="has no COLMAP model"):
            colmap.read(path, SIZE)


def test_the_file_that_is_named_decides(from_colmap: FromColmap, tmp_path: Path) -> None:
    for name in (*BINARY, *TEXT):
        source = from_colmap.folder / ("bin" if name in BINARY else "txt") / name
        (tmp_path / name).write_bytes(source.read_bytes())
    assert colmap.read(tmp_path, SIZE).format == "COLMAP binary"
    assert colmap.read(tmp_path / "points3D.txt", SIZE).format == "COLMAP text"
    (tmp_path / "images.bin").unlink()
    assert colmap.read(tmp_path, SIZE).format == "COLMAP text"


@pytest.mark.parametrize("kind", ["bin", "txt"])
def test_sceaux_agrees_with_its_own_error(data: Path, kind: str) -> None:
    model = colmap.read(data / "sceaux" / f"colmap_{kind}", (2832, 2128)).reconstruction
    assert (len(model.images), len(model.points), int(model.views_per_point.sum())) == (11, 7862, 37123)
    sums = np.zeros(len(model.points))
    for image in model.images:
        seen = model.intrinsics(image).project(image.to_camera(model.points.xyz[image.points]))
        np.add.at(sums, image.points, np.linalg.norm(seen - image.xy, axis=1))
    # Six digits of a text place a point to a hundredth of a pixel, all digits of a binary to the last bit.
    limit = 1e-9 if kind == "bin" else 0.01
    np.testing.assert_allclose(sums / model.views_per_point, model.points.error, rtol=0, atol=limit)


def test_a_header_that_promises_more(from_colmap: FromColmap, tmp_path: Path) -> None:
    """COLMAP's comments say how much follows, which is all that shows where a text was cut."""
    for name in TEXT:
        (tmp_path / name).write_bytes((from_colmap.folder / "txt" / name).read_bytes())
    lines = (tmp_path / "points3D.txt").read_text().splitlines(keepends=True)
    assert lines[2].startswith("# Number of points: 30")
    (tmp_path / "points3D.txt").write_text("".join(lines[:-1]))
    with pytest.raises(UserError, match=r"points3D.txt, line 3: expected 30 points.*29 follow"):
        colmap.read(tmp_path, SIZE)


@pytest.mark.parametrize(
    ("name", "what"), [(n, "not text") for n in BINARY] + [(n, "not binary") for n in TEXT]
)
def test_text_and_binary_are_not_mistaken(
    from_colmap: FromColmap, tmp_path: Path, name: str, what: str
) -> None:
    kind, other, suffix = ("bin", "txt", ".txt") if name in BINARY else ("txt", "bin", ".bin")
    for file in BINARY if name in BINARY else TEXT:
        (tmp_path / file).write_bytes((from_colmap.folder / kind / file).read_bytes())
    wrong = (from_colmap.folder / other / name).with_suffix(suffix)
    (tmp_path / name).write_bytes(wrong.read_bytes())
    with pytest.raises(UserError, match=f"{name}, byte .*{what}.*name it {wrong.name}"):
        colmap.read(tmp_path, SIZE)
    (tmp_path / name).write_bytes("# Camera list".encode("utf-16"))
    with pytest.raises(UserError, match=f"{name}, byte"):
        colmap.read(tmp_path, SIZE)


@pytest.mark.parametrize("name", BINARY)
def test_a_binary_file_cut_anywhere_is_named(from_colmap: FromColmap, tmp_path: Path, name: str) -> None:
    for file in BINARY:
        (tmp_path / file).write_bytes((from_colmap.folder / "bin" / file).read_bytes())
    whole = (tmp_path / name).read_bytes()
    for length in [*range(0, len(whole), 31), len(whole) - 1]:
        (tmp_path / name).write_bytes(whole[:length])
        with pytest.raises(UserError, match=rf"{name}, byte \d+: expected"):
            colmap.read(tmp_path, SIZE)
    (tmp_path / name).write_bytes(whole + b"\0")
    with pytest.raises(UserError, match=f"{name}, byte {len(whole)}: expected the file's end, not 1 byte"):
        colmap.read(tmp_path, SIZE)


NAN = struct.pack("<d", np.nan)
FIRST_IMAGE = 8 + struct.calcsize("<I7dI") + len("frame_000000.png") + 1


@pytest.mark.parametrize(
    ("name", "at", "damage", "message"),
    [
        ("cameras.bin", 0, struct.pack("<Q", 2**60), "at most .* cameras"),
        ("cameras.bin", 12, struct.pack("<i", 18), "0 to 17, not 18"),
        ("cameras.bin", 16, struct.pack("<Q", 0), "size"),
        ("cameras.bin", 32, struct.pack("<d", -500), "focal lengths"),
        ("images.bin", 0, struct.pack("<Q", 2**33), "at most .* images"),
        ("images.bin", 12, bytes(32), "quaternion that is not zero"),
        ("images.bin", 68, struct.pack("<I", 99), "model's cameras, not 99"),
        ("images.bin", FIRST_IMAGE, struct.pack("<Q", 2**28), "at most .* features"),
        ("images.bin", FIRST_IMAGE + 24, struct.pack("<Q", 5000), "model's points, not 5000"),
        ("points3D.bin", 0, struct.pack("<Q", 2**64 - 1), "at most .* points"),
        ("points3D.bin", 16, NAN, "a point of numbers"),
        ("points3D.bin", 51, struct.pack("<Q", 2**61), "point|track"),
    ],
)
def test_damaged_binaries_are_named(
    from_colmap: FromColmap, tmp_path: Path, name: str, at: int, damage: bytes, message: str
) -> None:
    for file in BINARY:
        (tmp_path / file).write_bytes((from_colmap.folder / "bin" / file).read_bytes())
    content = bytearray((tmp_path / name).read_bytes())
    content[at : at + len(damage)] = damage
    (tmp_path / name).write_bytes(content)
    with pytest.raises(UserError, match=rf"{name}, byte \d+: expected .*({message})") as error:
        colmap.read(tmp_path, SIZE)
    assert "\n" not in str(error.value)
