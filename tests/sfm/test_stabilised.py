"""Pictures that were shifted so that something in mid-scene stays in place are told from those of cameras."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from addon.cli.main import run_command
from addon.core.base.errors import UserError
from addon.core.camera.reconstruction import rotation_matrix
from addon.core.sfm.adjustment.bundle import Observations
from addon.core.sfm.adjustment.solution import Solution, empty
from addon.core.sfm.calibration.stabilised import compare, fit_shifts, refuse_shifted
from addon.core.sfm.tracking.tracks import Tracks

from .. import planes
from ..solving import refused

WIDTH, HEIGHT, FOCAL, FRAMES, POINTS = 640, 360, 544.0, 12, 300
KEYS = list(range(FRAMES))


def made(turn: float = 0.0, stays: float | None = None, noise: float = 0.05) -> Solution:
    """The truth as a solution of its tracks: a metre to the side past things 4 to 12 metres away, turning by
    radians, the pictures shifted so that what is at a depth `stays` in place."""
    rng = np.random.default_rng(5)
    depth = rng.uniform(4, 12, POINTS)
    xyz = np.column_stack([rng.uniform(-0.5, 0.5, POINTS), rng.uniform(-0.3, 0.3, POINTS), np.ones(POINTS)])
    xyz *= depth[:, None]
    frame, track = (part.ravel().astype(np.int32) for part in np.indices((FRAMES, POINTS)))
    steps = np.linspace(-0.5, 0.5, FRAMES)
    rotation = np.array([rotation_matrix(np.array([0, turn * s, 0.3 * turn * s])) for s in steps])
    translation = -np.einsum("fij,fj->fi", rotation, np.column_stack([steps, 0 * steps, 0 * steps]))
    local = np.einsum("mij,mj->mi", rotation[frame], xyz[track]) + translation[frame]
    xy = FOCAL * local[:, :2] / local[:, 2:] + [WIDTH / 2, HEIGHT / 2] + rng.normal(0, noise, (len(frame), 2))
    if stays is not None:
        xy[:, 0] += FOCAL * steps[frame] / stays
    tracks = Tracks(
        tuple(range(1, FRAMES + 1)), WIDTH, HEIGHT, frame, track, xy, np.zeros((POINTS, 3), np.uint8)
    )
    found = empty(tracks, FOCAL)
    found.rotation[:], found.translation[:], found.xyz[:] = rotation, translation, xyz
    return found


def turned_instead(shifted: Solution, stays: float) -> Solution:
    """A solve that takes the shifts for turns."""
    steps = np.linspace(-0.5, 0.5, FRAMES)
    for index, step in enumerate(steps):
        turn = rotation_matrix(np.array([0, step / stays, 0]))
        shifted.rotation[index] = turn
        shifted.translation[index] = -turn @ [step, 0, 0]
    return shifted


def test_depths_of_shifted_pictures_are_found_but_for_their_sign() -> None:
    shot = made(stays=7.0)
    xy = shot.tracks.xy - shot.centre
    found = fit_shifts(Observations(shot.tracks.frame_index, shot.tracks.track, xy), FRAMES, POINTS, 1.0)
    assert found is not None
    inverse, error = found
    assert np.median(error) < 0.2
    assert abs(np.corrcoef(inverse, 1 / shot.xyz[:, 2])[0, 1]) > 0.99


def test_shifted_pictures_are_refused() -> None:
    with pytest.raises(UserError, match="stabilized so that something in mid-scene stays in place"):
        refuse_shifted(turned_instead(made(stays=7.0), 7.0), KEYS)


@pytest.mark.parametrize("turn", [0.0, 0.05, 0.2])
def test_a_camera_is_not_taken_for_shifts(turn: float) -> None:
    refuse_shifted(made(turn), KEYS)
    compared = compare(made(turn), KEYS)
    assert compared is not None and compared.solved > 0.9 and compared.order > 0.8


def test_depths_in_another_order_than_the_motion_are_refused() -> None:
    shot = made()
    order = np.random.default_rng(0).permutation(POINTS)
    # Each point at another's depth, where the first frame saw it; the cameras as good as stand still.
    shot.xyz *= (shot.xyz[order, 2] / shot.xyz[:, 2])[:, None]
    compared = compare(shot, KEYS)
    assert compared is not None and compared.order < 0.3
    with pytest.raises(UserError):
        refuse_shifted(shot, KEYS)


@pytest.mark.long
def test_a_stabilised_clip_never_ends_as_a_success(tmp_path: Path) -> None:
    clip = planes.write_clip(tmp_path / "clip", planes.stabilised(10, 6.0))
    said = refused(clip, tmp_path / "work")
    assert "was stabilized" in said or "fit a static scene" in said


@pytest.mark.long
def test_a_good_solve_is_given_no_advice(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    clip = planes.write_clip(tmp_path / "clip", planes.sideways(10))
    compared = ("solve", clip, "--work", tmp_path / "work", "--focal", planes.FOCAL)
    assert run_command([str(each) for each in compared]) == 0
    assert "advice" not in capsys.readouterr().out
