"""Subjects that move by themselves: found, marked by strokes, carried, and in focus."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from addon.core.base.arrays import Bytes, LinearRGBA
from addon.core.base.errors import UserError
from addon.core.camera.canvas import Canvas
from addon.core.depth.source import DepthSource, PixelDepth
from addon.core.focus.subject import subject_place
from addon.core.subjects.strokes import MarkedSubject, Stroke

from ..scenes import texture
from . import walls
from .walls import FRAMES, HEIGHT, WIDTH, disc, filmed, moving, overlap, place

SOME = (FRAMES[0], 9, 16, 22, FRAMES[-1])


@pytest.fixture(scope="module")
def clip() -> walls.Filmed:
    return filmed(walls.with_disc)


def stroke(frame: int, adds: bool = True) -> Stroke:
    x, y = place(frame)
    return Stroke(frame, (((x - 8) / WIDTH, y / HEIGHT), ((x + 8) / WIDTH, y / HEIGHT)), adds)


def test_what_moves_is_found_whole_in_every_frame(clip: walls.Filmed) -> None:
    assert min(overlap(moving(clip, frame), disc(frame)) for frame in SOME) > 0.85


@pytest.mark.parametrize("shown", [walls.still, walls.with_shadow], ids=["nothing", "a shadow"])
def test_what_stands_still_is_no_subject(shown: object) -> None:
    found = filmed(shown)  # type: ignore[arg-type]
    assert all(not moving(found, frame).any() for frame in SOME)


def test_a_stroke_marks_what_moves_and_is_carried_both_ways(clip: walls.Filmed) -> None:
    carried = clip.parts.subjects.carried(MarkedSubject("disc", (stroke(16),)))
    for frame in SOME:
        cut = carried.cut(frame)
        assert overlap(cut.mask, disc(frame)) > 0.85 and cut.sure > 0.7
    assert carried.cut(16).sure == 1


PAUSES = (8, 25)
TINT = np.array((1.0, 0.75, 0.5))
"""Of the colours of a disc that does not always move: what looks as its background cannot be carried then."""


def when(frame: int) -> int:
    """The frame in which the disc is where one that pauses is."""
    first, last = PAUSES
    return frame if frame < first else first if frame < last else frame - last + first


def pausing(frame: int) -> Bytes:
    """The frame with the disc, which stands still for half of the clip."""
    picture, at = walls.still(frame), pausing_disc(frame)
    row, column = np.nonzero(at)
    x, y = pausing_place(frame)
    own = (texture(60, 60, 3) * TINT).astype(np.uint8)
    picture[row, column] = own[row - round(y) + 30, column - round(x) + 30]
    return picture


def pausing_place(frame: int) -> tuple[float, float]:
    x, y = place(when(frame))
    moved = walls.camera(frame) - walls.camera(when(frame))
    return x - moved * walls.LENS.fx / walls.FAR, y


def pausing_disc(frame: int) -> np.ndarray:
    x, y = pausing_place(frame)
    across, down = np.meshgrid(np.arange(WIDTH) - x, np.arange(HEIGHT) - y)
    return np.asarray(np.hypot(across, down) < 20)


def test_a_subject_that_pauses_is_no_part_of_the_static_scene() -> None:
    """Else the ground that it uncovers is taken along before and after."""
    x, y = pausing_place(16)
    corners = ((-12, -10), (12, -10), (-12, 0), (12, 0), (-12, 10), (12, 10))
    line = Stroke(16, tuple(((x + dx) / WIDTH, (y + dy) / HEIGHT) for dx, dy in corners))
    carried = filmed(pausing).parts.subjects.carried(MarkedSubject("disc", (line,)))
    assert min(overlap(carried.cut(frame).mask, pausing_disc(frame)) for frame in SOME) > 0.75


def thing(frame: int) -> Bytes:
    """The frame with a red thing that stands still before the far wall."""
    picture = walls.still(frame)
    picture[at_thing(frame)] = (190, 40, 30)
    return picture


def at_thing(frame: int) -> np.ndarray:
    left = round(90 - walls.camera(frame) * walls.LENS.fx / walls.FAR)
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[40:90, left : left + 26] = True
    return mask


def test_a_stroke_marks_what_stands_still_throughout() -> None:
    clip = filmed(thing)
    assert not moving(clip, 16).any()
    line = Stroke(16, ((95 / WIDTH, 50 / HEIGHT), (110 / WIDTH, 80 / HEIGHT)))
    carried = clip.parts.subjects.carried(MarkedSubject("thing", (line,)))
    assert min(overlap(carried.cut(frame).mask, at_thing(frame)) for frame in SOME) > 0.85
    # What a stroke takes away of it stays away.
    away = Stroke(16, ((90 / WIDTH, 82 / HEIGHT), (115 / WIDTH, 86 / HEIGHT)), False)
    cut = clip.parts.subjects.carried(MarkedSubject("thing", (line, away))).cut(16).mask
    cut = walls.sized(cut, (HEIGHT, WIDTH))
    assert not cut[83:85, 98:106].any() and cut[50:70, 92:112].mean() > 0.9


def behind_a_post(frame: int) -> Bytes:
    """The frame with a disc that moves straight on, and before it a post that hides it for some frames."""
    picture, own = walls.still(frame), texture(80, HEIGHT, 7)
    row, column = np.nonzero(straight_disc(frame))
    disc_own = (texture(60, 60, 3) * TINT).astype(np.uint8)
    picture[row, column] = disc_own[row - 40, column - (10 + 5 * frame)]
    left = round(95 - walls.camera(frame) * walls.LENS.fx / walls.NEAR)
    picture[:, left : left + 80] = own // 2
    return picture


def straight_disc(frame: int) -> np.ndarray:
    across, down = np.meshgrid(np.arange(WIDTH) - (40 + 5 * frame), np.arange(HEIGHT) - 70)
    return np.asarray(np.hypot(across, down) < 20)


def test_nothing_is_taken_for_a_subject_that_is_hidden() -> None:
    clip = filmed(behind_a_post)
    x = (40 + 5 * 6) / WIDTH
    line = Stroke(6, ((x - 8 / WIDTH, 70 / HEIGHT), (x + 8 / WIDTH, 70 / HEIGHT)))
    carried = clip.parts.subjects.carried(MarkedSubject("disc", (line,)))
    assert overlap(carried.cut(9).mask, straight_disc(9)) > 0.7
    assert not carried.cut(18).mask.any()


def test_strokes_in_two_frames_meet_in_the_middle(clip: walls.Filmed) -> None:
    both = clip.parts.subjects.carried(MarkedSubject("disc", (stroke(5), stroke(27))))
    one, other = (clip.parts.subjects.carried(MarkedSubject("disc", (stroke(n),))) for n in (5, 27))
    for frame, near in ((8, one), (24, other)):
        difference = cv2.absdiff(both.cut(frame).share, near.cut(frame).share)
        assert difference.mean() < 3 / 255
    assert overlap(both.cut(16).mask, disc(16)) > 0.85


def test_a_marked_subject_is_in_focus_as_it_moves(clip: walls.Filmed) -> None:
    marked = replace(clip, marked=(MarkedSubject("disc", (stroke(16),)),))
    found = marked.subject_place("disc", 16)
    assert set(found.followed) == set(FRAMES)
    canvas = marked.canvas(16)
    depth = marked.depth_source().at(16, canvas, np.zeros((0, 0, 4), np.float32))
    assert depth is not None
    own = depth.inverse_depth[walls.sized(marked.parts.named("disc").mask(16), depth.inverse_depth.shape)]
    assert np.median(own) == pytest.approx(1 / found.distance, rel=0.1)
    with pytest.raises(UserError, match="there is no subject 'cat'; there are: disc"):
        marked.parts.named("cat").mask(16)


def test_where_a_subject_stands_the_depth_of_all_pixels_is_not_asked_for(clip: walls.Filmed) -> None:
    class Unasked(DepthSource):
        """Would take ten times as long."""

        def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth | None:
            raise AssertionError(frame)

    inverse = {frame: 0.2 + 0.001 * frame for frame in FRAMES}
    found = subject_place(clip.reconstruction, Unasked(), disc, 16, "disc", inverse.get)
    assert {frame: 1 / each for frame, each in found.followed.items()} == pytest.approx(inverse, rel=0.01)
