"""Subjects are found only in clips that certainly have moving objects."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from addon.core.base.arrays import Bytes, Mask
from addon.core.base.store import NOT_KEPT, Store
from addon.core.depth.multi_view_stereo import PlaneSweepStereo
from addon.core.depth.temporal_fusion import TemporalFusion
from addon.core.frame.clip_context import no_picture
from addon.core.subjects import gate
from addon.core.subjects.clip_subjects import OBJECTS, ClipSubjects
from addon.core.subjects.found_subjects import distinct, found_objects
from addon.core.subjects.networks import Networks
from addon.core.subjects.strokes import MarkedSubject, Stroke

from . import walls
from .walls import FRAMES, HEIGHT, WIDTH, disc, filmed, moving, place


def test_a_pole_that_the_border_cuts_in_a_few_frames_is_no_subject() -> None:
    """Other frames show the wall there, so that all of it seems to move."""
    clip, frame = filmed(walls.with_pole), 3
    assert not moving(clip, frame).any()


def test_depth_of_a_still_clip_equals_that_without_subjects() -> None:
    clip, frame = filmed(walls.with_pole), 3
    alone = PlaneSweepStereo(clip.reconstruction, clip.read)
    without, found = TemporalFusion(clip.reconstruction, alone).at(frame), clip.stereo.at(frame)
    for part in ("inverse_depth", "confidence", "moving"):
        np.testing.assert_array_equal(getattr(found, part), getattr(without, part))
    assert clip.parts.mask(frame) is None


def test_a_marked_subject_is_carried_where_no_subjects_are_found() -> None:
    x, y = 90 / WIDTH, 60 / HEIGHT
    stroke = Stroke(16, ((x, y), (x + 0.05, y + 0.1)))
    marked = replace(filmed(walls.still), marked=(MarkedSubject("wall", (stroke,)),))
    assert moving(marked, 16).any()


def test_masks_count_where_no_subjects_are_found() -> None:
    said = replace(filmed(walls.still), masks=lambda frame: disc(frame).astype(np.float32))
    np.testing.assert_array_equal(moving(said, 9), disc(9))


def subjects(shown: Callable[[int], Bytes], store: Store) -> ClipSubjects:
    """The subjects of a clip of pictures, without networks."""
    return ClipSubjects(filmed(walls.with_disc).reconstruction, shown, store, Networks(walls.NONE))


@pytest.mark.long
def test_objects_are_found_once(tmp_path: Path) -> None:
    (found,) = subjects(walls.with_disc, Store(tmp_path, lambda: "a")).objects
    first = found.mask(16)
    # Their strokes and masks are read, and no frame.
    store = Store(tmp_path, lambda: "a")
    (again,) = subjects(no_picture, store).objects
    assert again.name == "object 1" and np.array_equal(again.mask(16), first)
    still = Store(tmp_path, lambda: "b")
    assert subjects(walls.still, still).objects == subjects(no_picture, still).objects == []
    # A damaged file is none.
    store.write(OBJECTS, {"frames": np.array([1]), "counts": np.array([8]), "places": np.zeros(8)})
    assert len(subjects(walls.with_disc, store).objects) == 1


@pytest.mark.long
def test_a_mark_replaces_an_object() -> None:
    clip, (x, y) = filmed(walls.with_disc), place(16)
    assert [each.name for each in clip.parts.every_subject] == ["object 1"]

    def marked(*corners: tuple[float, float]) -> list[str]:
        mark = MarkedSubject("disc", (Stroke(16, corners),))
        return [each.name for each in replace(clip, marked=(mark,)).parts.every_subject]

    assert marked(((x - 8) / WIDTH, y / HEIGHT), ((x + 8) / WIDTH, y / HEIGHT)) == ["disc"]
    assert marked((0.02, 0.9), (0.05, 0.95)) == ["disc", "object 1"]


def test_photos_and_single_frames_have_no_moving_objects() -> None:
    clip = filmed(walls.with_disc)
    assert gate.moves(list(gate.moving_tracks(clip.reconstruction, clip.read)))
    assert not list(gate.moving_tracks(replace(clip.reconstruction, is_ordered=False), no_picture))
    single = replace(clip.reconstruction, images=clip.reconstruction.images[:1])
    assert not list(gate.moving_tracks(single, clip.read))


def still(places: np.ndarray, moved: float = 0.0) -> np.ndarray:
    """Tracks (n, 3, 2) through places (n, 2), shares of the width, that move to the right in each frame."""
    return places[:, None] + np.array([[-moved, 0], [0, 0], [moved, 0]])


def test_tracks_near_each_other_are_a_group() -> None:
    square = np.stack(np.meshgrid(np.arange(4), np.arange(4)), axis=-1).reshape(-1, 2) * 0.04
    tracks = still(np.concatenate([0.1 + square, 0.5 + square, [[0.95, 0.1]]]))
    found = gate.MovingTracks(1, tracks, (HEIGHT, WIDTH)).groups()
    assert [len(group) for group in found] == [16, 16]
    np.testing.assert_allclose(found[1], (0.5 + square) * [1, WIDTH / HEIGHT])
    assert gate.MovingTracks(1, np.zeros((0, 3, 2)), (HEIGHT, WIDTH)).groups() == []


def test_parts_of_an_object_that_something_hides_are_a_group_if_they_move_alike() -> None:
    part = np.stack(np.meshgrid(np.arange(2), np.arange(3)), axis=-1).reshape(-1, 2) * 0.04
    lost = still(part + np.array([0.25, 0.1]), 0.02)
    lost[:, 0] = np.nan
    alike = np.concatenate([still(part + 0.1, 0.02), lost])
    assert [len(each) for each in gate.MovingTracks(1, alike, (HEIGHT, WIDTH)).groups()] == [12]
    apart = np.concatenate([still(part + 0.1, 0.02), still(part + np.array([0.25, 0.1]), 0.01)])
    assert gate.MovingTracks(1, apart, (HEIGHT, WIDTH)).groups() == []


def sampled(frame: int, left: int, right: int) -> gate.MovingTracks:
    """A sampled frame with so many tracks in the middle of each half, which move alike."""
    x = np.repeat([0.42, 0.58], (left, right))
    return gate.MovingTracks(frame, still(np.column_stack([x, np.full(len(x), 0.3)])), (HEIGHT, WIDTH))


@dataclass(frozen=True)
class Half:
    """A subject that is carried on the left."""

    strokes: tuple[Stroke, ...]

    def mask(self, frame: int) -> Mask:
        found = np.zeros((HEIGHT, WIDTH), bool)
        found[:, : WIDTH // 2] = True
        return found


def test_groups_on_an_object_in_other_frames_are_the_same_object() -> None:
    def strokes(*tracks: gate.MovingTracks, people: bool = False) -> list[Counter[int]]:
        everywhere = np.full((HEIGHT, WIDTH), people)
        objects = distinct(found_objects(tracks, lambda frame: everywhere), Half)  # type: ignore[arg-type]
        return [Counter(each.frame for each in own.strokes) for own in objects]

    seen = sampled(2, 12, 0), sampled(4, 10, 0), sampled(6, 6, 4), sampled(8, 0, 10)
    assert strokes(*seen) == [{2: 12}]
    assert strokes(*seen, people=True) == []
    # Two groups of a frame are too far apart to be one.
    ends = np.repeat([0.1, 0.9], (12, 10))
    places = still(np.column_stack([ends, np.full(22, 0.3)]))
    assert strokes(*(gate.MovingTracks(frame, places, (HEIGHT, WIDTH)) for frame in (2, 4))) == [{2: 12}]
    # Seen in one frame alone it is no object.
    assert strokes(sampled(2, 12, 0), sampled(4, 0, 10)) == []


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
    assert subjects(flat, NOT_KEPT).objects == []
