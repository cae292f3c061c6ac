"""What the user lets the add-on take, here and in the processes that are started."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import pytest

from addon.core.base import limits

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(autouse=True)
def _unlimited(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    for name in (limits.THREADS, limits.KEPT_DEPTH, limits.OPENCV_THREADS):
        monkeypatch.setenv(name, "")
        monkeypatch.delenv(name)
    yield
    limits.limit_threads(0)
    limits.limit_kept_depth(0)


def test_threads_are_limited_here_and_in_other_processes() -> None:
    before = cv2.getNumThreads()
    assert limits.threads() == os.process_cpu_count()
    limits.limit_threads(1)
    assert limits.threads() == cv2.getNumThreads() == 1
    ask = "import cv2; from addon.core.base import limits; print(limits.threads(), cv2.getNumThreads())"
    said = subprocess.run([sys.executable, "-c", ask], cwd=ROOT, capture_output=True, text=True, check=True)
    assert said.stdout.split() == ["1", "1"]
    limits.limit_threads(0)
    assert limits.threads() == os.process_cpu_count() and cv2.getNumThreads() == before
    limits.limit_threads(10_000)
    assert limits.threads() == os.process_cpu_count()


def test_what_the_user_told_opencv_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(limits.OPENCV_THREADS, "3")
    limits.limit_threads(0)
    assert os.environ[limits.OPENCV_THREADS] == "3"


def test_kept_depth_is_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    assert limits.most_kept_depth() == limits.MOST_KEPT_DEPTH
    limits.limit_kept_depth(1000)
    assert limits.most_kept_depth() == 1000
    monkeypatch.setenv(limits.KEPT_DEPTH, "much")
    assert limits.most_kept_depth() == limits.MOST_KEPT_DEPTH
