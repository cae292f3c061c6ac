"""Bodies that walk: their parts are where they are told to be, in Cycles, in the true masks and in motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.core.frame.clip_context import ClipContext
from addon.core.media.clip import open_footage
from addon.core.media.light import to_linear
from benchmarks import store
from benchmarks.accuracy import metrics, subjects
from benchmarks.accuracy.cases import FromVideo, GroundTruth, TrueDepth
from benchmarks.accuracy.judge import Judge
from benchmarks.accuracy.mask_metrics import outline_band
from benchmarks.accuracy.scenes import Staged
from sample_scenes import figure, filming, staging, truth
from sample_scenes.shapes import box
from sample_scenes.stage import Cameras, Prop, Stage

GREY = np.full((4, 4, 3), 0.5, np.float32)
QUARTER = np.pi / 2


def level_cameras(frames: int, height: float = 1.0) -> Cameras:
    """64x36, at the world's origin, looking along +y: 1 m at 4 m is 16 pixels."""
    rotation = np.tile(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), (frames, 1, 1))
    translation = -rotation @ np.array([0, 0, height])
    return Cameras(64, 36, 64.0, rotation, translation)


def staged(*things: Prop, frames: int) -> Stage:
    wall = Prop("wall", box((20, 0.1, 10)).moved(0, 8, -4), GREY)
    return Stage("tiny", "a test", level_cameras(frames), (wall, *things), np.zeros((frames, 3)))


@pytest.fixture
def built() -> Iterator[list[bpy.types.Scene]]:
    """Scenes in here are removed."""
    before, scenes = bpy.context.window.scene, []
    yield scenes
    bpy.context.window.scene = before
    for scene in scenes:
        bpy.data.scenes.remove(scene)


def mask(stage: Stage, scene: bpy.types.Scene, frame: int) -> np.ndarray:
    parts = [i for i, thing in enumerate(stage.things) if thing.subject]
    return np.isin(truth.geometry(scene, frame).thing, parts)


def test_a_part_turns_about_its_joint_and_then_travels(built: list[bpy.types.Scene]) -> None:
    # A rod of 1 m that hangs from its joint, swings forwards to +x, then is moved.
    turn = figure.pitched([0.0, -QUARTER, -QUARTER])
    travel = np.array([[0, 4, 1.5], [0, 4, 1.5], [-1, 4, 1.0]])
    rod = Prop(
        "rod", box((0.25, 0.02, 1.0)).moved(0, 0, -1), GREY, travel=travel, turn=turn, subject="someone"
    )
    stage = staged(rod, frames=3)
    built.append(staging.build(stage))
    # Left, top, width and height in pixels; (0, 4, 1) is in the middle, 16 pixels are a metre.
    for frame, expected in ((1, (30, 10, 4, 16)), (2, (32, 8, 16, 4)), (3, (16, 16, 16, 4))):
        found = cv2.boundingRect(mask(stage, built[0], frame).astype(np.uint8))
        np.testing.assert_allclose(found, expected, atol=1, err_msg=f"frame {frame}")


def test_motion_follows_a_part_that_turns(built: list[bpy.types.Scene]) -> None:
    turn = figure.pitched([0.0, -0.3])
    travel = np.array([[0, 4, 1.5], [0.2, 4, 1.4]])
    rod = Prop(
        "rod", box((0.3, 0.02, 1.0)).moved(0, 0, -1), GREY, travel=travel, turn=turn, subject="someone"
    )
    stage = staged(rod, frames=2)
    built.append(staging.build(stage))
    here, after = (truth.geometry(built[0], frame) for frame in (1, 2))
    motion, seen = truth.motion(stage, 1, here, after)
    rows, columns = np.nonzero(mask(stage, built[0], 1) & seen)
    assert len(rows) > 40
    place = np.floor(np.stack([rows, columns], 1) + 0.5 + motion[rows, columns, ::-1]).astype(int)
    assert mask(stage, built[0], 2)[tuple(place.T)].mean() > 0.95
    # By hand: a point 0.5 m under the joint goes 0.2 + 0.5 sin 0.3 to the right at 16 pixels a metre.
    assert motion[18, 32, 0] == pytest.approx(16 * (0.2 + 0.5 * np.sin(0.3)), abs=0.35)
    np.testing.assert_allclose(motion[:, :20], 0, atol=1e-9)


# Judged


class Tiny(Staged):
    """Eight frames of two people who cross, at 96x54 pixels."""

    @cached_property
    def stage(self) -> Stage:
        made = filming.load("crossing").cut(slice(18, 26))
        return replace(made, cameras=made.cameras.resized(96, 54))


@pytest.fixture(scope="module")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tiny]:
    patch = pytest.MonkeyPatch()
    patch.setattr(store, "FOLDER", tmp_path_factory.mktemp("bench"))
    before = bpy.context.window.scene
    scene = Tiny("crossing", noise=0.05)
    yield scene
    patch.undo()
    bpy.context.window.scene = before
    bpy.data.scenes.remove(scene.scene)


def test_mattes_are_shares_of_pixels(tiny: Tiny) -> None:
    before = truth.pinhole(tiny.scene, 3, 64)
    both, near, far = (truth.matte(tiny.scene, tiny.stage, 3, name, 64) for name in ("", "near", "far"))
    np.testing.assert_allclose(both, near + far, atol=0.02)
    mask = tiny.subject(3)
    assert mask is not None
    away = ~outline_band(mask, 2)
    np.testing.assert_allclose(both[away], mask[away], atol=0.1)
    assert 0.05 < ((both > 0.1) & (both < 0.9)).sum() / mask.sum() < 1.5
    assert both.sum() == pytest.approx(mask.sum(), rel=0.05)
    np.testing.assert_array_equal(truth.pinhole(tiny.scene, 3, 64), before)


def test_the_matte_is_soft_where_it_is_judged(tiny: Tiny) -> None:
    mattes = {frame: tiny.matte(frame) for frame in (1, *tiny.judged(6))}
    np.testing.assert_array_equal(mattes.pop(1), tiny.subject(1))
    for frame, matte in mattes.items():
        assert matte is not None
        np.testing.assert_allclose(matte, truth.matte(tiny.scene, tiny.stage, frame, "", 16), atol=1e-6)
        assert ((matte > 0.1) & (matte < 0.9)).any()


def test_focus_is_on_a_subject_that_the_solve_has_no_points_on(tiny: Tiny) -> None:
    frame = tiny.judged(6)[0]
    true = GroundTruth(tiny).reconstruction(tiny.judged(6))
    images = []
    for image in true.images:
        column, row = image.xy.astype(int).T
        still = ~tiny.subject(image.frame)[row, column]
        images.append(replace(image, xy=image.xy[still], points=image.points[still]))
    solved = object.__new__(FromVideo)
    solved.scene, solved.reconstruction = tiny, replace(true, images=tuple(images))
    wanted = tiny.focus_depth(frame, 6)
    assert solved._focus(frame, 6).inverse_depth(solved.reconstruction, frame) == pytest.approx(1 / wanted)
    assert solved._radius(6) == pytest.approx(tiny.radius(6))


def test_the_benchmark_scores_the_subjects_band(tiny: Tiny) -> None:
    judged = Judge(tiny, 6, count=2)
    row = judged.row("T1", GroundTruth(tiny), "no blur", 0)
    pictures = [to_linear(tiny.frame(frame))[..., :3] for frame in judged.frames]
    truths = [truth.picture for truth in judged.truths]
    bands = [outline_band(tiny.subject(frame)) for frame in judged.frames]
    seeds = [truth.seeds for truth in judged.truths]
    scores = list(map(metrics.unbiased_psnr, pictures, seeds, bands))
    assert row.subject_psnr == pytest.approx(np.mean(scores))
    assert row.subject_rm == pytest.approx(metrics.rm(pictures, truths, bands))


def given(tiny: Tiny, subject: str = "") -> subjects.Given:
    """The clip with its true cameras and depth."""
    clip = ClipContext(tiny.cameras, open_footage(tiny.clip()).read, TrueDepth(tiny))
    return subjects.Given(tiny, clip, subject)


def test_the_true_masks_are_right(tiny: Tiny, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    truth_itself = subjects.Method(lambda given: given.truth, each=True)
    monkeypatch.setitem(subjects.METHODS, "truth", truth_itself)
    score = subjects.judge(given(tiny, "near"), "truth", range(1, 5), tmp_path)
    assert (score.iou, score.least_iou, score.good, score.fair) == (1, 1, 1, 1)
    assert (score.boundary_f, score.least_boundary_f, score.boiling) == (1, 1, 0)
    assert (score.torn, score.off_depth) == (0, 0)
    assert len(list(tmp_path.iterdir())) == 4
    assert "| crossing | near | truth | 4 | 1.000 |" in subjects.table([score])


def test_depth_knows_the_subject_that_a_stroke_marks(tiny: Tiny) -> None:
    near = given(tiny, "near")
    (mark,) = near.marked().clip.marked
    (stroke,) = mark.strokes
    assert mark.name == "near" and stroke.frame == 5 and stroke.adds
    column, row = (np.array(stroke.places) * (96, 54)).astype(int).T
    assert len(column) >= 3 and near.truth(5)[row, column].all()
    assert near.clip.marked == ()


def test_nothing_moves_in_depth_that_is_given(tiny: Tiny) -> None:
    score = subjects.judge(given(tiny), "moving", range(1, 3))
    assert (score.iou, score.boundary_f, score.good, score.torn) == (0, 0, 0, 0)
