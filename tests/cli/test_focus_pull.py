"""Focus pulled on the command line, and what a key of the aperture does."""

from __future__ import annotations

from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.scene.lens.lens import keys_of

from .solved_clips import FRAMES, run, work

__all__ = ["work"]
PULL = ("--focus-at", "0.2,0.5@2", "--focus-at", "0.8,0.5@5", "--method", "features")


def distances() -> list[float]:
    """Of the focus, at the clip's frames."""
    scene = bpy.context.scene
    found = []
    for frame in FRAMES:
        scene.frame_set(frame)
        found.append(scene.virtual_aperture.focus_distance)
    return found


def pictures(folder: Path) -> dict[str, np.ndarray]:
    return {file.name: cv2.imread(str(file), cv2.IMREAD_UNCHANGED) for file in sorted(folder.iterdir())}


def test_marks_are_keys_of_the_distance(
    work: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("save", work, "--blend", tmp_path / "a.blend", *PULL, "--blur", 0.02) == 0
    said = capsys.readouterr().out
    assert "away at frame 2, from points" in said and "away at frame 5, from points" in said
    assert "largest blur discs at frame 1" in said
    settings = bpy.context.scene.virtual_aperture
    # The aperture is the first one's.
    bpy.context.scene.frame_set(2)
    assert settings.blur == pytest.approx(0.02, rel=1e-3)
    keyed = distances()
    assert not settings.marks.points
    curve = keys_of(settings, "focus_distance")
    assert curve is not None and len(curve.keyframe_points) == len(FRAMES)
    # The plane is nearer on the left.
    assert keyed[1] < 7 < 8 < keyed[4]
    assert sorted(keyed[1:5]) == keyed[1:5]
    assert keyed[0] == pytest.approx(keyed[1], rel=0.02) and keyed[5] == pytest.approx(keyed[4], rel=0.02)


def test_a_pulled_frame_is_the_one_at_its_distance(work: Path, tmp_path: Path) -> None:
    lens = ("--method", "features", "--aperture-radius", 0.1, "--frames")
    out = ("--out", tmp_path / "pulled" / "####.png")
    assert run("render", work, *PULL, *lens[2:], "1-6", *out) == 0
    keyed, pulled = distances(), pictures(tmp_path / "pulled")
    for frame in (1, 3, 4):
        out = ("--out", tmp_path / "still" / "####.png")
        assert run("render", work, "--focus-distance", repr(keyed[frame - 1]), *lens, frame, *out) == 0
    still = pictures(tmp_path / "still")
    for name, picture in still.items():
        np.testing.assert_array_equal(picture, pulled[name])
    assert (pulled["0003.png"] != pulled["0004.png"]).any()


@pytest.mark.parametrize(
    ("marks", "said"),
    [
        (("0.2,0.5@2", "0.8,0.4"), "focus at 0.8,0.4 has no frame; a focus pull needs X,Y@FRAME"),
        (("0.2,0.5@2", "0.8,0.5@2"), "two focus marks are at frame 2"),
        (("0.2,0.5@2", "0.8,0.5@40"), "frame 40 is after the end of the clip"),
    ],
)
def test_marks_that_make_no_pull_are_refused(
    work: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], marks: tuple[str, str], said: str
) -> None:
    focus = [word for mark in marks for word in ("--focus-at", mark)]
    assert run("render", work, *focus, "--method", "features", "--out", tmp_path / "####.png") == 1
    assert said in capsys.readouterr().err
