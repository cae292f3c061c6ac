"""The focal length that a phone writes into its videos."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from addon.core.base.errors import UserError
from addon.core.camera.focal_length import from_equivalent, from_field_of_view, from_sensor, in_pixels
from addon.core.media.metadata import EQUIVALENT, equivalent_focal


def box(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I4s", 8 + len(content), kind) + content


def video(value: bytes, kind: int, version: bytes = b"", name: str = EQUIVALENT) -> bytes:
    """As a phone writes it: the pictures first, then what is said of them."""
    names = [b"com.apple.quicktime.make", name.encode()]
    keys = struct.pack(">II", 0, len(names)) + b"".join(box(b"mdta", each) for each in names)
    items = box(struct.pack(">I", 1), box(b"data", struct.pack(">II", 1, 0) + b"Phone"))
    items += box(struct.pack(">I", 2), box(b"data", struct.pack(">II", kind, 0) + value))
    meta = version + box(b"hdlr", bytes(24)) + box(b"keys", keys) + box(b"ilst", items)
    return box(b"ftyp", b"qt  ") + box(b"mdat", bytes(1000)) + box(b"moov", box(b"meta", meta))


@pytest.mark.parametrize(
    ("value", "kind"),
    [(struct.pack(">q", 26), 21), (struct.pack(">I", 26), 22), (b"\x1a", 21), (struct.pack(">f", 26), 23)],
)
@pytest.mark.parametrize("version", [b"", bytes(4)], ids=["mov", "mp4"])
def test_the_equivalent_is_read(tmp_path: Path, value: bytes, kind: int, version: bytes) -> None:
    path = tmp_path / "a.mov"
    path.write_bytes(video(value, kind, version))
    assert equivalent_focal(path) == 26


def test_a_file_that_says_nothing_or_nonsense_says_none(tmp_path: Path) -> None:
    path = tmp_path / "a.mov"
    whole = video(struct.pack(">q", 26), 21)
    others = [
        b"", b"nonsense", whole[:-30], video(b"", 21), video(struct.pack(">q", -5), 21),
        video(struct.pack(">q", 26), 21, name="com.example"), video(b"26", 1),
    ]  # fmt: skip
    others += [whole[:i] + bytes(4) + whole[i + 4 :] for i in range(0, len(whole) - 4, 7)]
    for content in others:
        path.write_bytes(content)
        assert equivalent_focal(path) in (None, 26)
    path.write_bytes(others[2])
    assert equivalent_focal(path) is None
    assert equivalent_focal(tmp_path / "missing.mov") is None


def test_a_lens_is_the_same_by_all_its_names() -> None:
    # 36 mm of film across and 24 down: a 43.27 mm lens sees the diagonal under 53.13 degrees.
    assert from_equivalent(36.0, 3600, 2400) == pytest.approx(3600)
    assert from_field_of_view(90.0, 1000) == pytest.approx(500)
    # Half the sensor's width before it is the same 90 degrees.
    assert from_sensor(11.8, 23.6, 1000) == pytest.approx(500)
    assert from_sensor(36.0, 36.0, 3600) == pytest.approx(3600)
    assert in_pixels(lambda width, height: 2.0 * width + height, 300, 200) == 800
    assert in_pixels(450.0, 300, 200) == 450


@pytest.mark.parametrize("bad", [0.0, -3.0, float("nan"), float("inf")])
def test_a_length_that_cannot_be_is_named(bad: float) -> None:
    for tell in (
        lambda: from_equivalent(bad, 1000, 500), lambda: from_sensor(bad, 36.0, 1000),
        lambda: from_sensor(35.0, bad, 1000), lambda: in_pixels(bad, 1000, 500),
        lambda: in_pixels(lambda width, height: bad, 1000, 500),
    ):  # fmt: skip
        with pytest.raises(UserError, match=f"is {bad:g} (mm|pixels); it must be"):
            tell()


@pytest.mark.parametrize("bad", [0.0, -3.0, 180.0, 200.0, float("nan"), float("inf")])
def test_a_field_of_view_that_cannot_be_is_named(bad: float) -> None:
    with pytest.raises(UserError, match=f"is {bad:g} degrees"):
        from_field_of_view(bad, 1000)
