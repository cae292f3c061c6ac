"""A street of lamps whose highlights are kept: found once, by any process, and the same ever after."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, lru_cache
from pathlib import Path

import numpy as np
import pytest

from addon.core.base.arrays import LinearRGBA
from addon.core.base.store import NOT_KEPT, Store
from addon.core.frame.clip_context import ClipContext, no_picture
from addon.core.frame.highlights import RESTORED
from addon.core.media.light import to_linear
from addon.core.media.picture_file import Pixels
from addon.core.warp import clipped_blobs as blobs
from addon.core.warp.highlights import lamps
from benchmarks.night_street import NightStreet

from ..variants import combined

STREET = NightStreet((320, 180), 12, 60)
FRAME = 6

read = lru_cache(maxsize=STREET.count)(STREET.read)


def street(store: Store = NOT_KEPT, pictures: Callable[[int], Pixels] = read) -> ClipContext:
    return replace(STREET.context, read=pictures, clip_store=store)


def only(frame: int) -> Pixels:
    return read(frame) if frame == FRAME else no_picture(frame)


@cache
def found() -> LinearRGBA:
    return street().picture(FRAME, RESTORED)


def test_lamps_of_a_street_get_light() -> None:
    before = to_linear(read(FRAME))
    lit = (found() > before).any(axis=2)
    assert lit.sum() > 300
    assert (before[lit].max(axis=1) >= RESTORED.threshold).all()
    assert found().max() > 5


def test_what_is_kept_is_what_was_found_and_no_other_frame_is_read_for_it(tmp_path: Path) -> None:
    first = street(Store(tmp_path, lambda: "a"))
    assert not first.knows_highlights(FRAME, RESTORED)
    np.testing.assert_array_equal(first.picture(FRAME, RESTORED), found())
    again = street(Store(tmp_path, lambda: "a"), only)
    assert again.knows_highlights(FRAME, RESTORED)
    np.testing.assert_array_equal(again.picture(FRAME, RESTORED), found())
    # Of another clip, or at another threshold, nothing is kept.
    assert not street(Store(tmp_path, lambda: "b")).knows_highlights(FRAME, RESTORED)
    assert not again.knows_highlights(FRAME, replace(RESTORED, threshold=0.9))


@pytest.mark.parametrize(("kind", "damage"), combined(["lost", "lamps"], ["cut", "noise", "other"]))
def test_a_damaged_file_is_not_there(tmp_path: Path, kind: str, damage: str) -> None:
    street(Store(tmp_path, lambda: "a")).picture(FRAME, RESTORED)
    files = sorted(tmp_path.rglob("*.npz"))
    others = [path for path in files if not path.name.startswith(kind)]
    for path in files:
        if kind == "lamps" or path.name.startswith(kind):
            data = path.read_bytes()
            noise = np.random.default_rng(0).bytes(len(data))
            path.write_bytes({"cut": data[:-9], "noise": noise, "other": others[0].read_bytes()}[damage])
    np.testing.assert_array_equal(street(Store(tmp_path, lambda: "a")).picture(FRAME, RESTORED), found())


def test_a_lamp_tells_the_same_alone_and_among_others() -> None:
    picture = to_linear(read(FRAME))
    every = blobs.clipped_blobs(picture, RESTORED.threshold)
    told = lamps(every)
    for number in (0, len(every) // 2, len(every) - 1):
        x, y = every.centre[number] * STREET.size
        alone = picture.copy()
        away = np.hypot(np.arange(180)[:, None] + 0.5 - y, np.arange(320) + 0.5 - x)
        others = (away > 12) & (alone[..., :3].max(axis=2) >= RESTORED.threshold)
        alone[others, :3] = 0.02
        single = blobs.clipped_blobs(alone, RESTORED.threshold)
        same = int(np.argmin(np.hypot(*(single.centre - every.centre[number]).T)))
        evidence = lamps(replace(single, spread=every.spread)).evidence[same]
        np.testing.assert_allclose(np.exp(evidence), np.exp(told.evidence[number]), atol=1e-3)
