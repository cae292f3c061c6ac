"""Commands of the command line, in a process of their own and in this one."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from addon.cli.main import run_command

HEADLESS = Path(__file__).resolve().parents[1] / "addon" / "headless.py"


def headless(
    *arguments: object, cwd: Path | None = None, environment: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """A command in a Blender of its own, as people start it: two seconds more than `run`."""
    return subprocess.run(
        [sys.executable, str(HEADLESS), *map(str, arguments)],
        capture_output=True, text=True, cwd=cwd, check=False,
        env=os.environ | {"PYTHONUNBUFFERED": "1"} | (environment or {}),
    )  # fmt: skip


def run(*arguments: object) -> int:
    """The exit status of a command without a Blender of its own, which takes two seconds to start."""
    return run_command([str(argument) for argument in arguments])
