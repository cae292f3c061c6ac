"""Results that are kept on disk: the same when they are read again, and never a reason to fail."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from addon.core.base import store as stores
from addon.core.base.arrays import Map
from addon.core.base.errors import UserError
from addon.core.base.file_lock import FileLock
from addon.core.base.store import NOT_KEPT, Entry, Store
from addon.core.camera.intrinsics import Intrinsics
from addon.core.depth.multi_view_stereo import DenseDepth
from addon.core.depth.stored_depth import FINEST, SUREST, depth_entry

SHAPE = (30, 40)
LENS = Intrinsics(40, 30, 40.0, 40.0, 20.0, 15.0)


def dense(inverse: Map, confidence: Map, moving: np.ndarray, past: Map | None = None) -> DenseDepth:
    return DenseDepth(1, inverse, confidence, moving, LENS, past)


def some(seed: int = 0) -> DenseDepth:
    dice = np.random.default_rng(seed)
    inverse = dice.uniform(0.01, 3.0, SHAPE).astype(np.float32)
    past = dice.uniform(0.5, 9.0, (SHAPE[0] + 8, SHAPE[1] + 8)).astype(np.float32)
    past[dice.random(past.shape) > 0.3] = np.nan
    return dense(inverse, dice.random(SHAPE).astype(np.float32), dice.random(SHAPE) > 0.5, past)


def keep(store: Store, frame: int, depth: DenseDepth, kind: str = "depth") -> DenseDepth:
    return store.get(depth_entry(kind, frame, LENS), lambda: depth)


def kept(store: Store, frame: int, lens: Intrinsics = LENS) -> DenseDepth | None:
    return store.read(depth_entry("depth", frame, lens))


def rounded(depth: DenseDepth) -> DenseDepth:
    """As a store returns it that keeps nothing."""
    return keep(NOT_KEPT, 1, depth)


def same(one: DenseDepth | None, other: DenseDepth) -> bool:
    return one is not None and all(
        np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True)
        for name in ("inverse_depth", "confidence", "moving", "past_border")
    )


def test_what_is_kept_is_within_half_a_step() -> None:
    inverse = np.linspace(0.2, 1.7, 1200, dtype=np.float32).reshape(SHAPE)
    found = rounded(dense(inverse, np.full(SHAPE, 0.3, np.float32), np.zeros(SHAPE, bool)))
    assert np.abs(found.inverse_depth - inverse).max() <= 0.51 * 1.5 / FINEST + 1e-7
    assert np.abs(found.confidence - 0.3).max() <= 0.51 / SUREST
    flat = rounded(dense(np.full(SHAPE, 0.7, np.float32), found.confidence, found.moving))
    np.testing.assert_array_equal(flat.inverse_depth, np.float32(0.7))
    assert flat.past_border is not None and np.isnan(flat.past_border).all()
    past = np.where(inverse > 1, 30 * inverse, np.float32(np.nan))
    found = rounded(dense(inverse, np.full(SHAPE, 0.3, np.float32), np.zeros(SHAPE, bool), past))
    assert found.past_border is not None
    np.testing.assert_allclose(found.past_border, past, atol=0.51 * 21 / FINEST)


def test_it_is_read_as_it_was_kept(tmp_path: Path) -> None:
    assert same(keep(Store(tmp_path, lambda: "a"), 7, some()), rounded(some()))
    again = Store(tmp_path, lambda: "a")
    assert same(kept(again, 7), rounded(some()))
    assert kept(again, 8) is None and kept(again, 7, Intrinsics(41, 30, 40.0, 40.0, 20.0, 15.0)) is None
    assert kept(Store(tmp_path, lambda: "b"), 7) is None
    assert not list(tmp_path.rglob(".part-*"))


def made(store: Store, frames: Sequence[int], make: Callable[[int], np.ndarray]) -> dict[int, np.ndarray]:
    """Arrays of frames, as they are kept or made."""
    names = {frame: f"lamps-{frame:06d}" for frame in frames}
    entries = {
        frame: Entry[np.ndarray](
            name, ("found",), lambda found: {"found": found}, lambda parts: parts["found"]
        )
        for frame, name in names.items()
    }
    return store.made(entries, make)


def test_several_share_what_is_to_be_made(tmp_path: Path) -> None:
    calls, frames = list[int](), range(12)

    def make(frame: int) -> np.ndarray:
        calls.append(frame)
        time.sleep(0.02)
        return np.full((4, 6), frame % 2 > 0)

    def work(_: int) -> dict[int, np.ndarray]:
        return made(Store(tmp_path, lambda: "a"), frames, make)

    with ThreadPoolExecutor(3) as pool:
        answers = list(pool.map(work, range(3)))
    assert sorted(calls) == list(frames)
    for answer in answers:
        assert all(np.all(answer[frame] == frame % 2) for frame in frames)
    assert not list(tmp_path.rglob("*.lock"))


def test_what_another_holds_for_too_long_is_made_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stores, "PATIENCE", 0.1)
    store = Store(tmp_path, lambda: "a")
    (tmp_path / "a").mkdir()
    with FileLock(tmp_path / "a" / "lamps-000002.lock", UserError):
        found = made(store, [1, 2], lambda frame: np.arange(frame))
    assert sorted(found) == [1, 2]


@pytest.mark.parametrize("damage", ["empty", "cut", "noise", "other"])
def test_a_damaged_file_is_not_there(tmp_path: Path, damage: str) -> None:
    store = Store(tmp_path, lambda: "a")
    keep(store, 1, some())
    (path,) = (tmp_path / "a").iterdir()
    data = path.read_bytes()
    noise = np.random.default_rng(0).bytes(len(data))
    path.write_bytes({"empty": b"", "cut": data[: len(data) // 2], "noise": noise, "other": b"PK"}[damage])
    assert kept(store, 1) is None
    keep(store, 1, some(1))
    assert same(kept(store, 1), rounded(some(1)))


def test_what_is_not_ours_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "0001.exr").write_bytes(bytes(4000))
    keep(Store(tmp_path, lambda: "mine"), 1, some())
    size = (tmp_path / "mine" / "depth-000001.npz").stat().st_size
    store = Store(tmp_path, lambda: "new", most=3 * size // 2)
    keep(store, 1, some())
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["0001.exr"]
    assert same(kept(store, 1), rounded(some()))


def test_what_is_found_of_a_clip_that_changed_meanwhile_is_not_kept(tmp_path: Path) -> None:
    keys = iter("aab")
    store = Store(tmp_path, lambda: next(keys))
    for frame in (1, 2):
        keep(store, frame, some())
    assert same(kept(store, 1), rounded(some())) and kept(store, 2) is None
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_the_oldest_keys_go_first_and_what_is_too_much_is_not_kept(tmp_path: Path) -> None:
    for age, key in enumerate(("old", "older")):
        keep(Store(tmp_path, partial(str, key)), 1, some())
        os.utime(tmp_path / key, (1000 - age, 1000 - age))
    one = sum(path.stat().st_size for path in (tmp_path / "old").iterdir())
    store = Store(tmp_path, lambda: "new", most=int(2.5 * one))
    keep(store, 1, some())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["new", "old"]
    for frame in (2, 3):
        keep(store, frame, some())
    assert [path.name for path in tmp_path.iterdir()] == ["new"]
    assert kept(store, 2) is not None and kept(store, 3) is None
