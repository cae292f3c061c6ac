"""Fixtures shared by all tests."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of real test data, which is never part of the project; skips where it is missing."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = Path(os.environ.get("VA_DATA", beside))
    if not folder.is_dir():
        pytest.skip(f"no real test data: {folder} is missing (set VA_DATA to the folder that holds it)")
    return folder


@pytest.fixture(scope="session")
def registered() -> Iterator[None]:
    """Register once: Blender refuses a class that is registered twice."""
    import addon

    addon.register()
    yield
    addon.unregister()


@pytest.fixture
def scene(registered: None) -> Iterator[object]:
    """A fresh, empty scene."""
    import bpy

    bpy.ops.wm.read_homefile(app_template="", use_empty=True, use_factory_startup=True)
    yield bpy.context.scene
    # A clip that stays open would be the next test's.
    from addon.scene import shot

    shot.forget()


@pytest.fixture(scope="session")
def duck(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The working folder of the real clip, solved once for all tests: it takes half a minute."""
    from addon.core.sfm.process import SolveProcess

    work = tmp_path_factory.mktemp("duck") / "demo.aperture"
    process = SolveProcess(data / "duck" / "demo.mp4", work)
    try:
        process.wait()
    finally:
        process.cancel()
    return work
