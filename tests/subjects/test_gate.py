"""Subjects are found only in clips that certainly have moving objects."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from addon.core.base.arrays import Bytes, Mask
from addon.core.base.store import Store
from addon.core.depth.multi_view_stereo import PlaneSweepStereo
from addon.core.depth.temporal_fusion import TemporalFusion
from addon.core.frame.clip_context import no_picture
from addon.core.subjects import gate
from addon.core.subjects.clip_subjects import OBJECTS, ClipSubjects
from addon.core.subjects.found_subjects import distinct, found_objects
from addon.core.subjects.networks import Networks
from addon.core.subjects.strokes import MarkedSubject, Stroke

from . import walls
from .walls import FRAMES, HEIGHT, WIDTH, filmed, moving, place


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


def still(places: np.ndarray, moved: float = 0.0) -> np.ndarray:
    """Tracks (n, 3, 2) through places (n, 2), shares of the width, that move to the right in each frame."""
    return places[:, None] + np.array([[-moved, 0], [0, 0], [moved, 0]])


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
