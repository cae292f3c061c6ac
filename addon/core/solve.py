"""Solving a clip in a worker process, and the working folder that keeps the result.

DIR/solve.json   which clip, which frames, and the report
DIR/model/       the reconstruction as a COLMAP text model
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import queue
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .colmap_model import read_model
from .errors import UserError
from .footage import Footage, FrameRange, open_footage
from .reconstruction import Reconstruction

STATE = "solve.json"
VERSION = 1
SHARES = {
    "Tracking features": (0.0, 0.2),
    "Verifying matches": (0.2, 0.3),
    "Solving cameras": (0.3, 0.8),
    "Registering frames": (0.8, 0.85),
    "Adjusting": (0.85, 1.0),
}
"""Which part of the whole each stage is, from the duck clip's times."""


@dataclass(frozen=True)
class Progress:
    """How far a solve is."""

    text: str
    share: float


@dataclass(frozen=True)
class Solve:
    """A finished solve and its clip."""

    work_dir: Path
    footage: Path
    frames: tuple[int, ...]
    reconstruction: Reconstruction
    report: dict[str, Any]

    @property
    def summary(self) -> str:
        """One line for the user."""
        r = self.report
        sigma = r["focal_sigma"]
        lens = f"focal length {'held at' if r['focal_held'] else 'found'} {r['focal']:.0f} px"
        lens += "" if sigma is None or r["focal_held"] else f" (+- {100 * sigma:.1f} %)"
        return (
            f"{r['registered']} of {r['frames']} frames registered, {r['points']} points,"
            f" reprojection error {r['reprojection_error']:.2f} px, {lens}"
        )


def default_work_dir(footage: Path, beside: Path) -> Path:
    """The working folder of a clip when none is named: `<clip>.aperture` in the folder `beside`."""
    stem = footage.name.replace("#", "").replace("%", "") or footage.parent.name
    return beside / f"{Path(stem).stem if footage.suffix else stem}.aperture"


class SolveProcess:
    """A solve under way in the worker process.

    Raises UserError at once for a clip that cannot be read and a working folder that is not ours or
    another clip's. Whatever ends it, the folder then holds either the old solve or the whole new one.
    """

    def __init__(
        self,
        footage: Path,
        work_dir: Path,
        frames: FrameRange | None = None,
        focal: float | None = None,
        again: bool = False,
    ) -> None:
        self.work_dir = work_dir
        self._process: subprocess.Popen[str] | None = None
        self._lines: queue.Queue[str] = queue.Queue()
        self._made: Path | None = None
        self._job: Path | None = None
        self.finished = False
        if focal is not None and not focal > 0:
            raise UserError(f"the focal length is {focal:g} pixels; it must be greater than zero")
        self._clip = open_footage(footage, frames)
        self._identity = identity(self._clip)
        if _is_solved(work_dir, self._clip, self._identity) and not again:
            self.finished = True
            return
        self._start(focal)

    def _start(self, focal: float | None) -> None:
        try:
            if not self.work_dir.exists():
                self._made = next(
                    p for p in [*reversed(self.work_dir.parents), self.work_dir] if not p.exists()
                )
                self.work_dir.mkdir(parents=True)
            self._job = Path(tempfile.mkdtemp(prefix=".solving-", dir=self.work_dir))
        except OSError as error:
            self._clean()
            raise UserError(
                f"the working folder {self.work_dir} cannot be written: {error.strerror}"
            ) from None
        job = {
            "footage": str(self._clip.path),
            "frames": self._clip.frames,
            "focal": focal,
            "folder": str(self._job),
        }
        (self._job / "job.json").write_text(json.dumps(job))
        self._log = (self._job / "log.txt").open("w")
        self._process = subprocess.Popen(
            [_python(), "-m", "addon.core.solve_worker", str(self._job / "job.json")],
            env=_environment(), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=self._log, text=True,
        )  # fmt: skip
        threading.Thread(target=self._listen, args=(self._process,), daemon=True).start()

    def _listen(self, process: subprocess.Popen[str]) -> None:
        # Windows cannot wait on a pipe with a timeout; a thread that only reads lines can.
        assert process.stdout is not None
        for line in process.stdout:
            self._lines.put(line)

    def poll(self) -> list[Progress]:
        """What happened since the last call; `finished` is set at the end. UserError if the solve failed."""
        steps: list[Progress] = []
        if self.finished or self._process is None:
            return steps
        ended = self._process.poll()
        if ended is not None:
            # The reader thread may still hold the last lines.
            time.sleep(0.05)
        while True:
            try:
                message = json.loads(self._lines.get_nowait())
            except queue.Empty:
                break
            except ValueError:
                continue
            if "error" in message:
                self.cancel()
                raise UserError(message["error"])
            if "ok" in message:
                self._process.wait()
                self._keep()
                return steps
            if "stage" in message:
                steps.append(_progress(**message))
        if ended is not None and not self.finished:
            last = (
                (self._job / "log.txt").read_text(errors="replace").strip().splitlines() if self._job else []
            )
            self.cancel()
            reason = last[-1] if last else "no message"
            raise UserError(f"the solving process ended with status {ended}: {reason}")
        return steps

    def wait(self, report: Callable[[Progress], None] = lambda _: None) -> None:
        """Poll to the end."""
        while not self.finished:
            for step in self.poll():
                report(step)
            time.sleep(0.02)

    def cancel(self) -> None:
        """End the worker and leave the folder as it was; harmless after the end."""
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(3)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._clean()

    def _keep(self) -> None:
        """Move the worker's result into place: the state file last, because it makes the folder a solve."""
        assert self._job is not None
        state = {
            "version": VERSION,
            "footage": str(self._clip.path),
            "relative": _relative(self._clip.path, self.work_dir),
            "identity": self._identity,
            "frames": self._clip.frames,
            "report": json.loads((self._job / "report.json").read_text()),
        }
        (self._job / STATE).write_text(json.dumps(state, indent=1))
        model = self.work_dir / "model"
        if model.exists():
            model.rename(self._job / "old")
        (self._job / "model").rename(model)
        (self._job / STATE).replace(self.work_dir / STATE)
        self._made = None
        self.finished = True
        self._clean()

    def _clean(self) -> None:
        if self._process is not None:
            self._log.close()
        if self._job is not None:
            shutil.rmtree(self._job, ignore_errors=True)
            self._job = None
        if self._made is not None:
            # Only folders of our own making, and only while they are empty.
            folder = self.work_dir
            with contextlib.suppress(OSError):
                while folder != self._made.parent:
                    folder.rmdir()
                    folder = folder.parent
            self._made = None


def load_solve(work_dir: Path) -> Solve:
    """The solve that a working folder keeps; UserError where there is none or its clip is gone."""
    state = _state(work_dir)
    if state is None:
        raise UserError(f"{work_dir} holds no solve; run: headless.py solve FOOTAGE --work {work_dir}")
    footage = Path(state["footage"])
    if not _footage_exists(footage) and state["relative"]:
        footage = (work_dir / state["relative"]).resolve()
    if not _footage_exists(footage):
        raise UserError(f"the clip {state['footage']} of {work_dir} is gone; put it back, or solve again")
    frames = tuple(int(f) for f in state["frames"])
    return Solve(work_dir, footage, frames, read_model(work_dir / "model"), state["report"])


def identity(footage: Footage) -> str:
    """What a clip is recognised by wherever it lies: sizes, and a hash of a video's first and last MiB."""
    digest = hashlib.sha256()
    if footage.is_video:
        size = footage.path.stat().st_size
        with footage.path.open("rb") as file:
            digest.update(str(size).encode() + file.read(1 << 20))
            file.seek(max(0, size - (1 << 20)))
            digest.update(file.read())
    else:
        # Neighbouring frames may be added or left out without making it another clip.
        first = footage.files[0]
        digest.update(f"{footage.width}x{footage.height}".encode() + first.suffix.encode())
        digest.update(str(first.parent.resolve()).encode())
    return digest.hexdigest()


def _is_solved(work_dir: Path, footage: Footage, identity: str) -> bool:
    """Whether the folder holds this very solve; UserError where it holds something else."""
    if not work_dir.exists():
        return False
    if not work_dir.is_dir():
        raise UserError(f"{work_dir} is a file; name a folder with --work")
    state = _state(work_dir)
    if state is None:
        if any(not p.name.startswith(".solving-") for p in work_dir.iterdir()):
            raise UserError(f"{work_dir} is not empty and holds no solve; name another folder with --work")
        return False
    if state["identity"] != identity:
        raise UserError(
            f"{work_dir} holds the solve of {Path(state['footage']).name}, not of {footage.path.name};"
            " name another folder with --work"
        )
    return tuple(state["frames"]) == footage.frames and (work_dir / "model").is_dir()


def _state(work_dir: Path) -> dict[str, Any] | None:
    try:
        state = json.loads((work_dir / STATE).read_text())
        if state["version"] > VERSION:
            raise UserError(f"{work_dir} was made with a newer Virtual Aperture; update the extension")
        missing = {"footage", "relative", "identity", "frames", "report"} - set(state)
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError):
        missing = {"everything"}
    if missing:
        raise UserError(f"{work_dir / STATE} is damaged; delete the folder and solve again")
    return dict(state)


def _footage_exists(path: Path) -> bool:
    return path.exists() or (path.parent.is_dir() and ("#" in path.name or "%" in path.name))


def _relative(path: Path, folder: Path) -> str:
    try:
        return os.path.relpath(path, folder)
    except ValueError:  # another drive
        return ""


def _progress(stage: str, done: int, total: int) -> Progress:
    low, high = SHARES.get(stage, (0.0, 1.0))
    share = low + (high - low) * done / max(total, 1)
    return Progress(f"{stage} {done}/{total}" if total > 1 else stage, share)


def _python() -> str:
    """Python for the worker. Blender's `sys.executable` is its own Python; some builds name the program."""
    if "python" in Path(sys.executable).name.lower():
        return sys.executable
    found = sorted(Path(sys.prefix, "bin").glob("python3*")) + sorted(
        Path(sys.prefix, "bin").glob("python.exe")
    )
    if not found:
        raise UserError(f"no Python was found beside {sys.executable}; the solve needs Blender's own Python")
    return str(found[0])


def _environment() -> dict[str, str]:
    # The worker finds our package under the plain name `addon`, whatever Blender calls the extension,
    # and the wheels on the path that Blender made for them.
    above = Path(__file__).resolve().parents[2]
    paths = [str(above), *(p for p in sys.path if p)]
    return os.environ | {"PYTHONPATH": os.pathsep.join(paths), "PYTHONUNBUFFERED": "1"}
