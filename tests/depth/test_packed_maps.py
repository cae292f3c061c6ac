"""Depth maps as networks and reconstruction tools write them: arrays, archives, one-channel EXR."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.depth.map_fit import ClipFit, FrameLine, fit_clip, steadied
from addon.core.depth.user_maps import DepthMaps, open_depth
from addon.core.media import picture_file
from addon.core.media.clip import Footage, FrameRange, open_footage
from addon.core.media.clip_identity import clip_digest
from addon.core.media.copying import copy_pictures
from addon.scene.base import exr

from ..map_fits import fitted
from ..pictures import one_channel

WIDTH, HEIGHT, COUNT = 48, 30, 6


@pytest.fixture(autouse=True)
def decoder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(picture_file, "exr_decoder", exr.read)


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Footage:
    """Frames 1 to 6."""
    folder = tmp_path_factory.mktemp("clip")
    for frame in range(1, COUNT + 1):
        cv2.imwrite(str(folder / f"clip_{frame:04d}.png"), np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    return open_footage(folder)


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Footage:
    path = tmp_path_factory.mktemp("video") / "clip.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 24, (WIDTH, HEIGHT))
    for _ in range(COUNT):
        writer.write(np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    writer.release()
    return open_footage(path)


def true_depth(frame: int) -> np.ndarray:
    """(30, 48) metres: a slope with a box before it, which moves with the frame (from 1)."""
    x, y = np.meshgrid(np.arange(WIDTH) / WIDTH, np.arange(HEIGHT) / HEIGHT)
    depth = 1 / (0.1 + 0.15 * y + 0.02 * x)
    depth[8:20, 4 * frame : 4 * frame + 12] = 2.0
    return depth


def stack() -> np.ndarray:
    return np.stack([true_depth(frame) for frame in range(1, COUNT + 1)])


def write_zip(path: Path, values: np.ndarray) -> None:
    """As ViPE: from 0, half floats, metres."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for index, each in enumerate(values):
            archive.writestr(f"{index:05d}.exr", one_channel(each))


WRITERS: dict[str, tuple[str, str, Callable[[Path, np.ndarray], None]]] = {
    "Video-Depth-Anything": (
        "clip_depths.npz", "inverse",
        lambda path, z: np.savez_compressed(path, depths=(3 / z + 1).astype("f4")),
    ),
    "DepthCrafter": (
        "clip.npz", "inverse",
        lambda path, z: np.savez_compressed(path, depth=(1 / z - (1 / z).min()) / np.ptp(1 / z)),
    ),
    "Depth-Anything-3": (
        "results.npz", "depth",
        lambda path, z: np.savez(
            path, depth=z.astype("f4"), conf=np.ones(z.shape, "f4"), intrinsics=np.zeros((COUNT, 3, 3), "f4")
        ),
    ),
    "MegaSaM": (
        "clip_sgd_cvd_hr.npz", "depth",
        lambda path, z: np.savez(
            path, images=np.zeros((*z.shape, 3), "u1"), depths=z.astype("f2"), intrinsic=np.eye(3),
            cam_c2w=np.zeros((COUNT, 4, 4)),
        ),
    ),
    "ViPE": ("clip.zip", "depth", write_zip),
}  # fmt: skip


def features(frame: int) -> tuple[np.ndarray, np.ndarray]:
    """Places (200, 2) and true inverse depths (200,), in a unit that is not metres."""
    xy = np.random.default_rng(frame).integers(0, [WIDTH, HEIGHT], (200, 2)) + 0.5
    column, row = xy.astype(int).T
    return xy, 0.4 / true_depth(frame)[row, column]


@pytest.mark.parametrize("tool", WRITERS)
@pytest.mark.parametrize("kind", ["clip", "video"])
def test_each_tools_file_comes_back_as_true_inverse_depth(
    tmp_path: Path, tool: str, kind: str, request: pytest.FixtureRequest
) -> None:
    name, holds, write = WRITERS[tool]
    footage: Footage = request.getfixturevalue(kind)
    write(tmp_path / name, stack())
    maps = open_depth(tmp_path / name, footage)
    assert maps.frames == footage.frames
    fit = fit_clip(maps, features)
    assert fit.kind == holds
    for frame in (1, 4, COUNT, 2):
        found = fitted(maps.read(frame), *features(frame), fit)
        # Half floats have 11 bits.
        np.testing.assert_allclose(found, 0.4 / true_depth(frame), rtol=2e-3, atol=1e-4)


def test_a_folder_of_arrays_and_of_one_channel_exr(tmp_path: Path, clip: Footage) -> None:
    """Depth Pro writes one .npz a picture, other tools EXR with the channel Z."""
    arrays, pictures = tmp_path / "arrays", tmp_path / "pictures"
    arrays.mkdir()
    pictures.mkdir()
    for frame, z in enumerate(stack(), start=1):
        np.savez_compressed(arrays / f"frame_{frame:03d}.npz", depth=z.astype("f4"))
        (pictures / f"z_{frame:04d}.exr").write_bytes(one_channel(z))
    for folder, pattern in ((arrays, "frame_###.npz"), (pictures, "z_####.exr")):
        for path in (folder, folder / pattern):
            maps = open_depth(path, clip)
            assert maps.frames == clip.frames
            np.testing.assert_allclose(maps.read(5).values, true_depth(5), rtol=1e-3)


def test_a_stack_is_of_the_whole_clip(tmp_path: Path, clip: Footage, video: Footage) -> None:
    """Whatever part of the clip was solved, its first map is the clip's first frame."""
    np.savez(tmp_path / "all.npz", depths=stack())
    np.savez(tmp_path / "few.npz", depths=stack()[:3])
    np.savez(tmp_path / "many.npz", depths=np.concatenate([stack(), stack()]))
    for whole in (clip, video):
        part = open_footage(whole.path, FrameRange(3, 5))
        assert not open_depth(tmp_path / "all.npz", part).notes
        np.testing.assert_allclose(open_depth(tmp_path / "all.npz", part).read(4).values, true_depth(4))
        for name, count in (("few", 3), ("many", 12)):
            with pytest.raises(UserError, match=rf"{name}\.npz .* {count} maps and the clip 6 frames:"):
                open_depth(tmp_path / f"{name}.npz", whole)
        # As many as were solved belong to those.
        few = open_depth(tmp_path / "few.npz", part)
        assert few.frames == (3, 4, 5) and not few.notes
        np.testing.assert_allclose(few.read(4).values, true_depth(2))


def test_what_is_cut_at_zero_is_far_and_holes_of_depth_are_not(tmp_path: Path, clip: Footage) -> None:
    inverse, depth = 1 / stack() - 0.13, stack()
    assert (inverse < 0).any()
    np.savez(tmp_path / "cut.npz", depths=np.maximum(inverse, 0))
    depth[:, :4, :4] = 0
    np.savez(tmp_path / "holes.npz", depths=depth)
    cut, holes = (open_depth(tmp_path / name, clip) for name in ("cut.npz", "holes.npz"))
    found = fitted(cut.read(1), *features(1), fit_clip(cut, features))
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found[inverse[0] < 0], 0.4 * 0.13, rtol=1e-3)
    found = fitted(holes.read(1), *features(1), fit_clip(holes, features))
    assert np.isnan(found[:4, :4]).all()
    assert np.isfinite(found[4:, 4:]).all()


def test_objects_and_damage_are_refused_by_name(tmp_path: Path, clip: Footage) -> None:
    """Arrays of objects are programs; they are not even looked at."""
    np.savez(tmp_path / "objects.npz", depths=np.array([{}, None], dtype=object))
    np.savez(tmp_path / "poses.npz", data=np.zeros((COUNT, 4, 4)), inds=np.arange(COUNT))
    np.savez(tmp_path / "flat.npz", depths=np.zeros(7))
    np.savez_compressed(tmp_path / "whole.npz", depths=stack())
    data = (tmp_path / "whole.npz").read_bytes()
    (tmp_path / "short.npz").write_bytes(data[: len(data) // 2])
    flipped = bytearray(data)
    flipped[len(data) // 2 : len(data) // 2 + 40] = bytes(40)
    (tmp_path / "flipped.npz").write_bytes(flipped)
    (tmp_path / "text.zip").write_text("not an archive")
    with zipfile.ZipFile(tmp_path / "none.zip", "w") as archive:
        archive.writestr("readme.txt", "")
    with zipfile.ZipFile(tmp_path / "bad.zip", "w") as archive:
        archive.writestr("00000.exr", b"no picture")
    for name, says in {
        "objects.npz": "array depths does not begin as an array of numbers",
        "poses.npz": "has no array depths or depth, but data, inds",
        "flat.npz": r"array depths has the shape \(7,\)",
        "short.npz": "not a complete .npz",
        "text.zip": "not a zip file",
        "none.zip": "has no pictures",
        "bad.zip": r"00000\.exr cannot be decoded",
        "nowhere.npz": "No such file",
    }.items():
        with pytest.raises(UserError, match=rf"^depth maps: .*{says}"):
            open_depth(tmp_path / name, clip)
    with pytest.raises(UserError, match=r"of flipped\.npz cannot be read: its array depths is damaged"):
        for frame in clip.frames:
            open_depth(tmp_path / "flipped.npz", clip).read(frame)


def test_a_packed_file_is_copied_and_recognised_whole(tmp_path: Path, clip: Footage) -> None:
    path = tmp_path / "maps.npz"
    np.savez(path, depths=stack())
    maps = open_depth(path, clip)
    copy = copy_pictures(maps.pictures, tmp_path / "copies")
    assert copy == tmp_path / "copies" / "maps.npz"
    np.testing.assert_array_equal(open_depth(copy, clip).read(2).values, maps.read(2).values)
    before = clip_digest(copy)
    assert before == clip_digest(path)
    np.savez(copy, depths=stack() + 1)
    assert clip_digest(copy) != before
    folder = tmp_path / "folder"
    folder.mkdir()
    np.savez(folder / "1.npz", depth=true_depth(1))
    before = clip_digest(folder)
    np.savez(folder / "1.npz", depth=true_depth(2))
    assert clip_digest(folder) != before


@pytest.mark.parametrize("walks", [False, True])
def test_a_scale_that_drifts_is_steadied_and_one_that_jumps_is_kept(walks: bool) -> None:
    """Fits that miss by chance are averaged; a network that sees each picture by itself jumps truly."""
    rng = np.random.default_rng(5)
    count, noise, jumps = 200, 0.02, 0.1
    true = np.column_stack([1 + 0.002 * np.arange(count), np.full(count, 0.5)])
    if walks:
        true += jumps * rng.standard_normal(true.shape)
    seen = true + noise * rng.standard_normal(true.shape)
    lines = [FrameLine(frame, line, np.eye(2) / noise**2) for frame, line in enumerate(seen)]
    spread = np.array([0.3, 0.3])
    clip = ClipFit("inverse", 0.0, 1.0, 1.0, 3.0, np.median(true, axis=0), spread, 0.01)
    found = np.array([steadied(lines[at - 4 : at + 5], at, clip) for at in range(4, count - 4)])
    off = np.sqrt(((found - true[4:-4]) ** 2).mean(axis=0))
    if walks:
        # The mean of its neighbours would be off by about as much as it jumps.
        assert off.max() < jumps / 3
    else:
        assert off.max() < 0.6 * noise


def test_a_map_file_that_begins_late_is_numbered_by_its_names(tmp_path: Path, clip: Footage) -> None:
    """A .zip has numbers of its own, unlike a stack."""
    with zipfile.ZipFile(tmp_path / "late.zip", "w") as archive:
        for frame in (3, 4):
            archive.writestr(f"depth/{frame:05d}.exr", one_channel(true_depth(frame)))
    maps: DepthMaps = open_depth(tmp_path / "late.zip", clip)
    assert maps.frames == (3, 4)
    np.testing.assert_allclose(maps.read(4).values, true_depth(4), rtol=1e-3)
