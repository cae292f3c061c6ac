"""Hard cases through the pipeline's numerical parts: a right picture or a clear refusal, nothing else.

`python -m benchmarks.stability` prints a Markdown table and exits with status 1 if a row is wrong: a crash, a
hang, a number that is none, a picture that differs from its reference, or an exception that is not for users.
Cases run in a child process, so that one that takes the process with it, or never ends, is only a row.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import json
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import warnings
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO

import numpy as np

from addon.core.base.errors import UserError

MARK = "stability-case "
ROOT = Path(__file__).resolve().parents[2]
CASES = "benchmarks.stability.geometry_cases"
START_SECONDS = 120.0
"""To import Blender on a busy machine."""
MEMORY = 12 << 30
"""Bytes of address space for the child: a case that asks for more must fail alone."""


@dataclass(frozen=True)
class Measure:
    """One figure of a case and the limit that makes it right."""

    value: float
    unit: str
    limit: float
    is_least: bool = False
    """The limit is the least that will do, not the most."""

    @property
    def holds(self) -> bool:
        if not np.isfinite(self.value):
            return False
        return self.value >= self.limit if self.is_least else self.value <= self.limit

    def __str__(self) -> str:
        return f"{self.value:.2g} {self.unit}" if abs(self.value) < 10 else f"{self.value:.1f} {self.unit}"


@dataclass(frozen=True)
class Case:
    """One row to be: `check` returns what it measured, or raises."""

    name: str
    run: str
    """What is run, for the table."""
    check: Callable[[], list[Measure]]
    expected: str = "right"
    """right, refused, or either."""
    seconds: float = 60.0
    """After which it counts as hanging."""
    cheap: bool = True
    """Belongs to the tests too."""


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    case: str
    run: str
    error: str
    outcome: str

    @property
    def is_wrong(self) -> bool:
        return self.outcome.startswith("WRONG")

    def __str__(self) -> str:
        cells = (self.case, self.run, self.error, self.outcome)
        return "| " + " | ".join(cell.replace("|", "/").replace("\n", " ") for cell in cells) + " |"


HEAD = "| case | run | error | outcome |\n|---|---|---|---|"


def judged(case: Case) -> Row:
    """Run one case here and judge it; only a crash of the process or a hang gets past this."""
    try:
        with warnings.catch_warnings():
            # numpy's warnings would reach the user's console: they count as bugs.
            warnings.simplefilter("error", RuntimeWarning)
            measures = case.check()
    except UserError as error:
        return Row(case.name, case.run, "-", _refusal(case, str(error)))
    except Exception as error:  # that is what the table is to show
        return Row(case.name, case.run, "-", f"WRONG: {type(error).__name__}: {error}")
    errors = ", ".join(str(measure) for measure in measures)
    missed = [m for m in measures if not m.holds]
    if case.expected == "refused":
        return Row(case.name, case.run, errors, "WRONG: not refused")
    if missed or not measures:
        wanted = ", ".join(f"{'>=' if m.is_least else '<='} {m.limit:g} {m.unit}" for m in missed)
        return Row(case.name, case.run, errors, f"WRONG: wanted {wanted or 'a measure'}")
    return Row(case.name, case.run, errors, "right")


def _refusal(case: Case, message: str) -> str:
    if case.expected == "right":
        return f"WRONG: refused: {message}"
    # House style: what is wrong; what to do.
    if "\n" in message or "; " not in message:
        return f"WRONG: refused without saying what to do: {message}"
    return f"refused: {message}"


def table(module: str = CASES, cheap: bool = False, only: str = "") -> Iterator[Row]:
    """The rows of a module's `cases()`, each run in a child process; a child that ends early is replaced."""
    cases = _cases(module)
    left = [c for c in cases if (c.cheap or not cheap) and only in c.name]
    while left:
        with _Child(module, [case.name for case in left]) as child:
            if not child.is_ready():
                yield from (Row(c.name, c.run, "-", f"WRONG: no start: {child.last_words()}") for c in left)
                return
            while left:
                case = left.pop(0)
                row = child.row(case)
                yield row
                if not child.is_alive:
                    break


class _Child:
    """A process that runs cases in order and writes a line for each."""

    def __init__(self, module: str, names: list[str]) -> None:
        self._log = tempfile.TemporaryFile("w+", errors="replace")  # noqa: SIM115
        self._process = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.stability", "--child", "--cases", module],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._log, text=True, cwd=ROOT,
        )  # fmt: skip
        assert self._process.stdin is not None and self._process.stdout is not None
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.write(json.dumps(names))
            self._process.stdin.close()
        self.is_alive = True
        self._lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._reader = threading.Thread(target=self._read, args=(self._process.stdout,), daemon=True)
        self._reader.start()

    def __enter__(self) -> _Child:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        self._reader.join()
        assert self._process.stdout is not None
        self._process.stdout.close()
        self._log.close()

    def _read(self, stdout: IO[str]) -> None:
        for line in stdout:
            # Blender writes to the same descriptor, not always to a line's end.
            if MARK in line:
                self._lines.put(line[line.index(MARK) + len(MARK) :])
        self._lines.put(None)

    def is_ready(self) -> bool:
        """Wait until the cases are imported."""
        with contextlib.suppress(queue.Empty):
            return self._lines.get(timeout=START_SECONDS) is not None
        return False

    def row(self, case: Case) -> Row:
        """Wait for the next case's row."""
        try:
            line = self._lines.get(timeout=case.seconds)
        except queue.Empty:
            self.is_alive = False
            return Row(case.name, case.run, "-", f"WRONG: hangs: no end after {case.seconds:g} s")
        if line is None:
            self.is_alive = False
            status = self._process.wait()
            how = signal.Signals(-status).name if status < 0 else f"status {status}"
            return Row(case.name, case.run, "-", f"WRONG: crashes: {how}: {self.last_words()}")
        return Row(**json.loads(line))

    def last_words(self) -> str:
        self._log.seek(0)
        return (self._log.read().strip().splitlines() or ["no message"])[-1]


def _cases(module: str) -> list[Case]:
    cases: list[Case] = importlib.import_module(module).cases()
    names = [case.name for case in cases]
    twice = {name for name in names if names.count(name) > 1}
    assert not twice, f"two cases have one name: {sorted(twice)}"
    return cases


def _run_child(module: str) -> None:
    names = json.load(sys.stdin)
    by_name = {case.name: case for case in _cases(module)}
    _limit_memory()
    print(MARK, flush=True)
    for name in names:
        print(f"\n{MARK}{json.dumps(asdict(judged(by_name[name])))}", flush=True)


def _limit_memory() -> None:
    with contextlib.suppress(ImportError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cheap", action="store_true", help="only what the tests run too")
    parser.add_argument("--only", default="", metavar="TEXT", help="only cases whose name has TEXT in it")
    parser.add_argument("--cases", default=CASES, metavar="MODULE", help=argparse.SUPPRESS)
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.child:
        _run_child(arguments.cases)
        return 0
    print(HEAD)
    wrong = total = 0
    for row in table(arguments.cases, arguments.cheap, arguments.only):
        print(row, flush=True)
        total += 1
        wrong += row.is_wrong
    print(f"{total} cases, {wrong} wrong", file=sys.stderr)
    return 1 if wrong or not total else 0


if __name__ == "__main__":
    sys.exit(main())
