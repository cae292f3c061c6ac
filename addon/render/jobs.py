"""Several processes that render shares of the same frames side by side, on one machine."""

from __future__ import annotations

import itertools
import os
import queue
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import bpy

from ..core.base.errors import UserError
from ..core.sfm.report import ranges

HEADLESS = Path(__file__).resolve().parents[1] / "headless.py"
PATIENCE = 10.0
"""Seconds in which a process that was told to end must have ended; then it is killed."""
TRIES = 2
"""How often a share is begun before its frames are given up."""
_FRAME = re.compile(r"frame (-?\d+): \d+ of \d+")

Command = Callable[[Sequence[int], int], list[str]]
"""Arguments of the command line that render frames as the share of this number."""


def launcher() -> list[str]:
    """The words before the arguments with which another process of this command line is started."""
    if bpy.app.binary_path:
        return [
            bpy.app.binary_path, "--background", "--python-exit-code", "1", "--python", str(HEADLESS), "--",
        ]  # fmt: skip
    return [sys.executable, str(HEADLESS)]


def shares(frames: Sequence[int], count: int) -> list[list[int]]:
    """At most `count` runs of neighbouring frames, as equal as can be: neighbours share their depth."""
    cuts = [len(frames) * n // count for n in range(count + 1)]
    return [list(frames[a:b]) for a, b in itertools.pairwise(cuts) if a < b]


@dataclass
class _Share:
    """Frames that one process renders."""

    number: int
    todo: list[int]
    """Those that it has not told to be done."""
    tries: int = 0
    process: subprocess.Popen[str] | None = None
    said: list[str] = field(default_factory=list)
    """What it wrote on standard error last."""


def render_side_by_side(
    frames: Sequence[int],
    count: int,
    command: Command,
    done: Callable[[int], None],
    note: Callable[[str], None],
) -> None:
    """Render frames in `count` processes; `done` is told of each frame, in whichever order, and `note` of
    what a process says that the user should know.

    A process that fails is started once more for what it had left. UserError naming the frames that are not
    done at the end. Whatever is raised here, Ctrl-C included, ends all of them; where this process is killed
    they end by themselves.
    """
    told: queue.Queue[tuple[_Share, str | None]] = queue.Queue()
    running = [_Share(number, todo) for number, todo in enumerate(shares(frames, count))]
    failed: list[_Share] = []
    try:
        for share in running:
            _start(share, command, told)
        left = len(running)
        while left:
            share, line = told.get()
            if line is not None:
                if (match := _FRAME.match(line)) and int(match[1]) in share.todo:
                    share.todo.remove(int(match[1]))
                    done(int(match[1]))
                elif "not finite" in line:
                    note(line.strip())
                continue
            assert share.process is not None
            if share.process.wait() == 0 or not share.todo:
                left -= 1
            elif share.tries < TRIES:
                _start(share, command, told)
            else:
                failed.append(share)
                left -= 1
    finally:
        _end([share.process for share in running if share.process is not None])
    if failed:
        lost = sorted(frame for share in failed for frame in share.todo)
        reasons = {_reason(share) for share in failed}
        raise UserError(f"frames {ranges(lost)} could not be rendered: {'; '.join(sorted(reasons))}")


def _start(share: _Share, command: Command, told: queue.Queue[tuple[_Share, str | None]]) -> None:
    share.tries += 1
    share.said = []
    try:
        process = subprocess.Popen(
            [*launcher(), *command(share.todo, share.number), "--end-with-input"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            encoding="utf-8", errors="replace", env=os.environ | {"PYTHONUNBUFFERED": "1"},
            # Ctrl-C is for whoever started them, who ends them.
            start_new_session=True,
        )  # fmt: skip
    except OSError as error:
        raise UserError(f"no process can be started to render: {error.strerror}") from None
    share.process = process

    def listen() -> None:
        assert process.stdout is not None
        for line in process.stdout:
            told.put((share, line))
        complaints.join()
        told.put((share, None))

    def complain() -> None:
        assert process.stderr is not None
        for line in process.stderr:
            share.said = [*share.said, line.strip()][-20:]

    complaints = threading.Thread(target=complain, daemon=True)
    complaints.start()
    threading.Thread(target=listen, daemon=True).start()


def _end(processes: list[subprocess.Popen[str]]) -> None:
    """End processes, at first politely."""
    alive = [process for process in processes if process.poll() is None]
    for process in alive:
        process.terminate()
    for process in alive:
        try:
            process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _reason(share: _Share) -> str:
    assert share.process is not None
    status = share.process.returncode
    errors = [line for line in share.said if line.startswith("error: ")]
    if errors:
        return errors[-1].removeprefix("error: ")
    if status < 0:
        return f"the process was ended by {signal.Signals(-status).name}"
    return f"the process ended with status {status}" + (f" ({share.said[-1]})" if share.said else "")


def end_with_input() -> None:
    """From now on end this process, as SIGTERM does, when its standard input closes: its parent is gone."""

    def watch() -> None:
        while os.read(0, 1):
            pass
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=watch, daemon=True).start()
