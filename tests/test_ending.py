"""Ctrl-C and SIGTERM end a run of tests with all that it has started."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PATIENCE = 60
"""Seconds until a run that was told to end is told once more: some thirty times what it takes."""
DEAF = """
import os, signal, subprocess, sys
from pathlib import Path
import pytest

WAITS = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); time.sleep(600)"

@pytest.mark.parametrize("number", range(2))
def test_deaf(number):
    for each in (signal.SIGINT, signal.SIGTERM):
        signal.signal(each, signal.SIG_IGN)
    child = subprocess.Popen([sys.executable, "-c", WAITS], start_new_session=True)
    part = Path(__file__).with_name(f"{number}.part")
    part.write_text(f"{os.getpid()} {child.pid}")
    part.rename(part.with_suffix(".pids"))
    child.wait()
"""
"""Two test processes that hear neither signal, and a child of each in a session of its own."""


def is_running(process: int) -> bool:
    """Whether a process is there and not only its status."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="processes are found in /proc")
@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_run_that_is_ended_leaves_no_process(tmp_path: Path, number: signal.Signals) -> None:
    (tmp_path / "test_deaf.py").write_text(DEAF)
    words = ["-m", "pytest", "-p", "tests.ending", "-p", "no:cacheprovider", "-n", "2", str(tmp_path)]
    run = subprocess.Popen(
        [sys.executable, *words], cwd=ROOT, start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        # A shell's background jobs ignore SIGINT, and their children inherit that.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    while len(files := list(tmp_path.glob("*.pids"))) < 2:
        assert run.poll() is None
        time.sleep(0.05)
    started = [int(each) for path in files for each in path.read_text().split()]
    assert all(map(is_running, started))
    # As a terminal sends it: to the whole group. Who sees no end of it presses again: Python drops an
    # exception that a signal raises in a destructor (seen once, on a machine that had more to do).
    for _ in range(3):
        os.killpg(run.pid, number)
        with contextlib.suppress(subprocess.TimeoutExpired):
            run.wait(PATIENCE)
            break
    assert run.poll() == pytest.ExitCode.INTERRUPTED
    assert not [process for process in started if is_running(process)]
