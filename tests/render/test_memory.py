"""With little address space the command line says what it lacks; with enough, pictures are as with any."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from addon.core.base import memory
from addon.render.gpu_views import egl_problem
from benchmarks.torture import clip
from benchmarks.torture.bench import HEADLESS, contents

from ..waiting import PATIENCE

LENS = ("--focus-distance", "7", "--blur", "0.05", "--method", "features", "--views", "4", "--frames", "1-3")
MB = 2**20
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits are known on Linux only")


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("memory")
    return clip.solve(clip.write_video(folder / "clip", 3), folder / "work")


def limited(limit: int | None, *arguments: object) -> tuple[int, str]:
    """Status and words of the command line on one processor: with more of them it takes more."""

    def prepare() -> None:
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
        if limit:
            resource.setrlimit(resource.RLIMIT_AS, (limit, limit))

    words = [sys.executable, str(HEADLESS), *map(str, arguments)]
    done = subprocess.run(words, capture_output=True, text=True, preexec_fn=prepare, check=False)
    return done.returncode, (done.stdout + done.stderr).strip()


@pytest.mark.parametrize("limit", [300 * MB, 800 * MB, 1200 * MB, memory.PROGRAM.mapped - MB])
def test_blender_is_not_loaded_where_it_would_crash(work: Path, limit: int) -> None:
    status, said = limited(limit, "report", work)
    assert status == 1 and said.startswith("error: the program takes at least") and "\n" not in said


@pytest.mark.skipif(bool(egl_problem()), reason=f"no GPU context can be had: {egl_problem()}")
@pytest.mark.parametrize("name, limit", [
    ("####.png", memory.PROGRAM.mapped + 150 * MB), ("####.png", memory.DRAWING.mapped - MB),
    ("a.mp4", memory.DRAWING.mapped), ("a.mp4", memory.MOVIE.mapped - MB),
])  # fmt: skip
def test_drawing_is_not_begun_where_it_would_crash(work: Path, tmp_path: Path, name: str, limit: int) -> None:
    status, said = limited(limit, "render", work, *LENS, "--out", tmp_path / "out" / name)
    last = said.splitlines()[-1]
    assert status == 1 and "takes at least" in last and "ulimit -v" in last, said
    assert "Traceback" not in said and not contents(tmp_path)


@pytest.mark.skipif(bool(egl_problem()), reason=f"no GPU context can be had: {egl_problem()}")
@pytest.mark.parametrize("name, need", [("####.png", memory.DRAWING), ("a.mp4", memory.MOVIE)])
def test_a_limit_that_is_enough_changes_nothing(
    work: Path, tmp_path: Path, name: str, need: memory.Need
) -> None:
    for folder, limit in (("limited", need.mapped + 128 * MB), ("free", None)):
        status, said = limited(limit, "render", work, *LENS, "--out", tmp_path / folder / name)
        assert status == 0, said
    assert contents(tmp_path / "limited") == contents(tmp_path / "free") != {}
    assert len(contents(tmp_path / "free")) == (3 if "#" in name else 1)


def test_nothing_of_blender_is_left_in_the_folder_for_temporary_files(
    work: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    status, said = limited(None, "report", work)
    assert status == 0, said
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
