"""Solving a clip in the worker process, to its end or to its refusal."""

from __future__ import annotations

from pathlib import Path

import pytest

from addon.core.base.errors import UserError
from addon.core.media.clip import FrameRange
from addon.core.sfm.process import SolveProcess, SolveProgress
from addon.core.sfm.workspace import Solve, load_solve

from .waiting import until


def solve(
    clip: Path,
    work: Path,
    again: bool = False,
    frames: FrameRange | None = None,
    focal: float | None = None,
    steps: list[SolveProgress] | None = None,
) -> Solve:
    """Solve in a worker process; its progress is added to `steps`. UserError for a refusal."""
    process = SolveProcess(clip, work, frames=frames, focal=focal, again=again)
    try:
        process.wait(lambda step: steps.append(step) if steps is not None else None)
    finally:
        process.cancel()
    return load_solve(work)


def begun(process: SolveProcess) -> list[SolveProgress]:
    """The first progress that the worker reports."""
    said: list[SolveProgress] = []
    until(lambda: said.extend(process.poll()) or said, "the worker reports nothing")
    return said


def refused(clip: Path, work: Path) -> str:
    """The one line that says why a clip is not solved, and nothing is left behind."""
    with pytest.raises(UserError) as error:
        solve(clip, work)
    assert not work.exists()
    assert "\n" not in str(error.value)
    return str(error.value)


def snapshot(folder: Path) -> dict[str, bytes]:
    """Contents of all files by their path in the folder."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}
