"""The render engine: F12, Ctrl-F12 and `blender -b file.blend -a` give the frames of the simulated lens."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from ..core.canvas import Picture
from ..core.errors import UserError
from ..scene.ignored import warn_of_ignored
from ..scene.properties import lens_settings
from ..scene.shot import Shot, shot_of
from .average import Told, render_frame
from .gpu_views import egl_problem

_error = ""
"""What went wrong in the last render: Blender does not tell scripts of an animation."""

_told: Told | None = None
"""Who wants to know of each frame that is drawn."""


def clear_error() -> None:
    """Forget the last render's error."""
    global _error
    _error = ""


def raise_error() -> None:
    """UserError if the last render failed."""
    if _error:
        raise UserError(_error)


def tell(told: Told | None) -> None:
    """From now on tell this one of each frame that is drawn, on the thread that draws; None tells nobody."""
    global _told
    _told = told


@contextmanager
def telling(told: Told) -> Iterator[None]:
    """Within it, tell `told` of each frame that is drawn."""
    tell(told)
    try:
        yield
    finally:
        tell(None)


class VirtualApertureEngine(bpy.types.RenderEngine):
    """Looks at the solved clip through every point of a virtual aperture."""

    bl_idname = "VIRTUAL_APERTURE"
    bl_label = "Virtual Aperture"
    # With a window the main thread draws (see `main_thread`). Without one, Blender crashes when it is to
    # give a context and there is no driver to give one.
    bl_use_gpu_context = bpy.app.background and not egl_problem()
    bl_use_preview = False
    bl_use_eevee_viewport = True

    def render(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Render the current frame into the Combined pass; a UserError becomes the engine's error."""
        global _error
        scene = depsgraph.scene_eval
        size = render_size(scene.render)
        warn_of_ignored(self, depsgraph.scene)
        try:
            picture = self._frame(scene, size)
        except UserError as error:
            _error = str(error)
            self.report({"ERROR"}, str(error))
            self.error_set(str(error))
            return
        if picture is not None:
            self._hand_over(picture, scene.render)

    def _frame(self, scene: bpy.types.Scene, size: tuple[int, int]) -> Picture | None:
        shot = shot_of(scene)
        check_shape(shot, size)
        lens = lens_settings(scene.virtual_aperture, shot.reconstruction)
        frame = frame_shown(shot, scene.frame_current)
        return render_frame(shot, frame, lens, size, self._carry_on, self._note, _told)

    def _carry_on(self, done: int, total: int) -> bool:
        self.update_stats("", f"View {done + 1} of {total}")
        self.update_progress(done / total)
        return not self.test_break()

    def _note(self, text: str) -> None:
        self.report({"INFO"}, text)

    def _hand_over(self, picture: Picture, render: bpy.types.RenderSettings) -> None:
        height, width = picture.shape[:2]
        left, bottom, right, top = 0, 0, width, height
        if render.use_border:
            left, right = (round(x * width) for x in (render.border_min_x, render.border_max_x))
            bottom, top = (round(y * height) for y in (render.border_min_y, render.border_max_y))
        # Blender's first row is the bottom one.
        part = np.ascontiguousarray(picture[::-1][bottom:top, left:right], dtype=np.float32)
        result = self.begin_result(0, 0, part.shape[1], part.shape[0])
        result.layers[0].passes["Combined"].rect.foreach_set(part.reshape(-1))
        self.end_result(result)


def render_size(render: bpy.types.RenderSettings) -> tuple[int, int]:
    """(width, height) in pixels of the whole rendered frame."""
    share = render.resolution_percentage / 100
    return max(1, int(render.resolution_x * share)), max(1, int(render.resolution_y * share))


def check_shape(shot: Shot, size: tuple[int, int]) -> None:
    """UserError where the render's shape is not the clip's: the picture would be stretched."""
    clip = shot.footage.width, shot.footage.height
    if abs(size[0] * clip[1] - size[1] * clip[0]) > max(*size, *clip):
        raise UserError(
            f"the render size {size[0]}x{size[1]} has another shape than the clip's {clip[0]}x{clip[1]};"
            " set the resolution back to the clip's and use the percentage or a border"
        )


def frame_shown(shot: Shot, frame: int) -> int:
    """The clip's frame for a scene frame: in a gap, and past the ends, the nearest one before."""
    frames = np.array(shot.footage.frames)
    return int(frames[max(0, int(np.searchsorted(frames, frame, side="right")) - 1)])


CLASSES = (VirtualApertureEngine,)
