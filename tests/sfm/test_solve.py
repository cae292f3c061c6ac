"""Solving clips in the worker process: what comes out, what is refused, and what is left behind."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.media.clip import FrameRange
from addon.core.readers.colmap_export import read_model
from addon.core.sfm.process import SolveProcess, SolveProgress
from addon.core.sfm.report import Figures, LensReport
from addon.core.sfm.steps import Attempt
from addon.core.sfm.workspace import Solve, load_solve

from .. import planes
from ..solving import begun, refused, snapshot, solve


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return planes.write_clip(tmp_path_factory.mktemp("footage") / "walk", planes.sideways(16))


@pytest.fixture(scope="module")
def steps() -> list[SolveProgress]:
    return []


@pytest.fixture(scope="module")
def solved(clip: Path, steps: list[SolveProgress], tmp_path_factory: pytest.TempPathFactory) -> Solve:
    return solve(clip, tmp_path_factory.mktemp("solves") / "deep" / "walk", steps=steps)


@pytest.fixture
def work(solved: Solve, tmp_path: Path) -> Path:
    """A copy of the solved clip's working folder."""
    return Path(shutil.copytree(solved.work_dir, tmp_path / "work"))


def test_every_frame_is_registered(solved: Solve) -> None:
    assert solved.reconstruction.frames.tolist() == list(range(1, 17)) == list(solved.frames)
    assert len(solved.reconstruction.points) > 300
    assert solved.reconstruction.points.error.mean() < 0.5
    assert solved.reconstruction.cameras[0].width == planes.SIZE[0]
    assert "16 of 16 frames" in solved.summary


def test_depths_are_in_proportion(solved: Solve) -> None:
    image = solved.reconstruction.image_at(8)[0]
    depth = image.to_camera(solved.reconstruction.points.xyz[image.points])[:, 2]
    truth = np.full(len(depth), 10.0)
    centre, matrix = np.linspace(-0.5, 0.5, 16)[7], planes.camera_matrix()
    for z, (left, right) in list(planes.PLANES.items())[1:]:
        low, high = matrix[0, 0] * (np.array([left, right]) - centre) / z + matrix[0, 2]
        # A track on a silhouette may belong to either side.
        truth[(image.xy[:, 0] > low + 6) & (image.xy[:, 0] < high - 6)] = z
        truth[np.abs(image.xy[:, :1] - [low, high]).min(axis=1) <= 6] = np.nan
    scale = np.nanmedian(depth / truth)
    for z in planes.PLANES:
        assert (truth == z).sum() > 30
        assert np.median(depth[truth == z]) / scale == pytest.approx(z, rel=0.03)
    known = np.isfinite(truth)
    assert np.mean(np.abs(depth / scale / truth - 1)[known] < 0.1) > 0.97


def test_poses_are_the_truth(solved: Solve) -> None:
    centres = np.array([image.centre for image in solved.reconstruction.images])
    path = np.linalg.norm(centres[-1] - centres[0])
    s = np.linspace(-0.5, 0.5, 16)
    truth = np.column_stack([s, 0.2 * s * s, 0.1 * s])
    # The best similarity (Umeyama, 1991).
    a, b = centres - centres.mean(axis=0), truth - truth.mean(axis=0)
    u, values, vt = np.linalg.svd(b.T @ a)
    flip = np.diag([1, 1, np.linalg.det(u @ vt)])
    scale = (values * np.diag(flip)).sum() / (a**2).sum()
    assert np.abs(scale * a @ (u @ flip @ vt).T - b).max() < 0.02
    assert path > 0


def test_only_the_result_is_kept(solved: Solve) -> None:
    assert {p.name for p in solved.work_dir.iterdir()} == {"solve.json", "model"}
    assert solved.figures.versions.keys() >= {"pycolmap", "opencv", "numpy"}


@pytest.mark.long
def test_the_focal_length_is_found_where_the_picture_tells_it(tmp_path: Path) -> None:
    true = 0.6 * planes.SIZE[0]
    found = solve(planes.write_clip(tmp_path / "wide", planes.sideways(16, true)), tmp_path / "work")
    assert found.figures.focal_from == "clip" and (found.figures.focal_sigma or 1.0) < 0.02
    assert found.reconstruction.cameras[0].fx == pytest.approx(true, rel=0.04)


def test_a_given_focal_length_is_held(clip: Path, tmp_path: Path) -> None:
    some, work = FrameRange(1, 8), tmp_path / "work"
    given = solve(clip, work, focal=300.0, frames=some)
    assert given.figures.focal_from == "given" and given.reconstruction.cameras[0].fx == 300.0
    assert SolveProcess(clip, work, focal=300.0, frames=some).finished
    another = SolveProcess(clip, work, focal=250.0, frames=some)
    assert not another.finished
    another.cancel()


@pytest.mark.long
def test_the_focal_length_of_straight_ahead_motion_is_not_believed(tmp_path: Path) -> None:
    ahead = [planes.view(np.array([0.0, 0.0, z]), np.zeros(3)) for z in np.linspace(0, 1.5, 16)]
    solved = solve(planes.write_clip(tmp_path / "ahead", ahead), tmp_path / "work")
    assert solved.figures.focal_from == "guess" and (solved.figures.focal_sigma or 0.0) > 0.02
    assert len(solved.reconstruction.images) == 16


def test_a_folder_of_something_else_is_refused(clip: Path, tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("precious")
    before = snapshot(tmp_path)
    with pytest.raises(UserError, match="not empty"):
        SolveProcess(clip, tmp_path)
    with pytest.raises(UserError, match="is a file"):
        SolveProcess(clip, tmp_path / "thesis.txt")
    assert snapshot(tmp_path) == before


def test_cancelling_leaves_nothing(clip: Path, tmp_path: Path) -> None:
    process = SolveProcess(clip, tmp_path / "new" / "work")
    assert not process.finished
    begun(process)
    process.cancel()
    process.cancel()
    assert not (tmp_path / "new").exists()


def test_cancelling_again_keeps_the_old_solve(work: Path, clip: Path) -> None:
    before = snapshot(work)
    process = SolveProcess(clip, work, again=True)
    begun(process)
    process.cancel()
    assert snapshot(work) == before
    assert SolveProcess(clip, work).finished


@pytest.mark.long
def test_solving_again_replaces_the_solve(work: Path, clip: Path) -> None:
    (work / "model" / "points3D.txt").write_text("")
    again = solve(clip, work, again=True, focal=planes.FOCAL, frames=FrameRange(1, 8))
    assert len(again.reconstruction.points) > 300
    assert {p.name for p in work.iterdir()} == {"solve.json", "model"}


def test_a_failed_solve_keeps_the_old_one(clip: Path, work: Path) -> None:
    before = snapshot(work)
    with pytest.raises(UserError, match="at least 4"):
        solve(clip, work, frames=FrameRange(1, 2))
    assert snapshot(work) == before


def test_a_worker_that_dies_is_told_in_one_line(clip: Path, tmp_path: Path) -> None:
    process = SolveProcess(clip, tmp_path / "work")
    begun(process)
    assert process._job.process is not None
    process._job.process.kill()
    with pytest.raises(UserError, match="the solving process was ended by SIGKILL") as error:
        process.wait()
    assert "\n" not in str(error.value)
    assert not (tmp_path / "work").exists()


def test_a_package_of_the_same_name_in_the_current_folder_is_not_ours(
    clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "addon").mkdir()
    (tmp_path / "addon" / "__init__.py").write_text("raise SystemExit(7)")
    monkeypatch.chdir(tmp_path)
    process = SolveProcess(clip, tmp_path / "work")
    # The other package would end the worker before it says anything, and `poll` would raise.
    assert begun(process)[0].text.startswith("Tracking features")
    process.cancel()


@pytest.mark.long
def test_a_turning_camera_is_refused(tmp_path: Path) -> None:
    clip = planes.write_clip(tmp_path / "pan", planes.turning(12))
    assert "too little parallax" in refused(clip, tmp_path / "work")


def test_a_still_camera_is_refused(tmp_path: Path) -> None:
    clip = planes.write_clip(tmp_path / "still", [planes.view(np.zeros(3), np.zeros(3))] * 6)
    assert "does not move" in refused(clip, tmp_path / "work")


def test_a_camera_that_rolls_at_once_is_solved_by_keypoints(tmp_path: Path) -> None:
    middle = (np.array(planes.SIZE) - 1) / 2
    roll = cv2.getRotationMatrix2D(middle.tolist(), 40, 1)
    pictures = planes.sideways(16)
    pictures[8:] = [cv2.warpAffine(picture, roll, planes.SIZE) for picture in pictures[8:]]
    result = solve(planes.write_clip(tmp_path / "rolled", pictures), tmp_path / "work")
    assert result.figures.tracker == "sift"
    assert len(result.reconstruction.frames) == 16 and result.reconstruction.points.error.mean() < 0.5
    before, after = (result.reconstruction.image_at(frame)[0].rotation for frame in (8, 9))
    angle = np.degrees(np.arccos(((after @ before.T).trace() - 1) / 2))
    assert abs(angle - 40) < 1


def test_two_shots_are_refused(tmp_path: Path) -> None:
    pictures = planes.sideways(6) + [picture[::-1] for picture in planes.sideways(6)]
    assert "cut" in refused(planes.write_clip(tmp_path / "shots", pictures), tmp_path / "work")


def test_no_texture_is_refused(tmp_path: Path) -> None:
    clip = planes.write_clip(tmp_path / "wall", [np.full((240, 320, 3), 90, np.uint8)] * 5)
    assert "too little texture" in refused(clip, tmp_path / "work")


@pytest.mark.parametrize(
    ("said", "read"), [(None, (0.0, 0.0)), ([0.0, -0.4], (0.0, -0.4)), ([0.0, 2.0], None), ("x", None)]
)
def test_a_readout_is_kept_and_must_lie_within_a_frame(
    work: Path, said: object, read: tuple[float, float] | None
) -> None:
    state = json.loads((work / "solve.json").read_text())
    del state["digest"], state["report"]["readout"]
    if said is not None:
        state["report"]["readout"] = said
    (work / "solve.json").write_text(json.dumps(state))
    if read is None:
        with pytest.raises(UserError, match=r"the report in .*solve\.json is damaged"):
            load_solve(work)
    else:
        assert load_solve(work).reconstruction.readout == read


def test_figures_of_other_versions_are_read() -> None:
    assert Figures.read({}) == Figures()
    kept = {"method": "pairs", "fps": 25, "readout": [0, 0.1], "distortion": None, "unknown": 1}
    found = Figures.read(kept | {"depth_evidence": {"parallax": 1.0}, "attempts": [{"name": "corners"}]})
    assert found.lens == LensReport(readout=(0.0, 0.1), frame_ms=40.0)
    # What lacks a part is left out.
    assert found.depth_evidence is None and found.attempts == ()
    one = Figures("pairs", attempts=(Attempt("corners, pairs", 1.5, 0.9, 0.4), Attempt("corners", 0.1)))
    assert Figures.read(json.loads(json.dumps(one.as_dict()))) == one


def test_a_clip_that_moved_along_is_found_and_a_lost_one_told(
    solved: Solve, clip: Path, tmp_path: Path
) -> None:
    top = Path(os.path.commonpath([clip, solved.work_dir]))
    clip_there = shutil.copytree(clip, tmp_path / clip.relative_to(top))
    there = shutil.copytree(solved.work_dir, tmp_path / solved.work_dir.relative_to(top))
    state = json.loads((there / "solve.json").read_text())
    del state["digest"]
    (there / "solve.json").write_text(json.dumps(state | {"footage": str(tmp_path / "gone")}))
    assert load_solve(there).footage == clip_there
    shutil.rmtree(clip_there)
    with pytest.raises(UserError, match="is missing"):
        load_solve(there)


def test_the_duck(duck: Path) -> None:
    solved = load_solve(duck)
    shot = solved.reconstruction
    assert len(shot.images) >= 0.95 * 118
    assert shot.points.error.mean() < 1.0
    assert (shot.cameras[0].width, shot.cameras[0].height) == (884, 1080)
    image = shot.image_at(60)[0]
    cells = {(int(x * 8 // 884), int(y * 6 // 1080)) for x, y in image.xy}
    assert len(cells) > 0.85 * 48
    depth = image.to_camera(shot.points.xyz[image.points])[:, 2]

    def inside(left: float, top: float, right: float, bottom: float) -> float:
        x, y = image.xy[:, 0] / 884, image.xy[:, 1] / 1080
        return float(np.median(depth[(x > left) & (x < right) & (y > top) & (y < bottom)]))

    card, duckling, wall = inside(0.0, 0.8, 0.3, 0.92), inside(0.43, 0.65, 0.6, 0.8), inside(0, 0, 0.6, 0.3)
    chart, mannequin = inside(0.2, 0.4, 0.7, 0.55), inside(0.8, 0.3, 0.92, 0.5)
    assert max(card, mannequin) < duckling < chart < wall
    assert read_model(duck / "model").frames.tolist() == shot.frames.tolist()


@pytest.mark.long
def test_frames_blurred_by_the_cameras_motion(tmp_path: Path) -> None:
    # The shutter is open all the time: fifteen frames of seven pictures each.
    many = planes.sideways(15 * 7)
    blurred = [np.mean(many[i : i + 7], axis=0).astype(np.uint8) for i in range(0, len(many), 7)]
    solved = solve(planes.write_clip(tmp_path / "clip", blurred), tmp_path / "work", focal=planes.FOCAL)
    shot = solved.reconstruction
    assert len(shot.images) == 15
    found = np.array([image.centre for image in shot.images])
    middle = np.linspace(-0.5, 0.5, 15 * 7)[3::7]
    step = np.linalg.norm(np.diff(found, axis=0), axis=1)
    true = np.linalg.norm(np.diff(np.column_stack([middle, 0.2 * middle**2, 0.1 * middle]), axis=0), axis=1)
    assert np.ptp(step / true) < 0.02 * np.median(step / true)


@pytest.mark.long
def test_a_zoom_that_nobody_announced_is_followed(tmp_path: Path) -> None:
    focal = planes.FOCAL * np.geomspace(1, 1.4, 16)
    steps = np.linspace(-0.5, 0.5, 16)
    pictures = [
        planes.view(np.array([x, 0.2 * x, 0.0]), np.array([0.0, 0.02 * x, 0.0]), f)
        for x, f in zip(steps, focal, strict=True)
    ]
    solved = solve(planes.write_clip(tmp_path / "clip", pictures), tmp_path / "work")
    found = np.array([solved.reconstruction.intrinsics(image).fx for image in solved.reconstruction.images])
    assert len(found) == 16
    assert np.ptp(np.log(found / focal)) < 0.03
    assert any("zooms" in note for note in solved.quality.notes)
