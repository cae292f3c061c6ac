"""Solving a clip in a worker process."""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import threading
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..base import priority
from ..base.atomic import collect_temporary
from ..base.errors import Remedy, UserError
from ..camera.focal_length import Focal, in_pixels
from ..media.clip import FrameRange, open_footage
from ..media.clip_identity import identity
from ..media.video import video_info
from .staging import Staging
from .tracks import TRACKERS
from .workspace import check_replaceable, imported_from, is_solved

SHARES = {
    "Tracking features": (0.0, 0.2),
    "Verifying matches": (0.2, 0.27),
    "Solving cameras": (0.27, 0.42),
    "Settling the focal length": (0.42, 0.8),
    "Registering frames": (0.8, 0.82),
    "Adjusting": (0.82, 0.93),
    "Looking for points": (0.93, 1.0),
}
"""Which part of the whole each stage is, from the times of the duck and the sample clip."""


END = 0.3
"""Seconds that the worker has to end by itself: it has nothing to clean up, and who cancels waits."""


@dataclass(frozen=True)
class Progress:
    """How far a solve is."""

    text: str
    share: float


class SolveProcess:
    """A solve under way in the worker process.

    Raises UserError at once for a clip that cannot be read, a focal length that cannot be, and a working
    folder that is not ours, another clip's, being solved into by somebody else, or, unless `again`, an
    import's. Whatever ends it, the folder then holds either the old solve or the whole new one.
    """

    def __init__(
        self,
        footage: Path,
        work_dir: Path,
        frames: FrameRange | None = None,
        focal: Focal | None = None,
        again: bool = False,
        tracker: str = TRACKERS[0],
        zooms: bool = False,
        yielding: bool = False,
    ) -> None:
        """With `yielding` other programs go first, such as the interface that waits for it."""
        self.work_dir = work_dir
        self._yields = yielding
        self._process: subprocess.Popen[str] | None = None
        self._lines: queue.Queue[str] = queue.Queue()
        self._listener: threading.Thread | None = None
        self._staging: Staging | None = None
        self.finished = False
        collect_temporary()
        self.clip = open_footage(footage, frames)
        self.clip.close()
        self._identity = identity(self.clip.path)
        pixels = None if focal is None else in_pixels(focal, self.clip.width, self.clip.height)
        self._options: dict[str, Any] = {"focal": pixels, "tracker": tracker, "zooms": zooms}
        if self._is_kept(again):
            self.finished = True
            return
        self._staging = Staging(work_dir)
        try:
            # Somebody else may have come to the end meanwhile.
            if self._is_kept(again):
                self.finished = True
                self.cancel()
                return
            self._launch(self._staging.folder)
        except OSError as error:
            self.cancel()
            raise UserError(f"the solving process cannot be started: {error.strerror}") from None
        except UserError:
            self.cancel()
            raise

    def _is_kept(self, again: bool) -> bool:
        """Whether the folder keeps this very solve; UserError where it keeps what may not be replaced."""
        if again:
            check_replaceable(self.work_dir, self.clip)
            return False
        solved = is_solved(self.work_dir, self.clip, self._options)
        _refuse_import(self.work_dir)
        return solved

    def _launch(self, folder: Path) -> None:
        job = {
            "footage": str(self.clip.path),
            "frames": self.clip.frames,
            "video": asdict(video_info(self.clip.path)) if self.clip.is_video else None,
            "folder": str(folder),
            "tracker": self._options["tracker"],
            "lens": {name: self._options[name] for name in ("focal", "zooms")},
        }
        (folder / "job.json").write_text(json.dumps(job), encoding="utf-8")
        with (folder / "log.txt").open("w", encoding="utf-8") as log:
            lowered = priority.CREATION_FLAGS if self._yields else 0
            self._process = subprocess.Popen(
                # -P: a folder called "addon" in the current directory must not be taken for ours.
                [_python(), "-P", "-m", "addon.core.sfm.worker", str(folder / "job.json")],
                env=_environment(), stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, text=True,
                encoding="utf-8", creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0) | lowered,
            )  # fmt: skip
        if self._yields:
            priority.let_others_go_first(self._process)
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
                raise UserError(message["error"], *map(Remedy, message["remedies"])) from _bug(message)
            if "ok" in message:
                self._process.wait()
                self._keep()
                return steps
            if "stage" in message:
                steps.append(_progress(**message))
        if ended is not None and not self.finished:
            assert self._staging is not None
            log = self._staging.folder / "log.txt"
            last = log.read_text("utf-8", errors="replace").strip().splitlines()
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
                process.wait(END)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self._clean()

    def _keep(self) -> None:
        assert self._staging is not None
        said = json.loads((self._staging.folder / "report.json").read_text(encoding="utf-8"))
        try:
            self._staging.keep(self.clip, self._identity, self._options, said)
        finally:
            self._clean()
        self.finished = True

    def _clean(self) -> None:
        if self._process is not None and self._process.poll() is not None:
            if self._listener is not None:
                self._listener.join()
            for pipe in (self._process.stdin, self._process.stdout):
                if pipe is not None:
                    pipe.close()
        if self._staging is not None:
            self._staging.discard()
            self._staging = None
            # The worker's own, where it was ended.
            collect_temporary()


def _refuse_import(work_dir: Path) -> None:
    # What another program found may have cost more than a solve, and is not ours to throw away unasked.
    imported = imported_from(work_dir)
    if imported:
        raise UserError(
            f"{work_dir} holds an import ({imported}), not a solve of our own; go on with it as it is, name"
            " another folder, or replace it",
            Remedy.WORK_DIR,
            Remedy.AGAIN,
        )


def _bug(message: dict[str, Any]) -> Exception | None:
    """The worker's traceback, for whoever asks for it."""
    return RuntimeError(message["traceback"]) if "traceback" in message else None


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
    above = Path(__file__).resolve().parents[3]
    paths = [str(above), *(p for p in sys.path if p)]
    return os.environ | {"PYTHONPATH": os.pathsep.join(paths), "PYTHONUNBUFFERED": "1"}
