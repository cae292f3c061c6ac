"""Taking solves in, handing them out and judging them, on the command line."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.base.worker import Worker
from addon.core.media import video
from addon.core.sfm.process import SolveProcess
from addon.core.sfm.workspace import Solve, load_solve

from .. import foreign_models, planes
from ..command_line import run

PART = ("--frames", "1-8", "--focal", "272")


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return planes.write_clip(tmp_path_factory.mktemp("footage") / "walk", planes.sideways(16))


@pytest.fixture(scope="module")
def solved(clip: Path, tmp_path_factory: pytest.TempPathFactory) -> Solve:
    work = tmp_path_factory.mktemp("solves") / "work"
    assert run("solve", clip, "--work", work, "--fov", 60.93) == 0
    return load_solve(work)


@pytest.fixture(scope="module")
def part(clip: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The working folder of a solve of half the frames."""
    work = tmp_path_factory.mktemp("part") / "work"
    assert run("solve", clip, "--work", work, *PART) == 0
    return work


@pytest.mark.parametrize(
    ("focal", "pixels"),
    [
        ((), None),
        (("--focal", "300"), 300.0),
        (("--focal35", "29.4213"), 272.0),
        (("--fov", "60.93109"), 272.0),
        # 320 pixels on 24 mm.
        (("--focal-mm", "20.4", "--sensor-mm", "24"), 272.0),
    ],
)
def test_a_known_lens_is_the_workers_focal_length_in_pixels(
    clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, focal: tuple[str, ...], pixels: float | None
) -> None:
    """As the call says, which is not sent."""
    work, jobs = tmp_path / "work", []

    def call(_: Worker, function: partial[Any]) -> None:
        jobs.append(function.args[0])
        raise UserError("that is enough")

    monkeypatch.setattr(Worker, "call", call)
    assert run("solve", clip, "--work", work, *focal) == 1
    (job,) = jobs
    assert job.focal == (pixels and pytest.approx(pixels, rel=1e-5)) and not job.zooms
    assert not work.exists()


@pytest.mark.long
def test_a_given_focal_length_is_held(solved: Solve) -> None:
    assert solved.reconstruction.cameras[0].fx == pytest.approx(planes.FOCAL, abs=0.1)
    assert solved.quality.focal_from == "given"


def test_a_video_is_opened_once_before_its_worker_starts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "walk.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 24, planes.SIZE)
    for picture in planes.sideways(3):
        writer.write(picture)
    writer.release()
    opened: list[Path] = []
    decode = video._decode_all
    monkeypatch.setattr(video, "_decode_all", lambda clip: opened.append(clip) or decode(clip))
    process = SolveProcess(path, tmp_path / "work", focal=lambda width, height: width + height / 1000)
    process.cancel()
    assert len(opened) == 1
    assert process.clip.frames == (1, 2, 3)


def test_a_report_is_of_what_is_there(solved: Solve, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("report", solved.work_dir, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    counts = [len(image.points) for image in solved.reconstruction.images]
    assert found["registered"] == found["frames"] == 16
    assert found["points_per_frame"] == [min(counts), int(np.median(counts)), max(counts)]
    assert found["reprojection_error"] == pytest.approx(solved.reconstruction.points.error.mean(), rel=0.01)
    assert found["explained"] > 0.9
    assert found["advice"] == ""
    assert run("report", solved.work_dir) == 0
    assert "16 of 16 registered" in capsys.readouterr().out


def test_an_exported_model_comes_back(solved: Solve, tmp_path: Path) -> None:
    out, work = tmp_path / "model", tmp_path / "work"
    assert run("export", solved.work_dir, "--model", out) == 0
    assert "shot_0001.png" in (out / "images.txt").read_text()
    assert run("import", out, "--footage", solved.footage, "--work", work) == 0
    back = load_solve(work)
    assert back.quality.focal_from == "file"
    one, other = solved.reconstruction, back.reconstruction
    np.testing.assert_array_equal(one.frames, other.frames)
    for a, b in zip(one.images, other.images, strict=True):
        np.testing.assert_array_equal(a.xy, b.xy)
        np.testing.assert_array_equal(a.points, b.points)
        # It was normalised already.
        np.testing.assert_allclose(a.rotation, b.rotation, atol=1e-9)
        np.testing.assert_allclose(a.centre, b.centre, atol=1e-6)


def test_an_import_is_not_taken_for_a_solve(
    solved: Solve, clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    work = tmp_path / "work"
    assert run("import", solved.work_dir / "model", "--footage", clip, "--work", work) == 0
    before = (work / "solve.json").read_text()
    for more in ((), ("--frames", "1-8"), ("--focal", "272")):
        assert run("solve", clip, "--work", work, *more) == 1
        said = capsys.readouterr().err
        assert "holds an imported solve (COLMAP text)" in said
        assert "--again" in said
    assert (work / "solve.json").read_text() == before
    assert run("solve", clip, "--work", work, *PART, "--again") == 0
    assert load_solve(work).quality.focal_from == "given"
    kept = (work / "solve.json").stat().st_mtime_ns
    assert run("solve", clip, "--work", work, *PART) == 0
    assert (work / "solve.json").stat().st_mtime_ns == kept


def test_a_solve_of_some_frames_is_not_replaced_by_an_import(
    solved: Solve, part: Path, clip: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = (part / "solve.json").read_text()
    assert run("import", solved.work_dir / "model", "--footage", clip, "--work", part) == 1
    assert "holds a solve of this clip" in capsys.readouterr().err
    assert (part / "solve.json").read_text() == before


def test_nothing_of_the_users_is_overwritten(
    solved: Solve, clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "model").mkdir()
    assert run("export", solved.work_dir, "--model", tmp_path / "model") == 1
    assert "exists" in capsys.readouterr().err
    assert run("import", solved.work_dir / "model", "--footage", clip, "--work", solved.work_dir) == 1
    assert "--again" in capsys.readouterr().err
    before = (solved.work_dir / "solve.json").read_text()
    broken = tmp_path / "broken"
    broken.mkdir()
    for name in ("cameras.txt", "images.txt", "points3D.txt"):
        (broken / name).write_text("nonsense\n")
    assert run("import", broken, "--footage", clip, "--work", tmp_path / "work") == 1
    assert "cameras.txt" in capsys.readouterr().err
    assert not (tmp_path / "work").exists()
    assert run("import", broken, "--footage", clip, "--work", solved.work_dir, "--again") == 1
    assert (solved.work_dir / "solve.json").read_text() == before


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--fov", "200"), "field of view is 200 degrees"),
        (("--focal35", "-3"), "focal length is -3 mm"),
        (("--focal-mm", "35", "--sensor-mm", "-1"), "sensor is -1 mm"),
        (("--focal-mm", "35"), "needs --sensor-mm"),
        (("--sensor-mm", "36"), "needs --focal-mm"),
    ],
)
def test_a_lens_that_cannot_be_is_refused(
    clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], said: str
) -> None:
    assert run("solve", clip, "--work", tmp_path / "work", *arguments) == 1
    assert said in capsys.readouterr().err
    assert not (tmp_path / "work").exists()


def test_voodoos_pan_is_taken_in_and_called_one(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = data / "voodoo"
    assert run("import", folder / "3d_tracking.txt", "--footage", folder, "--work", tmp_path / "work") == 0
    assert "only turns" in capsys.readouterr().out
    assert run("solve", folder, "--work", tmp_path / "solve") == 1
    assert "only turns" in capsys.readouterr().err
    assert not (tmp_path / "solve").exists()


@pytest.mark.parametrize("kind", ["voodoo", "behind"])
def test_a_reprojection_error_that_nobody_measured_is_not_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    model = foreign_models.world()
    if kind == "behind":
        # Every point is behind every camera, though the file says where they were seen.
        model = replace(model, points=replace(model.points, xyz=model.points.xyz * [1, 1, -1]))
    file = tmp_path / ("model.txt" if kind == "voodoo" else "bundle.out")
    file.write_text((foreign_models.voodoo if kind == "voodoo" else foreign_models.bundler)(model))
    size = foreign_models.SIZE
    clip = planes.write_clip(tmp_path / "clip", [np.full((*size[::-1], 3), n, np.uint8) for n in range(4)])
    work = tmp_path / "work"
    assert run("import", file, "--footage", clip, "--work", work) == 0
    assert "reprojection error not measured" in capsys.readouterr().out
    assert run("report", work) == 0
    assert "reprojection  not measured: the model has no usable observations" in capsys.readouterr().out
    assert run("report", work, "--json") == 0
    said = json.loads(capsys.readouterr().out)
    assert said["reprojection_error"] is None and said["depth_sigma"] is None


@pytest.mark.usefixtures("registered")
def test_a_solve_finds_the_depth_of_all_frames_if_asked(clip: Path, tmp_path: Path) -> None:
    work = tmp_path / "work"
    assert run("solve", clip, "--work", work, *PART, "--depth") == 0
    assert len(list((work / "depth").rglob("depth-*.npz"))) == 8
