"""What a living process works on is left alone, whichever machine or container looks at it."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from addon.core.base import atomic, file_lock
from addon.core.base.errors import UserError
from addon.core.base.file_lock import is_abandoned
from addon.core.sfm.state import recover

ROOT = Path(__file__).resolve().parents[2]
HOLD = """
import sys, pathlib
sys.path.insert(0, sys.argv[1])
from addon.core.base import atomic, file_lock
from addon.core.sfm.state import Staging
home = pathlib.Path(sys.argv[2])
staging = Staging(home / "work")
(staging.folder / "tracks").touch()
with file_lock.OutputLock(home / "m.mp4"), atomic.staged(home / "a.png") as part:
    with atomic.temporary_folder() as folder:
        part.write_text("half")
        (folder / "views").touch()
        print("held", flush=True)
        input()
staging.discard()
"""
COLLECT = """
import sys, pathlib
sys.path.insert(0, sys.argv[1])
from addon.core.base import atomic, file_lock
from addon.core.sfm.state import recover
home = pathlib.Path(sys.argv[2])
recover(home / "work")
atomic.collect_orphans(home)
atomic.collect_temporary()
file_lock.collect_locks(home)
"""
NAMESPACE = ("unshare", "--pid", "--fork", "--mount-proc")
"""Before a command: run it with a table of processes of its own, as in a container."""


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder for output, for a solve and for temporary files."""
    (tmp_path / "work").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    return tmp_path


@contextmanager
def held(home: Path) -> Iterator[subprocess.Popen[str]]:
    """A process that solves, writes a picture and a movie, and has a folder for temporary files."""
    words = [sys.executable, "-c", HOLD, str(ROOT), str(home)]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stdout.readline() == "held\n"
        yield process
        process.kill()


def elsewhere(home: Path) -> None:
    """Another container looks for what dead processes left."""
    if subprocess.run([*NAMESPACE, "true"], capture_output=True, check=False).returncode:
        pytest.skip("NOT TESTED: this machine lets nobody make a namespace of processes (unshare --pid)")
    subprocess.run([*NAMESPACE, sys.executable, "-c", COLLECT, str(ROOT), str(home)], check=True)


def files(home: Path) -> list[str]:
    return sorted(str(path.relative_to(home)) for path in home.rglob("*"))


def test_what_lives_in_another_namespace_is_left_alone(home: Path) -> None:
    with held(home) as owner:
        before = files(home)
        elsewhere(home)
        assert files(home) == before and any("tracks" in name for name in before)
        owner.communicate("\n")
        assert owner.returncode == 0
    assert files(home) == ["a.png", "work"]


def test_what_was_killed_in_another_namespace_is_collected(home: Path) -> None:
    with held(home) as owner:
        owner.kill()
        owner.wait()
        assert any("tracks" in name for name in files(home))
        elsewhere(home)
    assert [name for name in files(home) if name != f"work/{file_lock.NAME}"] == ["work"]


def test_what_cannot_be_told_is_not_removed(home: Path) -> None:
    # Another machine's, a container's, an older version's; all of them as old as can be.
    for name in ("0123456789ab-7-0123abcd", "0123456789ab-0123abcd", "host-999999999-0123abcd"):
        for path in (home / f".part-{name}-a.png", home / "work" / f".solving-{name}"):
            path.touch()
            os.utime(path, (0, 0))
    (home / ".virtual-aperture-m.mp4.lock").mkdir()
    before = files(home)
    recover(home / "work")
    atomic.collect_orphans(home)
    file_lock.collect_locks(home)
    assert files(home) == before


def test_a_lock_tells_whether_its_owner_lives(home: Path) -> None:
    lock = home / "work" / file_lock.NAME
    with held(home) as owner:
        assert not is_abandoned(lock)
        with pytest.raises(UserError, match=f"is being solved into by process {owner.pid}"):
            file_lock.FolderLock(home / "work")
        owner.kill()
        owner.wait()
        assert is_abandoned(lock)
    assert not is_abandoned(home / "none")


def test_what_cannot_be_written_leaves_no_lock(home: Path) -> None:
    with pytest.raises(UserError, match="cannot be written"):
        atomic.write_bytes(home / "work" / "x" / ("n" * 250), b"data")
    assert files(home) == ["work", "work/x"]
