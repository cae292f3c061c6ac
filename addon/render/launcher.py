"""Other processes of this command line."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path

import bpy

from ..core.base import limits
from ..core.base.job import Job

HEADLESS = Path(__file__).resolve().parents[1] / "headless.py"
CHILD = "--child"
"""Option of commands: be a child, as `messages.speak` has it."""


def launcher() -> list[str]:
    """The words before the arguments with which another process of this command line is started."""
    if bpy.app.binary_path:
        return [
            bpy.app.binary_path, "--background", "--python-exit-code", "1", "--python", str(HEADLESS), "--",
        ]  # fmt: skip
    return [sys.executable, str(HEADLESS)]


def start(job: Job, arguments: Sequence[str], yielding: bool = False, one_thread: bool = False) -> None:
    """Have a command of this command line do a job; `yielding` and errors as of `Job.start`."""
    environment = os.environ | (limits.ONE_THREAD if one_thread else {})
    job.start([*launcher(), *arguments, CHILD], yielding, environment)
