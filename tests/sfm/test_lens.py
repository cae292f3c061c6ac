"""What a clip tells of its lens and its shutter: simulated tracks of a hand that holds a real camera.

Points lie at 2 to 8 m; tracks have the errors of optical flow, noise and drift along them. The camera that
films them is written here again: COLMAP's formula, and a rotation for each place that is read.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.base.arrays import Floats
from addon.core.camera.canvas import Canvas
from addon.core.camera.intrinsics import Intrinsics
from addon.core.camera.reconstruction import rotation_matrix, rotation_vector
from addon.core.camera.stmap import redistort_map
from addon.core.sfm import report
from addon.core.sfm.adjustment import solution
from addon.core.sfm.adjustment.solution import Solution
from addon.core.sfm.calibration import lens
from addon.core.sfm.calibration.lens import Found, find_lens, report_of
from addon.core.sfm.calibration.self_calibration import refine_focal_length
from addon.core.sfm.process import SolveProcess
from addon.core.sfm.report import Figures
from addon.core.sfm.tracking.tracks import Tracks
from addon.core.sfm.workspace import load_solve
from benchmarks.solving.real_lens import RealLens
from sample_scenes.stage import Cameras

from .. import planes
from ..variants import variants

SIZE = np.array([640, 360])
FOCAL, START, KNOWN = 560.0, 544.0, 0.2
"""Pixels of the true focal length and of the one that a solve begins with, and its relative sigma."""
FRAMES, POINTS = 24, 400
NOISE, DRIFT = 0.3, 0.03
"""Pixels, of each observation and of a track from a frame to the next."""


@dataclass(frozen=True)
class Hand:
    """0.5 m to the side by a hand that shakes, and the gaze wanders by 8 degrees."""

    k1: float = 0.0
    readout: float = 0.0
    """Of the height, in frames."""
    path: tuple[float, float, float] = (0.5, 0.02, 0.1)
    """Metres."""
    shake: float = 0.6
    """Degrees."""
    yaw: float = 8.0
    """Degrees."""

    def poses(self) -> tuple[Floats, Floats]:
        """(F, 3, 3) and (F, 3) world-to-camera."""
        rng, share = np.random.default_rng(1), np.linspace(-0.5, 0.5, FRAMES)
        phase, often = rng.uniform(0, 2 * np.pi, (3, 6)), rng.uniform(1, 6, (3, 6))
        wave = np.sin(2 * np.pi * often * share[:, None, None] + phase).sum(axis=2) / 2
        turn = np.radians(self.shake * wave + self.yaw * share[:, None] * [0, 1, 0])
        rotation = np.array([rotation_matrix(each) for each in turn])
        centre = share[:, None] * self.path + np.array(self.path) * 0.02 * wave
        return rotation, -np.einsum("fij,fj->fi", rotation, centre)

    @property
    def lens(self) -> Intrinsics:
        return Intrinsics(640, 360, FOCAL, FOCAL, 320.0, 180.0, self.k1)

    def tracks(self) -> tuple[Tracks, Floats, Floats]:
        """What is tracked, and the true poses."""
        rng, (rotation, translation) = np.random.default_rng(0), self.poses()
        reach = 0.62 * SIZE / FOCAL
        rays = np.column_stack([rng.uniform(-reach, reach, (POINTS, 2)), np.ones(POINTS)])
        xyz = rays / rng.uniform(1 / 8, 1 / 2, (POINTS, 1))
        drift = np.cumsum(rng.normal(0, DRIFT, (FRAMES, POINTS, 2)), axis=0)
        frame, track, xy = [], [], []
        for index in range(FRAMES):
            before, after = max(index - 1, 0), min(index + 1, FRAMES - 1)
            spin = rotation_vector(rotation[after] @ rotation[before].T) / (after - before)
            local = xyz @ rotation[index].T + translation[index]
            place = self.lens.project(local)
            for _ in range(6 if self.readout else 0):
                when = self.readout * (place[:, 1] / SIZE[1] - 0.5)
                read = np.array([rotation_matrix(each) for each in when[:, None] * spin])
                place = self.lens.project(np.einsum("pij,pj->pi", read, local))
            place = place + drift[index] + rng.normal(0, NOISE, (POINTS, 2))
            # Beyond what this lens can see the polynomial comes back.
            ahead = np.linalg.norm(local[:, :2] / local[:, 2:], axis=1) < 1.0
            inside = np.nonzero(np.all((place > 0) & (place < SIZE), axis=1) & ahead)[0]
            frame.append(np.full(len(inside), index))
            track.append(inside)
            xy.append(place[inside])
        tracks = Tracks(
            tuple(range(1, FRAMES + 1)), 640, 360, np.concatenate(frame).astype(np.int32),
            np.concatenate(track).astype(np.int32), np.concatenate(xy), np.zeros((POINTS, 3), np.uint8),
        )  # fmt: skip
        return tracks, rotation, translation

    def solved(self, every: int = 1) -> Solution:
        """What a solver makes of it that begins near the true poses and takes the camera for a pinhole; only
        some of the frames have poses."""
        tracks, rotation, translation = self.tracks()
        made = solution.empty(tracks, START)
        made.rotation[::every], made.translation[::every] = rotation[::every], translation[::every]
        wide = replace(made, largest_error=40.0)
        solution.triangulate(wide)
        solution.drop_bad(wide)
        refine_focal_length(wide, START, KNOWN)
        made = replace(wide, largest_error=solution.LARGEST_ERROR)
        solution.triangulate(made)
        solution.drop_bad(made)
        refine_focal_length(made, START, KNOWN)
        solution.triangulate(made)
        solution.drop_bad(made)
        return made


@cache
def found_of(hand: Hand) -> Found | None:
    """Of a hand's clip."""
    found = find_lens(hand.solved(), START, KNOWN)
    if found is not None:
        focal = float(found.solution.focal[0])
        k1, k2 = found.lens.terms(found.lens.parameters, focal)
        print(f"focal {focal:.1f}, k1 {k1:.4f}, k2 {k2:.4f}, readout {found.lens.readout}")
    return found


@pytest.mark.parametrize(
    "k1", [pytest.param(-0.3, marks=pytest.mark.long), pytest.param(-0.1, marks=pytest.mark.long), 0.05]
)
def test_a_lens_that_bends_is_found(k1: float) -> None:
    hand = Hand(k1=k1)
    found = found_of(hand)
    assert found is not None and found.lens.readout == (0.0, 0.0)
    focal = float(found.solution.focal[0])
    assert focal == pytest.approx(FOCAL, rel=0.015)
    assert found.lens.terms(found.lens.parameters, focal)[0] == pytest.approx(k1, abs=0.015)
    # Within what it claims, of two deviations.
    assert abs(focal / FOCAL - 1) < 2 * found.focal_sigma
    # Its STMap takes the picture's corner to where the true lens has it.
    made = [_corner(lens) for lens in (hand.lens, found.lens.intrinsics(focal))]
    assert np.linalg.norm(made[0] - made[1]) < 0.5


def _corner(lens: Intrinsics) -> Floats:
    """(2,) pixels from the middle of a pinhole's picture, by the STMap, of the last pixel of the clip's."""
    canvas = Canvas(lens)
    u, v = redistort_map(canvas)[-1, -1]
    return np.array([u * canvas.pinhole.width, (1 - v) * canvas.pinhole.height]) - [
        canvas.pinhole.cx, canvas.pinhole.cy
    ]  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("readout", [0.4, -0.4])
def test_a_shutter_that_reads_rows_is_found(readout: float) -> None:
    found = found_of(Hand(readout=readout))
    assert found is not None and not found.lens.parameters[:4].any()
    assert found.lens.readout == (0.0, pytest.approx(readout, abs=0.06))


def test_both_are_found_of_one_camera() -> None:
    found = found_of(Hand(k1=-0.1, readout=0.4))
    assert found is not None
    k1, _ = found.lens.terms(found.lens.parameters, float(found.solution.focal[0]))
    assert k1 == pytest.approx(-0.1, abs=0.015) and found.lens.readout[1] == pytest.approx(0.4, abs=0.06)


NOTHING = {
    "a pinhole": Hand(),
    "straight ahead through a lens, without a turn": Hand(0.05, 0.4, path=(0, 0, 1.0), shake=0, yaw=0),
    "straight ahead without a turn": Hand(path=(0, 0, 1.0), shake=0, yaw=0),
    "a short path": Hand(path=(0.03, 0, 0.005), shake=0.05, yaw=0),
}


@pytest.mark.parametrize("name", variants(NOTHING, 2))
def test_what_is_not_there_or_not_told_is_held(name: str) -> None:
    assert found_of(NOTHING[name]) is None


def test_the_tracks_are_those_of_a_pinhole_once_it_is_taken_out() -> None:
    hand = Hand(k1=-0.1, readout=0.4)
    found = found_of(hand)
    assert found is not None
    tracks, made = hand.tracks()[0], found.solution
    assert np.array_equal(made.recorded, tracks.xy) and not np.allclose(made.tracks.xy, tracks.xy, atol=2)
    error = made.errors()[made.used]
    assert made.used.mean() > 0.98 and np.median(error) < 0.45
    reconstruction = found.lens.recording(solution.collect(made))
    image = reconstruction.images[0]
    assert np.isin(image.xy, tracks.xy).all()
    assert reconstruction.readout == found.lens.readout and reconstruction.cameras[0].k1 < -0.08
    # As reported, with the shutter: pinholes and lenses without it are off by more.
    told = report.report(
        reconstruction, tracks.frames, Figures(lens=report_of(found.lens, reconstruction.cameras[0].fx))
    )
    still = report.report(replace(reconstruction, readout=(0.0, 0.0)), tracks.frames, Figures())
    assert told.reprojection_error == pytest.approx(reconstruction.points.error.mean())
    assert told.reprojection_error < 0.45 < still.reprojection_error


def test_the_lens_is_found_with_a_focal_length_that_is_given(monkeypatch: pytest.MonkeyPatch) -> None:
    hand = Hand(k1=-0.1)
    made = hand.solved()
    made.focal[:] = FOCAL
    # Of many keyframes only some are looked at, and the others follow.
    monkeypatch.setattr(lens, "KEYS", 16)
    found = find_lens(made, FOCAL, 0.0)
    assert found is not None and np.all(found.solution.focal == FOCAL)
    assert np.isfinite(found.solution.translation).all() and found.solution.used.mean() > 0.98
    assert found.lens.intrinsics(FOCAL).k1 == pytest.approx(-0.1, abs=0.01)


@pytest.mark.long
@pytest.mark.parametrize(("k1", "readout"), [(-0.3, 0.0), (0.0, 0.5)], ids=["bends", "reads rows"])
def test_a_real_cameras_clip_is_solved_with_its_lens_and_shutter(
    k1: float, readout: float, tmp_path: Path
) -> None:
    """Pictures, through the worker, and what a working folder gives back."""
    frames, rng = 24, np.random.default_rng(3)
    share = np.linspace(-0.5, 0.5, frames)
    centre = np.column_stack([2 * share, 0.4 * share**2, 0.2 * share])
    phase, often = rng.uniform(0, 2 * np.pi, (3, 4)), rng.uniform(1, 5, (3, 4))
    turn = np.radians(1.0) * np.sin(2 * np.pi * often * share[:, None, None] + phase).sum(axis=2) / 2
    turn = turn + share[:, None] * [0.02, 0.16, 0.0]
    rotation = np.array([cv2.Rodrigues(each)[0] for each in turn])
    cameras = Cameras(*planes.SIZE, planes.FOCAL, rotation, -np.einsum("fij,fj->fi", rotation, centre))
    filmed = RealLens(256, 192, readout=readout, k1=k1)
    pictures = [
        filmed.recorded(planes.view(c, t).astype(np.float32), frame, cameras, planes.FOCAL)
        for frame, (c, t) in enumerate(zip(centre, turn, strict=True), 1)
    ]
    clip = planes.write_clip(tmp_path / "clip", [np.clip(each, 0, 255).astype(np.uint8) for each in pictures])
    process = SolveProcess(clip, tmp_path / "work")
    while not process.finished:
        process.poll()
        time.sleep(0.05)
    solved = load_solve(tmp_path / "work")
    camera = solved.reconstruction.cameras[0]
    print(camera, solved.reconstruction.readout, solved.quality.text({}))
    assert camera.fx == pytest.approx(planes.FOCAL, rel=0.03)
    assert camera.k1 == pytest.approx(k1, abs=0.03) and (k1 != 0 or not camera.is_distorted)
    assert solved.reconstruction.readout[1] == pytest.approx(readout, abs=0.1)
    assert solved.figures.lens is not None
    assert solved.figures.lens.readout == solved.reconstruction.readout
    error = solved.reconstruction.points.error.mean()
    assert solved.quality.reprojection_error == pytest.approx(error, rel=1e-3)
    true = Intrinsics(256, 192, planes.FOCAL, planes.FOCAL, 128.0, 96.0, k1)
    assert np.linalg.norm(_corner(true) - _corner(camera)) < 0.5
