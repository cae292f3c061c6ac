"""Other processes of this command line, and the scene as a .blend for them."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path

import bpy
import gpu

from ...core.base import limits
from ...core.base.atomic import staged
from ...core.base.errors import UserError
from ...core.base.messages import Warned
from ...core.base.streams import say_to
from ...core.base.worker import Worker
from ..views.quiet import quiet

HEADLESS = Path(__file__).resolve().parents[2] / "headless.py"
JOB = "--job"
"""Instead of a command, which the parent sends."""
BACKENDS = {"METAL", "OPENGL", "VULKAN"}
"""Blender's GPU backends but that without a GPU."""
ENDS = b"ENDB", b"\xb1\xea\x92\x8f"
"""Ends of a .blend: its last block, or, if it is compressed, the number of Zstandard's seek table."""


def launcher() -> list[str]:
    """Return the words before the arguments with which another process of this command line is started."""
    if bpy.app.binary_path:
        return [
            bpy.app.binary_path, *_backend(), "--background", "--python-exit-code", "1",
            "--python", str(HEADLESS), "--",
        ]  # fmt: skip
    return [sys.executable, str(HEADLESS)]


def _backend() -> list[str]:
    """The words that choose this Blender's GPU backend; none before it has a GPU context."""
    try:
        backend = gpu.platform.backend_type_get()
    except SystemError:
        return []
    return ["--gpu-backend", backend.lower()] if backend in BACKENDS else []


def start(
    worker: Worker,
    arguments: Sequence[object],
    scene: str = "",
    one_thread: bool = False,
    yields: bool = True,
    **more: object,
) -> None:
    """Start another process of this command line.

    A window goes first, unless the user waits for the process (`yields`).

    `arguments` are those of a command, or the name of one of `engine_jobs.JOBS`; people cannot ask for a
    .blend's `scene` and for `more`. UserError as of `Worker.start`.
    """
    told = {"arguments": [str(each) for each in arguments], "scene": scene, **more}
    told["scripts"] = not bpy.app.autoexec_fail
    environment = os.environ | (limits.ONE_THREAD if one_thread else {})
    worker.start([*launcher(), JOB], told, yields and not bpy.app.background, environment)


def write_blend(blend: Path) -> None:
    """Write the open scene as a .blend with relative paths, atomically.

    Raises:
        UserError: It cannot be written.
    """
    with staged(blend) as part:
        try:
            with quiet(1):
                bpy.ops.wm.save_as_mainfile(filepath=str(part), check_existing=False, copy=True)
        except RuntimeError as error:
            raise UserError(f"{blend} cannot be written: {str(error).strip()}") from None
        finally:
            part.with_name(part.name + "1").unlink(missing_ok=True)
        # Blender does not always notice that it could not write on.
        if not part.is_file() or not any(end in part.read_bytes()[-64:] for end in ENDS):
            raise UserError(f"{blend} could not be written completely; is the disk full?")


class CalledProcess:
    """Another process, in which functions are called; it is started when it is needed."""

    def __init__(self, program: str = "process") -> None:
        """Set its name in errors."""
        self._program = program
        self.worker: Worker | None = None
        """The process, if there is one."""

    def launch(self, worker: Worker) -> None:
        """Start the process."""
        raise NotImplementedError

    def begin(self) -> Worker:
        """Return the process that runs, or start one.

        Raises:
            UserError: It cannot be started.
        """
        self.poll()
        if self.worker is None or not self.worker.is_running:
            worker = Worker(self._program)
            self.launch(worker)
            self.worker = worker
        return self.worker

    def poll(self) -> None:
        """Read all answers."""
        if self.worker is not None:
            for message in self.worker.poll():
                if isinstance(message, Warned):
                    say_to(2, f"note: {message.text}")

    def end(self) -> Worker | None:
        """End the process, which is returned, without waiting for it; its calls are cancelled."""
        worker, self.worker = self.worker, None
        if worker is not None:
            worker.leave()
        return worker
