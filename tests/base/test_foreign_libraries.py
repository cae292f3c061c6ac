"""Other versions of our libraries, first on the path: named when the program starts, not after a solve."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from addon.core.base.system import LIBRARIES

ROOT = Path(__file__).resolve().parents[2]
OLD = '__version__ = "{}"\ndef __getattr__(name): return lambda *a, **k: None\n'
"""A module that has everything, by its word."""
CONTRIB = "__version__ = '5.0.0'\nclass dnn:\n    ENGINE_CLASSIC = 1\n"
FAKES = {
    "an old OpenCV": ("cv2", OLD.format("4.11.0"), "4.11.0"),
    "OpenCV without contrib": ("cv2", CONTRIB, "ximgproc"),
    "a broken OpenCV": ("cv2", "raise RuntimeError('libGL.so.1:\\nnot there')", "libGL.so.1: not there"),
    "NumPy 1": ("numpy", OLD.format("1.26.4"), "1.26.4"),
    "a stub of NumPy": ("numpy", "", "unknown version"),
    "a PyAV that exits": ("av", "import no_such_module", "no_such_module"),
}


def run(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(folder), str(ROOT)])
    return subprocess.run(
        [sys.executable, *words], cwd=folder, env=os.environ | {"PYTHONPATH": path},
        capture_output=True, text=True,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("fake", "is_package", "process"),
    [
        ("an old OpenCV", False, "headless"), ("OpenCV without contrib", True, "worker"),
        ("a broken OpenCV", False, "register"), ("NumPy 1", True, "headless"),
        ("a stub of NumPy", False, "worker"), ("a PyAV that exits", True, "headless"),
    ],
)  # fmt: skip
def test_it_is_named_when_a_process_starts(tmp_path: Path, fake: str, is_package: bool, process: str) -> None:
    """The module, its place and version, what is needed, and what to do, in one line."""
    module, content, said = FAKES[fake]
    file = tmp_path / (f"{module}/__init__.py" if is_package else f"{module}.py")
    file.parent.mkdir(exist_ok=True)
    file.write_text(content)
    words = {
        "headless": [str(ROOT / "addon" / "headless.py"), "solve", "clip", "--work", "work"],
        "worker": ["-P", "-m", "addon.core.sfm.worker", "folder"],
        "register": ["-c", "import addon; addon.register()"],
    }[process]
    done = run(tmp_path, *words)
    assert done.returncode == 1
    line = done.stderr.strip().splitlines()[-1]
    for part in (LIBRARIES[module][0], str(file), said, "disable the add-on", "PYTHONPATH"):
        assert part in line, line
    if process == "headless":
        assert line.startswith("error: the program cannot be loaded: ")
        assert len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "work").exists()


def test_a_folder_without_code_hides_nothing(tmp_path: Path) -> None:
    """A namespace package comes last, whatever its place on the path."""
    (tmp_path / "cv2").mkdir()
    done = run(tmp_path, str(ROOT / "addon" / "headless.py"), "--help")
    assert done.returncode == 0


def test_the_pinned_versions_are_new_enough() -> None:
    pins = (ROOT / "pyproject.toml").read_text()
    for module, project in (("numpy", "numpy"), ("cv2", "opencv-contrib-python-headless"), ("av", "av")):
        assert f'"{project}=={LIBRARIES[module][1]}.' in pins
