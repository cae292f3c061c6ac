"""Other processes of this command line, and the scene as a .blend for them."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path

import bpy
import gpu

from ...core.base import limits
from ...core.base.atomic import staged, temporary_folder, write_bytes
from ...core.base.calls import Caller, Named
from ...core.base.errors import UserError
from ...core.base.job import Job, Leaving, end_meanwhile
from ..views.quiet import quiet

HEADLESS = Path(__file__).resolve().parents[2] / "headless.py"
JOB = "--job"
"""Before the file of a job, instead of a command."""
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
    job: Job,
    file: Path,
    arguments: Sequence[object],
    scene: str = "",
    one_thread: bool = False,
    yields: bool = True,
    **more: object,
) -> None:
    """Have another process of this command line do a job, which it reads in a file.

    A window goes first, unless the user waits for the process (`yields`).

    `arguments` are those of a command, or the name of one of `engine_jobs.JOBS`; people cannot ask for a
    .blend's `scene` and for `more`. UserError where the file cannot be written, and as of `Job.start`.
    """
    told = {"arguments": [str(each) for each in arguments], "scene": scene, **more}
    told["scripts"] = not bpy.app.autoexec_fail
    write_bytes(file, json.dumps(told).encode())
    environment = os.environ | (limits.ONE_THREAD if one_thread else {})
    job.start([*launcher(), JOB, str(file)], yields and not bpy.app.background, environment)


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
        self._caller: Caller | None = None
        self._held = ExitStack()

    @property
    def job(self) -> Job | None:
        """The process, if there is one."""
        return None if self._caller is None else self._caller.job

    def started(self, start: Callable[[Job, Path], Named]) -> Caller:
        """Return the caller of the process that runs.

        If there is none, `start` starts it with a new folder for its calls, and returns names for `pack`.
        """
        self.poll()
        if self._caller is not None and self._caller.job.is_running:
            return self._caller
        self.end()
        job, folder = Job(self._program), self._held.enter_context(temporary_folder())
        try:
            self._caller = Caller(job, folder, start(job, folder))
        except BaseException:
            self._held.close()
            raise
        return self._caller

    def poll(self) -> None:
        """Read all answers."""
        if self._caller is not None:
            self._caller.poll()

    def end(self) -> Leaving | None:
        """End the process without waiting for it, then remove its files; its calls are cancelled."""
        if self._caller is None:
            return None
        self._caller.drop()
        leaving, self._caller = end_meanwhile([self._caller.job], self._held.pop_all().close), None
        return leaving
