"""A clip without parallax through the context that product and tests share."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from addon.core.camera.intrinsics import Intrinsics
from addon.core.camera.reconstruction import MEDIAN_DEPTH, Image, Points, Reconstruction, rotation_matrix
from addon.core.depth.flat_scene import ORIGIN
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.highlights import HighlightSettings
from addon.core.media.light import to_linear
from addon.core.subjects.strokes import MarkedSubject, Stroke

from .. import planes
from ..staying_clips import StayingClip, staying_clip

COUNT, FRAME = 16, 8


@pytest.fixture(scope="module")
def clip() -> StayingClip:
    """A camera that turns while a card goes by, whose lower border is in the picture."""
    return staying_clip(COUNT, 0.1)


def reconstruction(clip: StayingClip) -> Reconstruction:
    """What a solve has of it: turns, and points at one distance."""
    nothing = np.zeros((0, 2)), np.zeros(0, np.int32)
    images = tuple(
        Image(number, rotation_matrix(np.array([0.0, turn, 0.0])), np.zeros(3), *nothing)
        for number, turn in enumerate(clip.turns.tolist(), 1)
    )
    points = Points(np.array([[0.0, 0, MEDIAN_DEPTH]] * 3), np.zeros((3, 3), np.uint8), np.zeros(3))
    width, height = planes.SIZE
    camera = Intrinsics(width, height, planes.FOCAL, planes.FOCAL, width / 2, height / 2)
    return Reconstruction((camera,), images, points)


def context(
    clip: StayingClip, is_masked: bool = False, marked: tuple[MarkedSubject, ...] = ()
) -> ClipContext:
    masks = (lambda frame: clip.walker[frame - 1].astype(np.float32)) if is_masked else None
    return ClipContext(
        reconstruction(clip), lambda frame: clip.pictures[frame - 1], masks=masks, marked=marked
    )


def test_a_masked_subject_stands_before_an_estimated_background(clip: StayingClip) -> None:
    made = context(clip, is_masked=True)
    canvas, picture = made.canvas(FRAME), to_linear(clip.pictures[FRAME - 1])
    depth = made.depth(FRAME, canvas, picture)
    assert depth.origin == ORIGIN
    walker = clip.walker[FRAME - 1]
    near = np.unique(depth.inverse_depth[walker])
    assert len(near) == 1 and near[0] > 1.9 / MEDIAN_DEPTH
    far = depth.inverse_depth[: planes.SIZE[1] // 2][~walker[: planes.SIZE[1] // 2]]
    assert far == pytest.approx(1 / MEDIAN_DEPTH, rel=0.2)
    place = made.places(FRAME).find(0.05, 0.1)
    assert place.distance == pytest.approx(MEDIAN_DEPTH, rel=0.2) and place.source.startswith(ORIGIN)


def test_hidden_background_is_from_frames_in_which_the_subject_was_elsewhere(clip: StayingClip) -> None:
    made = context(clip, is_masked=True)
    canvas, picture = made.canvas(FRAME), to_linear(clip.pictures[FRAME - 1])
    depth = made.depth(FRAME, canvas, picture)
    fill = made.hidden_colours(FRAME, canvas, picture, depth, HighlightSettings(gain=0))
    inner = cv2.erode(clip.walker[FRAME - 1].astype(np.uint8), np.ones((11, 11))) > 0
    row, column = np.nonzero(inner)
    colour, known = fill(np.column_stack([column, row]) + 0.5, np.full(len(row), 1 / MEDIAN_DEPTH))
    assert known.mean() > 0.5
    true = to_linear(clip.without[FRAME - 1])[row, column, :3]
    assert np.median(np.abs(np.sqrt(colour) - np.sqrt(true)).max(axis=1)[known]) < 0.08


def test_colours_of_other_frames_are_not_used_under_soft_edges(clip: StayingClip) -> None:
    """A camera that seems to stay moves a little: mixed pixels taken apart by such colours become specks."""
    soft = context(clip)
    blurred = [cv2.GaussianBlur(each.astype(np.float32), (0, 0), 2) for each in clip.walker]
    made = ClipContext(soft.reconstruction, soft.read, masks=lambda frame: blurred[frame - 1])
    canvas, picture = made.canvas(FRAME), to_linear(clip.pictures[FRAME - 1])
    depth = made.depth(FRAME, canvas, picture)
    fill = made.hidden_colours(FRAME, canvas, picture, depth, HighlightSettings(gain=0))
    opacity = blurred[FRAME - 1]
    row, column = np.nonzero((opacity > 0.1) & (opacity < 0.9))
    _, known = fill(np.column_stack([column, row]) + 0.5, np.full(len(row), 1 / MEDIAN_DEPTH))
    assert len(row) > 100 and not known.any()


def test_a_stroke_marks_a_subject_with_an_estimated_distance(clip: StayingClip) -> None:
    row, column = np.argwhere(clip.walker[FRAME - 1]).mean(axis=0)
    at = float(column / planes.SIZE[0]), float(row / planes.SIZE[1])
    made = context(clip, marked=(MarkedSubject("card", (Stroke(FRAME, (at,)),)),))
    assert made.may_focus_on_subjects
    place = made.subject_place("card", FRAME)
    assert 0 < place.distance < MEDIAN_DEPTH / 1.9 and sorted(place.followed) == list(range(1, COUNT + 1))
