"""Where the focus strip shows marks, and what a click on it means; how it looks is seen in the window."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.core.focus.focus import Focus
from addon.core.focus.place import Place
from addon.core.focus.pull import FocusMark
from addon.scene.build import build
from addon.scene.focus import focus_marks
from addon.scene.focus.kept_marks import at_distance
from addon.ui.focus.focus_strip import GAP, SIDE, Strip, spread

from ..scenes import LENS, slanted_shot


def test_it_is_the_nearest_that_can_be() -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        places = np.sort(rng.uniform(0, 400, 5))
        found = spread(places.tolist(), 50, 0, 400)
        assert np.all(np.diff(found) >= 50 - 1e-9) and found[0] >= 0 and found[-1] <= 400
        for _ in range(50):
            other = np.sort(rng.uniform(0, 200, 5)) + 50 * np.arange(5)
            assert np.sum((found - places) ** 2) <= np.sum((other - places) ** 2) + 1e-9


@pytest.fixture
def strip(scene: bpy.types.Scene) -> Strip:
    """Marks at frames 1, 21 and 22 of 1 to 41, between pixels 100 and 956 at a resolution scale of 1."""
    scene.frame_start, scene.frame_end = 1, 41
    for frame in (1, 21, 22):
        scene.virtual_aperture.marks.items.add().fill(FocusMark(frame, (at_distance(5.0, frame),)))
    return Strip.over(100, 956, 0, 1.0, scene)


def test_frames_and_places_are_the_same_both_ways(strip: Strip) -> None:
    assert [strip.frame_at(strip.place_of(frame)) for frame in range(1, 42)] == list(range(1, 42))
    assert strip.place_of(21) == pytest.approx((strip.left + strip.right) / 2)
    # Past the ends there are no frames.
    assert strip.frame_at(-1000) == 1 and strip.frame_at(5000) == 41
    assert strip.place_of(-7) == strip.left and strip.place_of(99) == strip.right


def test_a_thumbnail_is_where_it_is_seen(strip: Strip) -> None:
    one, other, last = strip.middles
    assert one == strip.left and last - other == pytest.approx(SIDE + GAP)
    middle = (strip.thumbnails + strip.top) / 2
    assert [strip.mark_at(x, middle) for x in strip.middles] == [0, 1, 2]
    assert strip.mark_at((other + last) / 2, middle) is None
    assert strip.mark_at(one + SIDE, middle) is None
    assert strip.mark_at(one, strip.top + 1) is None and strip.mark_at(one, -1) is None


def test_a_mark_is_moved(scene: bpy.types.Scene, tmp_path: Path) -> None:
    made = slanted_shot(tmp_path, LENS)
    settings = build(scene, made.footage, made.reconstruction)
    marks = [FocusMark.of(Place(Focus(distance=d), f, d, "a distance")) for f, d in ((1, 5.0), (2, 9.0))]
    focus_marks.replace_all(settings, marks)
    drag = bpy.ops.virtual_aperture.drag_focus_mark
    assert drag(index=0, frame=3) == {"FINISHED"}
    assert [(mark.frame, round(mark.distance, 3)) for mark in settings.marks.items] == [(2, 9.0), (3, 5.0)]
    with pytest.raises(RuntimeError, match="frame 3 already has a focus mark"):
        drag(index=0, frame=3)
    with pytest.raises(RuntimeError, match="there is no focus mark 2"):
        drag(index=2, frame=1)
    assert [mark.frame for mark in settings.marks.items] == [2, 3]
