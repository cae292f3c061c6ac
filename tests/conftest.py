"""Fixtures shared by all tests."""

from __future__ import annotations

import os
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
