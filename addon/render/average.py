"""From a frame's plan and picture to the averaged frame in the source's geometry."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..core.base.arrays import Floats, LinearRGB, LinearRGBA, in_channels
from ..core.base.progress import checkpoint, stage
from ..core.frame.cg_layers import DrawCG, joined
from ..core.frame.clip_context import ClipContext
from ..core.frame.detail import enlarged, sharp_frame
from ..core.frame.grain import grained, lost_frame
from ..core.frame.inspection import opaque_triangles, shares_of, source_frame
from ..core.frame.plan import FrameOptions
from ..core.frame.view_error import PILOT, difference, other_views, views_for_error
from ..core.frame.vignetting import LEAST_LEFT, light_left
from ..core.frame.warped_frame import MeshedFrame, WarpedFrame, drawn_size, mesh_frame
from ..core.media.noise import Noise
from . import gpu_views

TOLD = 0.3
"""Share of the time of drawing that is over once it is known how many views there are to be. By eye."""
MOST_SOFTER = 0.05
"""Share of a frame that the clip's own lens blurs more than the wished one, from which a note is given.
Chosen by inspection."""
LEAST_COVER = 0.05
"""Share of the views that must have covered a pixel for its colour to be made whole."""


@dataclass(frozen=True)
class Drawn:
    """A drawn frame with more data than its picture."""

    warped: WarpedFrame
    source: LinearRGBA
    """(H, W, 4) the frame, linear, at the size that it was drawn at."""
    seconds: float
    """Seconds of drawing."""


OnFrame = Callable[[Drawn], None]
"""Called with each frame that is drawn."""

READ, WARPED = 0.01, 0.7
"""Shares of a frame's time that are over once it is read and once its mesh is made; the rest draws its views.
From `python -m benchmarks.timings.frame_costs`, with 24 views on 2 cores, where depth is to be found."""


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
    with stage("Reading", 0.0, READ):
        picture = resized(clip.picture(frame, options.highlights), size)
        small = drawn_size(options, size)
        source = resized(picture, small)
        noise = clip.noise(frame, size) if options.grain else None
    with stage("Mesh", READ, WARPED):
        meshed = mesh_frame(clip, frame, options, small, source, draw_cg)
        warped = None if options.target_psnr else meshed.through(meshed.views, reuse=True)
    if meshed.geometry.samples.pose_interpolated:
        note(f"Frame {frame} was not solved: its camera is interpolated from its neighbours")
    if meshed.steadied and meshed.steadied.strength < options.stabilize:
        note(
            f"Stabilize is {meshed.steadied.strength:.2f} instead of {options.stabilize:.2f}: from a steadier"
            " path the camera would see what the clip does not show"
        )
    if meshed.softer > MOST_SOFTER:
        note(f"Frame {frame}: {meshed.softer:.0%} of it is softer in the clip than your lens makes it")
    if meshed.why:
        note(f"Frame {frame} uses the method {meshed.mesher.name}: {meshed.why}")
    began = time.perf_counter()
    with stage("Views", WARPED, 1.0):
        if warped is None:
            warped, mean = draw_to_error(meshed, options.target_psnr)
        else:
            mean = draw_mean(warped)
    checkpoint(1.0)
    result = warped.plan.canvas.to_source(mean)
    if small != size:
        result = enlarged(result, source, picture, _sharp_share(warped))
    if noise is not None:
        result = grained(result, _lost(warped, noise, size), noise, frame, options.grain, picture)
    if on_frame is not None:
        on_frame(Drawn(warped, source, time.perf_counter() - began))
    return result


def _sharp_share(warped: WarpedFrame) -> LinearRGB | None:
    """(h, w, 3) share of its sharpness that each pixel of a frame drawn smaller keeps, if that is known."""
    sharp = sharp_frame(warped)
    if sharp is None:
        return None
    return np.asarray(warped.plan.canvas.to_source(draw_mean(sharp))[..., :3])


def _lost(warped: WarpedFrame, noise: Noise, size: tuple[int, int]) -> LinearRGB:
    """(h, w, 3) the shares of `lost_frame` in a frame's pixels at its size (width, height)."""
    with stage("Grain", 1.0, 1.0):
        painted = lost_frame(warped, noise, size[0] / warped.plan.canvas.camera.width)
        canvas = painted.plan.canvas
        return resized(canvas.to_source(draw_mean(painted)), size)[..., :3]


def draw_to_error(meshed: MeshedFrame, wished: float) -> tuple[WarpedFrame, LinearRGBA]:
    """Draw a frame with as many views as an error in dB needs; see `view_error` for its estimate.

    Returns:
        The frame, and the mean (h, w, 4) of its views in its canvas.
    """
    first = meshed.through(PILOT)
    second = other_views(meshed, first)
    with stage("Views", 0.0, TOLD):
        one, other = draw_mean(first), draw_mean(second)
    count = views_for_error(difference(one, other), wished, meshed.mesher.is_prefiltered)
    if not count:
        both = replace(
            first.plan,
            offsets=np.concatenate([first.plan.offsets, second.plan.offsets]),
            registration=np.concatenate([first.plan.registration, second.plan.registration]),
            weights=_joined(first.plan.weights, second.plan.weights),
        )
        return replace(first, plan=both), (one + other) / np.float32(2)
    warped = meshed.through(count, reuse=True)
    with stage("Views", TOLD, 1.0):
        return warped, draw_mean(warped)


def _joined(one: Floats | None, other: Floats | None) -> Floats | None:
    """(N + M,) weights of two sets of views that count alike."""
    return None if one is None or other is None else np.concatenate([one, other]) / 2


def draw_shares(drawn: Drawn) -> LinearRGBA:
    """Return (H, W, 3) the shares of `inspection.SOURCES` in each of the result's pixels."""
    with stage("Sources", 1.0, 1.0):
        mean = draw_mean(source_frame(drawn.warped))
    return shares_of(mean, drawn.warped.plan.canvas)


def draw_mean(warped: WarpedFrame) -> LinearRGBA:
    """Return the mean of a frame's views (h, w, 4) in its canvas, with its highlights' discs.

    UserError where no GPU context can be had.
    """
    gpu_views.check_gpu()
    plan, texture = warped.plan, warped.texture
    if warped.cg:
        mesh, texture = joined(plan.mesh, texture, opaque_triangles(warped), warped.cg)
        plan = replace(plan, mesh=mesh)
    mean = gpu_views.mean_of_views(plan, texture)
    if warped.plan.vignetting:
        mean /= in_channels(np.maximum(light_left(warped.plan), np.float32(LEAST_LEFT)), 4)
    if warped.is_whole:
        # A gap that some view had between triangles takes the colour of the other views.
        mean /= in_channels(np.maximum(mean[..., 3], np.float32(LEAST_COVER)), 4)
    if warped.highlight_discs is not None:
        cg = [each.layer for each in warped.cg]
        mean[..., :3] += warped.highlight_discs.light(warped.plan, warped.layers, cg)
    return mean


def resized(picture: LinearRGBA, size: tuple[int, int]) -> LinearRGBA:
    """Return a picture (H, W, 4) in linear light at another size (width, height), without negative light."""
    if (picture.shape[1], picture.shape[0]) == size:
        return picture
    shrinks = size[0] < picture.shape[1]
    resampled = cv2.resize(picture, size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC)
    return np.maximum(np.asarray(resampled, dtype=np.float32), 0)
