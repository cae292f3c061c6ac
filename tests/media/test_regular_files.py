"""Pipes, devices and files that lie about their size: told in a line, and never waited for."""

from __future__ import annotations

import io
import json
import os
import signal
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any

import cv2
import numpy as np
import pytest

from addon.cli.main import run_command
from addon.core.base import npz
from addon.core.base.digest import file_digest
from addon.core.base.errors import UserError
from addon.core.base.file_lock import FolderLock
from addon.core.base.store import Store
from addon.core.camera.reconstruction import Intrinsics
from addon.core.depth.multi_view_stereo import DenseDepth
from addon.core.depth.stored_depth import depth_entry
from addon.core.media import exif
from addon.core.media.clip import open_footage
from addon.core.media.clip_identity import is_clip
from addon.core.media.copying import copy_file
from addon.core.media.picture_file import read_picture
from addon.core.readers import bundler, nvm, read_reconstruction, voodoo
from addon.core.readers.matching import Imported
from addon.core.readers.parsing import Text
from addon.core.sfm.state import read_state, write_state
from addon.core.sfm.workspace import keep_import, load_solve
from addon.render.output import frame_files, run_report
from addon.scene.sources.shot import reconstruction_digest

from ..scenes import slanted_plane, texture, write_frames

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
HANGS = 60
"""Seconds of a busy machine after which a call would not end."""

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names")


@pytest.fixture(autouse=True)
def _end_what_hangs() -> Iterator[None]:
    def ended(_signal: int, _frame: FrameType | None) -> None:
        raise TimeoutError("it hangs")

    before = signal.signal(signal.SIGALRM, ended)
    signal.alarm(HANGS)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def pipe(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    os.mkfifo(path)
    return path


def device(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    path.symlink_to("/dev/zero")
    return path


KINDS = [(pipe, "it is a pipe, not a file"), (device, "it is a device, not a file")]


@pytest.mark.parametrize(("make", "said"), KINDS)
@pytest.mark.parametrize(
    ("name", "read"),
    [
        ("a.png", read_picture),
        ("a.mp4", open_footage),
        ("solve.json", lambda path: read_state(path.parent)),
    ],
)
def test_only_files_are_read(
    tmp_path: Path, make: Callable[[Path], Path], said: str, name: str, read: Callable[[Path], object]
) -> None:
    path = make(tmp_path / name)
    with pytest.raises(UserError, match=rf"{name} cannot be read: {said}") as raised:
        read(path)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("make", [pipe, device])
def test_what_is_no_file_tells_nothing(tmp_path: Path, make: Callable[[Path], Path]) -> None:
    path = make(tmp_path / "a.mp4")
    assert exif.photo_data(path) is None
    assert not is_clip(path, "2:" + "0" * 64)
    assert not any(reader.recognises(path) for reader in (nvm, voodoo, bundler))
    assert "cannot be read back" in frame_files.still_problem(path)
    with pytest.raises(UserError, match=r"a\.mp4 cannot be read: it is a .*, not a file"):
        frame_files.key_of(path)
    with pytest.raises(UserError, match="is not a file"):
        Text(path)
    with pytest.raises(UserError, match="not a file, or is missing"):
        copy_file(path, tmp_path / "copy.mp4")
    lock = FolderLock(tmp_path)
    (tmp_path / ".solving.lock").unlink()
    make(tmp_path / ".solving.lock")
    lock.release()


def test_a_pipe_among_the_frames_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    frames = write_frames(tmp_path / "frames", LENS)
    pipe(frames / "clip_0002.png")
    assert run_command(["solve", str(frames), "--work", str(tmp_path / "work")]) == 1
    said = capsys.readouterr().err
    assert "clip_0002.png cannot be read: it is a pipe" in said and len(said.splitlines()) == 1


def test_reports_go_into_files(tmp_path: Path) -> None:
    for path in (pipe(tmp_path / "a.json"), device(tmp_path / "b.json")):
        for overwrite in (False, True):
            with pytest.raises(UserError, match="is not a file; choose another file"):
                run_report.check_report(path, overwrite)


def video(path: Path) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 24, (LENS.width, LENS.height))
    for number in range(3):
        writer.write(np.roll(texture(LENS.width, LENS.height, 0), number, axis=1))
    writer.release()
    return path


@pytest.fixture
def work(tmp_path: Path) -> Path:
    """The solve of a small video."""
    clip = video(tmp_path / "clip.mp4")
    keep_import(Imported(slanted_plane(LENS), "COLMAP text", ()), open_footage(clip), tmp_path / "work")
    return tmp_path / "work"


def say(work: Path, **changed: object) -> None:
    """Have a state tell something else, with a digest as if the solve had written it."""
    state = json.loads((work / "solve.json").read_text())
    del state["digest"]
    write_state(work / "solve.json", state | changed)


@pytest.mark.parametrize(("make", "said"), KINDS)
def test_a_strangers_solve_of_no_file_is_refused(
    work: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], make: Callable[[Path], Path], said: str
) -> None:
    say(work, footage=str(make(tmp_path / "their.mp4")), relative="")
    for command in ("report", "render"):
        options = ["--focus-point", "3", "--out", str(tmp_path / "####.png")] if command == "render" else []
        assert run_command([command, str(work), *options]) == 1
        err = capsys.readouterr().err
        assert f"their.mp4 cannot be read: {said}" in err and len(err.splitlines()) == 1


@pytest.mark.parametrize("lie", [{"times": list(range(10**6))}, {"times": []}, {"width": 10**9}])
def test_a_count_or_a_size_that_the_clip_does_not_have_is_not_believed(
    work: Path, lie: dict[str, Any]
) -> None:
    video = json.loads((work / "solve.json").read_text())["video"]
    say(work, video=video | lie)
    footage = load_solve(work).open_clip()
    assert (footage.frames, footage.width, footage.height) == ((1, 2, 3), LENS.width, LENS.height)


def test_a_state_that_is_too_large_is_not_read(work: Path) -> None:
    with (work / "solve.json").open("r+b") as file:
        file.truncate(1 << 40)
    with pytest.raises(UserError, match=r"solve\.json cannot be read: it has 1099511627776 bytes"):
        load_solve(work)


def test_a_folder_of_1_0_is_read_without_the_points_that_frames_did_not_track(work: Path) -> None:
    path, before = work / "model" / "visible.npz", load_solve(work).reconstruction
    np.savez_compressed(path, frame=np.array([1, 1]), point=np.array([0, 2]))
    state = json.loads((work / "solve.json").read_text())
    say(work, model=state["model"] | {path.name: file_digest(path)})
    assert reconstruction_digest(load_solve(work).reconstruction) == reconstruction_digest(before)


def bomb(path: Path, size: int) -> None:
    """Numbers of zeros that are packed a thousand times smaller."""
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<i8", "fortran_order": False, "shape": (size // 8,)}
    )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in ("frame", "point"):
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                file.write(header.getvalue())
                for _ in range(size >> 20):
                    file.write(bytes(1 << 20))


def test_packed_zeros_are_not_unpacked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.npz"
    bomb(path, 1 << 26)
    unpacked = []
    before = zipfile.ZipFile.read
    monkeypatch.setattr(zipfile.ZipFile, "read", lambda *names: unpacked.append(names) or before(*names))
    with pytest.raises(ValueError, match=r"a\.npz unpacks to more"):
        npz.read_arrays(path, ("frame", "point"), 1 << 20)
    assert not unpacked


def test_an_array_is_as_large_as_it_says(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, x=np.arange(6.0).reshape(2, 3), y=np.float32(3), z=np.asfortranarray(np.eye(2, 3)))
    found = npz.read_arrays(path, ("x", "y", "z"), 8 * 6 + 4 + 48)
    for name, array in np.load(path).items():
        np.testing.assert_array_equal(found[name], array)
    for most, names in ((10, ("x",)), (1000, ("x", "q"))):
        with pytest.raises(ValueError, match=r"unpacks to more|is not a file of"):
            npz.read_arrays(path, names, most - npz.HEADER if most == 10 else most)
    for shape in ("(9999999999,)", "(-1,)", "(1, 1)", "(" * 5000, "x", "()"):
        data = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".encode()
        with zipfile.ZipFile(path, "w") as archive:
            size = (len(data) + 1).to_bytes(2, "little")
            archive.writestr("x.npy", b"\x93NUMPY\x01\x00" + size + data + b"\n" + bytes(48))
        with pytest.raises(ValueError):
            npz.read_arrays(path, ("x",), 1 << 20)


def test_kept_depth_of_another_size_than_the_frame_is_not_decoded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lens = Intrinsics(40, 30, 40.0, 40.0, 20.0, 15.0)
    flat = np.full((30, 40), 0.5, np.float32)
    store, entry = Store(tmp_path, lambda: "a"), depth_entry("depth", 1, lens)
    store.get(entry, lambda: DenseDepth(1, flat, flat, flat > 1, lens))
    assert store.read(entry) is not None
    path = next(tmp_path.rglob("depth-*.npz"))
    with np.load(path) as there:
        parts = dict(there)
    # 400 megapixels in half a megabyte.
    parts["inverse"] = cv2.imencode(".png", np.zeros((20_000, 20_000), np.uint8))[1]
    np.savez(path, **parts)
    sizes = []
    decode = cv2.imdecode
    monkeypatch.setattr(cv2, "imdecode", lambda *arguments: sizes.append(decode(*arguments)) or sizes[-1])
    assert store.read(entry) is None
    assert max((each.size for each in sizes), default=0) <= 9 * 40 * 40


def test_a_model_that_is_a_pipe_is_refused(work: Path, tmp_path: Path) -> None:
    for name in ("a.nvm", "bundle.out", "a.txt"):
        path = pipe(tmp_path / "models" / name)
        with pytest.raises(UserError, match=r"is not a file|not a model in a known format"):
            read_reconstruction(path, open_footage(tmp_path / "clip.mp4"))
