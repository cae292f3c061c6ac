"""The shape of the aperture on the command line, in the .blend and in what is sent elsewhere."""

from __future__ import annotations

from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.cli.main import run_command
from addon.core.camera.reconstruction import Intrinsics
from addon.core.readers.colmap_export import write_model

from ..scenes import slanted_plane, write_frames

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
FRAMES = (1, 2, 3)


@pytest.fixture
def work(scene: bpy.types.Scene, tmp_path: Path) -> Path:
    """A working folder of a clip with two lamps."""
    footage = write_frames(tmp_path / "clip", LENS, FRAMES)
    for path in footage.iterdir():
        picture = cv2.imread(str(path)) // 3
        picture[30:33, 120:123] = picture[60:63, 40:43] = 255
        cv2.imwrite(str(path), picture)
    (tmp_path / "model").mkdir()
    write_model(tmp_path / "model", slanted_plane(LENS, FRAMES, count=800))
    assert run("import", tmp_path / "model", "--footage", footage, "--work", tmp_path / "work") == 0
    return tmp_path / "work"


@pytest.fixture
def letter(tmp_path: Path) -> Path:
    """A picture that lets light through on its left half."""
    picture = np.zeros((32, 32), np.uint8)
    picture[:, :16] = 255
    path = tmp_path / "picture of an aperture.png"
    cv2.imwrite(str(path), picture)
    return path


def run(*words: object) -> int:
    return run_command([str(word) for word in words])


def lens(*aperture: object) -> list[object]:
    words: list[object] = ["--focus-distance", 5, "--blur", 0.12, "--method", "features", "--views", 24]
    return words + (["--aperture", *aperture] if aperture else [])


def rendered(work: Path, out: Path, *aperture: object) -> np.ndarray:
    assert run("render", work, *lens(*aperture), "--frames", 2, "--out", out / "####.png") == 0
    return cv2.imread(str(out / "0002.png")).astype(float)


def test_the_shape_is_drawn_and_tells_frames_apart(work: Path, letter: Path, tmp_path: Path) -> None:
    plain = rendered(work, tmp_path / "plain")
    for number, shape in enumerate((["blades=3"], ["ratio=3"], [f"image={letter}"], ["vignetting=0.9"])):
        other = rendered(work, tmp_path / str(number), *shape)
        assert np.abs(other - plain).max() > 8, shape
    # Frames of another aperture are not taken for finished ones: they are in the way.
    assert (
        run("render", work, *lens("blades=5"), "--frames", 2, "--out", tmp_path / "plain" / "####.png") == 1
    )
    # Behind the focus discs are upright: with the left half open the light goes to the left.
    half = cv2.imread(str(tmp_path / "2" / "0002.png")).sum(axis=2)[16:46, 107:137].astype(float)
    half -= np.median(half)
    assert half[:, :15].clip(0).sum() > 1.5 * half[:, 15:].clip(0).sum()


@pytest.mark.parametrize(
    ("word", "said"),
    [("blades=90", "from 0 to 16"), ("blades=5.5", "whole number"), ("ratio=wide", "not a number"),
     ("blade=5", "is not valid"), ("blades", "is not valid")],
)  # fmt: skip
def test_words_that_are_no_shape_are_refused(
    work: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], word: str, said: str
) -> None:
    assert run("render", work, *lens(word), "--out", tmp_path / "o" / "####.png") == 2
    errors = capsys.readouterr().err
    assert "--aperture" in errors and said in errors


def test_a_picture_that_is_not_there_is_named(
    work: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    missing = tmp_path / "gone.png"
    assert run("render", work, *lens(f"image={missing}"), "--out", tmp_path / "o" / "####.png") == 1
    assert "gone.png" in capsys.readouterr().err
    assert not (tmp_path / "o").exists()


def test_the_picture_goes_with_the_blend(work: Path, letter: Path, tmp_path: Path) -> None:
    blend = tmp_path / "sent" / "a.blend"
    assert run("save", work, "--blend", blend, *lens(f"image={letter}")) == 0
    copy = blend.parent / "aperture" / letter.name
    assert copy.read_bytes() == letter.read_bytes()
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    shape = bpy.context.scene.virtual_aperture.shape
    assert shape.image == f"//aperture/{letter.name}"
    assert shape.aperture.image is not None


def test_the_picture_waits_for_a_solve(work: Path, letter: Path, tmp_path: Path) -> None:
    out = tmp_path / "job"
    words = lens("image=/is/not/there.png", "ratio=2", f"image={letter}")
    assert run("farm", tmp_path / "clip", *words, "--out", out) == 0
    assert (out / "input" / "aperture" / letter.name).read_bytes() == letter.read_bytes()
    blend = tmp_path / "a.blend"
    letter.unlink()
    words = ["--lens", out / "input" / "lens.json", "--no-copy", "--blend", blend]
    assert run("save", work, *words) == 0
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    shape = bpy.context.scene.virtual_aperture.shape
    assert shape.image == f"//job/input/aperture/{letter.name}"
    assert shape.aperture.ratio == 2 and shape.aperture.image is not None
