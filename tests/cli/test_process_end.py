"""How the command line's process ends."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.torture import clip
from benchmarks.torture.bench import HEADLESS

from ..waiting import PATIENCE


def test_nothing_of_blender_is_left_in_the_folder_for_temporary_files(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path_factory.mktemp("solved")
    work = clip.solve(clip.write_video(folder / "clip", 3), folder / "work")
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    done = subprocess.run(
        [sys.executable, str(HEADLESS), "report", str(work)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert not list(tmp_path.glob("blender_*"))


def test_a_thread_that_does_not_end_keeps_no_process() -> None:
    words = (
        "import threading, time\nfrom addon import headless\n"
        "threading.Thread(target=time.sleep, args=(1000,)).start()\n"
        "print('wrote it')\nheadless._leave(3)"
    )
    done = subprocess.run(
        [sys.executable, "-c", words], capture_output=True, text=True, check=False, timeout=PATIENCE,
        cwd=HEADLESS.parents[1],
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (3, "wrote it\n")
