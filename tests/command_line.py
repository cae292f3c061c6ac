"""Commands of the command line, in a process of their own and in this one."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from addon.cli.main import run_command

HEADLESS = Path(__file__).resolve().parents[1] / "addon" / "headless.py"

type Ended = subprocess.CompletedProcess[str]


def headless(*arguments: object, environment: dict[str, str] | None = None) -> Ended:
    """A command in a Blender of its own, as people start it: two seconds more than `here`."""
    return subprocess.run(
        [sys.executable, str(HEADLESS), *map(str, arguments)],
        capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONUNBUFFERED": "1"} | (environment or {}),
    )  # fmt: skip


def run(*arguments: object) -> int:
    """The exit status of a command in this process, where Blender knows our classes."""
    return run_command([str(argument) for argument in arguments])


def here(*arguments: object) -> Ended:
    """The same with what it says: as `headless`, without a process."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        with _into(out, 1), _into(err, 2):
            status = run(*arguments)
        out.seek(0)
        err.seek(0)
        return subprocess.CompletedProcess(arguments, status, out.read().decode(), err.read().decode())


def done(*arguments: object) -> str:
    """What a command in this process says, which must not fail."""
    ended = here(*arguments)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


@contextlib.contextmanager
def _into(file: IO[bytes], descriptor: int) -> Iterator[None]:
    """Write what goes to standard output (1) or error (2) into a file, Python's and that of C code."""
    redirected = contextlib.redirect_stdout if descriptor == 1 else contextlib.redirect_stderr
    kept = os.dup(descriptor)
    os.dup2(file.fileno(), descriptor)
    try:
        with os.fdopen(os.dup(file.fileno()), "w", buffering=1) as stream, redirected(stream):
            yield
    finally:
        os.dup2(kept, descriptor)
        os.close(kept)


def words_of(task: list[str]) -> list[str]:
    """What follows the program in the command of a farm's task."""
    return task[task.index(str(HEADLESS)) + 1 :]
