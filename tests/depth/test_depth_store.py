"""Depth that is kept on disk: the same when it is read again, and never a reason to fail."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from addon.core.base.arrays import Floats
from addon.core.base.errors import UserError
from addon.core.base.file_lock import FileLock
from addon.core.depth import depth_store
from addon.core.depth.depth_store import FINEST, SUREST, DepthStore, KeptDepth, delete_kept, kept_numbers

SHAPE = (30, 40)


def some(seed: int = 0) -> KeptDepth:
    dice = np.random.default_rng(seed)
    inverse = dice.uniform(0.01, 3.0, SHAPE).astype(np.float32)
    past = dice.uniform(0.5, 9.0, (SHAPE[0] + 8, SHAPE[1] + 8)).astype(np.float32)
    past[dice.random(past.shape) > 0.3] = np.nan
    return KeptDepth.of(inverse, dice.random(SHAPE).astype(np.float32), dice.random(SHAPE) > 0.5, past)


def same(one: KeptDepth | None, other: KeptDepth) -> bool:
    return one is not None and all(
        np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True)
        for name in ("inverse_depth", "confidence", "moving", "past_border")
    )


def test_what_is_kept_is_within_half_a_step() -> None:
    inverse = np.linspace(0.2, 1.7, 1200, dtype=np.float32).reshape(SHAPE)
    kept = KeptDepth.of(inverse, np.full(SHAPE, 0.3, np.float32), np.zeros(SHAPE, bool))
    assert np.abs(kept.inverse_depth - inverse).max() <= 0.51 * 1.5 / FINEST + 1e-7
    assert np.abs(kept.confidence - 0.3).max() <= 0.51 / SUREST
    flat = KeptDepth.of(np.full(SHAPE, 0.7, np.float32), kept.confidence, kept.moving)
    np.testing.assert_array_equal(flat.inverse_depth, np.float32(0.7))
    assert np.isnan(flat.past_border).all()
    past = np.where(inverse > 1, 30 * inverse, np.float32(np.nan))
    kept = KeptDepth.of(inverse, np.full(SHAPE, 0.3, np.float32), np.zeros(SHAPE, bool), past)
    np.testing.assert_allclose(kept.past_border, past, atol=0.51 * 21 / FINEST)


def test_it_is_read_as_it_was_kept(tmp_path: Path) -> None:
    DepthStore(tmp_path, lambda: "a").keep_depth(7, some())
    again = DepthStore(tmp_path, lambda: "a")
    assert same(again.depth(7, SHAPE), some())
    assert again.depth(8, SHAPE) is None and again.depth(7, (30, 41)) is None
    assert DepthStore(tmp_path, lambda: "b").depth(7, SHAPE) is None
    assert not list(tmp_path.rglob(".part-*"))


def made(
    store: DepthStore, frames: Sequence[int], make: Callable[[int], np.ndarray]
) -> dict[int, np.ndarray]:
    """Arrays of frames, as they are kept or made."""

    def name(frame: int) -> str:
        return f"lamps-{frame:06d}"

    def read(frame: int) -> np.ndarray | None:
        kept = store.read(name(frame), ("found",))
        return kept and kept["found"]

    def kept(frame: int) -> np.ndarray:
        found = make(frame)
        store.write(name(frame), {"found": found})
        return found

    return store.made(frames, name, read, kept)


def test_what_is_kept_is_made_once(tmp_path: Path) -> None:
    calls = list[int]()

    def make(frame: int) -> np.ndarray:
        calls.append(frame)
        return np.arange(4)

    for _ in range(2):
        np.testing.assert_array_equal(made(DepthStore(tmp_path, lambda: "a"), [3], make)[3], np.arange(4))
    assert calls == [3]


def test_several_share_what_is_to_be_made(tmp_path: Path) -> None:
    calls, frames = list[int](), range(12)

    def make(frame: int) -> np.ndarray:
        calls.append(frame)
        time.sleep(0.02)
        return np.full((4, 6), frame % 2 > 0)

    def work(_: int) -> dict[int, np.ndarray]:
        return made(DepthStore(tmp_path, lambda: "a"), frames, make)

    with ThreadPoolExecutor(3) as pool:
        answers = list(pool.map(work, range(3)))
    assert sorted(calls) == list(frames)
    for answer in answers:
        assert all(np.all(answer[frame] == frame % 2) for frame in frames)
    assert not list(tmp_path.rglob("*.lock"))


def test_what_another_holds_for_too_long_is_made_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(depth_store, "PATIENCE", 0.1)
    store = DepthStore(tmp_path, lambda: "a")
    (tmp_path / "a").mkdir()
    with FileLock(tmp_path / "a" / "lamps-000002.lock", UserError):
        found = made(store, [1, 2], lambda frame: np.arange(frame))
    assert sorted(found) == [1, 2]


def test_what_frames_are_found_from_goes_first(tmp_path: Path) -> None:
    kept, key = some(), "a"
    DepthStore(tmp_path, lambda: key).keep_depth(1, kept, "single")
    size = next(tmp_path.rglob("single-*.npz")).stat().st_size
    store = DepthStore(tmp_path, lambda: key, most=size + size // 2)
    store.keep_depth(2, kept, "coarse")
    assert store.problem is not None
    store.keep_depth(1, kept)
    assert store.problem is None
    assert [path.name for path in tmp_path.rglob("*.npz")] == ["depth-000001.npz"]


@pytest.mark.parametrize("damage", ["empty", "cut", "noise", "other"])
def test_a_damaged_file_is_not_there(tmp_path: Path, damage: str) -> None:
    store = DepthStore(tmp_path, lambda: "a")
    store.keep_depth(1, some())
    (path,) = (tmp_path / "a").iterdir()
    data = path.read_bytes()
    noise = np.random.default_rng(0).bytes(len(data))
    path.write_bytes({"empty": b"", "cut": data[: len(data) // 2], "noise": noise, "other": b"PK"}[damage])
    assert store.depth(1, SHAPE) is None
    store.keep_depth(1, some(1))
    assert same(store.depth(1, SHAPE), some(1))


def test_nothing_fails_where_nothing_can_be_kept(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    store = DepthStore(tmp_path / "file", lambda: "a")
    store.keep_depth(1, some())
    assert store.depth(1, SHAPE) is None


def test_numbers_of_a_clip_are_made_once_and_again_where_they_are_damaged(tmp_path: Path) -> None:
    made = list[int]()

    def numbers(count: int = 3) -> Floats:
        made.append(count)
        return np.linspace(0.1, 0.7, count)

    first = kept_numbers(DepthStore(tmp_path, lambda: "key"), "clip-noise", (0, 3), numbers)
    again = kept_numbers(DepthStore(tmp_path, lambda: "key"), "clip-noise", (0, 3), numbers)
    np.testing.assert_array_equal(first, again)
    assert len(made) == 1

    store = DepthStore(tmp_path, lambda: "key")
    store.write("clip-noise", {"numbers": np.array([1.0, np.nan, 2.0])})
    np.testing.assert_array_equal(kept_numbers(store, "clip-noise", (0, 3), numbers), first)
    kept_numbers(store, "clip-noise", (0, 4), lambda: numbers(4))
    assert made == [3, 3, 4]
    assert delete_kept(tmp_path) > 0
    assert not list(tmp_path.glob("*/clip-*"))


def test_processes_that_need_a_result_of_the_clip_wait_for_one_another(tmp_path: Path) -> None:
    made = list[int]()

    def numbers() -> Floats:
        made.append(1)
        time.sleep(0.2)
        return np.arange(3.0)

    def work(_: int) -> Floats:
        return kept_numbers(DepthStore(tmp_path, lambda: "key"), "clip-noise", (0, 3), numbers)

    with ThreadPoolExecutor(3) as pool:
        answers = list(pool.map(work, range(3)))
    assert made == [1]
    np.testing.assert_array_equal(answers, 3 * [np.arange(3.0)])
    assert not list(tmp_path.rglob("*.lock"))


def test_a_result_of_the_clip_is_made_all_the_same_if_another_holds_it_too_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(depth_store, "LONG_PATIENCE", 0.1)
    store = DepthStore(tmp_path, lambda: "key")
    (tmp_path / "key").mkdir()
    with FileLock(tmp_path / "key" / "clip-noise.lock", UserError):
        found = kept_numbers(store, "clip-noise", (0, 3), lambda: np.arange(3.0))
    np.testing.assert_array_equal(found, np.arange(3.0))


def test_what_is_not_ours_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "0001.exr").write_bytes(bytes(4000))
    DepthStore(tmp_path, lambda: "mine").keep_depth(1, some())
    size = (tmp_path / "mine" / "depth-000001.npz").stat().st_size
    store = DepthStore(tmp_path, lambda: "new", most=3 * size // 2)
    store.keep_depth(1, some())
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["0001.exr"]
    assert same(store.depth(1, SHAPE), some())


def test_what_is_found_of_a_clip_that_changed_meanwhile_is_not_kept(tmp_path: Path) -> None:
    keys = iter("aab")
    store = DepthStore(tmp_path, lambda: next(keys))
    for frame in (1, 2):
        store.keep_depth(frame, some())
    assert same(store.depth(1, SHAPE), some()) and store.depth(2, SHAPE) is None
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_the_oldest_keys_go_first_and_what_is_too_much_is_not_kept(tmp_path: Path) -> None:
    for age, key in enumerate(("old", "older")):
        DepthStore(tmp_path, partial(str, key)).keep_depth(1, some())
        os.utime(tmp_path / key, (1000 - age, 1000 - age))
    one = sum(path.stat().st_size for path in (tmp_path / "old").iterdir())
    store = DepthStore(tmp_path, lambda: "new", most=int(2.5 * one))
    store.keep_depth(1, some())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["new", "old"]
    for frame in (2, 3):
        store.keep_depth(frame, some())
    assert [path.name for path in tmp_path.iterdir()] == ["new"]
    assert store.depth(2, SHAPE) is not None and store.depth(3, SHAPE) is None
