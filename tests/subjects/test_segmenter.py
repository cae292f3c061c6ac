"""A salient-object network of the user's own: what is taken, and subjects that it cuts out and carries."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.base.arrays import Bytes, Mask
from addon.core.base.errors import UserError
from addon.core.subjects.carried import CarriedSubject
from addon.core.subjects.networks import Networks
from addon.core.subjects.odds import overlap
from addon.core.subjects.pictures import ClipPictures, small
from addon.core.subjects.segmenter import Segmenter
from addon.core.subjects.strokes import Stroke

from ..onnx_files import ANY, Side, red
from ..scenes import texture

WIDTH, HEIGHT, RADIUS = 640, 360, 50
FRAMES = tuple(range(1, 31))
NONE = Path("none")
"""Folder without the built-in networks."""


def write(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


def place(frame: int) -> tuple[float, float]:
    return 120 + 12 * frame, 180 + 60 * np.sin(frame / 4)


def shown(frame: int) -> Bytes:
    """(HEIGHT, WIDTH, 3) a red ball that swings behind a pole, and a smaller one that rests."""
    picture = np.repeat(cv2.cvtColor(texture(WIDTH, HEIGHT, 1), cv2.COLOR_RGB2GRAY)[..., None], 3, axis=2)
    for x, y in (place(frame), (600, 330)):
        cv2.circle(picture, (round(x), round(y)), RADIUS if x < 590 else 20, (200, 30, 40), -1)
        cv2.circle(picture, (round(x - 15), round(y - 15)), 12, (235, 60, 90), -1)
    cv2.rectangle(picture, (300, 0), (309, HEIGHT), (30, 90, 60), -1)
    return picture


def ball(frame: int) -> Mask:
    """(h, w) where the ball is, at the size that subjects are found at."""
    mask = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    cv2.circle(mask, tuple(round(each) for each in place(frame)), RADIUS, (255, 255, 255), -1)
    mask[:, 300:310] = 0
    return np.asarray(small(mask)[..., 0] > 127)


def followed(path: Path, strokes: tuple[Stroke, ...]) -> CarriedSubject:
    return CarriedSubject(ClipPictures(FRAMES, shown), Networks(NONE, path), strokes)


@pytest.mark.parametrize("shape", [ANY, (1, 3, 1024, 1024), (1, 3, 320, 320)])
def test_networks_of_the_known_sides_find_the_test_picture(tmp_path: Path, shape: tuple[Side, ...]) -> None:
    Segmenter(write(tmp_path / "own.onnx", red(shape))).check()


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"not a network", "net.onnx cannot be read"),
        (red((1, 3, 384, 384)), "384 x 384 pixels; IS-Net"),
        (red((1, 1, 320, 320)), "not a picture"),
        (red(times=-40.0), "does not find the disc of a test picture"),
    ],
)
def test_other_files_are_refused_with_what_was_expected(tmp_path: Path, data: bytes, said: str) -> None:
    with pytest.raises(UserError, match=said):
        Segmenter(write(tmp_path / "net.onnx", data)).check()
    with pytest.raises(UserError, match=r"segmenter: gone.onnx cannot be read"):
        Segmenter(tmp_path / "gone.onnx")


def test_a_click_cuts_an_object_out_of_all_frames_in_any_order(tmp_path: Path) -> None:
    path = write(tmp_path / "own.onnx", red())
    x, y = place(8)
    click = (Stroke(8, ((x / WIDTH, y / HEIGHT),)),)
    subject = followed(path, click)
    masks = {frame: subject.mask(frame) for frame in (*FRAMES[::-1],)}
    found = [overlap(masks[frame], ball(frame)) for frame in FRAMES]
    # In three frames a part of it comes into view behind the pole.
    assert min(found) > 0.7 and np.mean(found) > 0.95
    # What was asked for before makes no difference.
    for frame in (3, 21):
        np.testing.assert_array_equal(followed(path, click).mask(frame), masks[frame])


def test_pixels_under_a_stroke_that_takes_away_are_not_the_subjects(tmp_path: Path) -> None:
    x, y = place(8)
    adds = Stroke(8, ((x / WIDTH, y / HEIGHT),))
    takes = Stroke(8, (((x - 30) / WIDTH, (y + 30) / HEIGHT), ((x + 30) / WIDTH, (y + 30) / HEIGHT)), False)
    subject = followed(write(tmp_path / "own.onnx", red()), (adds, takes))
    assert not (subject.mask(8) & subject.strokes_in(8)[1]).any()
