"""Each place that starts a thread stands in ARCHITECTURE.md, and no module imports threads as it loads."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
ADDON = ROOT / "addon"
STARTING_MODULES = {"threading", "concurrent", "multiprocessing", "queue", "asyncio"}
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


def imported(node: ast.AST) -> set[str]:
    """The modules that an import names."""
    if isinstance(node, ast.Import):
        return {each.name.partition(".")[0] for each in node.names}
    return (
        {str(node.module).partition(".")[0]} if isinstance(node, ast.ImportFrom) and not node.level else set()
    )


def test_no_module_imports_threads_as_it_is_loaded() -> None:
    for path in ADDON.rglob("*.py"):
        tree, place = ast.parse(path.read_text()), path.relative_to(ADDON).as_posix()
        for node in ast.walk(tree):
            if found := imported(node) & STARTING_MODULES:
                assert place in STARTING, f"{place} imports {found}"
                assert node not in tree.body, f"{place} imports {found} as it is loaded"
