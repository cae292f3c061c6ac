"""The render engine: F12, Ctrl-F12 and `blender -b file.blend -a` give the frames of the simulated lens."""

import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field

import bpy
import cv2
import numpy as np

from ..core.base import memory
from ..core.base.arrays import LinearRGBA, Map
from ..core.base.errors import UserError
from ..core.base.progress import Cancelled, OnProgress, checkpoint, reporting, stage
from ..core.frame.detail import enlarged_values
from ..core.frame.frame import Frame
from ..core.frame.passes import circle_of_confusion, depth, in_focus
from ..core.frame.plan import FrameOptions
from ..scene import passes
from ..scene.base.remedy_words import WORDS
from ..scene.base.timeline import clip_frame, scene_time
from ..scene.ignored import stand_in, warn_of_ignored
from ..scene.lens.lens import frame_options
from ..scene.sources.hdr_view import WAYS_OUT, lost
from ..scene.sources.shot import Shot, shot_of
from .cg.cg_process import draw_cg
from .processes.frames_ahead import DrawnFrame, frame_ahead
from .viewport.pictures import FIRST, Wanted, has_depth, make_picture
from .viewport.viewport import PREVIEW, Shown, draw, update
from .views import frame_notes
from .views.average import OnFrame, draw_matte, render_frame
from .views.frame_size import render_size, shape_problem
from .views.gpu_views import egl_problem

VALUES: dict[str, Callable[[Frame], Map]] = {
    passes.DEPTH: depth,
    passes.CIRCLE_OF_CONFUSION: circle_of_confusion,
    passes.IN_FOCUS: in_focus,
}
"""Values of the passes of the sharp frame."""
CHANNEL = {passes.DEPTH: "Z", passes.CIRCLE_OF_CONFUSION: "X", passes.IN_FOCUS: "X", passes.RANGE_MATTE: "X"}
"""Name of a pass's channel in files."""
REDRAW = 0.1
"""Seconds between two texts about a render's progress: more of them would only cost redraws."""
_renders = ContextVar("renders", default=False)
"""True on the thread that Blender renders on, as others that work side by side must not call Blender."""


@dataclass
class RenderWatch:
    """The events of renders for the script that starts them: Blender reports no errors of animations."""

    on_frame: OnFrame | None = None
    """Called with each frame that is drawn, on the thread that draws."""
    on_progress: OnProgress | None = None
    """Called with the stage and the finished share of a frame, every `REDRAW` seconds."""
    error: BaseException | None = None
    """The exception of the last render that failed."""
    pictures: dict[str, LinearRGBA] | None = None
    """(H, W, 4), and (H, W, 1) of passes besides Combined, that were drawn last, by name; None where nobody
    asks for them, for they are large."""
    notes: list[str] = field(default_factory=list)
    """Notes on the present frame."""
    is_drawn: bool = False
    """True if a render reached its picture. An exception before our code runs, such as a signal while Blender
    prepares a frame, leaves a black frame and no error."""

    def raise_error(self) -> None:
        """Raise the exception of a render that failed."""
        if self.error is not None:
            raise self.error

    def check_drawn(self) -> None:
        """Raise what a render failed of, or UserError where there is no picture."""
        self.raise_error()
        if not self.is_drawn:
            raise UserError("rendering stopped before there was a picture; render again")


@contextmanager
def watched(on_frame: OnFrame | None = None, on_progress: OnProgress | None = None) -> Iterator[RenderWatch]:
    """Watch the renders within; without `on_frame` and `on_progress` those of an enclosing watch stay."""
    around = VirtualApertureEngine.watch
    VirtualApertureEngine.watch = RenderWatch(on_frame or around.on_frame, on_progress or around.on_progress)
    try:
        yield VirtualApertureEngine.watch
    finally:
        VirtualApertureEngine.watch = around


class VirtualApertureEngine(bpy.types.RenderEngine):
    """Renders the solved clip with the depth of field of a large lens."""

    bl_idname = "VIRTUAL_APERTURE"
    bl_label = "Virtual Aperture"
    # With a window the main thread draws (see `main_thread`). Without one, Blender crashes when it is to
    # give a context and there is no driver to give one.
    bl_use_gpu_context = bpy.app.background and not egl_problem()
    bl_use_preview = False
    bl_use_eevee_viewport = True
    # Blender makes the engine's instances, so they have no arguments.
    watch = RenderWatch()

    def __init__(self, *args: object, **kwargs: object) -> None:
        super().__init__(*args, **kwargs)
        self._in_viewport = Shown()

    def view_update(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        """Begin with the picture of a scene that has changed."""
        update(self._in_viewport, context, depsgraph)

    def view_draw(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        """Draw the frame through the lens into a viewport in Rendered shading."""
        draw(self, self._in_viewport, context, depsgraph)

    def update_render_passes(self, scene: bpy.types.Scene, renderlayer: bpy.types.ViewLayer) -> None:
        """Tell Blender's compositor which passes there will be."""
        self.register_pass(scene, renderlayer, "Combined", 4, "RGBA", "COLOR")
        for name in passes.wanted(renderlayer):
            self.register_pass(scene, renderlayer, name, 1, CHANNEL[name], "VALUE")

    def render(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Render the current frame into the Combined pass.

        Whatever is raised is reported as an error: then Blender ends an animation and writes no file for the
        frame.
        """
        scene = depsgraph.scene_eval
        self._title, self._shown = frame_title(scene, self.is_animation), 0.0
        try:
            _renders.set(True)
            with PREVIEW.paused(), reporting(self._on_progress):
                checkpoint()
                warn_of_ignored(self, depsgraph.scene)
                number, size = scene.frame_current, render_size(scene.render)
                if replaced := stand_in(scene, shot_of(scene)):
                    frame_notes.add(scene, number, replaced)
                    # An animation has warned of its range.
                    self.report({"INFO" if self.is_animation else "WARNING"}, f"Frame {number} {replaced}")
                with self._at_whole_frame(depsgraph):
                    scene, layer = depsgraph.scene_eval, depsgraph.view_layer_eval
                    with self._first_look(scene, size, layer.name):
                        pictures = self._frame(scene, number, size, layer)
                self._hand_over(pictures, scene.render, depsgraph.view_layer_eval.name)
        except Cancelled:
            return
        except UserError as error:
            self._fail(error, error.worded(WORDS))
        except Exception as error:
            if memory.is_shortage(error):
                scarce = memory.shortage(f"frame {depsgraph.scene.frame_current} could not be rendered")
                self._fail(scarce, str(scarce))
                return
            traceback.print_exc()
            self._fail(error, f"Rendering failed: {type(error).__name__}: {error} (the console shows where)")
        except BaseException as error:
            # Ctrl-C: Blender would swallow it and go on with the next frame.
            self._fail(error, f"Rendering was stopped by {type(error).__name__}")

    def _fail(self, error: BaseException, text: str) -> None:
        self.watch.error = error
        self.report({"ERROR"}, text)
        self.error_set(text)

    @contextmanager
    def _at_whole_frame(self, depsgraph: bpy.types.Depsgraph) -> Iterator[None]:
        """Evaluate the scene at the clip's frame, where remapping or subframes lead between two frames."""
        scene = depsgraph.scene_eval
        now, frame = (scene.frame_current, scene.frame_subframe), clip_frame(scene)
        if scene.frame_current_final == frame:
            yield
            return
        self.frame_set(*scene_time(scene, frame))
        try:
            yield
        finally:
            self.frame_set(*now)

    def _frame(
        self, scene: bpy.types.Scene, number: int, size: tuple[int, int], layer: bpy.types.ViewLayer
    ) -> dict[str, LinearRGBA]:
        """The frame (H, W, 4) and passes (H, W, 1) of a view layer, by name, at the scene's own `number`."""
        names = passes.wanted(layer)
        with stage("Clip", 0.0, 0.0):
            shot, frame, lens = lens_of(scene, size)
        pictures: dict[str, LinearRGBA] = {}

        def on_frame(drawn: Frame) -> None:
            if passes.RANGE_MATTE in names:
                matte = cv2.resize(draw_matte(drawn, passes.range_of(layer)), size)
                pictures[passes.RANGE_MATTE] = np.asarray(matte, np.float32)[..., None]
            for name in (each for each in names if each in VALUES):
                values = enlarged_values(VALUES[name](drawn), drawn.small, drawn.source)
                pictures[name] = np.asarray(values, np.float32)[..., None]
            if names and passes.CIRCLE_OF_CONFUSION in pictures:
                pictures[passes.CIRCLE_OF_CONFUSION] *= size[0] / drawn.small.shape[1]
            if self.watch.on_frame is not None:
                self.watch.on_frame(drawn)

        def note(text: str) -> None:
            self.report({"INFO"}, text)
            frame_notes.add(scene, frame, text)
            if self.watch.pictures is not None:
                self.watch.notes.append(text)

        if self.is_animation and self.watch.on_frame is None:
            drawn = frame_ahead(scene, number, size[0] * size[1], draw_alone)
            if drawn is not None:
                for text in drawn.notes:
                    note(text)
                pictures = drawn.pictures
        if not pictures:
            cg = draw_cg(scene, layer.name)
            pictures["Combined"] = render_frame(shot.context, frame, lens, size, note, on_frame, cg)
        if shot.space is not None and (share := lost(scene, shot.space.name, pictures["Combined"])):
            note(f"{share:.0%} of the pixels are brighter than white and lost in this format: {WAYS_OUT}")
        return pictures

    @contextmanager
    def _first_look(self, scene: bpy.types.Scene, size: tuple[int, int], layer: str) -> Iterator[None]:
        """Where somebody looks, show a first look at the frame while depth or CG objects are made."""
        shown = None
        if not (bpy.app.background or self.is_animation):
            wanted = Wanted(*lens_of(scene, size), size)
            # Errors of the frame are reported when it is drawn.
            with suppress(UserError):
                slow = "" if has_depth(wanted) else "from this frame alone; finding depth"
                if not slow and hasattr(scene, "cycles") and draw_cg(scene, layer) is not None:
                    slow = f"without CG objects; Cycles takes {scene.cycles.samples} samples for them"
                if slow:
                    look = make_picture(wanted, FIRST).linear.astype(np.float32)
                    shown = self._begin({"Combined": look}, scene.render, layer)
                    self.update_result(shown)
                    self._title += f" | First look {slow}"
        try:
            yield
        finally:
            if shown is not None:
                self.end_result(shown, cancel=True, do_merge_results=False)

    def _on_progress(self, stage_name: str, share: float) -> None:
        if self.test_break():
            raise Cancelled
        now = time.monotonic()
        if now - self._shown < REDRAW or not _renders.get():
            return
        self._shown = now
        if self.watch.on_progress is not None:
            self.watch.on_progress(stage_name or "Starting", share)
        self.update_stats("", f"{self._title} | {stage_name or 'Starting'} | {100 * share:.0f}%")
        self.update_progress(share)

    def _hand_over(
        self, pictures: dict[str, LinearRGBA], render: bpy.types.RenderSettings, layer: str
    ) -> None:
        for name in pictures:
            if name not in ("Combined", passes.DEPTH):
                self.add_pass(name, 1, CHANNEL[name], layer=layer)
        self.end_result(self._begin(pictures, render, layer))
        if self.watch.pictures is not None:
            self.watch.pictures |= pictures
        self.watch.is_drawn = True

    def _begin(
        self, pictures: dict[str, LinearRGBA], render: bpy.types.RenderSettings, layer: str
    ) -> bpy.types.RenderResult:
        """Begin a result with pictures (H, W, n) by the names of their passes."""
        height, width = pictures["Combined"].shape[:2]
        left, bottom, right, top = 0, 0, width, height
        if render.use_border:
            left, right = (round(x * width) for x in (render.border_min_x, render.border_max_x))
            bottom, top = (round(y * height) for y in (render.border_min_y, render.border_max_y))
        result = self.begin_result(0, 0, right - left, top - bottom, layer=layer)
        # With stereoscopy each view has a pass of the same name.
        for each in result.layers[0].passes:
            if each.name in pictures:
                # Blender's first row is the bottom one.
                part = pictures[each.name][::-1][bottom:top, left:right]
                each.rect.foreach_set(np.ascontiguousarray(part, dtype=np.float32).reshape(-1))
        return result


def frame_title(scene: bpy.types.Scene, is_animation: bool) -> str:
    """Which frame is being rendered: "Frame 3 of 36" of an animation, else "Frame 12"."""
    if not is_animation:
        return f"Frame {scene.frame_current}"
    step, start, end = scene.frame_step, scene.frame_start, scene.frame_end
    return f"Frame {(scene.frame_current - start) // step + 1} of {(end - start) // step + 1}"


def lens_of(scene: bpy.types.Scene, size: tuple[int, int]) -> tuple[Shot, int, FrameOptions]:
    """Return a scene's shot, the clip's frame and the lens.

    Raises:
        UserError: One is missing, or the render's size has another shape than the clip, which would be
            stretched.
    """
    shot = shot_of(scene)
    frame = shot.frame_at(clip_frame(scene))
    if problem := shape_problem(size, shot.size(frame)):
        raise UserError(problem)
    return shot, frame, frame_options(scene.virtual_aperture, shot.reconstruction)


def draw_alone(name: str, frame: int) -> DrawnFrame:
    """Draw a frame of a scene, by the scene's number, in a process that draws ahead of another one.

    Raises:
        UserError: It cannot be drawn.
    """
    scene = bpy.data.scenes[name]
    scene.frame_set(frame)
    with watched() as watch:
        watch.pictures = pictures = dict[str, LinearRGBA]()
        try:
            bpy.ops.render.render(scene=name)
        except RuntimeError as error:
            watch.raise_error()
            raise UserError(str(error).strip()) from error
        watch.check_drawn()
        return DrawnFrame(pictures, tuple(watch.notes))
