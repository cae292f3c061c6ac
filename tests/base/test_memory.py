"""Free memory, and shortages of it."""

from __future__ import annotations

import subprocess
import sys
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
    """A /proc of a machine with 8 GiB free, and of a process in the group /job/render."""
    folder = tmp_path / "proc"
    (folder / "self").mkdir(parents=True)
    (folder / "meminfo").write_text(f"MemTotal: 1 kB\nMemAvailable: {8 * GB // 1024} kB\n")
    (folder / "self" / "cgroup").write_text("0::/job/render\n")
    return folder


def group(folder: Path, limit: object, used: int, cached: int) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "memory.max").write_text(f"{limit}\n")
    (folder / "memory.current").write_text(f"{used}\n")
    (folder / "memory.stat").write_text(f"anon 5\ninactive_file {cached - 1000}\nactive_file 1000\n")


def test_the_narrowest_group_counts_and_caches_are_dropped(
    proc: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    groups = tmp_path / "groups"
    monkeypatch.setattr(memory, "PROC", proc)
    monkeypatch.setattr(memory, "GROUPS", groups)
    assert memory.free() == 8 * GB
    group(groups / "job" / "render", "max", GB, 2000)
    assert memory.free() == 8 * GB
    group(groups / "job", 4 * GB, 2 * GB, GB)
    group(groups, 9 * GB, 2 * GB, 2000)
    assert memory.free() == 3 * GB


def limited(code: str, left: int) -> str:
    """What Python code prints with so many bytes of address space left; its last word is its own end."""
    script = (
        "import mmap, os, resource, sys\nimport cv2\nimport numpy as np\nfrom pathlib import Path\n"
        "from addon.core.base import memory\nfrom addon.core.media import video\n"
        "pages = int((memory.PROC / 'self' / 'statm').read_text().split()[0])\n"
        f"most = pages * os.sysconf('SC_PAGE_SIZE') + {left}\n"
        "resource.setrlimit(resource.RLIMIT_AS, (most, most))\n"
        f"{code}\nsys.stdout.flush()\nos._exit(0)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, cwd=ROOT, check=True
    )
    return done.stdout.strip()


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


def test_a_video_is_not_blamed_where_memory_is_short(tmp_path: Path) -> None:
    path = tmp_path / "clip.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 24, (1920, 1080))
    for value in range(6):
        writer.write(np.full((1080, 1920, 3), 40 * value, np.uint8))
    writer.release()
    words = f"try:\n    print(video.video_info(Path({str(path)!r})).count)\n"
    words += "except Exception as error:\n    print(error)"
    said = limited(words, 4 * 2**20)
    assert "not enough memory" in said and "convert" not in said
    assert limited(words, GB) == "6"
