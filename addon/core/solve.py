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
        self._listener: threading.Thread | None = None
        self._focal = focal
        self._made: Path | None = None
        self._job: Path | None = None
        self.finished = False
        if focal is not None and not focal > 0:
            raise UserError(f"the focal length is {focal:g} pixels; it must be greater than zero")
        self._clip = open_footage(footage, frames)
        self._clip.close()
        self._identity = identity(self._clip.path)
        if _is_solved(work_dir, self._clip, self._identity, focal) and not again:
            self.finished = True
            return
        self._start()

    def _start(self) -> None:
        try:
            if not self.work_dir.exists():
                self._made = next(
                    p for p in [*reversed(self.work_dir.parents), self.work_dir] if not p.exists()
                )
                self.work_dir.mkdir(parents=True)
            self._job = Path(tempfile.mkdtemp(prefix=".solving-", dir=self.work_dir))
            self._launch(self._job)
        except OSError as error:
            self.cancel()
            raise UserError(
                f"no solve can be started in the working folder {self.work_dir}: {error.strerror}"
            ) from None
        except UserError:
            self.cancel()
            raise

    def _launch(self, folder: Path) -> None:
        job = {
            "footage": str(self._clip.path),
            "frames": self._clip.frames,
            "focal": self._focal,
            "folder": str(folder),
        }
        (folder / "job.json").write_text(json.dumps(job), encoding="utf-8")
        with (folder / "log.txt").open("w", encoding="utf-8") as log:
            self._process = subprocess.Popen(
                # -P: a folder called "addon" in the current directory must not be taken for ours.
                [_python(), "-P", "-m", "addon.core.solve_worker", str(folder / "job.json")],
                env=_environment(), stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, text=True,
                encoding="utf-8", creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
            )  # fmt: skip
        self._listener = threading.Thread(target=self._listen, args=(self._process,), daemon=True)
        self._listener.start()

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
        if ended is not None and self._listener is not None:
            # The thread may still hold the last lines.
            self._listener.join()
        while True:
            try:
                message = json.loads(self._lines.get_nowait())
            except queue.Empty:
                break
            except ValueError:
                continue
            if "error" in message:
                self.cancel()
                raise UserError(message["error"]) from _bug(message)
            if "ok" in message:
                self._process.wait()
                self._keep()
                return steps
            if "stage" in message:
                steps.append(_progress(**message))
        if ended is not None and not self.finished:
            last = (
                (self._job / "log.txt").read_text("utf-8", errors="replace").strip().splitlines()
                if self._job
                else []
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
            if self._listener is not None:
                self._listener.join(0.05)

    def cancel(self) -> None:
        """End the worker and leave the folder as it was; harmless after the end."""
        process = self._process
        if process is not None and process.poll() is None:
            process.terminate()
            try:
                process.wait(3)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
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
            "focal": self._focal,
            "report": json.loads((self._job / "report.json").read_text(encoding="utf-8")),
        }
        (self._job / STATE).write_text(json.dumps(state, indent=1), encoding="utf-8")
        model, old = self.work_dir / "model", self._job / "old"
        try:
            if model.exists():
                model.rename(old)
            (self._job / "model").rename(model)
            (self._job / STATE).replace(self.work_dir / STATE)
        except OSError as error:
            if old.exists():
                shutil.rmtree(model, ignore_errors=True)
                old.rename(model)
            self.cancel()
            raise UserError(
                f"the solve cannot be moved into {self.work_dir}: {error.strerror}; the old one is as it was"
            ) from None
        self._made = None
        self.finished = True
        self._clean()

    def _clean(self) -> None:
        if self._process is not None and self._process.poll() is not None:
            if self._listener is not None:
                self._listener.join()
            for pipe in (self._process.stdin, self._process.stdout):
                if pipe is not None:
                    pipe.close()
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


def identity(path: Path) -> str:
    """What a clip is recognised by wherever it lies: a video's size and a hash of its first and last MiB,
    a sequence's file names and sizes. Not the times, which copying changes."""
    digest = hashlib.sha256()
    if path.is_file():
        size = path.stat().st_size
        with path.open("rb") as file:
            digest.update(str(size).encode() + file.read(1 << 20))
            file.seek(max(0, size - (1 << 20)))
            digest.update(file.read())
    else:
        for image in open_footage(path).files:
            digest.update(f"{image.name}\n{image.stat().st_size}\n".encode())
    return digest.hexdigest()


def _is_solved(work_dir: Path, footage: Footage, identity: str, focal: float | None) -> bool:
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
    wanted = tuple(state["frames"]) == footage.frames and focal in (None, state.get("focal"))
    return wanted and (work_dir / "model").is_dir()


def _state(work_dir: Path) -> dict[str, Any] | None:
    try:
        state = json.loads((work_dir / STATE).read_text(encoding="utf-8"))
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


def _bug(message: dict[str, Any]) -> Exception | None:
    """The worker's traceback, for whoever asks for it."""
    return RuntimeError(message["traceback"]) if "traceback" in message else None


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
