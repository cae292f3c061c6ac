"""Subjects are found only in clips that certainly have moving objects."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from addon.core.base.arrays import Bytes
from addon.core.depth.depth_store import DepthStore
from addon.core.depth.multi_view_stereo import PlaneSweepStereo
from addon.core.depth.temporal_fusion import TemporalFusion
from addon.core.frame.clip_context import no_picture
from addon.core.subjects import gate
from addon.core.subjects.found import FoundSubjects
from addon.core.subjects.strokes import MarkedSubject, Stroke

from . import walls
from .walls import FRAMES, HEIGHT, WIDTH, disc, filmed, moving, overlap, place


def test_a_pole_that_the_border_cuts_in_a_few_frames_is_no_subject() -> None:
    """Other frames show the wall there, so that all of it seems to move."""
    clip, frame = filmed(walls.with_pole), 3
    assert not moving(clip, frame).any()
    surely = filmed(walls.with_pole, is_sure=True)
    assert overlap(moving(surely, frame), walls.pole(frame)) > 0.9


def test_depth_of_a_still_clip_equals_that_without_subjects() -> None:
    clip, frame = filmed(walls.with_pole), 3
    alone = PlaneSweepStereo(clip.reconstruction, clip.read, finds_motion=False)
    without, found = TemporalFusion(clip.reconstruction, alone).at(frame), clip.stereo.at(frame)
    for part in ("inverse_depth", "confidence", "moving"):
        np.testing.assert_array_equal(getattr(found, part), getattr(without, part))
    assert clip.left_out(frame) is None


def test_a_marked_subject_is_carried_where_no_subjects_are_found() -> None:
    x, y = 90 / WIDTH, 60 / HEIGHT
    stroke = Stroke(16, ((x, y), (x + 0.05, y + 0.1)))
    marked = replace(filmed(walls.still), marked=(MarkedSubject("wall", (stroke,)),))
    assert moving(marked, 16).any() and not marked.subjects.is_sure


def test_masks_count_where_no_subjects_are_found() -> None:
    said = replace(filmed(walls.still), masks=lambda frame: disc(frame).astype(np.float32))
    np.testing.assert_array_equal(moving(said, 9), disc(9))


def test_the_decision_is_stored(tmp_path: Path) -> None:
    clip, store = filmed(walls.with_disc), DepthStore(tmp_path, lambda: "a")
    assert FoundSubjects(clip.reconstruction, clip.read, store=store).is_sure
    # The decision is read, and no frame.
    assert FoundSubjects(clip.reconstruction, no_picture, store=DepthStore(tmp_path, lambda: "a")).is_sure
    still = DepthStore(tmp_path, lambda: "b")
    assert not FoundSubjects(clip.reconstruction, walls.still, store=still).is_sure
    assert not FoundSubjects(clip.reconstruction, no_picture, store=still).is_sure


def test_photos_and_single_frames_have_no_moving_objects() -> None:
    clip = filmed(walls.with_disc)
    assert gate.moves(clip.reconstruction, clip.read)
    assert not gate.moves(replace(clip.reconstruction, is_ordered=False), no_picture)
    single = replace(clip.reconstruction, images=clip.reconstruction.images[:1])
    assert not gate.moves(single, clip.read)


def along(track: int) -> np.ndarray:
    """Places (frames, 2) in OpenCV's pixels that follow the far wall, and rise by `track` tenths a frame."""
    shift = np.array([walls.camera(frame) * walls.LENS.fx / walls.FAR for frame in FRAMES])
    return np.column_stack([150 - shift, 60 - 0.1 * track * np.arange(len(FRAMES))])


def test_a_track_that_one_point_explains_is_still_at_any_depth() -> None:
    """A track in a single frame has no residual."""
    clip, here = filmed(walls.still), 12
    still = along(0)
    nearer = 150 + 3 * (still - 150)
    lost = still.copy()
    lost[here + 1 :] = lost[:here] = np.nan
    tracks = np.stack([still, nearer, along(10), lost]).astype(np.float32)
    lenses = [walls.LENS] * len(FRAMES)
    found = gate.still_residuals(tracks, clip.reconstruction.images, lenses, here)
    assert found[:2] == pytest.approx(0, abs=0.01) and found[2] > 5 and np.isnan(found[3])


def test_a_single_track_among_still_ones_is_no_object() -> None:
    places = np.stack(np.meshgrid(np.arange(20, 220, 6.0), np.arange(20, 140, 6.0)), axis=-1)
    places = places.reshape(-1, 2).astype(np.float32)
    residual = np.full(len(places), 0.1)
    residual[::40] = 9.0
    assert not gate.on_moving_objects(places, residual, (HEIGHT, WIDTH)).any()
    x, y = place(16)
    inside = np.linalg.norm(places - (x, y), axis=1) < 25
    residual[inside] = 9.0
    found = gate.on_moving_objects(places, residual, (HEIGHT, WIDTH))
    assert found.sum() >= gate.TRACKS and not found[~inside].any()


def flat(frame: int) -> Bytes:
    return np.full((HEIGHT, WIDTH, 3), 90, np.uint8)


def test_a_picture_without_corners_has_no_moving_objects() -> None:
    assert not filmed(flat).subjects.is_sure
