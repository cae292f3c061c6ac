"""From a frame's plan and picture to the averaged frame in the source's geometry."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from ..core.canvas import Picture
from ..core.footage import to_linear
from ..core.inspection import shares_of, source_frame
from ..core.views import LensSettings
from ..core.warp_frame import WarpedFrame, warp_frame
from ..scene.shot import Shot
from . import cycles_views, gpu_views
from .main_thread import CarryOn

LEAST_COVER = 0.05
"""Share of the views that must have covered a pixel for its colour to be made whole."""


@dataclass(frozen=True)
class Drawn:
    """A frame that was drawn, for who wants to know more of it than its picture."""

    warped: WarpedFrame
    lens: LensSettings
    source: Picture
    """(H, W, 4) the frame, linear."""
    seconds: float
    """What drawing took."""


Told = Callable[[Drawn, CarryOn], None]


def render_frame(
    shot: Shot,
    frame: int,
    lens: LensSettings,
    size: tuple[int, int],
    carry_on: CarryOn,
    note: Callable[[str], None],
    told: Told | None = None,
) -> Picture | None:
    """One frame through the lens: (h, w, 4) float32, linear, premultiplied; None when `carry_on` said no.

    `carry_on(done, total)` is asked before each view, `note` is told what the user should know, and `told`
    of the frame, if it was drawn.
    """
    source = _resized(to_linear(shot.read(frame)), size)
    warped = warp_frame(shot, frame, lens, size, source)
    if warped.plan.carried:
        note(f"Frame {frame} was not registered: its camera is carried over from its neighbours")
    if warped.why:
        note(f"Frame {frame} is drawn by the method {warped.method}: {warped.why}")
    began = time.perf_counter()
    mean = draw_mean(warped, carry_on, note)
    if mean is None:
        return None
    picture = warped.plan.canvas.to_source(mean)
    if told is not None:
        told(Drawn(warped, lens, source, time.perf_counter() - began), carry_on)
    return picture


def draw_shares(drawn: Drawn, carry_on: CarryOn) -> Picture | None:
    """(H, W, 3) the shares of `inspection.SOURCES` in each of the result's pixels; None as `render_frame`."""
    mean = draw_mean(source_frame(drawn.warped, drawn.lens.radius), carry_on, lambda note: None)
    return None if mean is None else shares_of(mean, drawn.warped.plan.canvas)


def draw_mean(warped: WarpedFrame, carry_on: CarryOn, note: Callable[[str], None]) -> Picture | None:
    """The mean of a frame's views (h, w, 4) in its canvas, as `render_frame` asks and tells."""
    problem = gpu_views.gpu_problem()
    if problem:
        note(no_gpu_note(problem))
    draw = cycles_views.mean_of_views if problem else gpu_views.mean_of_views
    mean = draw(warped.plan, warped.texture, carry_on)
    if mean is not None and warped.is_whole:
        # A gap that some view had between triangles takes the colour of the other views.
        mean /= np.maximum(mean[..., 3:], np.float32(LEAST_COVER))
    return mean


def no_gpu_note(problem: str) -> str:
    """What the user is told where Cycles stands in."""
    return f"no GPU context ({problem}): views are drawn by Cycles, which is slower"


def _resized(picture: Picture, size: tuple[int, int]) -> Picture:
    if (picture.shape[1], picture.shape[0]) == size:
        return picture
    shrinks = size[0] < picture.shape[1]
    resampled = cv2.resize(picture, size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC)
    return np.maximum(np.asarray(resampled, dtype=np.float32), 0)
