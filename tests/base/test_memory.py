"""Limits of memory are known before something that does not survive them is begun."""

from __future__ import annotations

import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.base import memory

ROOT = Path(__file__).resolve().parents[2]
GB = 2**30
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits are known on Linux only")


@pytest.fixture
def proc(tmp_path: Path) -> Path:
    """A /proc of a process that holds 0.25 GiB, in the group /job/render of both versions."""
    folder = tmp_path / "proc"
    (folder / "self").mkdir(parents=True)
    (folder / "meminfo").write_text("MemTotal: 1 kB\nSwapTotal: 0 kB\n")
    (folder / "self" / "status").write_text(f"Name: x\nRssAnon:\t {GB // 4 // 1024} kB\n")
    (folder / "self" / "cgroup").write_text("3:cpu:/\n2:memory,x:/job/render\n0::/job/render\n")
    return folder


def group(folder: Path, limit: object, used: int, cached: int, first: bool = False) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    names = ("memory.limit_in_bytes", "memory.usage_in_bytes") if first else ("memory.max", "memory.current")
    prefix = "total_" if first else ""
    (folder / names[0]).write_text(f"{limit}\n")
    (folder / names[1]).write_text(f"{used}\n")
    stat = f"anon 5\n{prefix}inactive_file {cached - 1000}\n{prefix}active_file 1000\n"
    (folder / "memory.stat").write_text(stat)


def test_what_others_hold_is_not_ours_and_caches_are_given_back(proc: Path, tmp_path: Path) -> None:
    groups = tmp_path / "groups"
    group(groups / "job" / "render", 4 * GB, 2 * GB, GB)
    # 4 less the 1 that is no cache, of which a quarter is this process's own.
    assert memory.memory_limit(proc, groups) == 4 * GB - GB + GB // 4


def test_the_narrowest_group_counts(proc: Path, tmp_path: Path) -> None:
    groups = tmp_path / "groups"
    group(groups / "job" / "render", "max", GB, 2000)
    group(groups / "job", 3 * GB, 2 * GB, 2000)
    group(groups, 9 * GB, 2 * GB, 2000)
    assert memory.memory_limit(proc, groups) == GB + 2000 + GB // 4


def test_control_groups_of_the_first_version(proc: Path, tmp_path: Path) -> None:
    groups = tmp_path / "groups"
    # Within a container the group's own path does not exist.
    group(groups / "memory", 2 * GB, GB, 2000, first=True)
    assert memory.memory_limit(proc, groups) == GB + 2000 + GB // 4
    group(groups / "memory", 2**63 - 4096, GB, 2000, first=True)
    assert memory.memory_limit(proc, groups) is None


def test_soft_or_unknown_limits_are_none(proc: Path, tmp_path: Path) -> None:
    groups = tmp_path / "groups"
    assert memory.memory_limit(proc, groups) is None
    assert memory.memory_limit(tmp_path / "no proc", groups) is None
    group(groups, GB, GB, 2000)
    assert memory.memory_limit(proc, groups) == GB // 4 + 2000
    (proc / "meminfo").write_text("SwapTotal: 4 kB\n")
    assert memory.memory_limit(proc, groups) is None


def limited(code: str, left: int) -> str:
    """What Python code prints with so many bytes of address space left; its last word is its own end."""
    script = (
        "import mmap, os, resource, sys\nimport cv2\nimport numpy as np\nfrom pathlib import Path\n"
        "from addon.core.base import memory\nfrom addon.core.media import video\n"
        f"most = memory._mapped() + {left}\nresource.setrlimit(resource.RLIMIT_AS, (most, most))\n"
        "memory.keep_to_one_arena()\n"
        f"{code}\nsys.stdout.flush()\nos._exit(0)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, cwd=ROOT, check=True
    )
    return done.stdout.strip()


def test_a_large_array_lies_where_the_last_one_did() -> None:
    """Whole pages of memory are given back and fetched again otherwise."""
    words = (
        "import sys\nimport numpy as np\nfrom addon.core.base import memory\n"
        "if sys.argv[1:]: memory.keep_freed()\n"
        "own = lambda: memory._number(memory.PROC / 'self' / 'status', 'RssAnon:') // 1024\n"
        "before, large = own(), np.ones(2**26, np.uint8)\n"
        "del large\nprint(own() - before)"
    )
    kept = [
        int(subprocess.run([sys.executable, "-c", words, *given], capture_output=True, text=True, cwd=ROOT,
                           check=True).stdout)
        for given in ([], ["keep"])
    ]  # fmt: skip
    assert kept[0] < 16 and kept[1] >= 64


@pytest.mark.parametrize(
    "code",
    [
        "np.empty(2**40, np.uint8)",
        "cv2.resize(np.ones((64, 64), np.float32), (60000, 60000))",
        "mmap.mmap(-1, 2**40)",
    ],
)
def test_shortages_are_known_by_their_errors(code: str) -> None:
    words = f"try:\n    {code}\nexcept Exception as error:\n    print(memory.is_shortage(error))"
    assert limited(words, GB) == "True"


def test_other_errors_are_no_shortage() -> None:
    for error in (ValueError("std::bad"), OSError(2, "no file"), RuntimeError("broken")):
        assert not memory.is_shortage(error)


def test_a_video_is_not_blamed_where_memory_is_short(tmp_path: Path) -> None:
    path = tmp_path / "clip.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 24, (1920, 1080))
    for value in range(6):
        writer.write(np.full((1080, 1920, 3), 40 * value, np.uint8))
    writer.release()
    words = f"try:\n    print(video.video_info(Path({str(path)!r})).count)\n"
    words += "except Exception as error:\n    print(error)"
    said = limited(words, 4 * 2**20)
    assert "not enough memory" in said and "ulimit -v" in said and "convert" not in said
    assert limited(words, GB) == "6"


def test_a_limit_is_refused_below_the_need_and_only_there() -> None:
    need = memory.Need(GB, 0, 0)

    def limiting(limit: int) -> Callable[[], None]:
        return lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit))

    words = "from addon.core.base import memory\nfrom addon.core.base.errors import UserError\n"
    words += f"try:\n    memory.check('it', memory.Need({need.mapped}, 0, 0), {GB // memory.A_PIXEL})\n"
    words += "except UserError as error:\n    print(error)"
    said = [
        subprocess.run(
            [sys.executable, "-c", words], capture_output=True, text=True, cwd=ROOT, check=True,
            preexec_fn=limiting(limit),
        ).stdout
        for limit in (2 * GB - 2**20, 2 * GB)
    ]  # fmt: skip
    assert "takes at least 2.00 GiB of address space" in said[0] and "make the picture smaller" in said[0]
    assert said[1] == ""
