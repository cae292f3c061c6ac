"""Real clips: whether they are solved or refused, and how much depth they show.

`python -m benchmarks.special real_clips` solves those of the folder of real footage (`VA_DATA`) and writes
the table `benchmarks/results/real_margins.md`; with names, only these, the other rows being kept.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path

from addon.core.sfm.workspace import load_solve

from .. import store
from .__main__ import RESULTS, solve

DATA = Path(os.environ.get("VA_DATA", store.ROOT.parent / "shared" / "data"))
CLIPS = {
    "duck": "duck/demo.mp4", "dog": "clips/dog.mp4", "paraglider": "clips/paraglider.mp4",
    "backpack": "clips/backpack.mp4", "robot": "clips/robot.mp4", "room": "room/images",
    "kermit": "kermit/kermit###.jpg", "voodoo": "voodoo/frame-######.png",
}  # fmt: skip
STORED = RESULTS / "real_margins.json"


def main() -> None:
    rows = json.loads(STORED.read_text()) if STORED.exists() else {}
    for name in sys.argv[1:] or CLIPS:
        with tempfile.TemporaryDirectory() as folder:
            work = Path(folder) / "work"
            message = solve(DATA / CLIPS[name], work, None, "harris", False)
            evidence = None if message else load_solve(work).figures.depth_evidence
            advice = "" if message else load_solve(work).quality.advice
        rows[name] = {
            "outcome": message or f"solved; advice: {advice or 'none'}",
            **({} if evidence is None else asdict(evidence)),
        }
        print(name, rows[name], flush=True)
        STORED.write_text(json.dumps(rows, indent=1, sort_keys=True) + "\n")
    (RESULTS / "real_margins.md").write_text(table(rows))


def table(rows: dict[str, dict[str, object]]) -> str:
    """The rows as Markdown."""
    lines = [
        "# Depth in real clips", "",
        "*GRIC*, *parallax*, *noise* and *misfit* are as in [the table of motions](motions.md); those of a"
        " refused clip are in its message (`python -m benchmarks.special real_clips`).", "",
        "| clip | GRIC | parallax | noise | misfit | outcome |", "|---|---|---|---|---|---|",
    ]  # fmt: skip
    for name, row in rows.items():
        values = [row.get(key) for key in ("gain", "parallax", "noise", "misfit")]
        cells = [f"{value:.2f}" if isinstance(value, float) else "" for value in values]
        lines.append(f"| {name} | {' | '.join(cells)} | {row['outcome']} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
