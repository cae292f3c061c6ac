"""Colours of videos by their tags, and by their size without: against the matrices of ITU-T H.273."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from addon.core.base.errors import UserError
from addon.core.media.clip import open_footage
from addon.core.media.video_frame import upright

from ..variants import combined

KR_KB = {
    "BT.709": (0.2126, 0.0722), "FCC": (0.30, 0.11), "BT.601": (0.299, 0.114), "SMPTE 240M": (0.212, 0.087),
    "BT.2020": (0.2627, 0.0593),
}  # fmt: skip
TAGS = {1: "BT.709", 4: "FCC", 5: "BT.601", 6: "BT.601", 7: "SMPTE 240M", 9: "BT.2020"}
UNTAGGED = 2
SIZES = [(64, 480), (64, 576), (96, 718), (64, 720), (720, 64), (1280, 64), (128, 1080), (64, 1280)]
FORMATS = [f"yuv{sub}p{depth}" for sub in ("420", "422", "444") for depth in ("", "10le", "12le")]
COARSE, FINE = 3.0, 0.2
"""Of 255: FFmpeg's quick conversion of 8 bits, which every player on it has, and ours of more."""


def truth(code: tuple[int, int, int], bits: int, system: str, is_full: bool) -> NDArray[np.float64]:
    """(3,) R'G'B' of 255 by H.273, formulas 38 to 57 in reverse."""
    kr, kb = KR_KB[system]
    y, cb, cr = (value / 2 ** (bits - 8) for value in code)
    if is_full:
        scale = (2**bits - 1) / 2 ** (bits - 8)
        y, cb, cr = y / scale, (cb - 128) / scale, (cr - 128) / scale
    else:
        y, cb, cr = (y - 16) / 219, (cb - 128) / 224, (cr - 128) / 224
    red, blue = y + 2 * (1 - kr) * cr, y + 2 * (1 - kb) * cb
    green = (y - kr * red - kb * blue) / (1 - kr - kb)
    return 255 * np.clip([red, green, blue], 0, 1)


def plain(
    size: tuple[int, int], pixels: str, code: tuple[int, int, int], tag: int, span: int
) -> av.VideoFrame:
    frame = av.VideoFrame(*size, pixels)
    for plane, value in zip(frame.planes, code, strict=True):
        deep = frame.format.components[0].bits > 8
        count = plane.buffer_size // (2 if deep else 1)
        plane.update(np.full(count, value, "<u2" if deep else np.uint8).tobytes())
    frame.colorspace, frame.color_range = tag, span
    return frame


def shown(frame: av.VideoFrame) -> NDArray[np.float64]:
    """(3,) what is read in the middle of a frame, of 255."""
    with av.open("x.nut", "w", format="null") as container:
        stream = container.add_stream("rawvideo", rate=Fraction(24))
        picture = upright(frame, stream)
    middle = picture[picture.shape[0] // 2, picture.shape[1] // 2].astype(float)
    return middle / (257 if picture.dtype == np.uint16 else 1)


def by_rows(size: tuple[int, int]) -> str:
    return "BT.709" if size[1] >= 720 else "BT.601"


@pytest.mark.parametrize(("pixels", "tag"), combined(FORMATS, [UNTAGGED, 3, *TAGS]))
def test_colours_are_those_of_the_tag_or_of_the_rows(pixels: str, tag: int) -> None:
    """Over depths, subsampling, tags, ranges and sizes, for colours drawn at random."""
    random = np.random.default_rng(tag)
    bits = int(pixels.split("p")[1].removesuffix("le") or 8)
    for size in SIZES if tag not in TAGS else [(64, 480), (64, 720)]:
        for span in (0, 1, 2):
            code = tuple(
                (random.uniform((60, 90, 90), (200, 165, 165)) * 2 ** (bits - 8)).astype(int).tolist()
            )
            found = shown(plain(size, pixels, code, tag, span))
            wanted = truth(code, bits, TAGS.get(tag) or by_rows(size), span == 2)
            np.testing.assert_allclose(
                found,
                wanted,
                atol=COARSE if bits == 8 else FINE,
                err_msg=f"{pixels} {size} {tag} {span} {code}",
            )


@pytest.mark.parametrize(("pixels", "size"), combined(["yuvj420p", "yuvj422p", "yuvj444p"], SIZES))
def test_full_range_by_its_format(pixels: str, size: tuple[int, int]) -> None:
    found = shown(plain(size, pixels, (110, 90, 160), UNTAGGED, 0))
    np.testing.assert_allclose(found, truth((110, 90, 160), 8, by_rows(size), True), atol=COARSE)


def write(
    path: Path, codec: str, pixels: str, size: tuple[int, int], turned: int = 0, **options: str
) -> None:
    """An untagged clip of one colour."""
    deep = 4 if "10" in pixels else 1
    with av.open(str(path), "w") as file:
        stream = file.add_stream(codec, rate=Fraction(24))
        stream.width, stream.height, stream.pix_fmt = *size, pixels
        stream.options = options
        for _ in range(3):
            code = (110 * deep, 90 * deep, 160 * deep)
            file.mux(stream.encode(plain(size, pixels, code, UNTAGGED, 0)))
        file.mux(stream.encode(None))
    if not turned:
        return
    # The display matrix of the track header: a quarter turn.
    data = path.read_bytes()
    upright_matrix = b"".join(n.to_bytes(4) for n in (1 << 16, 0, 0, 0, 1 << 16, 0, 0, 0, 1 << 30))
    at = data.index(b"tkhd") + 44
    assert data[at : at + 36] == upright_matrix
    turn = b"".join(
        (n % 2**32).to_bytes(4) for n in (0, 1 << 16, 0, -1 << 16, 0, 0, size[1] << 16, 0, 1 << 30)
    )
    path.write_bytes(data[:at] + turn + data[at + 36 :])


@pytest.mark.parametrize(
    ("size", "turned", "system"),
    [
        ((640, 480), 0, "BT.601"), ((720, 1280), 0, "BT.709"), ((960, 540), 1, "BT.601"),
    ],
)  # fmt: skip
def test_one_clip_has_one_colour_in_8_and_10_bits(
    tmp_path: Path, size: tuple[int, int], turned: int, system: str
) -> None:
    """Rows count as they are stored, before the picture is turned."""
    write(tmp_path / "eight.mp4", "libx264", "yuv420p", size, turned, qp="0")
    write(tmp_path / "ten.mov", "prores_ks", "yuv422p10le", size, turned)
    wanted = truth((110, 90, 160), 8, system, False)
    for name, scale, atol in (("eight.mp4", 1, COARSE), ("ten.mov", 257, 1.0)):
        clip = open_footage(tmp_path / name)
        assert (clip.width, clip.height) == (size[::-1] if turned else size)
        found = clip.read(2)[clip.height // 2, clip.width // 2] / scale
        np.testing.assert_allclose(found, wanted, atol=atol, err_msg=name)


def test_coding_that_is_not_read_is_refused(tmp_path: Path) -> None:
    tag = 8
    with av.open(str(tmp_path / "odd.mkv"), "w") as file:
        stream = file.add_stream("libx264", rate=Fraction(24))
        stream.width, stream.height, stream.pix_fmt = 64, 64, "yuv420p"
        stream.codec_context.colorspace = tag
        for _ in range(3):
            file.mux(stream.encode(plain((64, 64), "yuv420p", (110, 90, 160), tag, 1)))
        file.mux(stream.encode(None))
    with pytest.raises(UserError, match=rf"odd\.mkv has matrix coefficients {tag} .*convert"):
        open_footage(tmp_path / "odd.mkv")
