"""A depth network of the user's own, an ONNX file, as a source of depth maps."""

from __future__ import annotations

import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.depth.map_fit import fit_clip
from addon.core.depth.user_maps import open_depth
from addon.core.media.clip import Footage, FrameRange, open_footage
from addon.core.media.clip_identity import clip_digest
from addon.core.media.copying import copy_pictures
from addon.core.media.light import decode_srgb
from addon.core.media.masks import open_masks

from ..map_fits import fitted
from ..onnx_files import Side, network, node

WIDTH, HEIGHT, COUNT = 96, 54, 6
MEAN, DEVIATION = 0.485, 0.229
"""ImageNet's, of red."""
OPEN: tuple[Side, ...] = ("batch", 3, "height", "width")


def red(shape: tuple[Side, ...]) -> bytes:
    """A network whose inverse depth is the display value of red from 0 to 1, undone what normalises it."""
    weight = np.zeros((1, 3, 1, 1), np.float32)
    weight[0, 0] = DEVIATION
    weights = {"w": weight, "b": np.array([MEAN], np.float32)}
    return network([node("Conv", ["x", "w", "b"], "y")], weights, shape)


def true_red(frame: int) -> np.ndarray:
    """(HEIGHT, WIDTH) display values: a slope, steeper from frame to frame."""
    x, y = np.meshgrid((np.arange(WIDTH) + 0.5) / WIDTH, (np.arange(HEIGHT) + 0.5) / HEIGHT)
    return 0.2 + 0.3 * y + 0.04 * frame * x


def pictures(folder: Path, width: int = WIDTH, height: int = HEIGHT) -> Footage:
    """Frames 1 to 6, green and blue noise that says nothing."""
    folder.mkdir()
    rng = np.random.default_rng(0)
    for frame in range(1, COUNT + 1):
        picture = rng.integers(0, 256, (height, width, 3)).astype(np.uint8)
        picture[..., 2] = np.round(255 * cv2.resize(true_red(frame), (width, height)))
        cv2.imwrite(str(folder / f"clip_{frame:04d}.png"), picture)
    return open_footage(folder)


@pytest.fixture
def clip(tmp_path: Path) -> Footage:
    return pictures(tmp_path / "clip")


def write(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


def features(frame: int) -> tuple[np.ndarray, np.ndarray]:
    """Places (200, 2) and true inverse depths (200,), in a unit of their own."""
    xy = np.random.default_rng(frame).integers(2, [WIDTH - 2, HEIGHT - 2], (200, 2)) + 0.5
    column, row = xy.astype(int).T
    return xy, 0.4 * true_red(frame)[row, column] + 0.05


@pytest.mark.parametrize("shape", [(1, 3, 27, 48), OPEN, (1, 3, -1, -1)], ids=str)
def test_what_it_says_is_fitted_as_any_map(tmp_path: Path, clip: Footage, shape: tuple[Side, ...]) -> None:
    maps = open_depth(write(tmp_path / "red.onnx", red(shape)), clip)
    assert maps.frames == clip.frames
    assert not maps.notes
    fit = fit_clip(maps, features)
    assert fit.kind == "inverse"
    inside = np.s_[1:-1, 1:-1]
    for frame in (1, 4, COUNT, 2):
        found = fitted(maps.read(frame), *features(frame), fit)
        # Half a step of 8 bits, and what a quarter of the pixels makes of a slope: at the rim it is flat.
        off = 0.4 * (0.5 / 255 + 0.25 * (0.3 / HEIGHT + 0.04 * frame / WIDTH))
        assert np.abs(found - (0.4 * true_red(frame) + 0.05))[inside].max() < off


@pytest.mark.parametrize(
    ("shape", "width", "height", "rows", "columns"),
    [
        ((1, 3, 20, 30), 96, 54, 20, 30),
        (OPEN, 96, 54, 294, 518),
        (OPEN, 54, 96, 518, 294),
        (OPEN, 60, 60, 518, 518),
        (("batch", 3, 20, "width"), 96, 54, 20, 518),
    ],
)
def test_the_input_has_the_size_that_the_file_tells_or_depth_anythings(
    tmp_path: Path, shape: tuple[Side, ...], width: int, height: int, rows: int, columns: int
) -> None:
    clip = pictures(tmp_path / "own", width, height)
    maps = open_depth(write(tmp_path / "red.onnx", red(shape)), clip)
    assert maps.stored(1).shape == (rows, columns, 3)


def test_the_size_of_midas_is_tried_where_that_does_not_run(tmp_path: Path) -> None:
    """A network that divides its picture into 32 x 32 pixels, as transformers do into their own."""
    clip = pictures(tmp_path / "own", 80, 60)
    weight = np.full((1, 3, 1, 1), 1 / 3, np.float32)
    nodes = [
        node("Reshape", ["x", "parts"], "parted"),
        node("Reshape", ["parted", "whole"], "same"),
        node("Conv", ["same", "w"], "y"),
    ]
    weights = {"parts": np.array([1, 3, 9, 32, 12, 32]), "whole": np.array([1, 3, 288, 384]), "w": weight}
    maps = open_depth(write(tmp_path / "parts.onnx", network(nodes, weights, OPEN)), clip)
    assert {maps.stored(frame).shape for frame in clip.frames} == {(288, 384, 3)}


def test_pictures_of_16_bits_and_of_linear_light_are_shown_to_it_as_8_bits_are(tmp_path: Path) -> None:
    """uint16, and floats as EXR has them, which only Blender decodes: given as .npz here."""
    values = np.repeat(true_red(3)[..., None], 3, axis=2)
    for name in ("deep", "linear"):
        (tmp_path / name).mkdir()
    for frame in (1, 2):
        cv2.imwrite(str(tmp_path / f"deep/{frame}.png"), np.round(65535 * values).astype(np.uint16))
        np.savez(tmp_path / f"linear/{frame}.npz", depth=decode_srgb(values[..., 0]).astype(np.float32))
    path = write(tmp_path / "red.onnx", red((1, 3, HEIGHT, WIDTH)))
    for name, dtype in (("deep", np.uint16), ("linear", np.float32)):
        clip = open_footage(tmp_path / name)
        assert clip.read(1).dtype == dtype
        np.testing.assert_allclose(open_depth(path, clip).stored(2)[..., 0], values[..., 0], atol=2e-5)


def test_of_a_part_of_a_video_each_frame_has_its_own_whoever_asks(tmp_path: Path) -> None:
    """Eight threads ask in disorder, while the clip itself is read in order."""
    path = tmp_path / "clip.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 24, (WIDTH, HEIGHT))
    for frame in range(40):
        writer.write(np.full((HEIGHT, WIDTH, 3), 40 + 4 * frame, np.uint8))
    writer.release()
    clip = open_footage(path, FrameRange(5, 36))
    model = write(tmp_path / "red.onnx", red((1, 3, 27, 48)))
    maps = open_depth(model, clip)
    asked = np.random.default_rng(1).permutation(clip.frames).tolist()
    with ThreadPoolExecutor(8) as pool:
        found = pool.map(maps.stored, asked)
        shown = {frame: clip.read(frame)[..., 0].mean() / 255 for frame in clip.frames}
    for frame, values in zip(asked, found, strict=True):
        assert abs(values.mean() - shown[frame]) < 1 / 255


def test_what_opencv_cannot_read_or_run_is_said_in_a_line(tmp_path: Path, clip: Footage) -> None:
    whole = red((1, 3, 27, 48))
    shape = (1, 3, 27, 48)
    for name, data, says in (
        ("text", b"no network at all", "OpenCV .* does not run it .*parse"),
        ("empty", b"", "OpenCV .* does not run it"),
        ("short", whole[: len(whole) // 2], "OpenCV .* does not run it .*parse"),
        ("unknown", network([node("Wonder", ["x"], "y")], {}, shape), "does not run it .*Wonder"),
        ("gray", red((1, 1, 27, 48)), "its input is 1 x 1 x 27 x 48, not a picture"),
        ("last", red((1, 27, 48, 3)), "its input is 1 x 27 x 48 x 3, not a picture"),
        ("huge", red((1, 3, 27, 10**9)), "its input is 1 x 3 x 27 x 1000000000, not a picture"),
        ("list", network([node("Flatten", ["x"], "y", axis=1)], {}, shape), "its output is 1 x 3888, not"),
        ("colours", network([node("Relu", ["x"], "y")], {}, shape), "its output is 1 x 3 x 27 x 48, not"),
        ("apart", network([node("Reshape", ["x", "s"], "y")], {"s": np.array([7, 5])}, OPEN), "not run it"),
    ):  # fmt: skip
        path = write(tmp_path / f"{name}.onnx", data)
        whole_line = rf"^depth maps: .*{name}\.onnx cannot be read: .*{says}"
        with pytest.raises(UserError, match=whole_line) as error:
            open_depth(path, clip)
        assert len(str(error.value).splitlines()) == 1
        assert not re.search(r"\.cpp|/io/", str(error.value))
    with pytest.raises(UserError, match=r"^depth maps: nowhere\.onnx cannot be read: No such file"):
        open_depth(tmp_path / "nowhere.onnx", clip)
    with pytest.raises(UserError, match="masks: "):
        open_masks(write(tmp_path / "red.onnx", whole), clip)


def test_no_damage_to_its_bytes_raises_anything_else(tmp_path: Path, clip: Footage) -> None:
    data = red((1, 3, 27, 48))
    part = open_footage(clip.path, FrameRange(1, 1))
    refused = 0
    for at in range(0, len(data), 3):
        damaged = bytearray(data)
        damaged[at] ^= 0x15
        try:
            open_depth(write(tmp_path / "damaged.onnx", bytes(damaged)), part).stored(1)
        except UserError:
            refused += 1
    assert refused > 10


def test_it_is_copied_and_recognised_by_its_bytes(tmp_path: Path, clip: Footage) -> None:
    """Frames that were rendered with another network are rendered again (`frame_keys`)."""
    path = write(tmp_path / "red.onnx", red(OPEN))
    copy = copy_pictures(open_depth(path, clip).pictures, tmp_path / "copies")
    assert copy == tmp_path / "copies" / "red.onnx"
    assert clip_digest(copy) == clip_digest(path)
    np.testing.assert_array_equal(open_depth(copy, clip).stored(2), open_depth(path, clip).stored(2))
    assert clip_digest(write(copy, red((1, 3, 27, 48)))) != clip_digest(path)
