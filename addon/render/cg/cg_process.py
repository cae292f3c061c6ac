"""CG objects of a render, drawn by Cycles in a process of our own: a render cannot start inside a render.

FOLDER/scene.blend            the file, as it was when the render began
FOLDER/000012.wanted.npz      what is to be drawn: a canvas at a frame, and the clip's depth there
FOLDER/000012.drawn.npz       what was drawn of it
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ...core.base.atomic import temporary_folder
from ...core.base.errors import UserError
from ...core.base.job import Job, Leaving, end_meanwhile
from ...core.base.progress import checkpoint
from ...core.camera.canvas import Canvas
from ...core.camera.reconstruction import Intrinsics
from ...core.depth.source import PixelDepth
from ...core.frame.cg_layers import CGObjects, DrawCG
from ...core.warp.cg_layer import CGLayer
from ...scene.base.timeline import clip_frame
from ...scene.cg_objects import cg_objects
from ...scene.gpu import main_thread
from ..processes.blend_file import write_blend
from ..processes.launcher import start
from ..views import render_handlers
from .cycles_layers import LOOK, Layers, Wanted

OVERSCAN = 1 / 16
"""Share of the picture's long side by which CG objects are drawn past its border: blur discs of an eighth of
it reach so far."""


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
        self._count = 0
        self._job = Job()
        try:
            blend = file or self._held.enter_context(temporary_folder()) / "scene.blend"
            self._folder = blend.parent
            if file is None:
                # Files are written on the main thread, which a render waits for.
                main_thread.call(lambda: write_blend(blend))
            job = blend.with_suffix(".json")
            start(self._job, job, ["cg"], scene, blend=str(blend), is_preview=file is not None)
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
        self._count += 1
        margin = int(np.ceil(OVERSCAN * max(pinhole.width, pinhole.height)))
        plate = np.zeros((0, 0)) if depth is None else depth.inverse_depth
        wanted = Wanted(layer, scene_frame, pinhole, margin, np.asarray(plate, np.float32))
        wanted.write(self._path("wanted"))
        path = self._path("drawn")
        while not path.exists():
            checkpoint()
            self._check(scene_frame)
            time.sleep(LOOK)
        drawn = Layers.read(path)
        path.unlink()
        typical, sharp = drawn.typical.tolist(), drawn.sharp.tolist()
        parts = zip(drawn.pictures, drawn.inverse_depths, typical, sharp, strict=True)
        layers = [CGLayer.of(picture, inverse, margin, *rest) for picture, inverse, *rest in parts]
        found = tuple(each for each in layers if each is not None)
        return CGObjects(found, drawn.shadow if drawn.shadow.size else None)

    def _path(self, what: str) -> Path:
        return self._folder / f"{self._count:06d}.{what}.npz"

    def _check(self, frame: int) -> None:
        """UserError naming the frame where the process has ended."""
        if not self.is_alive:
            failure = self._job.failure
            said = "its process ended" if failure is None else failure.text
            raise UserError(f"the CG objects of frame {frame} could not be rendered: {said}")

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
