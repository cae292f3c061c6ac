"""The plane sweep on a GPU against the processor's, and who sweeps where. What draws here is software: it is
made to sweep, which products leave to the processor."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.base.arrays import Floats, Map
from addon.core.base.errors import UserError
from addon.core.base.file_lock import FileLock
from addon.core.base.progress import Cancelled, reporting
from addon.core.base.store import Store, delete_kept
from addon.core.depth import matching
from addon.core.depth.matching import Winners
from addon.core.depth.multi_view_stereo import PlaneSweepStereo
from addon.core.depth.stored_depth import depth_entry
from addon.core.media.clip import open_footage
from addon.core.readers.matching import Imported
from addon.core.sfm.workspace import keep_import
from addon.render.views.gpu_views import gpu_problem
from addon.scene.gpu import gpu_matcher, gpu_sweep, gpu_sweep_shaders

from ..command_line import done
from ..planes import (
    CENTRES,
    HEIGHT,
    LENS,
    MIDDLE,
    RANGE,
    WIDTH,
    clip,
    features,
    halved,
    poses,
    truth,
    write_clip,
)
from ..scenes import psnr

pytestmark = pytest.mark.skipif(bool(gpu_problem()), reason="only CI is sure to have a GPU driver")
HALF = 0.5
"""Of a level."""
HALVED = LENS.scaled(WIDTH // 2, HEIGHT // 2)


@pytest.fixture(autouse=True)
def afresh(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A process that has not asked its GPU yet, and shares it with no other test process."""
    monkeypatch.setattr(gpu_matcher, "_problem", None)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.delenv(gpu_matcher.GPU, raising=False)


@pytest.fixture
def forced(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(gpu_matcher.GPU, "1")


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[tuple[int, int]]]:
    """Sizes (height, width) of the pictures that the GPU has swept."""
    swept: list[tuple[int, int]] = []
    sweep = gpu_sweep.winning_levels

    def counted(picture, *others):  # type: ignore[no-untyped-def]
        swept.append(picture.shape[:2])
        return sweep(picture, *others)

    monkeypatch.setattr(gpu_sweep, "winning_levels", counted)
    yield swept


def both(*given: object) -> tuple[Winners, Winners]:
    """What the processor and what the GPU finds."""
    ours, its = matching.winning_levels(*given), gpu_sweep.winning_levels(*given)  # type: ignore[arg-type]
    assert its.level.shape == its.rivals.shape == its.cost.shape == its.spread.shape == ours.level.shape
    return ours, its


def off(ours: Winners, its: Winners) -> Floats:
    """(h, w) levels that they are apart."""
    return np.asarray(np.abs(ours.level - its.level))


@pytest.mark.parametrize("case", ["one side", "few levels", "seen by none", "narrow"])
def test_levels_are_the_processors(case: str) -> None:
    picture, views, levels, guide, known = gpu_matcher.sample()
    if case == "one side":
        views = [view for view in views if view.side < 0]
    elif case == "few levels":
        levels, known = np.linspace(0, 2, 5), known / 3
    elif case == "seen by none":
        views = [replace(view, picture=np.zeros_like(view.picture)) for view in views]
    elif case == "narrow":
        picture, guide, known = (np.ascontiguousarray(part[:9, :5]) for part in (picture, guide, known))
    ours, its = both(picture, views, levels, guide, known)
    assert off(ours, its).max() < 0.05
    np.testing.assert_allclose(its.cost, ours.cost, atol=0.05)
    np.testing.assert_allclose(its.spread, ours.spread, atol=0.05)
    assert np.mean(its.rivals == ours.rivals) > 0.99


def test_depth_of_a_clip_is_that_of_the_planes_and_the_processors() -> None:
    """Whole depth of a frame: 320 x 240 pixels, its neighbours chosen, its exposures matched."""
    pictures, shot = clip(CENTRES), poses(CENTRES, features())

    def found(matcher: matching.Matcher) -> tuple[Map, Map]:
        dense = PlaneSweepStereo(shot, lambda n: pictures[n - 1], matcher=matcher).at(MIDDLE)
        return dense.inverse_depth, dense.confidence

    (ours, sure), (its, its_sure) = found(matching.winning_levels), found(gpu_sweep.winning_levels)
    level = RANGE / 64
    """Of the finest sweep there is: depth levels are at least so far apart."""
    assert np.mean(np.abs(ours - its) < HALF * level) > 0.999
    assert np.mean(np.abs(sure - its_sure) < 0.05) > 0.999
    assert np.median(np.abs(its - truth(CENTRES[MIDDLE - 1]))) < 0.02 * RANGE


def test_a_software_renderer_leaves_it_to_the_processor(calls: list[tuple[int, int]]) -> None:
    if gpu_matcher.is_real():
        pytest.skip("a real GPU draws here")
    given = gpu_matcher.sample()
    found = gpu_matcher.winning_levels(*given)
    assert not calls and np.array_equal(found.level, matching.winning_levels(*given).level)


def test_a_gpu_is_compared_once_and_then_sweeps(forced: None, calls: list[tuple[int, int]]) -> None:
    picture, *others = gpu_matcher.sample()
    for _ in range(3):
        gpu_matcher.winning_levels(picture, *others)
    assert calls == 4 * [picture.shape[:2]]


@pytest.mark.parametrize("name, right, wrong", [
    ("gather", "imageStore(costs", "imageStore(nothing"),  # It does not compile.
    ("paths", "min(min(old, beside)", "min(min(old, old)"),  # It gives another picture.
    ("finish", "spreads, at, vec4(", "spreads, at, vec4(0.0 / 0.0 + "),  # It gives none.
])  # fmt: skip
def test_a_gpu_that_differs_is_left_alone(
    name: str,
    right: str,
    wrong: str,
    forced: None,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    program = gpu_sweep_shaders.PROGRAMS[name]
    assert right in program.source
    broken = replace(program, source=program.source.replace(right, wrong))
    monkeypatch.setitem(gpu_sweep_shaders.PROGRAMS, name, broken)
    given = gpu_matcher.sample()
    for _ in range(2):
        found = gpu_matcher.winning_levels(*given)
        assert np.array_equal(found.level, matching.winning_levels(*given).level)
    assert capfd.readouterr().err.count("note: depth is found on the CPU instead of the GPU (") == 1


def test_a_gpu_that_fails_later_is_replaced(
    forced: None, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    given = gpu_matcher.sample()
    gpu_matcher.winning_levels(*given)

    def lost(*_: object) -> Winners:
        raise RuntimeError("the device was lost")

    monkeypatch.setattr(gpu_sweep, "winning_levels", lost)
    for _ in range(2):
        found = gpu_matcher.winning_levels(*given)
        assert np.array_equal(found.level, matching.winning_levels(*given).level)
    assert capfd.readouterr().err.count("the device was lost") == 1


def test_the_processor_sweeps_while_another_process_has_the_gpu(
    forced: None, monkeypatch: pytest.MonkeyPatch, calls: list[tuple[int, int]]
) -> None:
    given = gpu_matcher.sample()
    gpu_matcher.winning_levels(*given)
    calls.clear()
    monkeypatch.setattr(gpu_matcher, "PATIENCE", 0.05)
    with gpu_matcher._turn():
        (lock,) = Path(tempfile.gettempdir()).glob("*.lock")
        with pytest.raises(UserError):
            FileLock(lock, UserError, 0.0)
        gpu_matcher.winning_levels(*given)
    assert not calls
    gpu_matcher.winning_levels(*given)
    assert calls


def test_a_sweep_ends_where_the_user_wants_no_more(forced: None) -> None:
    given, seen = gpu_matcher.sample(), list[float]()

    def enough(_stage: str, share: float) -> None:
        seen.append(share)
        if len(seen) == 4:
            raise Cancelled

    # While it is compared nothing is known of the GPU yet.
    with pytest.raises(Cancelled), reporting(enough):
        gpu_matcher.winning_levels(*given)
    assert gpu_matcher._problem is None
    gpu_matcher.winning_levels(*given)
    seen.clear()
    with pytest.raises(Cancelled), reporting(enough):
        gpu_matcher.winning_levels(*given)
    assert len(set(seen[1:])) == 3 and seen == sorted(seen) and seen[-1] < 1
    # The GPU is well, and nobody has it.
    gpu_matcher.winning_levels(*given)
    assert gpu_matcher._problem == ""


@pytest.fixture
def work(registered: None, tmp_path: Path) -> Path:
    """A working folder with the planes' solve, of pictures of 160x120 pixels."""
    shot = write_clip(tmp_path / "clip", halved(clip(CENTRES)))
    solved = Imported(poses(CENTRES, features(), HALVED), "true cameras", ())
    keep_import(solved, open_footage(shot), tmp_path / "work")
    return tmp_path / "work"


def found_by(wish: str, *command: object) -> None:
    """A command with the GPU (1) or without (0)."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(gpu_matcher.GPU, wish)
        done(*command)


def test_depth_of_a_solve_is_found_by_it(calls: list[tuple[int, int]], work: Path) -> None:
    """`depth`, from the command to what is kept."""
    kept = []
    for wish in ("1", "0"):
        found_by(wish, "depth", work, "--frames", f"{MIDDLE}-{MIDDLE}")
        if wish == "1":
            assert (HALVED.height, HALVED.width) in calls and gpu_matcher._problem == ""
            calls.clear()
        (folder,) = {path.parent for path in (work / "depth").rglob("depth-*.npz")}
        store = Store(folder.parent, lambda name=folder.name: name)
        depth = store.read(depth_entry("depth", MIDDLE, HALVED))
        assert depth is not None
        kept.append(depth.inverse_depth)
        delete_kept(work / "depth")
    assert not calls
    its, ours = kept
    assert np.mean(np.abs(its - ours) < HALF * RANGE / 64) > 0.99
    assert np.median(np.abs(its - truth(CENTRES[MIDDLE - 1], HALVED))) < 0.02 * RANGE


@pytest.mark.long
def test_a_render_sweeps_in_the_context_that_the_engine_has(
    calls: list[tuple[int, int]], work: Path, tmp_path: Path
) -> None:
    pictures = []
    lens = ("--focus-distance", 6, "--blur", 0.05, "--views", 8)
    for wish in ("1", "0"):
        found_by(
            wish,
            "render",
            work,
            *lens,
            "--frames",
            f"{MIDDLE}-{MIDDLE}",
            "--out",
            tmp_path / wish / "####.png",
        )
        if wish == "1":
            assert (HALVED.height, HALVED.width) in calls and gpu_matcher._problem == ""
            calls.clear()
        pictures.append(cv2.imread(str(tmp_path / wish / f"{MIDDLE:04d}.png")) / 255)
        delete_kept(work / "depth")
    assert not calls and pictures[0].std() > 0.05
    assert psnr(*pictures) > 45
