"""The short form of `make torture`: a few tries of each fault that takes seconds, always the same ones."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from benchmarks.torture import __main__ as torture
from benchmarks.torture.bench import Bench
from benchmarks.torture.faults import FAULTS
from benchmarks.torture.mutations import mutate

QUICK = (
    "frames",
    "movie",
    "overwriting",
    "saving",
    "solving",
    "file-size",
    "other-frames",
    "output",
    "solve",
    "masks",
)


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    return Bench(tmp_path_factory.mktemp("torture") / "bench")


@pytest.mark.parametrize("fault", QUICK)
def test_nothing_is_lost_left_or_wrong(bench: Bench, fault: str) -> None:
    verdict = bench.attempt(FAULTS[fault].run, f"test {fault}")
    assert not any(getattr(verdict, kind) for kind in torture.KINDS), verdict.note


def test_the_table_counts_what_was_tried(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    right = (
        '{"fault": "frames", "lost": false, "crash": false, "hang": false, "leftover": false, "wrong": %s}\n'
    )
    # A run that was killed leaves half a line.
    path.write_text(right % "false" + right % "true" + right[:20])
    entries = torture.read(path)
    assert len(entries) == 2
    rows = [line for line in torture.table(entries).splitlines() if line.startswith("|")]
    assert rows[-2].endswith("| 2 | 0 | 0 | 0 | 0 | 1 |") and rows[-1].startswith("| **all** | 2 |")


def test_mutations_are_of_every_kind() -> None:
    data = b"one two\nthree 4 5\nsix\n" * 3
    found = {mutate(random.Random(seed), data) for seed in range(200)}
    assert len(found) > 100 and b"" in found and any(b"nan" in each for each in found)
