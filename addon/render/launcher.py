"""Other processes of this command line."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import bpy

from ..core.base.child import Child, Hear

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


def start(
    arguments: Sequence[str], hear: Hear, yielding: bool = False, environment: Mapping[str, str] | None = None
) -> Child:
    """Start a command of this command line, with more in its environment; arguments and errors as of
    `Child`."""
    return Child([*launcher(), *arguments, CHILD], hear, yielding, {**os.environ, **(environment or {})})
