"""Messages of one process to another."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from addon.core.base.errors import Remedy
from addon.core.base.messages import (
    Cancel,
    Failure,
    Message,
    Parcel,
    Progress,
    Result,
    Warned,
    decode,
    encode,
    send,
)  # fmt: skip
from addon.core.base.worker import Worker, end, end_all, tend

from ..waiting import until

ROOT = Path(__file__).resolve().parents[2]
SPEAK = "import os, sys; from addon.core.base.messages import *; speak();"


@pytest.mark.parametrize(
    "message",
    [
        Progress("depth", 3, 118), Progress("frames", 1, 2, -7), Warned("a \"quote\"\nand a line"), Result(),
        Progress("a", 1, 2, share=0.25),
        Failure("no: \u00e9", (Remedy.WORK_DIR, Remedy.AGAIN)), Cancel(3), Parcel(3, "a/b", False),
    ],
)  # fmt: skip
def test_a_message_is_one_line_that_is_read_as_it_was(message: Message) -> None:
    line = encode(message)
    assert "\n" not in line and decode(line + "\n") == message


@pytest.mark.parametrize(
    "line",
    ["", "frame 3: 1 of 2, 0.5 s", "3", "null", "[]", "{}", '{"message": "other"}', '{"message": "Warned"}',
     '{"message": []}', '{"message": "Result", "more": 1}',
     '{"message": "Failure", "text": "a", "code": 1, "remedies": ["none"]}', "[" * 100_000],
)  # fmt: skip
def test_what_is_no_message_is_none(line: str) -> None:
    assert decode(line) is None


def test_a_process_that_people_started_sends_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    send(Result())
    assert capfd.readouterr().out == ""


def started(script: str) -> Worker:
    """A process that runs a script."""
    job = Worker()
    job.start([sys.executable, "-c", SPEAK + script], environment=os.environ | {"PYTHONPATH": str(ROOT)})
    return job


def heard(script: str) -> tuple[Worker, list[Message]]:
    """A process that runs a script, and what it said until it ended."""
    job, messages = started(script), list[Message]()
    until(lambda: messages.extend(job.poll()) or not job.is_running)
    return job, messages


def test_only_messages_are_heard_whatever_is_printed() -> None:
    job, messages = heard(
        "print('frame 1: 1 of 2'); os.write(1, b'{\"message\": \"result\"}\\n'); send(Progress('a', 1, 2));"
        "os.system('echo x'); send(Result())"
    )
    assert messages == [Progress("a", 1, 2), Result()] and job.failure is None


@pytest.mark.parametrize(("said", "expected"), [(None, "1"), ("3", "3")])
def test_a_process_has_one_blas_thread_unless_the_user_says_more(
    said: str | None, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    if said:
        monkeypatch.setenv("OPENBLAS_NUM_THREADS", said)
    _, messages = heard("send(Progress(os.environ['OPENBLAS_NUM_THREADS'], 1, 2)); send(Result())")
    assert messages[0] == Progress(expected, 1, 2)


def test_a_process_that_did_not_say_that_it_is_done_has_failed() -> None:
    job, _ = heard("")
    assert job.failure == Failure("the process ended with status 0")
    job, _ = heard("sys.stderr.write('one\\nerror: two\\n'); os._exit(7)")
    assert job.failure == Failure("the process ended with status 7 (two)")
    job, messages = heard("send(Failure('no')); os._exit(2)")
    assert messages == [Failure("no")] and job.failure == messages[0]
    job, _ = heard(f"os.kill(os.getpid(), {int(signal.SIGKILL)})")
    assert job.failure is not None and "was ended by SIGKILL" in job.failure.text


def test_a_process_that_dies_after_it_was_done_has_done_its_work() -> None:
    job, _ = heard("send(Result()); os.abort()")
    assert job.failure is None


def test_a_process_that_does_not_listen_is_killed() -> None:
    script = (
        "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); send(Result()); time.sleep(9000)"
    )
    job = started(script)
    until(lambda: job.poll() == [Result()])
    end([job], 0.2)
    assert job.process is not None and job.process.returncode == -signal.SIGKILL
    end([job])


def test_processes_that_are_left_are_killed_in_the_end() -> None:
    deaf = (
        "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); send(Result()); time.sleep(9000)"
    )
    job, done = started(deaf), list[str]()
    until(lambda: job.poll() == [Result()])
    job.leave(lambda: done.append("then"))
    tend()
    assert done == [] and job.process is not None and job.process.poll() is None
    end_all(0.1)
    assert done == ["then"] and job.process.returncode == -signal.SIGKILL


def test_more_than_a_pipe_holds_is_heard_however_it_is_cut() -> None:
    text = "\u00e9" * 3000
    job, messages = heard(f"[send(Warned({text!r} + str(n))) for n in range(200)]; send(Result())")
    assert messages == [*(Warned(f"{text}{n}") for n in range(200)), Result()]
    assert job.failure is None and len(job.warnings) == 200


def test_a_process_is_at_its_end_though_another_holds_its_pipes() -> None:
    other = "subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(10)'])"
    job = Worker()
    job.start([sys.executable, "-c", f"import subprocess, sys; {other}"])
    until(lambda: job.poll() == [] and not job.is_running)
    assert job.failure == Failure("the process ended with status 0")


def is_there(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def test_a_process_ends_with_the_one_that_started_it() -> None:
    inner = SPEAK + "import time; print(os.getpid(), file=sys.stderr, flush=True); time.sleep(9000)"
    outer = (
        "import os, sys, time; from addon.core.base.worker import Worker; job = Worker();"
        f"job.start([sys.executable, '-c', {inner!r}]);\n"
        "while not job._complaints: job.poll(); time.sleep(0.01)\n"
        "print(job._complaints[0], flush=True); os.kill(os.getpid(), 9)"
    )
    ended = subprocess.run(
        [sys.executable, "-c", outer], stdout=subprocess.PIPE, text=True, check=False,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert ended.returncode == -signal.SIGKILL
    # The pipe is closed by the last of both.
    number = int(ended.stdout)
    until(lambda: not is_there(number))
