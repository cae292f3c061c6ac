"""The path of a frame: its picture and depth, layers, views through the lens, their mean, and effects."""

import time
from collections.abc import Callable
from dataclasses import replace

from ..base.arrays import LinearRGBA
from ..base.progress import checkpoint, stage
from ..depth.source import NO_PICTURE
from .cg_layers import DrawCG
from .clip_context import ClipContext
from .detail import resized
from .effects import DEEP, EFFECTS
from .forecast import drawn_size, open_frame
from .frame import Frame
from .meshers import MESHERS
from .meshers.layers import can_be_layered
from .plan import FrameOptions

TOO_LARGE = "its blur discs are too large for layers"
READ, WARPED = 0.01, 0.7
"""Shares of a frame's time that have passed once it is read and once its layers are made; the rest draws its
views. From `python -m benchmarks.timings.frame_costs`, with 24 views on 2 cores and unknown depth."""
DrawViews = Callable[[Frame], LinearRGBA]
"""Draws the views of a frame and returns their weighted mean (h, w, 4) in their canvas."""


def draw_frame(
    clip: ClipContext,
    number: int,
    options: FrameOptions,
    size: tuple[int, int],
    draw_views: DrawViews,
    draw_cg: DrawCG | None = None,
) -> tuple[LinearRGBA, Frame]:
    """Draw one frame through the lens.

    Passes checkpoints. Raises UserError if the settings do not fit the frame, or the clip cannot be read.

    Args:
        clip: The clip.
        number: Number of the frame.
        options: The lens.
        size: Final (width, height).
        draw_views: Draws the views.
        draw_cg: Draws the CG objects.

    Returns:
        The picture (h, w, 4), float32, linear and premultiplied, and how it was made.
    """
    with stage("Reading", 0.0, READ):
        source = resized(clip.picture(number, options.highlights), size)
        small = resized(source, drawn_size(options, size, draw_cg is not None))
    with stage("Mesh", READ, WARPED):
        there = small.shape[1], small.shape[0]
        frame = mesh_frame(clip, number, options, there, small, draw_cg, source).through(reuse=True)
    began = time.perf_counter()

    def average(prepared: Frame) -> LinearRGBA:
        return mean_of_views(prepared, draw_views)

    with stage("Views", WARPED, 1.0):
        mean = average(frame)
    checkpoint(1.0)
    picture = frame.views.canvas.to_source(mean)
    for effect in EFFECTS:
        picture = effect.after(picture, frame, average)
    return picture, replace(frame, draw_seconds=time.perf_counter() - began)


def mean_of_views(frame: Frame, draw_views: DrawViews) -> LinearRGBA:
    """Return the mean of a frame's views (h, w, 4) in their canvas, with its effects."""
    mean = draw_views(frame)
    for effect in EFFECTS:
        mean = effect.on_mean(mean, frame)
    return mean


def mesh_frame(
    clip: ClipContext,
    number: int,
    options: FrameOptions,
    size: tuple[int, int],
    small: LinearRGBA,
    draw_cg: DrawCG | None = None,
    source: LinearRGBA = NO_PICTURE,
) -> Frame:
    """Make the layers of a frame of size (width, height) from its picture (height, width, 4).

    `source` (H, W, 4) is the same picture at the final size, if that is another one. Passes checkpoints.
    Raises UserError if the settings do not fit the frame, or the clip cannot be read.
    """
    began = time.perf_counter()
    opened = open_frame(clip, number, options, size, small)
    frame = prepared(replace(opened, draw_cg=draw_cg, source=source if source.size else small))
    with stage("Mesh", DEEP if frame.is_layered else 0.0, 1.0):
        layers = frame.mesher.make(frame)
    return replace(frame, layers=layers, mesh_seconds=time.perf_counter() - began - frame.depth_seconds)


def prepared(frame: Frame) -> Frame:
    """Add the depth of an opened frame, and the effects before its layers; errors as of `mesh_frame`."""
    frame = _with_depth(frame)
    for effect in EFFECTS:
        frame = effect.before(frame)
    return frame


def _with_depth(frame: Frame) -> Frame:
    """Add depth, if layers need it and can be made."""
    if not frame.is_layered:
        return frame
    if not can_be_layered(frame.lens, frame.blur):
        return replace(frame, mesher=MESHERS["features"], why=TOO_LARGE)
    began = time.perf_counter()
    with stage("Depth", 0.0, DEEP):
        depth = frame.clip.depth(frame.number, frame.canvas, frame.picture, frame.options.quality)
    return replace(frame, depth=depth, depth_seconds=time.perf_counter() - began)
