"""OpenBLAS reads its number of threads when NumPy is loaded; the command line says it before."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from addon.core.sfm import process

from ..command_line import headless

HOOK = """
import os, pathlib, sys

class Loading:
    def find_spec(self, name, path=None, target=None):
        if name == "numpy":
            said = os.environ.get("OPENBLAS_NUM_THREADS", "none")
            pathlib.Path(__file__).with_name("said.txt").write_text(said)

sys.meta_path.insert(0, Loading())
"""
"""Python runs a `sitecustomize` at its start."""


def test_numpy_is_loaded_with_one_thread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    (tmp_path / "sitecustomize.py").write_text(HOOK)
    done = headless("--help", environment={"PYTHONPATH": f"{tmp_path}{os.pathsep}{Path.cwd()}"})
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "said.txt").read_text() == "1"


def test_the_solver_has_as_many_threads_as_the_user_sets(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "3")
    assert process.environment()["OPENBLAS_NUM_THREADS"] == "3"
