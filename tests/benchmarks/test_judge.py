"""The benchmark: what is given, how it is scored, kept and reported."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.camera.reconstruction import Reconstruction
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.quality import QUALITIES, Quality
from addon.core.media.clip import open_footage
from benchmarks import cost, store
from benchmarks.accuracy import __main__ as bench
from benchmarks.accuracy import cases, oracle, plan, report
from benchmarks.accuracy import rows as row_file
from benchmarks.accuracy.cases import (
    STEADY,
    BenchmarkCase,
    FromVideo,
    GroundTruth,
)
from benchmarks.accuracy.judge import Judge
from benchmarks.accuracy.methods import METHODS, Answer, with_layers
from benchmarks.accuracy.plan import Part, stale
from benchmarks.accuracy.rows import Row
from benchmarks.accuracy.scenes import FRAMES, SIZE, Short, Staged
from sample_scenes import filming
from sample_scenes.stage import Stage

BLUR = 6


class Tiny(Staged):
    """The bars at 96x54 pixels."""

    @cached_property
    def stage(self) -> Stage:
        made = filming.load("bars")
        return replace(made, cameras=made.cameras.resized(96, 54))


@pytest.fixture(scope="module")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tiny]:
    patch = pytest.MonkeyPatch()
    patch.setattr(store, "FOLDER", tmp_path_factory.mktemp("bench"))
    before = bpy.context.window.scene
    scene = Tiny("bars", noise=0.02)
    yield scene
    patch.undo()
    bpy.context.window.scene = before
    bpy.data.scenes.remove(scene.scene)


@pytest.fixture(scope="module")
def rows(tiny: Tiny) -> dict[tuple[str, int], Row]:
    """Every method of track T1, at its smallest number of views."""
    known, judged = GroundTruth(tiny), Judge(tiny, BLUR)
    found = [judged.row("T1", known, name, min(method.views)) for name, method in METHODS.items()]
    return {(row.method, row.views): row for row in found}


def test_every_method_is_scored(tiny: Tiny, rows: dict[tuple[str, int], Row]) -> None:
    assert {name for name, _ in rows} == set(METHODS)
    for row in rows.values():
        assert not row.note
        assert row.frames == 3
        for name in (
            "psnr",
            "edge_psnr",
            "unclipped_psnr",
            "ssim",
            "flip",
            "rm",
            "rm_floor",
            "warped",
            "cpu_s",
            "wall_s",
        ):
            value = getattr(row, name)
            assert value is not None and np.isfinite(value), (row.method, name)
        picture = store.FOLDER / "pictures" / f"bars-T1-6px-{row.method.replace(' ', '_')}-{row.views}.png"
        assert picture.exists()
    triangles = {method: row.triangles for (method, _), row in rows.items()}
    assert triangles["dense mesh"] > 2 * 96 * 54 > 5 * triangles["layers"]
    assert min(triangles["layers"], triangles["features"]) > 20


def test_scores_are_in_the_order_that_must_be(rows: dict[tuple[str, int], Row]) -> None:
    score = {name: row.psnr for (name, _), row in rows.items()}
    assert score["no blur"] == min(score.values())
    assert score["oracle"] == max(score.values())
    # One surface, however fine, has nothing behind its edges.
    assert score["layers"] > max(score["dense mesh"], score["features"])


def test_the_same_mesh_through_cycles_scores_alike(tiny: Tiny) -> None:
    known, judged = GroundTruth(tiny), Judge(tiny, BLUR)
    ours, lens = (judged.row("T1", known, name, 64) for name in ("features", "Cycles"))
    assert ours.psnr == pytest.approx(lens.psnr, abs=0.3)


def scaled(rec: Reconstruction, by: float) -> Reconstruction:
    images = tuple(replace(image, translation=by * image.translation) for image in rec.images)
    return Reconstruction(rec.cameras, images, replace(rec.points, xyz=by * rec.points.xyz))


def test_the_amount_of_blur_is_set_whatever_the_scale_of_the_solve(
    tiny: Tiny, monkeypatch: pytest.MonkeyPatch
) -> None:
    true = GroundTruth(tiny).case(18, BLUR)
    monkeypatch.setattr(Tiny, "judged", lambda self, blur: (18,))
    solved = object.__new__(FromVideo)  # as if the clip had been solved seven times too large
    solved.scene, solved.reconstruction = tiny, scaled(true.reconstruction, 7.0)
    solved.clip = ClipContext(solved.reconstruction, tiny.frame)
    given = solved.case(18, BLUR)
    assert given.focus.points, "the focus was to be picked"
    # Four features around the picked place are not exactly as deep as the place.
    assert given.focus_depth == pytest.approx(7 * true.focus_depth, rel=0.02)
    assert given.radius == pytest.approx(7 * true.radius, rel=0.05)
    # With the focus in the air, between things, there is nothing to pick.
    monkeypatch.setattr(Tiny, "focus_depth", lambda self, frame, blur: 4.5)
    given = solved.case(18, BLUR)
    assert not given.focus.points
    assert given.focus_depth == pytest.approx(7 * 4.5)


def test_a_refusal_is_a_row(tiny: Tiny, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(given: object, views: int) -> None:
        raise UserError("not with me")

    monkeypatch.setitem(METHODS, "scatter", replace(METHODS["scatter"], run=refuse))
    row = Judge(tiny, BLUR).row("T1", GroundTruth(tiny), "scatter", 0)
    assert row.note == "not with me"
    assert row.psnr is None
    assert "not with me" in report.line(row)
    given = replace(GroundTruth(tiny).case(18, BLUR), layers=lambda margin: None)
    with pytest.raises(UserError, match="hides"):
        with_layers(given)


def test_a_run_resumes_and_repeats_what_has_changed(
    tiny: Tiny, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(row_file, "RESULTS", tmp_path)
    monkeypatch.setattr(plan, "METHODS", {name: METHODS[name] for name in ("no blur", "scatter")})
    monkeypatch.setattr(plan, "MAIN_BLUR", BLUR)
    monkeypatch.setattr(plan, "ALL_BLURS", (BLUR,))
    monkeypatch.setattr(plan, "Short", lambda name: tiny)
    monkeypatch.setattr(Tiny, "is_filmed", True, raising=False)
    part = Part(tracks=("T1",))

    def run() -> list[str]:
        todo = list(stale("bars", part, row_file.load()).reasons)
        bench.run_track(Judge(tiny, BLUR), "T1", todo)
        return [each.method for each in todo]

    assert run() == ["no blur", "scatter"]
    assert run() == []
    with row_file.changed() as book:
        row = book.rows["bars", "T1", "scatter", 0, BLUR]
        assert row.spent_s > 0 and "(20" in row.measured
        book.rows[row.key] = replace(row, inputs=row.inputs.partition("-")[0] + "-other code")
    told = stale("bars", part, row_file.load())
    assert str(told).startswith("bars         1 rows stale (1 code changed)")
    assert run() == ["scatter"]


def test_each_method_of_a_video_pays_for_depth_of_its_own_quality(
    tiny: Tiny, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Depth is kept before a row's clock starts, and what it costs is added to the row."""
    true = GroundTruth(tiny).reconstruction(tiny.judged(BLUR))
    solved = object.__new__(FromVideo)
    solved.scene, solved.reconstruction = tiny, true
    solved.clip = ClipContext(true, open_footage(tiny.clip()).read)
    known = dict[str, list[str]]()

    def note(quality: Quality, case: BenchmarkCase, views: int) -> Answer:
        known[quality.name] = [
            each.name for each in QUALITIES.values() if case.clip.stereo_of(each).kept(case.frame) is not None
        ]
        return Answer(case.picture[..., :3], 1)

    def charged[T](work: Callable[[], T]) -> tuple[T, cost.Cost]:
        return work(), cost.Cost(1000.0, 2000.0, 0.0)

    monkeypatch.setattr(row_file, "RESULTS", tmp_path)
    monkeypatch.setattr(bench, "given_by", lambda track, scene: solved)
    monkeypatch.setattr(cases, "measured", charged)
    for quality in QUALITIES.values():
        monkeypatch.setitem(METHODS, quality.name, replace(METHODS[quality.name], run=partial(note, quality)))
    bench.run_track(Judge(tiny, BLUR), "T2", [plan.Wanted(BLUR, "T2", name, 0) for name in QUALITIES])
    assert known == {name: [name] for name in QUALITIES}
    for row in row_file.load().rows.values():
        assert row.cpu_s is not None and row.wall_s is not None
        assert row.cpu_s >= 1000 / STEADY and row.wall_s >= 2000 / STEADY


def test_a_plan_is_of_all_scenes_and_may_be_of_a_part() -> None:
    whole = [each for name in filming.STAGES for each in plan.wanted(name, Part())]
    assert {each.method for each in whole} == set(METHODS)
    assert {each.blur for each in plan.wanted("bars", Part())} == {plan.MAIN_BLUR}
    assert {each.blur for each in plan.wanted(plan.BLURRED, Part())} == set(plan.ALL_BLURS)
    asked = list(plan.wanted("stroller", Part(tracks=("T2",), blurs=(48,), methods=("scatter",))))
    assert asked == [plan.Wanted(48, "T2", "scatter", 0)]
    assert plan.possible(("bars", "T1", "layers", 256, plan.MAIN_BLUR))
    assert not plan.possible(("bars", "T1", "layers", 256, 32))


def test_two_processes_write_one_results_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(row_file, "RESULTS", tmp_path)
    monkeypatch.setattr(store, "FOLDER", tmp_path)

    def add(number: int) -> None:
        with row_file.changed() as book:
            row = Row("bars", "T1", "layers", number, BLUR, 2, "", 40.0, psnr=30.0)
            book.rows[row.key] = row

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(add, range(40)))
    assert len(row_file.load().rows) == 40


def test_a_scene_of_the_benchmark_is_a_cut_of_the_sample_scene() -> None:
    whole, short = filming.load("fence"), Short("fence")
    stage, first = short.stage, len(whole.cameras) // 2 - FRAMES // 2
    assert len(stage.cameras) == len(stage.focus) == FRAMES
    assert (stage.cameras.width, stage.cameras.height) == SIZE
    part = slice(first, first + FRAMES)
    np.testing.assert_array_equal(stage.cameras.centres, whole.cameras.centres[part])
    np.testing.assert_allclose(stage.focus_xy, whole.focus_xy[part] * SIZE[0] / whole.cameras.width)
    for cut, thing in zip(stage.things, whole.things, strict=True):
        for index in (0, FRAMES - 1):
            np.testing.assert_array_equal(cut.pose(index)[1], thing.pose(first + index)[1])
    assert short.judged(24) == (FRAMES // 2, FRAMES // 2 + 1)


def test_tables_and_plots_tell_every_row(rows: dict[tuple[str, int], Row], tmp_path: Path) -> None:
    noisy = replace(rows["scatter", 0], noise_ceiling=1.0)
    refused = replace(rows["no blur", 0], psnr=None, note="no parallax", track="T2")
    found = [*rows.values(), noisy, refused]
    text = report.write(
        tmp_path, row_file.Book(96, rows={(*row.key, row.noise_ceiling): row for row in found})
    )
    assert f"{noisy.psnr:.2f}*" in text or f"{noisy.psnr:.2f}***" in text
    assert "no parallax" in text
    # A head and a line each of T1, T2 and the summary, and the summary's row.
    assert text.count("\n| ") == len(found) + 2 + 2
    assert {path.name for path in tmp_path.iterdir()} == {"bench.md", "bench.png"}


def test_the_summary_tells_how_far_it_is_from_the_thesis_to_the_oracle(
    rows: dict[tuple[str, int], Row],
) -> None:
    named = {name: row for (name, _), row in rows.items()}
    half = replace(named["layers"], psnr=30.0, edge_psnr=None, flip=0.1, rm=0.005, rm_floor=0.003)
    made = [
        replace(named["thesis"], psnr=20.0, flip=0.4, rm=0.0085, rm_floor=0.003),
        half,
        replace(named["known fill"], psnr=35.0, edge_psnr=None),
        replace(named["oracle"], psnr=40.0),
        replace(named["Defocus"], psnr=29.0),
    ]
    last = row_file.summary(made).strip().splitlines()[-1]
    assert "| 20.00 | 29.00 | 30.00 | 40.00 | 50 % | - | 75 % / - |" in last
    assert "| 0.25 | 0.50 |" in last


def test_an_oracle_sees_behind_an_edge() -> None:
    behind = np.ones((64, 64, 4), np.float32)
    before = np.zeros((64, 64, 4), np.float32)
    before[:, 32:, 3] = 1  # black, opaque, on the right half
    layers = oracle.LayeredDepthImage(
        (
            oracle.Layer(behind, np.full((64, 64), 1 / 4, np.float32)),
            oracle.Layer(before, np.full((64, 64), 1 / 2, np.float32)),
        ),
        0,
        (0, 0, 0),
    )
    out = oracle.render(layers, focal=160, radius=0.25, focus=4.0, views=512)[32, :, 0]
    # D = 2 * 0.25 * 160 * (1/2 - 1/4) = 20 pixels around the edge at x = 32
    np.testing.assert_allclose(out[:21], 1, atol=1e-6)
    np.testing.assert_allclose(out[43:], 0, atol=1e-6)
    # Share of a disc to the left of a chord at distance d: 1/2 + (d sqrt(1-d^2) + asin d) / pi.
    d = (32 - (np.arange(24, 40) + 0.5)) / 10
    np.testing.assert_allclose(out[24:40], 0.5 + (d * np.sqrt(1 - d**2) + np.arcsin(d)) / np.pi, atol=0.02)


def test_digests_tell_things_apart(tmp_path: Path) -> None:
    one = filming.load("bars")
    assert store.digest(one) == store.digest(filming.load("bars"))
    assert store.digest(one) != store.digest(replace(one, air=(0.0, 0.0, 0.1)))
    moved = one.focus.copy()
    moved[3, 0] += 1e-9
    assert store.digest(one) != store.digest(replace(one, focus=moved))
    assert store.digest((1, (2, 3))) != store.digest((1, 2, 3))
    file = tmp_path / "code.py"
    file.write_text("a")
    before = store.digest(file)
    file.write_text("b")
    assert store.digest(file) != before
