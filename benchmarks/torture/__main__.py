"""`make torture`: tries of every fault, resumed where they were stopped, and a table of what they came to.

python -m benchmarks.torture --tries 100            every fault a hundred times, for hours
python -m benchmarks.torture --faults frames movie --tries 20
python -m benchmarks.torture --tries 0              only the table of what was tried so far
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from .bench import ROOT, Bench
from .faults import FAULTS

FOLDER = ROOT / "build" / "torture"
TABLE = ROOT / "benchmarks" / "results" / "torture.md"
KINDS = ("lost", "crash", "hang", "leftover", "wrong")


def main() -> int:
    """Try, tell and write the table; 1 where anything was not as it should be."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tries", type=int, default=100, metavar="N", help="of each fault, in all")
    parser.add_argument("--faults", nargs="+", choices=FAULTS, default=list(FAULTS))
    parser.add_argument("--minutes", type=float, default=float("inf"), help="stop after so long")
    parser.add_argument("--seed", default="0", help="of the tries")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="for results and scratch files")
    parser.add_argument("--table", type=Path, default=TABLE)
    options = parser.parse_args()
    results, until = options.folder / "results.jsonl", time.monotonic() + 60 * options.minutes
    known = read(results)
    done = {(each["fault"], each["seed"], each["number"]) for each in known}
    # By turns, so that a run that is stopped has tried everything.
    todo = [
        (fault, number)
        for number in range(options.tries)
        for fault in options.faults
        if number < FAULTS[fault].most and (fault, options.seed, number) not in done
    ]
    bench = Bench(options.folder / "bench") if todo else None
    for fault, number in todo:
        if time.monotonic() > until or bench is None:
            break
        began = time.monotonic()
        verdict = bench.attempt(FAULTS[fault].run, f"{options.seed} {fault} {number}")
        entry = {"fault": fault, "seed": options.seed, "number": number, **verdict.as_dict()}
        with results.open("a", encoding="utf-8") as file:
            file.write(json.dumps(entry) + "\n")
        known.append(entry)
        bad = [kind for kind in KINDS if entry[kind]]
        outcome = f"{', '.join(bad)} ({verdict.note})" if bad else "right"
        print(f"{fault} {number}: {outcome}, {time.monotonic() - began:.1f} s", flush=True)
    text = table(known)
    print(text)
    options.table.write_text(text, encoding="utf-8")
    return int(any(each[kind] for each in known for kind in KINDS))


def read(path: Path) -> list[dict[str, Any]]:
    """The tries so far; a last line that was cut off is not one."""
    entries = []
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        try:
            entries.append(json.loads(line))
        except ValueError:
            continue
    return entries


def table(entries: Iterable[dict[str, Any]]) -> str:
    """Markdown: a row a fault with the number of its tries and of those that came to what they must not."""
    rows: dict[str, list[int]] = {}
    for entry in entries:
        row = rows.setdefault(entry["fault"], [0] * (1 + len(KINDS)))
        row[0] += 1
        for at, kind in enumerate(KINDS, 1):
            row[at] += bool(entry[kind])
    total = [sum(column) for column in zip(*rows.values(), strict=True)] if rows else [0] * 6
    lines = [
        "# Torture", "",
        "Written by `make torture`. Each try is compared with an untouched run, to the bit.", "",
        "| fault | tries | lost | crash | hang | leftover | wrong success |",
        "|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    descriptions = {name: fault.description for name, fault in FAULTS.items() if name in rows}
    lines += [f"| {what} | {' | '.join(map(str, rows[name]))} |" for name, what in descriptions.items()]
    lines.append(f"| **all** | {' | '.join(map(str, total))} |")
    notes = [
        "", "Lost: something of the user's, or a finished frame, changed or gone, or the next run fails.",
        "Crash: ended by a signal that nobody sent, or by an error that is not one readable line.",
        "Leftover: files or processes that are there after the next run.",
        "Wrong success: status 0, and not the pictures of the reference.", "",
    ]  # fmt: skip
    return "\n".join(lines + notes)


if __name__ == "__main__":
    raise SystemExit(main())
