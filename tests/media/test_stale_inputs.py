"""Inputs that were exchanged, altered or damaged, and two who write the same: told, never taken silently."""

from __future__ import annotations

import errno
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import bpy
import pytest

from addon.core.base import digest, file_lock
from addon.core.base.errors import Remedy, UserError
from addon.core.camera.reconstruction import Intrinsics
from addon.core.media.clip import open_footage
from addon.core.media.clip_identity import identity, is_same_clip
from addon.core.readers.colmap_export import write_model
from addon.core.sfm.process import SolveProcess
from addon.core.sfm.state import Staging
from addon.core.sfm.workspace import is_solved, load_solve
from addon.render import engine
from addon.render.output import frame_files, output

from .. import planes
from ..command_line import run
from ..scenes import LENS, slanted_plane, write_frames
from ..slanted_clip import FRAMES, LENS_OPTIONS, keep, listed, ready, rendered, video
from ..waiting import PATIENCE

__all__ = ["ready"]
ROOT = Path(__file__).resolve().parents[2]


def exchange(path: Path) -> None:
    """Other contents of the same size and time under the same name."""
    state, data = path.stat(), bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)
    os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns))


@pytest.mark.parametrize("kind", ["video", "frames"])
def test_an_exchanged_clip_is_refused_by_every_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], scene: bpy.types.Scene, kind: str
) -> None:
    clip, work = tmp_path / f"clip{'.mp4' if kind == 'video' else ''}", tmp_path / "work"
    if kind == "video":
        video(clip)
        changed = clip
    else:
        write_frames(clip, LENS)
        changed = clip / "clip_0002.png"
    keep(clip, work)
    good = changed.read_bytes()
    exchange(changed)
    for command in (
        ("render", work, *LENS_OPTIONS, "--out", tmp_path / "o" / "####.png"),
        ("inspect", work, "--frame", 1, *LENS_OPTIONS, "--out", tmp_path / "i"),
        ("save", work, "--blend", tmp_path / "s" / "a.blend"),
    ):
        assert run(*command) == 1
        said = capsys.readouterr().err
        assert f"the clip {clip} is not the one solved in" in said and "--again" in said
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([clip.name, "work"])
    with pytest.raises(UserError, match="is no longer the clip that was solved") as raised:
        is_solved(work, open_footage(clip), {})
    assert Remedy.AGAIN in raised.value.remedies
    assert not is_solved(work, open_footage(clip), {}, again=True)
    changed.write_bytes(good)
    assert load_solve(work).footage == clip


def test_the_projects_own_copy_wins_if_it_is_the_one(tmp_path: Path) -> None:
    first = tmp_path / "first"
    keep(video(first / "clip.mp4"), first / "work")
    second = Path(shutil.copytree(first, tmp_path / "second"))
    assert load_solve(second / "work").footage == second / "clip.mp4"
    video(second / "clip.mp4", 1)
    assert load_solve(second / "work").footage == first / "clip.mp4"
    third = Path(shutil.copy(first / "clip.mp4", tmp_path / "third.mp4"))
    assert load_solve(second / "work", third).footage == third
    (first / "clip.mp4").unlink()
    with pytest.raises(UserError, match=r"second/clip\.mp4 is not the one solved in"):
        load_solve(second / "work")


def read_bytes(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Bytes that are read of each file for a digest from now on."""
    read, before = [], digest._digest

    def counted(path: Path) -> str:
        read.append(path.stat().st_size)
        return before(path)

    monkeypatch.setattr(digest, "_digest", counted)
    return read


@pytest.fixture
def large(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Path]:
    """A clip that counts as a large one, a video or a sequence, as it is recognised: it has no pictures."""
    monkeypatch.setattr(digest, "LARGE", 200_000)
    monkeypatch.setattr(digest, "_known", {})
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))

    def make(kind: str) -> Path:
        clip = tmp_path / ("clip.mp4" if kind == "video" else "clip")
        if kind != "video":
            clip.mkdir()
        for path in [clip] if kind == "video" else [clip / f"{n}.exr" for n in range(3)]:
            path.write_bytes(os.urandom(300_000))
            os.utime(path, (1e9, 1e9))
        return clip

    return make


def spoil(clip: Path, at: int, keep_time: bool = False) -> None:
    """Another byte in a video, or in the second picture of a sequence."""
    path = clip / "1.exr" if clip.is_dir() else clip
    state, data = path.stat(), bytearray(path.read_bytes())
    data[at] ^= 0xFF
    path.write_bytes(data)
    if keep_time:
        os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns))


@pytest.mark.parametrize(("kind", "keep_time"), [("video", False), ("frames", True)])
def test_a_large_clip_that_is_changed_in_the_middle_is_another(
    large: Callable[[str], Path], kind: str, keep_time: bool
) -> None:
    clip = large(kind)
    wanted = identity(clip)
    assert is_same_clip(clip, wanted)
    spoil(clip, 150_000, keep_time)
    assert not is_same_clip(clip, wanted)
    # A panel does not read it whole, but knows what a render has found.
    assert not is_same_clip(clip, wanted, at_a_glance=True)
    spoil(clip, 150_000)
    assert is_same_clip(clip, wanted)


def test_a_panel_judges_a_large_clip_by_its_size(
    large: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    clip = large("frames")
    wanted = identity(clip)
    spoil(clip, 150_000)
    read = read_bytes(monkeypatch)
    assert is_same_clip(clip, wanted, at_a_glance=True)
    with (clip / "1.exr").open("ab") as file:
        file.write(b"1")
    assert not is_same_clip(clip, wanted, at_a_glance=True)
    # What the size shows is not read.
    assert not is_same_clip(clip, wanted) and not read


def test_a_large_clip_is_read_whole_once_for_all_processes(
    large: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clip = large("frames")
    # Its times of change are those of today: until they are past it might change again within the same.
    now = time.time()
    monkeypatch.setattr(digest.time, "time", lambda: now + 60)
    read = read_bytes(monkeypatch)
    wanted = identity(clip)
    assert sum(size == 300_000 for size in read) == 3
    digest._known.clear()
    read.clear()
    assert identity(clip) == wanted and is_same_clip(clip, wanted) and 300_000 not in read
    # A copy is another file with other times: it is read, once.
    copy = tmp_path / "copy" / clip.name
    shutil.copytree(clip.parent, copy.parent)
    for expected in (True, False):
        digest._known.clear()
        read.clear()
        assert is_same_clip(copy, wanted) and (300_000 in read) == expected
    # Whatever the file of digests is, it is only for time.
    store = tmp_path / "cache" / "virtual-aperture" / "digests.json"
    for damage in (b"", b"[1]", b"{", b'{"a": 1}', b"[" * 100_000):
        digest._known.clear()
        store.write_bytes(damage)
        assert is_same_clip(clip, wanted)
    shutil.rmtree(store.parent)
    monkeypatch.setenv("XDG_CACHE_HOME", str(clip / "0.exr"))
    digest._known.clear()
    assert is_same_clip(clip, wanted)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is damaged .it is empty"),
        ("{", "is damaged .it is not JSON"),
        ('{"version": 1}', "is damaged .it lacks footage"),
        ('{"version": 99}', "made with a newer Virtual Aperture"),
    ],
)
def test_a_damaged_state_is_told_and_replaced(tmp_path: Path, text: str, said: str) -> None:
    clip, work = write_frames(tmp_path / "frames", LENS), tmp_path / "work"
    keep(clip, work)
    (work / "solve.json").write_text(text)
    calls: tuple[Callable[[], object], ...] = (
        lambda: load_solve(work),
        lambda: SolveProcess(clip, work),
        lambda: is_solved(work, open_footage(clip), {}),
        lambda: keep(clip, work),
    )
    for call in calls:
        with pytest.raises(UserError, match=said) as raised:
            call()
        assert str(work / "solve.json") in str(raised.value) and Remedy.AGAIN in raised.value.remedies
    process = SolveProcess(clip, work, again=True)
    assert not process.finished
    process.cancel()
    keep(clip, work, again=True)
    assert len(load_solve(work).frames) == 3


def test_a_damaged_report_is_told(tmp_path: Path) -> None:
    clip, work = write_frames(tmp_path / "frames", LENS), tmp_path / "work"
    keep(clip, work)
    state = json.loads((work / "solve.json").read_text())
    frames = json.dumps(state | {"frames": state["frames"][1:]})
    (work / "solve.json").write_text(frames)
    with pytest.raises(
        UserError, match=r"solve\.json is damaged \(it is not what the solve wrote\)"
    ) as raised:
        load_solve(work)
    assert Remedy.AGAIN in raised.value.remedies
    # Older ones have no digest.
    del state["digest"]
    (work / "solve.json").write_text(json.dumps(state | {"report": {"explained": "all"}}))
    with pytest.raises(UserError, match=r"the report in .*solve\.json is damaged"):
        _ = load_solve(work).summary


def test_an_altered_model_is_told(tmp_path: Path) -> None:
    clip, work = write_frames(tmp_path / "frames", LENS), tmp_path / "work"
    keep(clip, work)
    images = work / "model" / "images.txt"
    lines = images.read_text().splitlines()
    words = lines[2].split()
    words[5] = repr(float(words[5]) + 0.5)
    lines[2] = " ".join(words)
    images.write_text("\n".join(lines) + "\n")
    with pytest.raises(UserError, match=r"images\.txt was changed or damaged after the solve") as raised:
        load_solve(work)
    assert raised.value.remedies == (Remedy.AGAIN,)
    images.unlink()
    with pytest.raises(UserError, match=r"images\.txt is missing"):
        load_solve(work)
    # It may be imported, elsewhere.
    write_model(work / "model", slanted_plane(LENS))
    assert run("import", work / "model", "--footage", clip, "--work", tmp_path / "own") == 0


@pytest.mark.long
def test_a_clip_that_changes_while_it_is_solved_is_not_kept(tmp_path: Path) -> None:
    clip = planes.write_clip(tmp_path / "walk", planes.sideways(12))
    process = SolveProcess(clip, tmp_path / "work", focal=planes.FOCAL)
    with (clip / "shot_0012.png").open("ab") as file:
        file.write(b"\0")
    try:
        with pytest.raises(UserError, match="changed while it was being solved"):
            process.wait()
    finally:
        process.cancel()
    assert not (tmp_path / "work").exists()


@pytest.mark.parametrize("moved", ["old", "model", "model and no solve before"])
def test_a_kill_between_model_and_state_loses_nothing(tmp_path: Path, moved: str) -> None:
    clip, other, work = write_frames(tmp_path / "frames", LENS), tmp_path / "other", tmp_path / "work"
    keep(clip, work)
    before = listed(work / "model")
    longer = Intrinsics(LENS.width, LENS.height, 2 * LENS.fx, 2 * LENS.fy, LENS.cx, LENS.cy)
    keep(clip, other, longer)
    killed = work / ".solving-0123456789ab-0123abcd"
    killed.mkdir()
    (work / file_lock.NAME).touch()
    (work / "model").rename(killed / "old")
    shutil.copy(other / "solve.json", killed)
    if moved != "old":
        shutil.copytree(other / "model", work / "model")
    if moved == "model and no solve before":
        (work / "solve.json").unlink()
        shutil.rmtree(killed / "old")
    expected = before if moved == "old" else listed(other / "model")
    assert load_solve(work).reconstruction.cameras[0].fx == (LENS.fx if moved == "old" else longer.fx)
    assert listed(work / "model") == expected
    assert sorted(p.name for p in work.iterdir()) == [file_lock.NAME, "model", "solve.json"]


def test_a_killed_solve_leaves_nothing_after_the_next_start(tmp_path: Path) -> None:
    clip = planes.write_clip(tmp_path / "walk", planes.sideways(16))
    temporary, work = tmp_path / "tmp", tmp_path / "work"
    temporary.mkdir()
    script = (
        "import os, sys; from pathlib import Path; from addon.core.sfm.process import SolveProcess\n"
        "p = SolveProcess(Path(sys.argv[1]), Path(sys.argv[2]))\n"
        "while not any('Solving' in s.text for s in p.poll()): pass\n"
        "os.kill(p._job.process.pid, 9); os._exit(0)"
    )
    env = os.environ | {"PYTHONPATH": str(ROOT), "TMPDIR": str(temporary)}
    subprocess.run([sys.executable, "-c", script, clip, work], check=True, env=env, timeout=PATIENCE)
    assert list(temporary.iterdir()) and list(work.iterdir())
    again = script.splitlines()[0] + "\np = SolveProcess(Path(sys.argv[1]), Path(sys.argv[2])); p.cancel()"
    subprocess.run([sys.executable, "-c", again, clip, work], check=True, env=env, timeout=PATIENCE)
    assert list(temporary.iterdir()) == [] == list(work.iterdir())


def test_two_clips_do_not_share_a_folder_where_no_locks_are_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unknown(_file: int) -> None:
        raise OSError(errno.ENOLCK, "no locks available")

    monkeypatch.setattr(file_lock, "_lock", unknown)
    clip, work = write_frames(tmp_path / "one", LENS), tmp_path / "work"
    late = Staging(work)
    keep(clip, work)
    first = listed(work / "model")
    other = open_footage(video(tmp_path / "two.mp4"))
    (late.folder / "model").mkdir()
    write_model(late.folder / "model", slanted_plane(LENS))
    with pytest.raises(UserError, match=r"another solve was written to .* in the meantime"):
        late.keep(other, identity(other.path), {}, {})
    late.discard()
    assert listed(work / "model") == first and load_solve(work).footage == clip


@pytest.mark.long
def test_two_clips_race_into_one_folder(tmp_path: Path) -> None:
    script = (
        "import sys; from pathlib import Path; from addon.core.sfm.process import SolveProcess\n"
        "p = SolveProcess(Path(sys.argv[1]), Path(sys.argv[2]), focal=272.0)\n"
        "try: p.wait()\n"
        "finally: p.cancel()"
    )
    clips = [planes.write_clip(tmp_path / name, planes.sideways(12)[s:]) for name, s in (("a", 0), ("b", 1))]
    both = [
        subprocess.Popen(
            [sys.executable, "-c", script, str(clip), str(tmp_path / "work")],
            stderr=subprocess.PIPE, text=True, env=os.environ | {"PYTHONPATH": str(ROOT)},
        )
        for clip in clips
    ]  # fmt: skip
    errors = [process.communicate(timeout=PATIENCE)[1] for process in both]
    assert sorted(process.returncode for process in both) == [0, 1]
    won = 0 if both[0].returncode == 0 else 1
    assert "is being solved into" in errors[1 - won] or "choose another folder" in errors[1 - won]
    assert load_solve(tmp_path / "work").footage == clips[won]


def test_a_movie_is_written_by_one(ready: bpy.types.Scene, tmp_path: Path) -> None:
    out = tmp_path / "new" / "m.mp4"
    hold = (
        "import sys, pathlib; sys.path.insert(0, sys.argv[1]);"
        "from addon.core.base.file_lock import OutputLock;"
        "lock = OutputLock(pathlib.Path(sys.argv[2])); print('held', flush=True); input()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", hold, str(ROOT), str(out)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    ) as other:  # fmt: skip
        assert other.stdout is not None and other.stdout.readline() == "held\n"
        with pytest.raises(UserError, match=rf"m\.mp4 is being written by process {other.pid} on "):
            output.claimed(out)
        with output.claimed(out.with_name("other.mp4")):
            pass
        other.kill()
    with output.claimed(out):
        output.render_movie(ready, FRAMES, out, lambda text: None)
        with pytest.raises(UserError, match=r"m\.mp4 is being written here since"):
            output.claimed(out)
    assert [p.name for p in out.parent.iterdir()] == ["m.mp4"]


def test_the_command_line_holds_its_movie(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    work, out = tmp_path / "work", tmp_path / "o.mp4"
    keep(write_frames(tmp_path / "frames", LENS), work)
    with file_lock.OutputLock(out):
        assert run("render", work, *LENS_OPTIONS, "--out", out) == 1
    assert "is being written here" in capsys.readouterr().err


class _Meanwhile:
    """Runs `other` before the picture of a frame is drawn."""

    def __init__(self, frame: int, other: Callable[[], object], monkeypatch: pytest.MonkeyPatch) -> None:
        drawn = engine.render_frame
        self.frames: list[int] = []

        def render(taken: object, number: int, *rest: object) -> object:
            self.frames.append(number)
            if number == frame:
                other()
            return drawn(taken, number, *rest)

        monkeypatch.setattr(engine, "render_frame", render)


def test_ranges_of_a_sequence_are_written_side_by_side(
    ready: bpy.types.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, out = tmp_path / "whole" / "####.png", tmp_path / "o" / "####.png"
    rendered(ready, whole)

    def other() -> None:
        # Another run of frames 2 and 3, which comes to its end meanwhile.
        for frame in (2, 3):
            shutil.copy(whole.with_name(f"000{frame}.png"), out.parent)

    mine = _Meanwhile(1, other, monkeypatch)
    rendered(ready, out)
    assert mine.frames == [1]
    assert listed(out.parent) == listed(whole.parent)


@pytest.mark.parametrize(("overwrite", "taken"), [(False, 1), (True, 2), (False, 3)])
def test_another_run_with_other_settings_is_told(
    ready: bpy.types.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, overwrite: bool, taken: int
) -> None:
    out, others = tmp_path / "o" / "####.png", tmp_path / "others" / "####.png"
    ready.virtual_aperture.blur = 0.08
    rendered(ready, others)
    ready.virtual_aperture.blur = 0.03
    # While frame 2 is drawn, the other run replaces one of before, this one, or one of after.
    _Meanwhile(2, lambda: shutil.copy(others.with_name(f"000{taken}.png"), out.parent), monkeypatch)
    with pytest.raises(UserError, match=rf"frame {taken}: .*000{taken}\.png was replaced in the meantime"):
        rendered(ready, out, overwrite)
    theirs = out.with_name(f"000{taken}.png")
    assert frame_files.key_of(theirs) == frame_files.key_of(others.with_name(f"000{taken}.png"))


def test_save_takes_no_other_file_for_the_clip(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    clip, work, sent = video(tmp_path / "clip.mp4"), tmp_path / "work", tmp_path / "send"
    keep(clip, work)
    shutil.copytree(tmp_path, sent, ignore=lambda *_: ["work", "send"])
    exchange(sent / "clip.mp4")
    assert run("save", work, "--blend", sent / "a.blend") == 1
    assert "already exists and differs from" in capsys.readouterr().err
    assert [p.name for p in sent.iterdir()] == ["clip.mp4"]


@pytest.mark.long
def test_same_clip_same_model(tmp_path: Path) -> None:
    clip = planes.write_clip(tmp_path / "walk", planes.sideways(12))
    models = []
    for number in (0, 2):
        process = SolveProcess(clip, tmp_path / f"work{number}")
        # Whoever else computes must not matter.
        busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(number)]
        try:
            process.wait()
        finally:
            process.cancel()
            for each in busy:
                each.kill()
                each.wait()
        models.append(listed(tmp_path / f"work{number}" / "model"))
    assert models[0] == models[1]
