"""Drawing of frames with the views of Blender's GPU module."""

from collections.abc import Callable

from ...core.base.arrays import LinearRGBA, Map
from ...core.base.progress import stage
from ...core.frame.cg_layers import DrawCG
from ...core.frame.clip_context import ClipContext
from ...core.frame.frame import Frame
from ...core.frame.frame_path import draw_frame, mean_of_views
from ...core.frame.inspection import shares_of, source_frame
from ...core.frame.plan import FrameOptions
from ...core.frame.range_matte import Range, matte_frame, matte_of
from ...core.frame.report import notes
from . import gpu_views

OnFrame = Callable[[Frame], None]
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
    for each in notes(drawn):
        note(each)
    if on_frame is not None:
        on_frame(drawn)
    return picture


def draw_shares(frame: Frame) -> LinearRGBA:
    """Return the shares (H, W, 3) of `inspection.SOURCES` in each of the result's pixels."""
    with stage("Sources", 1.0, 1.0):
        mean = draw_mean(source_frame(frame))
    return shares_of(mean, frame.views.canvas)


def draw_matte(frame: Frame, wanted: Range) -> Map:
    """Return the matte (H, W) of a range of distances through the lens, in the source frame's geometry."""
    with stage("Range Matte", 1.0, 1.0):
        return matte_of(draw_mean(matte_frame(frame, wanted)), frame)


def draw_mean(frame: Frame) -> LinearRGBA:
    """Return the mean of a frame's views (h, w, 4) in their canvas, with its effects.

    Raises UserError without a GPU context.
    """
    return mean_of_views(frame, _views)


def _views(frame: Frame) -> LinearRGBA:
    """Return the weighted mean (h, w, 4) of a frame's views, with its CG objects."""
    gpu_views.check_gpu()
    return gpu_views.mean_of_views(frame.views, (*frame.layers, *frame.cg_layers))
