"""Lengths are the model's own: on the command line, in the scene, and in what is handed out again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.cli.main import run_command
from addon.core.camera.reconstruction import (
    MEDIAN_DEPTH,
    Intrinsics,
    Reconstruction,
    normalise,
    typical_distance,
)
from addon.core.readers.colmap_export import read_model, write_model
from addon.core.sfm.workspace import load_solve
from addon.render.views.average import render_frame
from addon.scene.lens.lens import frame_options
from addon.scene.sources.shot import shot_of

from ..scenes import psnr, slanted_plane, write_frames

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
FOCUS, RADIUS = 6.0, 0.11
"""Metres."""


@pytest.fixture(scope="module")
def metric() -> Reconstruction:
    """In metres, far from its origin, and lying on its side."""
    made, far = slanted_plane(LENS), np.array([400.0, -700.0, 10.0])
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    images = tuple(
        replace(i, rotation=i.rotation @ turn.T, translation=i.translation - i.rotation @ turn.T @ far)
        for i in made.images
    )
    return replace(made, images=images, points=replace(made.points, xyz=made.points.xyz @ turn.T + far))


@pytest.fixture
def footage(tmp_path: Path) -> Path:
    return write_frames(tmp_path / "clip", LENS)


def imported(model: Reconstruction, footage: Path, work: Path) -> Path:
    folder = work.with_suffix(".model")
    folder.mkdir()
    write_model(folder, model)
    assert run_command(["import", str(folder), "--footage", str(footage), "--work", str(work)]) == 0
    return work


def lens_on_the_command_line(work: Path, focus: float, radius: float) -> np.ndarray:
    """(H, W, 4) frame 2 through a lens told in numbers."""
    blend = work.with_suffix(".blend")
    words = (
        "--overwrite",
        "--focus-distance",
        focus,
        "--aperture-radius",
        radius,
        "--views",
        8,
        "--method",
        "features",
    )
    assert run_command(["save", str(work), "--blend", str(blend), *map(str, words)]) == 0
    scene = bpy.context.scene
    shot = shot_of(scene)
    lens = frame_options(scene.virtual_aperture, shot.reconstruction)
    return np.asarray(render_frame(shot.context, 2, lens, (LENS.width, LENS.height), lambda _: None))


def between(model: Reconstruction) -> np.ndarray:
    """Distances between cameras and of each point from the first one."""
    first = model.images[0].centre
    centres = np.array([image.centre for image in model.images])
    return np.linalg.norm(np.concatenate([centres, model.points.xyz]) - first, axis=1)


def test_an_import_keeps_its_metres_and_hands_them_out(
    metric: Reconstruction, footage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    work = imported(metric, footage, tmp_path / "work")
    kept = load_solve(work).reconstruction
    np.testing.assert_allclose(between(kept), between(metric), rtol=1e-9)
    # Near the origin and upright all the same.
    assert np.linalg.norm(np.mean([i.centre for i in kept.images], axis=0)) < 1e-9
    assert kept.images[0].rotation[1, 2] < -0.9
    assert run_command(["export", str(work), "--model", str(tmp_path / "out")]) == 0
    np.testing.assert_allclose(between(read_model(tmp_path / "out")), between(metric), rtol=1e-9)
    capsys.readouterr()
    assert run_command(["report", str(work)]) == 0
    depths = np.concatenate([i.to_camera(metric.points.xyz)[:, 2] for i in metric.images])
    low, middle, high = np.percentile(depths, (2, 50, 98))
    assert f"{low:.4g} to {high:.4g}, {middle:.4g} in the median" in capsys.readouterr().out


def test_a_lens_in_metres_makes_the_picture_of_the_same_scene_rescaled(
    registered: None, metric: Reconstruction, footage: Path, tmp_path: Path
) -> None:
    picture = lens_on_the_command_line(imported(metric, footage, tmp_path / "metres"), FOCUS, RADIUS)
    settings = bpy.context.scene.virtual_aperture
    assert settings.focus_distance == pytest.approx(FOCUS)
    assert settings.aperture_radius == pytest.approx(RADIUS)
    # The scene is in metres, too.
    points = np.array([v.co[:] for v in settings.points.data.vertices])
    size = np.linalg.norm(points, axis=1)
    assert np.median(size) == pytest.approx(typical_distance(metric), rel=1e-5)
    scale = MEDIAN_DEPTH / typical_distance(metric)
    assert abs(scale - 1) > 0.1
    other = lens_on_the_command_line(
        imported(normalise(metric), footage, tmp_path / "units"), scale * FOCUS, scale * RADIUS
    )
    assert psnr(picture, other) > 70
    # And not that of the same numbers in another unit.
    assert psnr(picture, lens_on_the_command_line(tmp_path / "units", FOCUS, RADIUS)) < 50
