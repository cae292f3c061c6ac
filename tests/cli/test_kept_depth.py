"""`depth` calls kept what can be read again, and fails where it cannot keep it."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.cli import depth
from addon.core.base import limits
from addon.core.base.store import delete_kept

from ..command_line import headless, run
from ..faults import full_disk
from ..slanted_clip import keep, video


@pytest.mark.long
@pytest.mark.parametrize("way", ["a file in its place", "full disk", "limit"])
def test_depth_that_cannot_be_kept_is_not_called_kept(
    registered: None, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
    way: str,
) -> None:  # fmt: skip
    work, said = tmp_path / "work", "the depth of frame 1 cannot be kept"
    keep(video(tmp_path / "clip.mp4"), work)
    assert run("depth", work) == 0
    assert "the depth of 3 frames is kept in" in capsys.readouterr().out
    kept = sorted((work / "depth").rglob("depth-*.npz"))
    sizes = [path.stat().st_size for path in kept]
    if way == "limit":
        most = sum(sizes) - sizes[-1] // 2
        monkeypatch.setenv(limits.KEPT_DEPTH, str(most))
        said = f"no more than {most} bytes of depth are kept for a clip; allow more (VIRTUAL_APERTURE_KEPT_DE"
    delete_kept(work / "depth")
    if way == "a file in its place":
        (work / "depth").rmdir()
        (work / "depth").touch()
    with full_disk(min(sizes) // 2) if way == "full disk" else nullcontext():
        assert run("depth", work) == 1
    captured = capsys.readouterr()
    there = len(list(work.rglob("depth-*.npz")))
    assert f"the depth of {there} of 3 frames is kept in {work}" in captured.err and said in captured.err
    assert there == (2 if way == "limit" else 0) and "the depth of 3 frames" not in captured.out
    # With space the same command goes on.
    monkeypatch.delenv(limits.KEPT_DEPTH, raising=False)
    if way == "a file in its place":
        (work / "depth").unlink()
    assert run("depth", work) == 0
    assert len(list(work.rglob("depth-*.npz"))) == 3


def test_where_no_file_can_be_written_it_does_not_begin(registered: None, tmp_path: Path) -> None:
    work = tmp_path / "work"
    keep(video(tmp_path / "clip.mp4"), work)
    with full_disk(0):
        ended = headless("depth", work, environment={"PYTHONDONTWRITEBYTECODE": "1"})
    said = [line for line in ended.stderr.splitlines() if line and "EGL" not in line]
    assert ended.returncode == 1
    assert said == [
        "error: no folder for temporary files can be written; free some space, or name another by TMPDIR"
    ]


def test_processes_share_a_clip_and_keep_what_one_does(registered: None, tmp_path: Path) -> None:
    pictures = []
    for jobs in (1, 2):
        work = tmp_path / f"work {jobs}"
        keep(video(tmp_path / f"{jobs}.mp4"), work)
        assert "the depth of 3 frames is kept" in headless("depth", work, "--jobs", jobs).stdout
        pictures.append({path.name: path.read_bytes() for path in work.rglob("depth-*.npz")})
    assert pictures[0] == pictures[1] and len(pictures[0]) == 3


def test_depth_is_found_with_what_is_marked_and_of_what_is_asked_for(
    registered: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    work, blend = tmp_path / "work", tmp_path / "a.blend"
    keep(video(tmp_path / "clip.mp4"), work)
    marked = ("--subject", "0.3,0.3", "0.4,0.6@2")
    assert run("depth", work, "--frames", "2-3", *marked) == 0
    assert "depth of frame 3: 2 of 2" in capsys.readouterr().out
    found = sorted(work.rglob("depth-*.npz"))
    assert [path.name for path in found] == ["depth-000002.npz", "depth-000003.npz"]
    # A .blend has its strokes with it.
    assert run("save", work, "--blend", blend, "--no-copy", "--focus-distance", "5", *marked) == 0
    assert run("depth", blend) == 0
    assert [path.parent for path in work.rglob("depth-*.npz")] == [found[0].parent] * 3
    assert run("depth", blend, *marked) == 2


def test_what_moves_by_jumps_is_told(
    registered: None, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    work = tmp_path / "work"
    keep(video(tmp_path / "clip.mp4"), work)
    assert run("depth", work) == 0
    assert "unsure" not in capsys.readouterr().out
    for number, path in enumerate(sorted((work / "depth").rglob("depth-*.npz"))):
        with np.load(path) as kept:
            parts = dict(kept)
        moving = np.zeros_like(cv2.imdecode(parts["moving"], cv2.IMREAD_UNCHANGED))
        # Now an arm, now a leg.
        moving[(slice(4, 8), slice(10, 40)) if number % 2 else (slice(2, 32), slice(12, 16))] = 1
        parts["moving"] = cv2.imencode(".png", moving)[1]
        np.savez(path, **parts)
    monkeypatch.setattr(depth, "FEWEST_JUMPS", 2)
    assert run("depth", work) == 0
    said = (
        "moving subjects are uncertain in 2 frames (2-3), where they jump; mark them with a stroke"
        " (--subject X,Y)"
    )
    assert said in capsys.readouterr().out
