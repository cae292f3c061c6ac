"""A virtual screen, and a Blender with the built extension."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from .program import ROOT, blender, headless
from .screen import Screen, missing_programs


@pytest.fixture(scope="session")
def needed() -> None:
    """Ends the run where Blender or a program for the screen is missing."""
    if blender() is None:
        pytest.exit("no Blender program: set BLENDER to one, or put blender on the path", 1)
    if missing := missing_programs():
        pytest.exit(f"{', '.join(missing)} not found: install what tools/debian-packages-window.txt lists", 1)


@pytest.fixture(scope="session")
def screen(needed: None) -> Iterator[Screen]:
    """A virtual screen."""
    made = Screen()
    yield made
    made.close()


@pytest.fixture(scope="module")
def hd_screen(needed: None) -> Iterator[Screen]:
    """One as large as most are."""
    made = Screen((1920, 1080))
    yield made
    made.close()


@pytest.fixture(scope="session")
def small_screen(needed: None) -> Iterator[Screen]:
    """One on which windows are drawn in less time."""
    made = Screen((800, 600))
    yield made
    made.close()


_failed: set[str] = set()
"""Modules in which a step failed."""


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Iterator[None]:
    report = yield
    if report.failed:
        _failed.add(item.nodeid.partition("::")[0])
    return report


@pytest.fixture
def in_order(request: pytest.FixtureRequest) -> None:
    """Steps that build on each other: skips where one of the module's failed before."""
    if request.node.nodeid.partition("::")[0] in _failed:
        pytest.skip("an earlier step failed")


@pytest.fixture(scope="session")
def zip_file() -> Path:
    """The extension with its wheels, which `make test-window` builds."""
    found = sorted((ROOT / "dist").glob("virtual_aperture-*-linux-x64.zip"))
    assert found, "no zip in dist/: call `make zip`"
    return found[-1]


@pytest.fixture(scope="session")
def folder() -> Iterator[Path]:
    """A folder with a short path, which a program in another root sees, too."""
    with tempfile.TemporaryDirectory(prefix="va-window-") as name:
        yield Path(name)


@pytest.fixture(scope="session")
def resources(needed: None, folder: Path, zip_file: Path) -> Path:
    """Blender's user folder with default preferences and the extension installed and enabled."""
    made = folder / "resources"
    made.mkdir()
    said = headless(made, "--command", "extension", "install-file", "-r", "user_default", "-e", str(zip_file))
    # It ends with 0 where it could not.
    assert "ERROR" not in said, said
    return made
