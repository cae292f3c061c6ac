"""Repairs of depth: what a stroke changes, in its own frame and in others."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.camera.canvas import Canvas
from addon.core.camera.intrinsics import Intrinsics
from addon.core.depth.source import PixelDepth
from addon.core.frame.repairs import CarriedPlaces, Repair, read_repairs, repaired
from addon.core.optics.thin_lens import ThinLens
from addon.core.subjects.pictures import ClipPictures

SIZE = WIDTH, HEIGHT = 256, 144
SIDE, STEP = 48, 5
"""Pixels of a square that moves over a textured wall, and by how much a frame."""
FRAMES = tuple(range(3, 15))
CANVAS = Canvas(Intrinsics(WIDTH, HEIGHT, 250.0, 250.0, 128.0, 72.0))
LENS = ThinLens(CANVAS.pinhole, 0.2, 0.25)
NEAR, FAR = 0.5, 0.1


def left(frame: int) -> int:
    """Left border of the square."""
    return 60 + STEP * (frame - FRAMES[0])


def square(frame: int) -> np.ndarray:
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[48 : 48 + SIDE, left(frame) : left(frame) + SIDE] = True
    return mask


def picture(frame: int) -> np.ndarray:
    """(H, W, 3) uint8: a bright textured square before a dark textured wall."""
    random = np.random.default_rng(1)
    wall, own = (cv2.GaussianBlur(random.random((HEIGHT, WIDTH, 3)), (0, 0), 2) for _ in range(2))
    shown = 60 + 400 * (wall - 0.5)
    shift = left(frame) - left(FRAMES[0])
    shown[square(frame)] = np.roll(180 + 400 * (own - 0.5), shift, axis=1)[square(frame)]
    return shown.clip(0, 255).astype(np.uint8)


CARRIED = CarriedPlaces(ClipPictures(FRAMES, picture))
MIDDLE = ((60 + SIDE / 2) / WIDTH, 72 / HEIGHT)


def depth(torn: bool = True) -> PixelDepth:
    """The square's depth, that of the wall in its lower half where it is torn."""
    return PixelDepth(np.full((HEIGHT, WIDTH), FAR), np.full((HEIGHT, WIDTH), 0.5, np.float32))


def mended(repair: Repair, frame: int, before: PixelDepth) -> PixelDepth:
    shown = np.dstack([picture(frame) / 255.0, np.ones((HEIGHT, WIDTH))]).astype(np.float32) ** 2.2
    return repaired(before, [repair], lambda one: CARRIED.region(one, frame), CANVAS, shown, LENS)


def iou(one: np.ndarray, other: np.ndarray) -> float:
    return float((one & other).sum() / (one | other).sum())


@pytest.mark.parametrize("frame", [3, 7, 14])
def test_a_stroke_goes_with_what_it_was_painted_on(frame: int) -> None:
    x, y = MIDDLE
    reach = 0.35 * SIDE / WIDTH
    stroke = Repair("nearer", 3, ((x - reach, y), (x + reach, y)), radius=0.5 * SIDE / WIDTH, amount=1.0)
    found = mended(stroke, frame, depth())
    changed = found.inverse_depth > 1.5 * FAR
    assert iou(changed, square(frame)) > 0.85
    assert found.inverse_depth[changed] == pytest.approx(2 * FAR)
    assert found.confidence is not None and found.confidence[changed].min() == 1
    assert found.confidence[0, 0] == 0.5


def test_its_outline_snaps_to_the_picture() -> None:
    y = MIDDLE[1]
    # It reaches past the square's right border by 6 pixels.
    corner = (60 + SIDE - 8) / WIDTH
    stroke = Repair("farther", 3, ((corner, y),), radius=14 / WIDTH)
    changed = mended(stroke, 3, depth()).inverse_depth < FAR
    plain = np.hypot(*(np.indices((HEIGHT, WIDTH))[::-1] + 0.5 - np.array([[[corner * WIDTH]], [[72]]]))) < 14
    assert (changed & ~square(3)).sum() < 0.5 * (plain & ~square(3)).sum()
    assert (changed & square(3)).sum() > 0.8 * (plain & square(3)).sum()


@pytest.mark.parametrize("frame", [3, 9])
def test_a_torn_part_takes_the_depth_of_the_reference(frame: int) -> None:
    inverse = np.full((HEIGHT, WIDTH), FAR)
    upper = square(frame)
    upper[72:] = False
    inverse[upper] = NEAR + 0.01 * frame
    x, _ = MIDDLE
    stroke = Repair(
        "same", 3, tuple((x + each * SIDE / WIDTH, 84 / HEIGHT) for each in (-0.3, 0.3)),
        radius=11 / WIDTH, reference=(x, 60 / HEIGHT),
    )  # fmt: skip
    found = mended(stroke, frame, PixelDepth(inverse)).inverse_depth
    lower = square(frame) & ~upper
    assert np.mean(np.abs(found[lower] - NEAR - 0.01 * frame) < 1e-6) > 0.8
    assert np.mean(found[~square(frame)] == FAR) > 0.97


def test_sharp_is_in_focus_and_soft_is_the_background() -> None:
    inverse = np.full((HEIGHT, WIDTH), NEAR)
    inverse[:, WIDTH // 2 :] = FAR
    at = ((0.3, 0.5),)
    sharp = mended(Repair("sharp", 3, at), 3, PixelDepth(inverse)).inverse_depth
    assert np.unique(sharp).tolist() == pytest.approx([FAR, 0.25, NEAR])
    soft = mended(Repair("soft", 3, at), 3, PixelDepth(inverse)).inverse_depth
    assert (soft != inverse).any() and np.unique(soft).tolist() == pytest.approx([FAR, NEAR])


def test_a_frame_that_does_not_show_it_is_not_changed() -> None:
    corner = Repair("nearer", FRAMES[-1], (((left(FRAMES[-1]) + SIDE - 2) / WIDTH, 0.5),), radius=0.01)
    assert CARRIED.region(corner, FRAMES[-1]) is not None
    assert CARRIED.region(corner, 99) is None
    # The wall that the square covers later.
    gone = Repair("nearer", 3, (((left(FRAMES[-1]) + 8) / WIDTH, 0.5),), radius=0.02)
    assert (mended(gone, 3, depth()).inverse_depth > FAR).any()
    np.testing.assert_array_equal(mended(gone, FRAMES[-1], depth()).inverse_depth, FAR)


def test_repairs_are_read_and_mistakes_are_named(tmp_path: Path) -> None:
    file = tmp_path / "mend.json"
    whole = {"kind": "same", "frame": 3, "places": [[0.1, 0.2], [0.3, 0.4]], "reference": [0.5, 0.5]}
    file.write_text(json.dumps([whole, {"kind": "soft", "frame": 4, "places": [[0, 1]], "radius": 0.1}]))
    assert read_repairs(file) == (
        Repair("same", 3, ((0.1, 0.2), (0.3, 0.4)), reference=(0.5, 0.5)),
        Repair("soft", 4, ((0.0, 1.0),), radius=0.1),
    )
    for held, said in (
        ({}, "holds no list of repairs"),
        ([{**whole, "kind": "blur"}], "repair 1 is not valid: there is no kind of repair 'blur'"),
        ([whole, {**whole, "reference": None}], "repair 2 is not valid: .*needs a reference"),
        ([{**whole, "places": [[0.1, 1.2]]}], "numbers from 0 to 1"),
        ([{**whole, "places": [0.1]}], "repair 1 is not valid"),
        ([{**whole, "size": 1}], "it has size"),
        ([{"kind": "soft"}], "frame is missing"),
        ([{**whole, "frame": "x"}], "not a whole number"),
        ([{**whole, "radius": 0}], "radius of 0"),
        ([{**whole, "amount": "nan"}], "not a number"),
    ):
        file.write_text(json.dumps(held))
        with pytest.raises(UserError, match=said) as raised:
            read_repairs(file)
        assert str(file) in str(raised.value)
    with pytest.raises(UserError, match="cannot be read as JSON"):
        read_repairs(tmp_path / "missing.json")
