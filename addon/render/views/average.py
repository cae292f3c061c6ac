"""Drawing of frames with the views of Blender's GPU module."""

from collections.abc import Callable
from dataclasses import replace

from ...core.base.arrays import LinearRGBA, Map
from ...core.base.progress import stage
from ...core.frame.cg_layers import DrawCG, joined
from ...core.frame.clip_context import ClipContext
from ...core.frame.frame_path import Drawn, draw_frame, mean_of_views
from ...core.frame.inspection import opaque_triangles, shares_of, source_frame
from ...core.frame.plan import FrameOptions
from ...core.frame.range_matte import Range, matte_frame, matte_of
from ...core.frame.warped_frame import WarpedFrame
from . import gpu_views

OnFrame = Callable[[Drawn], None]
"""Called with each frame that is drawn."""


def render_frame(
    clip: ClipContext,
    frame: int,
    options: FrameOptions,
    size: tuple[int, int],
    note: Callable[[str], None],
    on_frame: OnFrame | None = None,
    draw_cg: DrawCG | None = None,
) -> LinearRGBA:
    """Draw one frame through the lens.

    Passes checkpoints.

    Args:
        clip: The clip.
        frame: Number of the frame.
        options: The lens.
        size: (width, height).
        note: Called with notes for the user.
        on_frame: Called with the drawn frame.
        draw_cg: Draws the CG objects.

    Returns:
        (h, w, 4) float32, linear, premultiplied.
    """
    picture, drawn = draw_frame(clip, frame, options, size, _views, draw_cg)
    for each in drawn.notes:
        note(each)
    if on_frame is not None:
        on_frame(drawn)
    return picture


def draw_shares(drawn: Drawn) -> LinearRGBA:
    """Return the shares (H, W, 3) of `inspection.SOURCES` in each of the result's pixels."""
    with stage("Sources", 1.0, 1.0):
        mean = draw_mean(source_frame(drawn.warped))
    return shares_of(mean, drawn.warped.plan.canvas)


def draw_matte(warped: WarpedFrame, wanted: Range) -> Map:
    """Return the matte (H, W) of a range of distances through the lens, in the source frame's geometry."""
    with stage("Range Matte", 1.0, 1.0):
        return matte_of(draw_mean(matte_frame(warped, wanted)), warped)


def draw_mean(warped: WarpedFrame) -> LinearRGBA:
    """Return the mean of a frame's views (h, w, 4) in its canvas, with its effects.

    Raises UserError without a GPU context.
    """
    return mean_of_views(warped, _views)


def _views(warped: WarpedFrame) -> LinearRGBA:
    """Return the weighted mean (h, w, 4) of a frame's views, with its CG objects."""
    gpu_views.check_gpu()
    plan, texture = warped.plan, warped.texture
    if warped.cg:
        mesh, texture = joined(plan.mesh, texture, opaque_triangles(warped), warped.cg)
        plan = replace(plan, mesh=mesh)
    return gpu_views.mean_of_views(plan, texture)
