"""Reading clips: order, geometry, depth of bits, and what is refused."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.media.clip import FrameRange, open_footage
from addon.core.media.light import BRIGHTEST, finite, to_linear
from addon.core.media.picture_file import decode_picture

from ..pictures import of_channels


def numbered_picture(number: int, width: int = 64, height: int = 48) -> np.ndarray:
    """A gray level that says which frame it is."""
    return np.full((height, width, 3), number * 5 % 256, np.uint8)


def write_video(path: Path, count: int, size: tuple[int, int] = (64, 48)) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"FFV1"), 25, size)
    for number in range(1, count + 1):
        writer.write(numbered_picture(number, *size))
    writer.release()
    return path


def test_video_frames_are_numbered_from_one_and_read_in_any_order(tmp_path: Path) -> None:
    footage = open_footage(write_video(tmp_path / "a.avi", 40))
    assert footage.is_video and footage.frames == tuple(range(1, 41))
    assert (footage.width, footage.height, footage.fps) == (64, 48, 25)
    for frame in (1, 2, 30, 29, 3, 40, 1):
        assert abs(int(footage.read(frame)[0, 0, 0]) - 5 * frame) <= 1
    with pytest.raises(UserError, match="no frame 41; it has frames 1 to 40"):
        footage.read(41)


def test_gaps_numbers_and_steps_of_a_sequence_are_kept(tmp_path: Path) -> None:
    for number in (3, 4, 7, 12):
        cv2.imwrite(str(tmp_path / f"shot2_{number:04d}.png"), numbered_picture(number))
    (tmp_path / "notes.txt").write_text("not a picture")
    for path in (tmp_path, tmp_path / "shot2_####.png", tmp_path / "shot2_%04d.png"):
        footage = open_footage(path)
        assert footage.frames == (3, 4, 7, 12)
        assert footage.read(7)[0, 0, 0] == 35
    assert open_footage(tmp_path, FrameRange(3, 12, 4)).frames == (3, 7)
    assert open_footage(tmp_path, FrameRange.parse("4-9")).frames == (4, 7)
    with pytest.raises(UserError, match="no frames 20-30; it has frames 3 to 12 with 6 missing"):
        open_footage(tmp_path, FrameRange(20, 30))
    with pytest.raises(UserError, match="step is 0"):
        open_footage(tmp_path, FrameRange(3, 12, 0))


def test_a_pattern_leaves_other_clips_of_the_folder_out(tmp_path: Path) -> None:
    for name in ("a_01.png", "a_02.png", "b_01.png"):
        cv2.imwrite(str(tmp_path / name), numbered_picture(1))
    with pytest.raises(
        UserError, match=r"a_01.png and b_01.png are both frame 1|b_01.png and a_01.png are both"
    ):
        open_footage(tmp_path)
    assert open_footage(tmp_path / "a_##.png").frames == (1, 2)


@pytest.mark.parametrize(
    ("name", "kind"), [("x_1.png", np.uint8), ("x_1.tif", np.uint16), ("x_1.jpg", np.uint8)]
)
def test_depth_of_bits(tmp_path: Path, name: str, kind: type) -> None:
    top = np.iinfo(kind).max
    picture = np.zeros((8, 12, 3), kind)
    picture[..., 2] = top
    picture[..., 0] = top // 2
    cv2.imwrite(str(tmp_path / name), picture)
    read = open_footage(tmp_path).read(1)
    assert read.dtype == kind and abs(int(read[0, 0, 0]) - top) <= top * 0.02
    linear = to_linear(read)
    assert linear.shape == (8, 12, 4) and linear.dtype == np.float32
    assert linear[0, 0, 0] == pytest.approx(1.0, abs=0.03)
    assert linear[0, 0, 2] == pytest.approx(0.212, abs=0.02)


def test_alpha_is_premultiplied_in_linear_light(tmp_path: Path) -> None:
    picture = np.full((4, 4, 4), 255, np.uint8)
    picture[..., 3] = 51
    cv2.imwrite(str(tmp_path / "1.png"), picture)
    linear = to_linear(open_footage(tmp_path).read(1))
    assert np.allclose(linear, 0.2, atol=1e-6)


def test_colours_of_an_exr_stay_premultiplied_as_they_are_stored(scene: object) -> None:
    values = np.array([[0.5, 0.25, 0.125]]), np.array([[0.5, 1.0, 0.25]])
    data = of_channels({"R": values[0], "G": 0.5 * values[0], "B": 0.25 * values[0], "A": values[1]})
    expected = np.stack([*(share * values[0] for share in (1, 0.5, 0.25)), values[1]], axis=2)
    assert np.allclose(to_linear(decode_picture(data, "a.exr")), expected, atol=1e-6)


def test_exr_through_blenders_decoder(tmp_path: Path, scene: object) -> None:
    import bpy

    values = np.random.default_rng(0).random((6, 9, 4), dtype=np.float32) * 4
    values[..., 3] = 1
    image = bpy.data.images.new("x", 9, 6, float_buffer=True, alpha=True)
    image.pixels.foreach_set(values[::-1].ravel())
    settings = bpy.context.scene.render.image_settings
    settings.file_format = "OPEN_EXR"
    settings.color_depth = "32"
    settings.color_mode = "RGBA"
    image.save_render(str(tmp_path / "f_0007.exr"))
    footage = open_footage(tmp_path)
    assert footage.frames == (7,)
    assert np.allclose(to_linear(footage.read(7)), values, atol=1e-5)


def test_the_true_picture_of_an_anamorphic_phone_clip(data: Path) -> None:
    footage = open_footage(data / "duck" / "demo.mp4")
    assert (footage.width, footage.height, len(footage.frames)) == (884, 1080, 118)
    in_order = {frame: footage.read(frame) for frame in range(55, 66)}
    footage.read(100)
    assert np.array_equal(footage.read(60), in_order[60])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda p: p / "####.png", "has no images"),
        (lambda p: p / "nowhere" / "####.png", "does not exist"),
        (lambda p: (p / "zero.mp4").touch() or p / "zero.mp4", "is empty"),
    ],
)
def test_what_cannot_be_opened(tmp_path: Path, make: object, message: str) -> None:
    with pytest.raises(UserError, match=message) as caught:
        open_footage(make(tmp_path))  # type: ignore[operator]
    assert "\n" not in str(caught.value)


def test_a_broken_or_differently_sized_picture_is_named(tmp_path: Path) -> None:
    for number in (1, 2, 3):
        cv2.imwrite(str(tmp_path / f"{number}.png"), numbered_picture(number))
    (tmp_path / "2.png").write_bytes(b"\x89PNG broken")
    cv2.imwrite(str(tmp_path / "3.png"), numbered_picture(3, 32, 20))
    footage = open_footage(tmp_path)
    with pytest.raises(UserError, match=r"2.png cannot be decoded"):
        footage.read(2)
    with pytest.raises(UserError, match=r"3\.png is 32x20, the clip is 64x48"):
        footage.read(3)


def test_values_that_are_not_finite_come_from_around() -> None:
    picture = np.full((20, 30, 4), 0.25, np.float32)
    picture[:, 15:] = 0.75
    broken = picture.copy()
    broken[5, 4, 0], broken[6, 20], broken[7, 20, 3] = np.nan, np.inf, -np.inf
    broken[10, 10, 1], broken[11, 10, 1] = -5e6, 1e30
    mended, count = finite(broken)
    assert count == 3
    assert mended[10, 10, 1] == 0 and mended[11, 10, 1] == BRIGHTEST
    mended[10:12, 10, 1] = 0.25
    assert np.array_equal(mended, picture)
    nothing, count = finite(np.full((4, 5, 3), np.nan, np.float32))
    assert count == 20 and np.array_equal(nothing, np.zeros((4, 5, 3)))
    stored = np.full((4, 5, 3), 9, np.uint8)
    assert finite(stored) == (stored, 0)


def test_pictures_without_numbers_or_said_to_be_are_stills_of_any_size(tmp_path: Path) -> None:
    for name, width in (("pear", 64), ("apple", 32), ("quince", 48)):
        cv2.imwrite(str(tmp_path / f"{name}.png"), numbered_picture(width, width))
    footage = open_footage(tmp_path)
    assert footage.is_stills and footage.frames == (1, 2, 3)
    assert [footage.read(frame).shape[1] for frame in footage.frames] == [32, 64, 48]
    assert footage.named("pear") == footage.named("pear.png") == 2
    with pytest.raises(UserError, match=r"no pictures 'plum'; it has apple\.png, pear\.png, quince\.png"):
        footage.named("plum")


def test_numbers_are_no_order_of_what_is_said_to_be_stills(tmp_path: Path) -> None:
    for name in ("a_01.png", "a_02.png", "b_01.png"):
        cv2.imwrite(str(tmp_path / name), numbered_picture(1))
    assert open_footage(tmp_path, stills=True).frames == (1, 2, 3)
    assert not open_footage(tmp_path / "a_##.png").is_stills
    with pytest.raises(UserError, match="not a folder of photos"):
        open_footage(write_video(tmp_path / "a.avi", 3), stills=True)
