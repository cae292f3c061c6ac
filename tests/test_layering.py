"""Rooms import downwards only, the core knows nothing of Blender, pycolmap stays in the worker process."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
ADDON = ROOT / "addon"
FLOORS = ("core", "scene", "render", "ui", "cli")
"""Folders of the add-on, the lowest first: each may import those before it."""
ROOMS = ("base", "camera", "optics", "media", "readers", "depth", "subjects", "sfm", "warp", "focus", "frame")
"""Folders of the core, the lowest first."""
PARTS = {
    "core/sfm": ("tracking", "adjustment", "calibration", "mapping"),
    "scene": ("base", "gpu", "solve", "sources", "lens", "focus"),
    "render": ("views", "processes", "cg", "viewport", "output"),
    "ui": ("base", "jobs", "picking", "focus", "footage", "panels"),
}
"""Folders of rooms that have some, the lowest first; files beside them are of no floor."""
BLENDER = {"bpy", "bmesh", "blf", "gpu", "gpu_extras", "imbuf", "mathutils"}
WORKER = {"mapping/incremental_mapping", "mapping/keyframes", "mapping/photo_mapping", "worker"}
"""Modules of `sfm` that only run in the worker process."""


def imports(path: Path) -> Iterator[tuple[str, ...]]:
    """Every import of a file as the parts of the module's path, relative ones from the root on."""
    package = path.relative_to(ROOT).parts[:-1]
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (tuple(alias.name.split(".")) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            module = tuple(node.module.split(".")) if node.module else ()
            yield from ((*base, *module, alias.name) for alias in node.names)


def upward(folder: Path, floors: tuple[str, ...]) -> list[str]:
    """Imports from a floor of one above it."""
    place = folder.relative_to(ROOT).parts
    return [
        f"{path.relative_to(ROOT)} imports {'.'.join(module)}"
        for number, floor in enumerate(floors)
        for path in sorted((folder / floor).rglob("*.py"))
        for module in imports(path)
        if module[: len(place)] == place and module[len(place)] in floors[number + 1 :]
    ]


def test_the_add_on_imports_downwards() -> None:
    assert upward(ADDON, FLOORS) == []


def test_the_core_imports_downwards() -> None:
    assert {p.name for p in (ADDON / "core").iterdir() if p.is_dir()} - {"__pycache__"} == set(ROOMS)
    assert upward(ADDON / "core", ROOMS) == []


@pytest.mark.parametrize("room", sorted(PARTS))
def test_a_room_imports_downwards(room: str) -> None:
    folders = {p.name for p in (ADDON / room).iterdir() if p.is_dir()} - {"__pycache__"}
    assert folders == set(PARTS[room])
    assert upward(ADDON / room, PARTS[room]) == []


def test_modules_import_each_other_in_no_circle() -> None:
    files = {path.relative_to(ROOT).with_suffix("").parts: path for path in ADDON.rglob("*.py")}
    needs = {
        name: {m if m in files else m[:-1] for m in imports(path)} & files.keys() - {name}
        for name, path in files.items()
    }
    while free := [name for name, wanted in needs.items() if not wanted & needs.keys()]:
        for name in free:
            del needs[name]
    assert not needs, sorted(needs)


def test_the_core_never_imports_blender_nor_anything_above_it() -> None:
    for path in (ADDON / "core").rglob("*.py"):
        for module in imports(path):
            assert module[0] not in BLENDER, path
            assert module[:1] != ("addon",) or module[1] == "core", path


def test_only_the_list_of_meshers_knows_the_thesis() -> None:
    thesis = ("addon", "core", "frame", "meshers", "thesis")
    users = {path for path in ADDON.rglob("*.py") if any(module[:5] == thesis for module in imports(path))}
    assert users == {ADDON / "core/frame/meshers/__init__.py"}


def test_pycolmap_stays_in_the_worker() -> None:
    worker = {ADDON / "core/sfm" / f"{name}.py" for name in WORKER}
    quiet = [p for p in ADDON.rglob("*.py") if p not in worker]
    for path in quiet:
        assert all(module[0] != "pycolmap" for module in imports(path)), path
    core = [p.relative_to(ROOT).with_suffix("").parts for p in quiet if "core" in p.parts]
    names = ", ".join(sorted(".".join(parts) for parts in core if parts[-1] != "__init__"))
    check = f"import sys, {names}; assert 'pycolmap' not in sys.modules"
    subprocess.run([sys.executable, "-c", check], check=True, cwd=ROOT)


def test_no_test_takes_anything_from_the_file_of_another() -> None:
    """What several need lies in a module of its own, so that a file of tests can be edited for itself."""
    assert not [
        f"{path.relative_to(ROOT)} imports {'.'.join(module)}"
        for path in sorted((ROOT / "tests").rglob("*.py"))
        for module in imports(path)
        if module[0] == "tests" and any(part.startswith("test_") for part in module[1:-1])
    ]
