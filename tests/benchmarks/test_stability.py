"""Hard cases: a right picture or a clear refusal; and that the table of them sees what is wrong."""

from __future__ import annotations

import os
import subprocess
import sys
import time
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.base.progress import reporting
from addon.core.focus.focus import Focus
from addon.core.frame.plan import FrameOptions
from benchmarks.stability.__main__ import Case, Measure, table
from benchmarks.stability.reference import (
    LENS,
    displacement_error,
    map_picture,
    one_triangle,
    plane_picture,
    plane_places,
    psnr,
    rendered,
    shot,
)

from ..scenes import painted, planned

ROOT = Path(__file__).resolve().parents[2]


def test_every_cheap_case_is_right_or_refused() -> None:
    from addon.render.views import gpu_views

    problem = gpu_views.gpu_problem()
    if problem:
        pytest.skip(f"no GPU context can be had: {problem}")
    rows = list(table(cheap=True))
    assert len(rows) > 200
    wrong = [str(row) for row in rows if row.is_wrong]
    assert not wrong, "\n".join(wrong)
    assert all(row.outcome == "right" or row.outcome.startswith("refused: ") for row in rows)


# The table itself: this module's cases go wrong in every way that there is.

THIS = "tests.benchmarks.test_stability"
"""pytest knows it by another name, because the root is a package too."""


def _measured(value: float) -> list[Measure]:
    return [Measure(value, "px", 0.01)]


def _displaced() -> list[Measure]:
    picture = map_picture(96, 54)
    return [Measure(displacement_error(picture[:, 1:], picture[:, :-1], (96, 54)), "px", 0.01)]


def _raising(error: Exception) -> list[Measure]:
    raise error


def _sleeping() -> list[Measure]:
    time.sleep(120)
    return []


def _aborting() -> list[Measure]:
    os.abort()


def _warning() -> list[Measure]:
    warnings.warn("overflow", RuntimeWarning, stacklevel=1)
    return _measured(0.0)


def cases() -> list[Case]:
    """For `benchmarks.stability`, which imports this module by its name."""
    clear = UserError("the wheel is square; choose a round one")
    return [
        Case("fine", "nothing", lambda: _measured(0.001)),
        Case("a pixel off", "a shifted picture", _displaced),
        Case("no number", "nothing", lambda: _measured(float("nan"))),
        Case("nothing measured", "nothing", lambda: []),
        Case("a bug", "raise", lambda: _raising(ValueError("wheel"))),
        Case("a warning", "warn", _warning),
        Case("clear refusal", "raise", lambda: _raising(clear), "refused"),
        Case("wrongly refused", "raise", lambda: _raising(clear)),
        Case("refused without advice", "raise", lambda: _raising(UserError("no")), "refused"),
        Case("wrongly accepted", "nothing", lambda: _measured(0.0), "refused"),
        Case("aborts", "abort", _aborting),
        Case("fine after a crash", "nothing", lambda: _measured(0.0)),
        Case("hangs", "sleep", _sleeping, seconds=1.0),
        Case("fine after a hang", "nothing", lambda: _measured(0.0)),
    ]


def test_the_table_reports_what_is_wrong_and_goes_on() -> None:
    outcomes = {row.case: row.outcome for row in table(THIS)}
    assert list(outcomes) == [case.name for case in cases()]
    right = {name for name, outcome in outcomes.items() if not outcome.startswith("WRONG")}
    assert right == {"fine", "clear refusal", "fine after a crash", "fine after a hang"}
    expected = {
        "a pixel off": "WRONG: wanted <= 0.01 px",
        "no number": "WRONG: wanted <= 0.01 px",
        "a bug": "WRONG: ValueError: wheel",
        "a warning": "WRONG: RuntimeWarning: overflow",
        "clear refusal": "refused: the wheel is square; choose a round one",
        "wrongly refused": "WRONG: refused: the wheel is square; choose a round one",
        "refused without advice": "WRONG: refused without saying what to do: no",
        "wrongly accepted": "WRONG: not refused",
        "hangs": "WRONG: hangs: no end after 1 s",
    }
    assert {name: outcomes[name] for name in expected} == expected
    crash = "WRONG: crashes: SIGABRT" if os.name == "posix" else "WRONG: crashes: status"
    assert outcomes["aborts"].startswith(crash)


@pytest.mark.parametrize(("only", "status"), [("fine", 0), ("pixel", 1), ("no such case", 1)])
def test_the_command_ends_with_a_status(only: str, status: int) -> None:
    command = [sys.executable, "-m", "benchmarks.stability", "--cases", THIS, "--only", only]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, cwd=ROOT)
    assert ended.returncode == status, ended.stderr
    lines = ended.stdout.splitlines()
    assert lines[0] == "| case | run | error | outcome |"
    assert len(lines) == 2 + sum(only in case.name for case in cases())
    assert all(line.count("|") == 5 for line in lines)


# The references, against each other and by hand.


def test_the_float64_renderer_draws_a_plane_as_its_closed_form_does() -> None:
    offsets = 0.7 * np.array([[1.0, 0.0], [-0.3, 0.8], [0.0, -1.0]])
    plan = one_triangle(LENS, 1 / 8, (4e-4, -3e-4), 1 / 6, offsets)
    shown = plane_places(LENS, 1 / 8, (4e-4, -3e-4), 1 / 6, offsets)
    picture = map_picture(96, 54)
    assert psnr(rendered(plan, picture), plane_picture(shown, picture)) > 200 - 1e-9


def test_the_closed_form_by_hand() -> None:
    """f = 80, offset 0.5 to the right, contrast 1/8 - 1/6: seen 80 * 0.5 / 24 pixels further right."""
    shown = plane_places(LENS, 1 / 8, (0.0, 0.0), 1 / 6, np.array([[0.5, 0.0]]))
    assert shown[0, 10, 20] == pytest.approx([20.5 - 40 / 24, 10.5])


# Fixes that the table alone would not explain.


def test_memory_that_runs_out_while_drawing_is_a_users_error() -> None:
    from addon.render.views import gpu_views

    if gpu_views.gpu_problem():
        pytest.skip("no GPU context can be had")
    plan = planned(shot(), 1, FrameOptions(Focus(distance=8.0), 0.3, 4), (96, 54))

    def no_room(_stage: str, _share: float) -> None:
        raise MemoryError

    with (
        reporting(no_room),
        pytest.raises(UserError, match=r"not enough memory to draw a picture of 96x54; render at a lower"),
    ):
        gpu_views.mean_of_views(*painted(plan, map_picture(96, 54)))


def test_one_point_in_the_lens_does_not_refuse_the_frame() -> None:
    """Its disc is cut to a size at which nothing is left of it; the mesh still covers the border."""
    rec = shot(frames=(1,))
    xyz = rec.points.xyz.copy()
    xyz[0] *= 1e-4
    rec = replace(rec, points=replace(rec.points, xyz=xyz))
    plan = planned(rec, 1, FrameOptions(Focus(distance=8.0), 0.3, 16), (96, 54))
    discs = 2 * 0.3 * LENS.fx * np.abs(plan.mesh.inverse_depth - 1 / 8)
    assert discs.max() == pytest.approx(16 * np.hypot(96, 54))
    assert plan.mesh.xy.min() < -discs.max() / 2
