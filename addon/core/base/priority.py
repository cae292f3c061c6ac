"""Processes that let others go first, such as the interface that started them."""

from __future__ import annotations

import contextlib
import os
import subprocess
from typing import Any

YIELDING = 10
"""Niceness, of 0 to 19, of a process that works while others are waited for. Chosen by inspection."""
CREATION_FLAGS = getattr(subprocess, "BELOW_NORMAL_PRIORITY_CLASS", 0)
"""The same for `subprocess.Popen` on Windows."""


def let_others_go_first(process: subprocess.Popen[Any]) -> None:
    """Lower the priority of a process that was just started; on Windows `CREATION_FLAGS` have done it."""
    if hasattr(os, "setpriority"):
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, process.pid, YIELDING)
