"""Files kept by what they were made from: a truth that took minutes is made once."""

from __future__ import annotations

import hashlib
import os
import subprocess
from collections.abc import Callable, Iterable
from dataclasses import fields, is_dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from addon.render.views.quiet import quiet

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "build" / "bench"
SOLVER = tuple(f"addon/core/{room}" for room in ("base", "camera", "media", "sfm"))
"""What a solve is made by; the rest of the product cannot change it."""


def digest(*things: Any) -> str:
    """A short hash of arrays, dataclasses, sequences and plain values, the same on every machine."""
    state = hashlib.sha256()
    for thing in things:
        _add(state, thing)
    return state.hexdigest()[:16]


def _add(state: Any, thing: Any) -> None:
    if isinstance(thing, np.ndarray):
        state.update(f"{thing.dtype}{thing.shape}".encode() + np.ascontiguousarray(thing).tobytes())
    elif is_dataclass(thing):
        for field in fields(thing):
            state.update(field.name.encode())
            _add(state, getattr(thing, field.name))
    elif isinstance(thing, Path):
        state.update(thing.read_bytes())
    elif isinstance(thing, (tuple, list)):
        state.update(f"{len(thing)}[".encode())
        for each in thing:
            _add(state, each)
    else:
        state.update(repr(thing).encode() + b";")


def sources(*names: str) -> list[Path]:
    """Python files below the project's root that the names, files or folders, stand for, sorted."""
    found: list[Path] = []
    for name in names:
        path = ROOT / name
        found += sorted(path.rglob("*.py")) if path.is_dir() else [path]
    return found


def commit() -> str:
    """The commit of the working tree and today's date: with which code a figure was measured, and when."""
    git = ["git", "-C", str(ROOT)]
    name, changed = (
        subprocess.run([*git, *words], capture_output=True, text=True, check=False).stdout.strip()
        for words in (["rev-parse", "--short", "HEAD"], ["status", "--short", "--", "addon"])
    )
    return f"{name or 'unknown'}{' with changes' if changed else ''} ({datetime.now(UTC):%Y-%m-%d})"


def measured_at(marks: Iterable[str], code: str, today: str) -> str:
    """When rows were measured, by their marks of `commit`, for a document; `code` is the digest with which
    all of them were up to date, `today` that of the code as it is."""
    order = sorted(set(marks), key=lambda mark: mark.partition(" (")[::-1])
    ends = dict.fromkeys([order[0], order[-1]]) if order else ["no commit"]
    return f"measured at {' to '.join(ends)}" + ("" if code == today else ", of an earlier commit")


def provenance(*names: str) -> str:
    """Of which code and on what a figure was measured, for the head of a table: commit, date, digest of the
    named sources (the add-on's where none are named) and number of processors."""
    code = digest(sources(*(names or ("addon",))))
    return f"commit {commit()}, code {code}, {os.cpu_count()} processors"


def kept(folder: str, key: str, make: Callable[[], NDArray[Any]]) -> NDArray[Any]:
    """The array stored under a key, made and stored where it is not there yet, which is said."""
    path = FOLDER / folder / f"{key}.npy"
    if path.exists():
        stored: NDArray[Any] = np.load(path)
        return stored
    print(f"making {path.parent.name}/{path.name}", flush=True)
    with quiet(1):
        array = make()
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part")
    with part.open("wb") as file:
        np.save(file, array)
    part.rename(path)
    return array
