"""Debug views: pictures of what the current frame is drawn from, for the Image Editor."""

from __future__ import annotations

from contextlib import ExitStack

import bpy
import numpy as np

from ..core.base.errors import UserError
from ..core.lens.inspection import NAMES, Shown
from ..render import engine
from ..render.run_report import Inspector
from ..scene.remedy_words import WORDS
from .operators import Result, refused, reported
from .render_clip import can_render, prepare_render

MARK = "virtual_aperture"
"""Custom property of our images: which picture it is."""
LOOK = 0.1
"""Seconds between two looks whether the frame is drawn."""


class VIRTUAL_APERTURE_OT_inspect_frame(bpy.types.Operator):  # noqa: N801
    """Render the current frame, and make pictures of its depth, confidence, mesh, layers, sources and blur"""

    bl_idname = "virtual_aperture.inspect_frame"
    bl_label = "Inspect Frame"
    bl_options = {"UNDO"}  # noqa: RUF012

    _inspector: Inspector | None = None
    _watch = engine.RenderWatch()
    _watching = ExitStack()
    _timer: bpy.types.Timer | None = None

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return can_render(cls, context)

    def _check(self, context: bpy.types.Context) -> None:
        prepare_render(context.scene)
        self._inspector = Inspector()

    @reported
    def execute(self, context: bpy.types.Context) -> Result:
        self._check(context)
        assert self._inspector is not None
        try:
            with engine.watched(self._inspector.on_frame) as self._watch:
                bpy.ops.render.render(use_viewport=True)
        except RuntimeError as error:
            self._watch.raise_error()
            raise refused(error) from None
        return self._finish()

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Result:
        return self.execute(context) if bpy.app.background else self._begin(context)

    @reported
    def _begin(self, context: bpy.types.Context) -> Result:
        if bpy.app.is_job_running("RENDER"):
            raise UserError("Blender is rendering; wait for it, or press ESC in its window")
        self._check(context)
        assert self._inspector is not None
        # The render job does the work: it has its own thread, its progress and its ESC.
        self._watching = ExitStack()
        self._watch = self._watching.enter_context(engine.watched(self._inspector.on_frame))
        if "RUNNING_MODAL" not in bpy.ops.render.render("INVOKE_DEFAULT", use_viewport=True):
            self._watching.close()
            raise UserError("Blender does not render now; try again")
        self._timer = context.window_manager.event_timer_add(LOOK, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if event.type != "TIMER" or bpy.app.is_job_running("RENDER"):
            return {"PASS_THROUGH"}
        self.cancel(context)
        try:
            return self._finish()
        except UserError as error:
            self.report({"ERROR"}, error.worded(WORDS))
            return {"CANCELLED"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Called by Blender, too, when another file is loaded meanwhile."""
        self._watching.close()
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None

    def _finish(self) -> Result:
        assert self._inspector is not None
        self._watch.raise_error()
        report, pictures = self._inspector.report, self._inspector.pictures
        if report is None:
            self.report({"WARNING"}, "Inspecting was cancelled; the pictures are as they were")
            return {"CANCELLED"}
        names = show(pictures)
        for line in report.words():
            self.report({"INFO"}, line)
        self.report({"INFO"}, f"Look at {', '.join(names)} in the Image Editor")
        return {"FINISHED"}


def show(pictures: dict[str, Shown]) -> list[str]:
    """Pictures (H, W, 3) sRGB into images of this file, the same ones each time; their names.

    Images of what is not among them are removed: they would be another frame's.
    """
    ours = shown()
    for name in ours.keys() - pictures.keys():
        bpy.data.images.remove(ours[name])
    names = []
    for name, picture in pictures.items():
        height, width = picture.shape[:2]
        image = ours.get(name) or bpy.data.images.new(f"VA {name}", width, height)
        image[MARK] = name
        if tuple(image.size) != (width, height):
            image.scale(width, height)
        rgba = np.ones((height, width, 4), np.float32)
        # Blender's first row is the bottom one.
        rgba[..., :3] = picture[::-1] / np.float32(255)
        image.pixels.foreach_set(rgba.ravel())
        image.update()
        # Else Blender asks on exit whether to save it.
        image.pack()
        names.append(image.name)
    return names


def shown() -> dict[str, bpy.types.Image]:
    """Our images in this file, by picture."""
    ours = {image.get(MARK): image for image in bpy.data.images}
    return {name: ours[name] for name in NAMES if name in ours}


CLASSES = (VIRTUAL_APERTURE_OT_inspect_frame,)
