"""The judge's own geometry: its lens, depth, motion and layers fit each other and its pictures."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.core.optics.aperture_sampling import vogel_disc
from addon.core.readers.colmap_export import read_model, write_model
from benchmarks.accuracy import metrics
from sample_scenes import filming, staging, truth
from sample_scenes.stage import Stage

FRAME = 18
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def stage() -> Stage:
    """Thin bars before a vase: occlusion, lamps over white, and a sky."""
    made = filming.load("bars")
    return replace(made, cameras=made.cameras.resized(96, 54))


@pytest.fixture(scope="module")
def scene(stage: Stage) -> Iterator[bpy.types.Scene]:
    before = bpy.context.window.scene
    scene = staging.build(stage)
    yield scene
    bpy.context.window.scene = before
    bpy.data.scenes.remove(scene)


def test_the_mean_of_pinholes_is_the_thin_lens(stage: Stage, scene: bpy.types.Scene) -> None:
    focus, radius = float(stage.focus_depth[FRAME - 1]), 0.04
    seeds = [truth.lens(scene, FRAME, radius, focus, noise=0.005, seed=seed) for seed in (1, 2)]
    lens = (seeds[0] + seeds[1]) / 2
    noise = metrics.psnr(*seeds)
    # With 4 samples a view the seeds' patterns are alike, and their mean stays 10 dB off however many views.
    views = [
        truth.virtual_pinhole(scene, FRAME, (x, y), focus, samples=16, seed=n)
        for n, (x, y) in enumerate(radius * vogel_disc(64))
    ]
    score = metrics.psnr(np.asarray(np.mean(views, axis=0)), lens)
    sharp = metrics.psnr(truth.pinhole(scene, FRAME, 16), lens)
    print(f"64 pinholes {score:.1f} dB, seed against seed {noise:.1f} dB, one pinhole {sharp:.1f} dB")
    assert score > noise
    assert sharp < noise - 15, "there is nothing to tell apart"


def test_depth_is_where_blenders_rays_hit(stage: Stage, scene: bpy.types.Scene) -> None:
    found = truth.geometry(scene, FRAME)
    cameras, graph = stage.cameras, bpy.context.evaluated_depsgraph_get()
    origin, rotation = cameras.centres[FRAME - 1], cameras.rotation[FRAME - 1]
    rng = np.random.default_rng(0)
    names = [prop.name for prop in stage.things]
    misses = 0
    for row, column in zip(rng.integers(0, 54, 60), rng.integers(0, 96, 60), strict=True):
        ray = np.array([(column + 0.5 - 48) / cameras.focal, (row + 0.5 - 27) / cameras.focal, 1.0])
        hit, place, _, _, thing, _ = scene.ray_cast(graph, origin.tolist(), (rotation.T @ ray).tolist())
        depth, number = found.depth[row, column], found.thing[row, column]
        if not hit:
            assert np.isinf(depth)
            assert number == -1
            continue
        # At silhouettes a hundredth of a pixel decides.
        same = names[number] == thing.name.split(".")[0]
        misses += not same
        if same:
            assert depth == pytest.approx((rotation @ (np.array(place) - origin))[2], rel=2e-3)
    assert misses <= 2


def test_motion_brings_the_next_frame_into_register() -> None:
    stage = filming.load("bars")
    # Large enough for the hand's motion to be pixels, not fractions of one.
    stage = replace(stage, cameras=stage.cameras.resized(384, 216))
    scene = staging.build(stage)
    here, after = truth.geometry(scene, FRAME), truth.geometry(scene, FRAME + 1)
    motion, seen = truth.motion(stage, FRAME, here, after)
    first, second = (np.clip(truth.pinhole(scene, frame, 16), 0, 1) for frame in (FRAME, FRAME + 1))
    bpy.data.scenes.remove(scene)
    inner = cv2.erode(seen.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    assert 0.5 < inner.mean() < 1
    grid = np.stack(np.meshgrid(np.arange(384), np.arange(216)), axis=-1)

    def error(motion: np.ndarray) -> float:
        moved = cv2.remap(second, (grid + motion).astype(np.float32), None, cv2.INTER_CUBIC)
        return float(np.abs(moved - first)[inner].mean())

    around = [error(motion + step) for step in ((0.3, 0), (-0.3, 0), (0, 0.3), (0, -0.3))]
    assert error(motion) < min(around)
    assert error(motion) < 0.7 * error(0 * motion)


def test_layers_over_each_other_are_the_picture(stage: Stage, scene: bpy.types.Scene) -> None:
    total = np.full((54, 96, 3), stage.air, np.float32)
    for number in sorted({prop.layer for prop in stage.things}):
        picture, depth = truth.layer(scene, stage, FRAME, number, 4, samples=64)
        assert picture.shape == (62, 104, 4)
        covered = picture[..., 3] > 0.99
        assert not covered.any() or np.isfinite(depth[covered]).mean() > 0.98
        inner = picture[4:-4, 4:-4]
        total = inner[..., :3] + (1 - inner[..., 3:]) * total
    # Where two silhouettes share a pixel, coverage alone does not tell which one hides what.
    away = ~metrics.edge_band(1 / truth.geometry(scene, FRAME).depth, width=5)
    assert away.mean() > 0.3
    one, other = (truth.pinhole(scene, FRAME, 64, seed) for seed in (1, 2))
    assert metrics.psnr(total, one, away) > metrics.psnr(other, one, away) - 1


def test_the_camera_records_eight_bits(stage: Stage) -> None:
    picture = np.full((40, 60, 3), 0.2140, np.float32)  # sRGB 0.5
    picture[:, :20] = 7.0
    plain = truth.recorded(picture, 1, noise=0.0)
    assert plain.dtype == np.uint8
    assert (plain[:, :20] == 255).all()
    assert (np.abs(plain[:, 20:].astype(int) - 127.5) <= 0.5).all()
    noisy = truth.recorded(picture, 1)
    assert noisy[:, 20:].std() == pytest.approx(truth.NOISE, rel=0.1)
    np.testing.assert_array_equal(noisy, truth.recorded(picture, 1))
    assert (noisy != truth.recorded(picture, 2)).any()


def test_true_cameras_survive_a_colmap_model(stage: Stage, tmp_path: Path) -> None:
    write_model(tmp_path, filming.true_cameras(stage.cameras))
    read = read_model(tmp_path)
    assert len(read.images) == len(stage.cameras)
    assert read.cameras[0].fx == pytest.approx(stage.cameras.focal)
    np.testing.assert_allclose([i.centre for i in read.images], stage.cameras.centres, atol=1e-9)


def test_a_saved_sample_opens_and_renders(stage: Stage, tmp_path: Path) -> None:
    """In a process of its own, for saving empties the file that is open."""
    script = f"""
import sys; sys.path.insert(0, {str(ROOT)!r})
from pathlib import Path
from dataclasses import replace
import bpy
from sample_scenes import filming
stage = filming.load('bars')
stage = replace(stage, cameras=stage.cameras.resized(48, 27))
filming.save_blend(stage, Path({str(tmp_path / "bars.blend")!r}), samples=4)
bpy.ops.wm.open_mainfile(filepath={str(tmp_path / "bars.blend")!r})
scene = bpy.context.scene
assert [s.name for s in bpy.data.scenes] == ['bars'], list(bpy.data.scenes)
scene.frame_set(18)
scene.render.filepath = {str(tmp_path / "frame.png")!r}
bpy.ops.render.render(write_still=True)
"""
    subprocess.run([sys.executable, "-c", script], check=True, capture_output=True)
    shown = cv2.imread(str(tmp_path / "frame.png"))
    assert shown.shape == (27, 48, 3)
    assert shown.std() > 20
