"""Windows and macOS, as far as Linux can look like them: imports, locks, and paths that are text."""

from __future__ import annotations

import argparse
import ntpath
import os
import subprocess
import sys
from pathlib import Path, PureWindowsPath
from types import SimpleNamespace
from typing import Any

import bpy
import pytest

from addon.cli import lens_options
from addon.cli.aperture import image_of, with_image
from addon.core.base import file_lock
from addon.core.base.errors import UserError
from addon.core.sfm import state as solve_state
from addon.core.sfm.state import recorded_places
from addon.scene.base import paths
from addon.ui.focus import lens_presets

ROOT = Path(__file__).resolve().parents[1]
WITHOUT_POSIX = r"""
import importlib, importlib.abc, os, pathlib, signal, sys
import av, bpy, cv2, numpy, pycolmap
class Hidden(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name in ("fcntl", "grp", "posix", "pty", "pwd", "resource", "termios", "tty"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
for name in ("fcntl", "grp", "pwd", "resource", "termios"):
    sys.modules.pop(name, None)
sys.meta_path.insert(0, Hidden())
# Both lists by Python's documentation of `os` and `signal`: "Availability: Unix".
for name in "fork getuid killpg mkfifo nice setpriority setsid statvfs sysconf uname".split():
    delattr(os, name)
for name in "SIGALRM SIGHUP SIGKILL SIGUSR1 alarm setitimer".split():
    delattr(signal, name)
root = pathlib.Path(sys.argv[1])
for file in sorted((root / "addon").rglob("*.py")):
    module = file.relative_to(root).with_suffix("").parts
    if module[1:2] not in (("headless",), ("presets",)):
        importlib.import_module(".".join(module).removesuffix(".__init__"))
import addon
addon.register()
addon.unregister()
print("IMPORTED", len([name for name in sys.modules if name.startswith("addon.")]))
"""


def test_the_add_on_needs_no_module_of_posix() -> None:
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_POSIX, str(ROOT)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "IMPORTED" in done.stdout, done.stderr


class Msvcrt:
    """Windows' own lock of a byte: one holder each file, by its number on the disk."""

    LK_NBLCK = 2

    def __init__(self) -> None:
        self.held: dict[int, int] = {}

    def locking(self, file: int, mode: int, count: int) -> None:
        """Lock some bytes from the file's position on."""
        assert (mode, count, os.lseek(file, 0, os.SEEK_CUR)) == (self.LK_NBLCK, 1, file_lock.FAR)
        if self.held.setdefault(os.fstat(file).st_ino, file) != file:
            raise PermissionError(13, "Permission denied")


@pytest.fixture
def windows_locks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Locks by Windows' system call."""
    monkeypatch.setattr(file_lock, "sys", SimpleNamespace(platform="win32"))
    monkeypatch.setitem(sys.modules, "msvcrt", Msvcrt())  # type: ignore[arg-type]
    monkeypatch.setitem(sys.modules, "fcntl", None)


def test_windows_locks_a_byte_beyond_the_text(windows_locks: None, tmp_path: Path) -> None:
    one = file_lock.FileLock(tmp_path / "lock", UserError)
    assert one.is_locked and file_lock.owner_of(tmp_path / "lock")
    with pytest.raises(UserError, match="here since"):
        file_lock.FileLock(tmp_path / "lock", UserError, patience=0)
    assert not file_lock.is_abandoned(tmp_path / "lock")
    one.release()
    assert not (tmp_path / "lock").exists()


def test_others_lock_by_flock(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    import fcntl

    calls: list[int] = []
    for system in ("linux", "darwin"):
        monkeypatch.setattr(file_lock, "sys", SimpleNamespace(platform=system))
        monkeypatch.setattr(fcntl, "flock", lambda _, flags: calls.append(flags))
        file_lock.FileLock(tmp_path / "lock", UserError).release()
    assert calls == [fcntl.LOCK_EX | fcntl.LOCK_NB] * 2


@pytest.fixture
def windows_paths(monkeypatch: pytest.MonkeyPatch) -> None:
    """Paths as text by the rules of Windows, in the modules that handle them as such."""
    for module in (solve_state, paths):
        monkeypatch.setattr(module, "os", SimpleNamespace(path=ntpath, sep="\\"))
    monkeypatch.setattr(paths, "Path", PureWindowsPath)


def test_a_solve_of_windows_finds_the_clip_beside_it(windows_paths: None, tmp_path: Path) -> None:
    clips = PureWindowsPath(r"C:\My Clips")
    relative = solve_state._relative(clips / "a" / "walk.mp4", clips / "walk.aperture")  # type: ignore[arg-type]
    assert relative == "../a/walk.mp4"
    state: dict[str, Any] = {"relative": relative, "footage": r"C:\My Clips\a\walk.mp4"}
    assert recorded_places(tmp_path / "walk.aperture", state)[0] == tmp_path / "a" / "walk.mp4"
    assert solve_state._relative(clips / "walk.mp4", PureWindowsPath("D:/solves")) == ""  # type: ignore[arg-type]


def test_a_blend_of_windows_has_slashes(windows_paths: None, monkeypatch: pytest.MonkeyPatch) -> None:
    folder: Any = PureWindowsPath(r"C:\film")
    assert paths.relative(r"C:\film\clips\walk.mp4", folder) == "//clips/walk.mp4"
    assert paths.relative(r"C:\walk.mp4", folder) == "//../walk.mp4"
    assert paths.relative(r"\\server\clips\walk.mp4", folder) == r"\\server\clips\walk.mp4"
    assert paths.relative(r"D:\walk.mp4", folder) == r"D:\walk.mp4"


def test_a_lens_file_of_windows_is_read_elsewhere(tmp_path: Path) -> None:
    words = with_image(["blades=6", r"image=C:\iris.png"], PureWindowsPath(r"aperture\iris.png"))  # type: ignore[arg-type]
    file = tmp_path / "lens.json"
    lens_options.write_lens(file, {"depth": PureWindowsPath(r"depth\maps"), "aperture": words})
    assert "\\" not in file.read_text()
    options = argparse.Namespace(**lens_options.lens_defaults(), focus_is_needed=False)
    lens_options.read_lens(file, options)
    assert options.depth == tmp_path / "depth" / "maps"
    assert image_of(options.aperture) == tmp_path / "aperture" / "iris.png"


def test_a_preset_of_windows_is_python(
    scene: bpy.types.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # As escapes in a string, \n and \t would be a line's end and a tab.
    image = r"C:\new\tables\iris.png"
    monkeypatch.setattr(lens_presets, "absolute", lambda path, _: PureWindowsPath(path))
    scene.virtual_aperture.shape.image = image
    lens_presets.VIRTUAL_APERTURE_OT_add_lens_preset.add(None, bpy.context, str(tmp_path / "preset.py"))
    scene.virtual_aperture.shape.image = ""
    bpy.utils.execfile(str(tmp_path / "preset.py"))
    assert scene.virtual_aperture.shape.image == image
