"""A sample scene filmed and solved for the thesis's figures, kept below build/figures."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from addon.core.base.arrays import Floats
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Intrinsics, Reconstruction
from addon.core.depth.sparse import FrameFeatures, frame_features
from addon.core.focus.focus import Focus
from addon.core.media.clip import Footage, open_footage
from addon.core.media.light import to_linear
from addon.core.sfm.process import SolveProcess
from addon.core.sfm.workspace import Solve, load_solve
from addon.render.views.quiet import quiet
from addon.scene.sources.shot import Shot
from sample_scenes import filming, staging, truth
from sample_scenes.stage import Stage

from .. import store
from ..picked import pick

FOLDER = store.ROOT / "build" / "figures"
SAMPLES = 8
"""Of the clip, per pixel: what is left of their noise is far below the camera's."""
LENS_NOISE = 0.03
"""Of pictures through a true lens: Cycles samples every pixel until its error is about this."""

Picture = NDArray[np.float32]


class Clip:
    """One scene: its true geometry, its clip, and the solve of that clip."""

    def __init__(self, name: str) -> None:
        self.name = name

    @cached_property
    def stage(self) -> Stage:
        return filming.load(self.name)

    @cached_property
    def folder(self) -> Path:
        """Named after a hash of what it is made from, so that a changed scene is filmed anew."""
        code = store.sources("sample_scenes/filming.py")
        return FOLDER / f"{self.name}-{store.digest(self.stage, SAMPLES, code)}"

    @cached_property
    def _scene(self) -> bpy.types.Scene:
        return staging.build(self.stage, SAMPLES)

    @property
    def scene(self) -> bpy.types.Scene:
        """The scene in Blender, and the window's, without which its camera would not move."""
        bpy.context.window.scene = self._scene
        return self._scene

    @cached_property
    def footage(self) -> Footage:
        folder = self.folder / "clip"
        missing = [f for f in self.frames if not (folder / f"frame_{f:04d}.png").exists()]
        if missing:
            print(f"{self.name}: filming {len(missing)} frames", flush=True)
        with quiet(1):
            for frame in missing:
                filming.film_frame(self.scene, frame, folder, SAMPLES)
        return open_footage(folder)

    @property
    def frames(self) -> range:
        return range(1, len(self.stage.cameras) + 1)

    @property
    def middle(self) -> int:
        """The frame that is shown."""
        return len(self.stage.cameras) // 2

    @property
    def size(self) -> tuple[int, int]:
        return self.stage.cameras.width, self.stage.cameras.height

    def solve(self, focal: float | None = None) -> Solve:
        """What the add-on makes of the clip alone, or of the clip and its focal length in pixels."""
        code = store.digest(store.sources(*store.SOLVER))
        work = self.folder / f"{'video' if focal is None else 'focal'}-{code}.aperture"
        process = SolveProcess(self.footage.path, work, focal=focal)
        if not process.finished:
            given = "" if focal is None else " with the true focal length"
            print(f"{self.name}: solving the cameras{given}", flush=True)
        try:
            process.wait()
        finally:
            process.cancel()
        return load_solve(work)

    @cached_property
    def solved(self) -> Solve:
        return self.solve()

    @cached_property
    def shot(self) -> Shot:
        """What the add-on renders: the clip, its solve, and the depth that it finds."""
        return Shot(self.footage, self.reconstruction)

    @property
    def reconstruction(self) -> Reconstruction:
        return self.solved.reconstruction

    @property
    def lens(self) -> Intrinsics:
        """As solved."""
        return self.reconstruction.intrinsics(self.reconstruction.image_at(self.middle)[0])

    def features(self, frame: int) -> FrameFeatures:
        return frame_features(self.reconstruction, frame, Canvas(self.lens))

    def depth(self, frame: int) -> Floats:
        """(H, W) true depth in metres, inf where there is only air."""
        with quiet(1):
            return truth.geometry(self.scene, frame).depth

    @cached_property
    def unit(self) -> float:
        """Scene units of the solve that move the features as far in the picture as one metre should.

        A solve has no scale, and its focal length may be off; what a virtual camera's picture depends on is
        focal length times inverse depth, whose true values the features' own pixels have.
        """
        features = self.features(self.middle)
        depth = self.depth(self.middle)
        column, row = np.clip(features.observed, 0, np.array(self.size) - 1).astype(int).T
        wanted = self.stage.cameras.focal / depth[row, column]
        return float(np.median(wanted / (self.lens.fx * features.inverse_depth)))

    def frame(self, frame: int) -> NDArray[np.uint8]:
        """(H, W, 3) of the clip as filmed."""
        return np.asarray(self.footage.read(frame), dtype=np.uint8)

    def picture(self, frame: int) -> Picture:
        """(H, W, 4) of the clip, linear."""
        return to_linear(self.footage.read(frame))

    def seen(self, point: Floats, frame: int) -> tuple[float, float]:
        """Where a point of the world is seen, as fractions of the picture."""
        x, y = self.stage.cameras.project(point[None])[frame - 1, 0] / self.size
        return float(x), float(y)

    def pick(self, point: Floats, frame: int) -> Focus:
        """The focus points that a click on a place of the world picks."""
        return pick(self.reconstruction, frame, *self.seen(point, frame))

    def from_beside(self, frame: int, offset: tuple[float, float], focus: float) -> Picture:
        """(H, W, 3) the true picture from a camera `offset` metres (right, down), in register at `focus`."""
        name = f"beside-{frame:04d}-{offset[0]:g}-{offset[1]:g}-{focus:.6g}"
        return store.kept(
            str(self.folder),
            name,
            lambda: truth.virtual_pinhole(self.scene, frame, offset, focus, SAMPLES, seed=0),
        )

    def through_lens(self, frame: int, radius: float, focus: float, width: int) -> Picture:
        """(h, width, 3) the true picture through a lens of `radius` metres focused at depth `focus`."""
        name = f"lens-{frame:04d}-{radius:.6g}-{focus:.6g}-{width}-{LENS_NOISE:g}"

        def make() -> Picture:
            with _resized(self.scene, width):
                return truth.lens(self.scene, frame, radius, focus, LENS_NOISE, seed=0)

        return store.kept(str(self.folder), name, make)


@contextmanager
def _resized(scene: bpy.types.Scene, width: int) -> Iterator[None]:
    render = scene.render
    before = render.resolution_percentage
    render.resolution_percentage = round(100 * width / render.resolution_x)
    try:
        yield
    finally:
        render.resolution_percentage = before
