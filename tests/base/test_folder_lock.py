"""One solve at a time a folder."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path

import pytest

from addon.core.base.errors import Remedy, UserError
from addon.core.base.file_lock import NAME, FolderLock
from addon.core.sfm.process import SolveProcess

from .. import planes

ROOT = Path(__file__).resolve().parents[2]
HOLD = (
    "import sys, pathlib; sys.path.insert(0, sys.argv[1]);"
    "from addon.core.base.file_lock import FolderLock;"
    "lock = FolderLock(pathlib.Path(sys.argv[2])); print('held', flush=True); input()"
)


def hold(folder: Path) -> subprocess.Popen[str]:
    """Another process that holds a folder."""
    other = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(ROOT), str(folder)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert other.stdout is not None and other.stdout.readline() == "held\n"
    return other


def test_a_folder_is_held_by_one(tmp_path: Path) -> None:
    one = FolderLock(tmp_path)
    with pytest.raises(UserError, match=r"is being solved into here since .*; wait for it") as refused:
        FolderLock(tmp_path)
    assert refused.value.remedies == (Remedy.WORK_DIR,)
    one.release()
    one.release()
    assert list(tmp_path.iterdir()) == []
    FolderLock(tmp_path).release()


def test_another_process_is_named_and_its_end_frees_the_folder(tmp_path: Path) -> None:
    with hold(tmp_path) as other:
        with pytest.raises(UserError, match=rf"by process {other.pid} on .* since \d\d:\d\d"):
            FolderLock(tmp_path)
        other.kill()
    assert (tmp_path / NAME).exists()
    FolderLock(tmp_path).release()
    assert list(tmp_path.iterdir()) == []


def test_many_at_once_hold_it_one_after_the_other(tmp_path: Path) -> None:
    holders, most, wins = [0], [0], [0]

    def often() -> None:
        for _ in range(300):
            try:
                lock = FolderLock(tmp_path)
            except UserError:
                continue
            holders[0] += 1
            most[0] = max(most[0], holders[0])
            wins[0] += 1
            holders[0] -= 1
            lock.release()

    threads = [threading.Thread(target=often) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most[0] == 1 and wins[0] > 0
    assert list(tmp_path.iterdir()) == []


def test_what_a_process_that_was_killed_left_is_no_obstacle(tmp_path: Path) -> None:
    clip, work = planes.write_clip(tmp_path / "walk", planes.sideways(3)), tmp_path / "work"
    work.mkdir()
    with hold(work) as other:
        other.kill()
    process = SolveProcess(clip, work)
    process.cancel()
    assert list(work.iterdir()) == []
