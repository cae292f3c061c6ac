"""Other processes of this command line."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import bpy

from ...core.base import limits
from ...core.base.atomic import write_bytes
from ...core.base.job import Job

HEADLESS = Path(__file__).resolve().parents[2] / "headless.py"
JOB = "--job"
"""Before the file of a job, instead of a command."""


def launcher() -> list[str]:
    """Return the words before the arguments with which another process of this command line is started."""
    if bpy.app.binary_path:
        return [
            bpy.app.binary_path, "--background", "--python-exit-code", "1", "--python", str(HEADLESS), "--",
        ]  # fmt: skip
    return [sys.executable, str(HEADLESS)]


def start(
    job: Job,
    file: Path,
    arguments: Sequence[object],
    scene: str = "",
    one_thread: bool = False,
    yields: bool = True,
    **more: object,
) -> None:
    """Have another process of this command line do a job, which it reads in a file.

    A window goes first, unless the user waits for the process (`yields`).

    `arguments` are those of a command, or the name of one of `engine_jobs.JOBS`; people cannot ask for a
    .blend's `scene` and for `more`. UserError where the file cannot be written, and as of `Job.start`.
    """
    told = {"arguments": [str(each) for each in arguments], "scene": scene, **more}
    told["scripts"] = not bpy.app.autoexec_fail
    write_bytes(file, json.dumps(told).encode())
    environment = os.environ | (limits.ONE_THREAD if one_thread else {})
    job.start([*launcher(), JOB, str(file)], yields and not bpy.app.background, environment)
