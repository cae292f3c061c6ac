"""CG objects of a render, drawn by Cycles in a process of our own: a render cannot start inside a render.

The file is copied as it is when the render begins.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import bpy
import numpy as np

from ...core.base.calls import Failed
from ...core.base.errors import UserError
from ...core.base.progress import checkpoint
from ...core.base.worker import Worker
from ...core.camera.reconstruction import Intrinsics
from ...core.depth.source import PixelDepth
from ...core.frame.cg_layers import CGObjects, DrawCG
from ...scene.base.events import RENDERS, at
from ...scene.base.timeline import clip_frame
from ...scene.cg_objects import cg_objects
from ...scene.gpu import main_thread
from ..processes.launcher import CalledProcess, start, write_blend
from .cycles_layers import Wanted, draw

View = tuple[str, int]
"""Name of a view layer, and frame of the scene's animation."""
OVERSCAN = 1 / 16
"""Share of the picture's long side by which CG objects are drawn past its border: blur discs of an eighth of
it reach so far."""
LOOK = 0.02
"""Seconds between two looks for results."""


class CGProcess(CalledProcess):
    """The process that draws CG objects."""

    _file: Path | None = None
    """The .blend that it was started with for a preview."""
    _scene = ""
    """Name of the scene."""
    is_kept = False
    """True if the scene stays unchanged between renders."""

    def draw(
        self, scene: str, view: View, pinhole: Intrinsics, depth: PixelDepth | None, file: Path | None = None
    ) -> CGObjects:
        """Draw the CG objects of a scene as the pinhole of a canvas sees them.

        Passes checkpoints. For a preview `file` is a .blend; else the open file is copied as the process
        starts, so that it must stay unchanged.

        Raises:
            UserError: The process fails, and is ended.
        """
        if file != self._file:
            self.end()
            self._file = file
        self._scene = scene
        layer, frame = view
        margin = int(np.ceil(OVERSCAN * max(pinhole.width, pinhole.height)))
        plate = np.zeros((0, 0)) if depth is None else depth.inverse_depth
        wanted = Wanted(layer, frame, pinhole, margin, np.asarray(plate, np.float32))
        call = self.begin().call(partial(draw, wanted))
        try:
            while not call.ended:
                checkpoint()
                self.poll()
                time.sleep(LOOK)
            return call.result()
        except (UserError, Failed) as error:
            self.end()
            raise UserError(f"the CG objects of frame {frame} could not be rendered: {error}") from None
        finally:
            # Nobody waits for it any longer.
            call.cancel()

    def launch(self, worker: Worker) -> None:
        """Start the process."""
        blend = self._file or worker.folder / "scene.blend"
        if self._file is None:
            # Files are written on the main thread, which a render waits for.
            main_thread.call(lambda: write_blend(blend))
        start(
            worker, ["cg"], self._scene, blend=blend, folder=worker.folder, is_preview=self._file is not None
        )


_process = CGProcess()


def draw_cg(scene: bpy.types.Scene, layer: str) -> DrawCG | None:
    """Return the function that draws a view layer's CG objects at the scene's frame; None without any."""
    original = scene.original if scene.is_evaluated else scene
    if not cg_objects(original, original.view_layers[layer]):
        return None
    name, view = original.name, (layer, clip_frame(scene))
    return lambda frame, canvas, depth: _process.draw(name, view, canvas.pinhole, depth)


@contextmanager
def kept() -> Iterator[None]:
    """Keep one process for the CG objects of all renders within; the scene must stay unchanged.

    At the end the process and its files are removed.
    """
    before, _process.is_kept = _process.is_kept, True
    try:
        yield
    finally:
        _process.is_kept = before
        if (left := end()) is not None:
            # A command ends without waiting for other processes.
            left.join()


@at(*RENDERS)
def end(*_: object) -> Worker | None:
    """End the process of a render, unless it is `kept`; returns it if there is one."""
    return None if _process.is_kept else _process.end()
