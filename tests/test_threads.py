"""Every place that starts a thread stands in ARCHITECTURE.md with its reason, and what runs there names no
`bpy`."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
ADDON = ROOT / "addon"
STARTS = {"Thread", "ThreadPoolExecutor", "Timer", "start_new_thread", "ThreadPool"}


def started(path: Path) -> list[ast.Call]:
    """The calls in a file that start threads."""
    calls = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)]
    return [call for call in calls if ast.unparse(call.func).rpartition(".")[2] in STARTS]


STARTING = {path.relative_to(ADDON).as_posix(): path for path in ADDON.rglob("*.py") if started(path)}


def test_each_place_is_listed_with_its_reason() -> None:
    section = (ROOT / "ARCHITECTURE.md").read_text().split("## Threads")[1].split("\n## ")[0]
    rows = re.findall(r"^\| `([\w/]+\.py)` \| (.+) \| (.+) \|$", section, re.MULTILINE)
    assert sorted(place for place, _, _ in rows) == sorted(STARTING)
    assert all(reason and end for _, reason, end in rows)


@pytest.mark.parametrize("place", sorted(place for place in STARTING if not place.startswith("core/")))
def test_what_runs_there_names_no_bpy(place: str) -> None:
    # The core imports none at all (test_layering.py).
    tree = ast.parse(STARTING[place].read_text())
    functions = {node.name: node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
    for call in started(STARTING[place]):
        target = next(ast.unparse(word.value) for word in call.keywords if word.arg == "target")
        name = target.rpartition(".")[2]
        # One that is not of the file is the core's.
        assert name in functions or re.search(rf"from \.+core\..* import .*\b{name}\b", ast.unparse(tree))
        if name in functions:
            named = {node.id for node in ast.walk(functions[name]) if isinstance(node, ast.Name)}
            assert not named & {"bpy", "context", "scene"}, f"{place}: {name} names {named}"
