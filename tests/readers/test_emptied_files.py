"""Files of other programs' solves that are empty or hold their header alone; `test_fuzz` cuts them off."""

from __future__ import annotations

from pathlib import Path

import pytest

from addon.core.base.errors import UserError
from addon.core.readers import read_reconstruction

from .. import camera_files as cameras
from .. import foreign_models as foreign
from .small_models import CLIP, models

PARTS = [(label, name) for label, files in models().items() for name in files]


def refusal(path: Path) -> str:
    """Why a model is refused; empty where it is read."""
    try:
        read_reconstruction(path, CLIP)
    except UserError as error:
        return str(error)
    return ""


def headers(content: bytes) -> list[bytes]:
    """What a writer leaves that ends before its first item."""
    lines = content.splitlines(keepends=True)
    comments = [line for line in lines if line.startswith(b"#")]
    return [
        b"",
        b"\n",
        b"\xef\xbb\xbf",
        b"".join(comments),
        content[:8] if b"\0" in content else lines[0],
        b"\0" * 8,
        b"{}",
        b"PK\5\6" + b"\0" * 18,
    ]


def is_named(text: str, file: Path) -> bool:
    """Whether a refusal names the file, and what is to be done."""
    ways_out = ("again", "choose", "give", "name it", "save it", "delete", "take", "undistort")
    return str(file) in text and any(way in text for way in ways_out)


@pytest.mark.parametrize(("label", "name"), PARTS)
def test_an_emptied_file_is_named(tmp_path: Path, label: str, name: str) -> None:
    """Whatever is given, the file or the folder it is in."""
    files = models()[label]
    for other, content in files.items():
        (tmp_path / other).write_bytes(content)
    whole = label.startswith(("COLMAP", "Stray"))
    given = tmp_path if whole else tmp_path / next(iter(files))
    assert not refusal(given)
    for content in headers(files[name]):
        (tmp_path / name).write_bytes(content)
        text = refusal(given)
        if name == "camera_matrix.csv" and not text:
            continue  # odometry.csv has the lenses, too
        assert is_named(text, tmp_path / name), (content[:40], text)


@pytest.mark.parametrize("kind", ["pose", "intrinsics"])
def test_the_emptied_one_of_vipes_files_is_named(tmp_path: Path, kind: str) -> None:
    """Both have one name."""
    cameras.vipe(tmp_path, foreign.world(images=3))
    assert not refusal(tmp_path)
    file = tmp_path / kind / "shot.npz"
    content = file.read_bytes()
    for left in (b"", content[: len(content) // 2], b"PK\5\6" + b"\0" * 18):
        file.write_bytes(left)
        text = refusal(tmp_path)
        assert is_named(text, file if kind == "intrinsics" or len(left) != 22 else tmp_path), text
