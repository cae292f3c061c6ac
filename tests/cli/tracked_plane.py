"""The slanted plane's clip, imported as solved, and commands over it."""

from __future__ import annotations

from pathlib import Path

import pytest

from addon.cli.main import run_command
from addon.core.readers.colmap_export import write_model

from ..scenes import LENS, slanted_plane, write_plane

FRAMES = tuple(range(1, 7))
PLANE = slanted_plane(LENS, FRAMES, count=1500)


@pytest.fixture
def work(registered: None, tmp_path: Path) -> Path:
    """The working folder of a clip of the slanted plane."""
    return imported(tmp_path, write_plane(tmp_path / "clip", PLANE))


def imported(tmp_path: Path, footage: Path) -> Path:
    """The working folder of the clip with a plane's model."""
    (tmp_path / "model").mkdir()
    write_model(tmp_path / "model", PLANE)
    words = ("import", tmp_path / "model", "--footage", footage, "--work", tmp_path / "work")
    assert run_command([str(each) for each in words]) == 0
    return tmp_path / "work"


def run(command: str, work: Path, *options: object) -> int:
    """The exit status of a command about a working folder, in this process, with two views."""
    return run_command([command, str(work), *map(str, options), "--views", "2"])
