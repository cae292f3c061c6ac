"""Lower priority for child processes, so that the interface stays responsive."""

from __future__ import annotations

import contextlib
import os
import subprocess
from typing import Any

YIELDING = 10
"""Niceness in [0, 19] of a background process. Chosen by inspection."""
CREATION_FLAGS = getattr(subprocess, "BELOW_NORMAL_PRIORITY_CLASS", 0)
"""The same for `subprocess.Popen` on Windows."""


def let_others_go_first(process: subprocess.Popen[Any]) -> None:
    """Lower the priority of a process that was just started; on Windows `CREATION_FLAGS` does it."""
    if hasattr(os, "setpriority"):
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, process.pid, YIELDING)
