"""Picture files are shown upright and with square pixels, as their own tags say, as masks and maps are."""

from __future__ import annotations

import io
import struct
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from PIL import Image, ImageOps

from addon.core.base.errors import UserError
from addon.core.depth.user_maps import open_depth
from addon.core.media import picture_file
from addon.core.media.clip import Footage, open_footage
from addon.core.media.masks import open_masks
from addon.scene.base import exr as blender_exr

from ..pictures import MODES, encoded, exr, sequence, with_chunks
from ..variants import combined

KINDS = [(suffix, mode) for suffix, modes in MODES.items() for mode in modes]


def shown(data: bytes, mode: str) -> np.ndarray:
    """(H, W, 3 or 4) of a file by Pillow, turned by Pillow; 8 bits of each channel."""
    opened = Image.open(io.BytesIO(data))
    picture = ImageOps.exif_transpose(opened)
    if mode == "RGBA" and opened.format == "TIFF":
        # OpenCV multiplies the colours of 8 bits by alpha.
        colour, alpha = np.split(np.asarray(picture).astype(float), [3], axis=2)
        return np.dstack([np.round(colour * alpha / 255), alpha]).astype(int)
    if mode == "I;16":
        return np.repeat(np.asarray(picture)[..., None] >> 8, 3, axis=2)
    return np.asarray(picture.convert("RGBA" if mode in ("LA", "RGBA", "RGBA16") else "RGB"))


def eight_bits(picture: np.ndarray) -> np.ndarray:
    return picture >> 8 if picture.dtype == np.uint16 else picture


@pytest.mark.parametrize(("kind", "orientation"), combined(KINDS, range(1, 9)))
def test_pictures_are_shown_upright(tmp_path: Path, kind: tuple[str, str], orientation: int) -> None:
    suffix, mode = kind
    data = encoded(suffix, mode, orientation)
    clip = open_footage(sequence(tmp_path / "clip", data, suffix))
    expected = shown(data, mode)
    assert (clip.height, clip.width) == expected.shape[:2]
    found = eight_bits(clip.read(2))
    assert found.shape == expected.shape
    assert np.abs(found.astype(int) - expected).max() <= (4 if suffix == ".jpg" else 1)


@pytest.mark.parametrize(
    ("suffix", "mode", "orientation"),
    [(".png", "L", 3), (".jpg", "L", 6), (".tif", "L", 6), (".png", "I;16", 1)],
)
def test_masks_and_maps_are_turned_by_their_own_tag(
    tmp_path: Path, suffix: str, mode: str, orientation: int
) -> None:
    """Whether the clip has one or not."""
    data = encoded(suffix, mode, orientation)
    expected = shown(data, mode)[..., 0]
    clip_data = cv2.imencode(".png", np.zeros((*expected.shape, 3), np.uint8))[1].tobytes()
    clip = open_footage(sequence(tmp_path / "clip", clip_data, ".png"))
    masks = open_masks(sequence(tmp_path / "masks", data, suffix), clip)
    found = masks.at(1)
    assert found is not None and not masks.notes
    np.testing.assert_allclose(found, expected / 255, atol=5 / 255)
    maps = open_depth(tmp_path / "masks", clip)
    assert maps.stored(1).shape[:2] == expected.shape and not any("stretched" in note for note in maps.notes)


def with_ratio(kind: str, ratio: float) -> tuple[bytes, str]:
    """A file whose pixels are so many times as wide as high, as each kind says it, and its ending."""
    across, down = 3000, round(3000 * ratio)
    if kind == "EXR":
        half = np.random.default_rng(1).random((32, 48, 3))
        return exr(half, pixelAspectRatio=("float", struct.pack("<f", ratio))), ".exr"
    if kind.startswith("PNG"):
        chunk = struct.pack(">IIB", across, down, kind == "PNG metre")
        return with_chunks(encoded(".png", "RGB"), pHYs=chunk), ".png"
    if kind == "TIFF":
        return encoded(".tif", "RGB", dpi=(across, down)), ".tif"
    data = bytearray(encoded(".jpg", "RGB"))
    assert data[6:11] == b"JFIF\0"
    data[13:18] = struct.pack(">BHH", kind == "JPEG inch", across, down)
    return bytes(data), ".jpg"


RATIO_KINDS = ["EXR", "PNG", "PNG metre", "TIFF", "JPEG", "JPEG inch"]
RATIOS = [0.5, 8 / 9, 1.0, 1.004, 12 / 11, 4 / 3, 1.5, 1.8, 2.0]


@pytest.fixture(autouse=True)
def decoder(registered: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blender's EXR decoder."""
    monkeypatch.setattr(picture_file, "exr_decoder", blender_exr.read)


@pytest.mark.parametrize("kind", RATIO_KINDS)
def test_pixels_become_square(tmp_path: Path, kind: str) -> None:
    for number, ratio in enumerate(RATIOS):
        data, suffix = with_ratio(kind, ratio)
        clip = open_footage(sequence(tmp_path / str(number), data, suffix))
        # EXR's number is exact; densities may be rounded.
        is_square = abs(ratio - 1) < 0.01
        assert (clip.width, clip.height) == (48 if is_square else round(48 * ratio), 32)
        assert clip.read(1).shape[:2] == (32, clip.width) and not clip.notes
        assert clip.stored_size == (48, 32)


@pytest.mark.parametrize(
    ("kind", "ratio"), combined([*RATIO_KINDS, "video", "wrong video"], [0.5, 1.0, 1.33, 2.0])
)
def test_the_user_s_ratio_comes_first(tmp_path: Path, kind: str, ratio: float) -> None:
    if kind.endswith("video"):
        path, wide = video(tmp_path / "clip.mp4", kind == "wrong video")
        assert open_footage(path).width == wide
    else:
        data, suffix = with_ratio(kind, 1.7)
        path = sequence(tmp_path / "clip", data, suffix)
    clip = open_footage(path, pixel_aspect=ratio)
    assert (clip.width, clip.height) == (round(clip.stored_size[0] * ratio), clip.stored_size[1])
    assert clip.read(2).shape[:2] == (clip.height, clip.width)
    assert (clip.whole().width, clip.part([2]).width) == (clip.width, clip.width)


def video(path: Path, ratio: bool) -> tuple[Path, int]:
    """A video of three frames of 64x48, perhaps with a ratio of 2, and the width that it is shown in."""
    with av.open(str(path), "w") as file:
        stream = file.add_stream("libx264", rate=24)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        if ratio:
            stream.codec_context.sample_aspect_ratio = Fraction(2)
        for level in (60, 90, 120):
            picture = np.full((48, 64, 3), level, np.uint8)
            file.mux(stream.encode(av.VideoFrame.from_ndarray(picture, "rgb24")))
        file.mux(stream.encode(None))
    return path, 128 if ratio else 64


def test_impossible_ratios_are_named(tmp_path: Path) -> None:
    png = with_chunks(encoded(".png", "RGB"), pHYs=struct.pack(">IIB", 72, 7200, 1))
    clip = open_footage(sequence(tmp_path / "clip", png, ".png"))
    assert clip.width == 48
    assert clip.notes == [
        "f_0001.png: its pixels are 100 times as wide as high, which cannot be: they count as square"
    ]
    with pytest.raises(UserError, match=r"a pixel aspect of 40 cannot be; it is from 0\.25 to 4"):
        open_footage(tmp_path / "clip", pixel_aspect=40)


def squeezed(tmp_path: Path) -> Footage:
    png = with_chunks(encoded(".png", "RGB"), pHYs=struct.pack(">IIB", 1, 2, 0))
    return open_footage(sequence(tmp_path / "clip", png, ".png"))


@pytest.mark.parametrize("has_ratio", [True, False])
@pytest.mark.parametrize("size", [(48, 32), (24, 16), (96, 32)])
def test_masks_and_maps_of_stored_or_shown_pictures_fit(
    tmp_path: Path, size: tuple[int, int], has_ratio: bool
) -> None:
    """Programs that know nothing of a ratio make them of the stored pixels."""
    clip = squeezed(tmp_path)
    assert (clip.width, clip.height) == (96, 32)
    ramp = np.tile(np.linspace(0, 255, size[0]), (size[1], 1)).astype(np.uint8)
    data = cv2.imencode(".png", ramp)[1].tobytes()
    if has_ratio and size != (96, 32):
        data = with_chunks(data, pHYs=struct.pack(">IIB", 1, 2, 0))
    folder = sequence(tmp_path / "beside", data, ".png")
    masks, maps = open_masks(folder, clip), open_depth(folder, clip)
    assert not any("stretched" in note for note in (*masks.notes, *maps.notes))
    found = masks.at(2)
    assert found is not None and found.shape == (32, 96)
    np.testing.assert_allclose(found[5], np.linspace(0, 1, 96), atol=0.03)


def test_a_picture_on_its_side_is_squeezed_before_it_is_turned(tmp_path: Path) -> None:
    data = with_chunks(encoded(".png", "RGB", 6), pHYs=struct.pack(">IIB", 1, 2, 0))
    clip = open_footage(sequence(tmp_path / "clip", data, ".png"))
    # Stored 48x32, shown as 96x32, then turned.
    assert (clip.width, clip.height) == (32, 96)
    assert clip.read(1).shape[:2] == (96, 32)
