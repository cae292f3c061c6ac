"""CG objects of a render, drawn by Cycles in a process of our own: a render cannot start inside a render.

The file is copied as it is when the render begins; drawings are calls (`core/base/calls.py`).
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ...core.base.atomic import temporary_folder
from ...core.base.calls import Caller, Failed
from ...core.base.errors import UserError
from ...core.base.job import Job, Leaving, end_meanwhile
from ...core.base.progress import checkpoint
from ...core.camera.canvas import Canvas
from ...core.camera.reconstruction import Intrinsics
from ...core.depth.source import PixelDepth
from ...core.frame.cg_layers import CGObjects, DrawCG
from ...scene.base.timeline import clip_frame
from ...scene.cg_objects import cg_objects
from ...scene.gpu import main_thread
from ..processes.blend_file import write_blend
from ..processes.launcher import start
from ..views import render_handlers
from .cycles_layers import Wanted, draw

OVERSCAN = 1 / 16
"""Share of the picture's long side by which CG objects are drawn past its border: blur discs of an eighth of
it reach so far."""
LOOK = 0.02
"""Seconds between two looks for results."""


class CGProcess:
    """The process that draws the CG objects of a scene."""

    def __init__(self, scene: str, file: Path | None = None) -> None:
        """Start the process with a copy of the file, for a scene of this name.

        Args:
            scene: Name of the scene.
            file: The copy, alone in its folder, to draw a preview of; else it is made of the open file.

        Raises:
            UserError: It cannot be started.
        """
        self._held = ExitStack()
        self._job = Job()
        try:
            folder = self._held.enter_context(temporary_folder())
            self._caller = Caller(self._job, folder)
            blend = file or folder / "scene.blend"
            if file is None:
                # Files are written on the main thread, which a render waits for.
                main_thread.call(lambda: write_blend(blend))
            start(
                self._job, folder / "job.json", ["cg"], scene, blend=str(blend), folder=str(folder),
                is_preview=file is not None,
            )  # fmt: skip
        except BaseException:
            self.end()
            raise

    @property
    def is_alive(self) -> bool:
        """Return whether the process can draw."""
        self._job.poll()
        return self._job.is_running

    def draw(self, layer: str, scene_frame: int, pinhole: Intrinsics, depth: PixelDepth | None) -> CGObjects:
        """Draw the CG objects at a frame of the scene, as the pinhole of a canvas sees them.

        Passes checkpoints.

        Raises:
            UserError: The process fails.
        """
        margin = int(np.ceil(OVERSCAN * max(pinhole.width, pinhole.height)))
        plate = np.zeros((0, 0)) if depth is None else depth.inverse_depth
        wanted = Wanted(layer, scene_frame, pinhole, margin, np.asarray(plate, np.float32))
        call = self._caller.call(partial(draw, wanted))
        try:
            while not call.ended:
                checkpoint()
                self._caller.poll()
                time.sleep(LOOK)
            return call.result()
        except (UserError, Failed) as error:
            raise UserError(f"the CG objects of frame {scene_frame} could not be rendered: {error}") from None
        finally:
            # One that nobody waits for any longer.
            call.cancel()

    def end(self) -> Leaving:
        """End the process without waiting for it, and remove its files after that."""
        return end_meanwhile([self._job], self._held.close)


_process: CGProcess | None = None
_is_kept = False
"""True if the scene stays unchanged between renders."""


def draw_cg(scene: bpy.types.Scene, layer: str) -> DrawCG | None:
    """Return the function that draws a view layer's CG objects at the scene's frame; None without any."""
    original = scene.original if scene.is_evaluated else scene
    if not cg_objects(original, original.view_layers[layer]):
        return None
    scene_frame = clip_frame(scene)

    def draw(frame: int, canvas: Canvas, depth: PixelDepth | None) -> CGObjects:
        global _process
        if _process is None:
            _process = CGProcess(original.name)
        try:
            return _process.draw(layer, scene_frame, canvas.pinhole, depth)
        except UserError:
            # The next frame has another one.
            _process.end()
            _process = None
            raise

    return draw


@contextmanager
def kept() -> Iterator[None]:
    """Keep one process for the CG objects of all renders within; the scene must stay unchanged.

    At the end the process and its files are removed.
    """
    global _is_kept
    before, _is_kept = _is_kept, True
    try:
        yield
    finally:
        _is_kept = before
        if (leaving := _end()) is not None:
            # A command ends without waiting for other processes.
            leaving.join()


def _end(*_: object) -> Leaving | None:
    """Called as a render begins, ends or is cancelled, or another file is opened.

    Returns the process that ends, if any.
    """
    global _process
    if _process is None or _is_kept:
        return None
    leaving, _process = _process.end(), None
    return leaving


_on_change = persistent(_end)


def register() -> None:
    """Begin anew with each render."""
    render_handlers.add(_on_change)


def unregister() -> None:
    """Undo `register`, and end what is under way."""
    render_handlers.remove(_on_change)
    _end()
