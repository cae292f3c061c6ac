"""From a frame's plan and picture to the averaged frame in the source's geometry."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from ..core.canvas import Picture
from ..core.depth import frame_features
from ..core.enlarge import enlarged
from ..core.footage import to_linear
from ..core.reconstruction import Floats
from ..core.views import FramePlan, LensSettings, can_be_layered, layered_plan, plan_frame
from ..scene.shot import Shot
from . import cycles_views, gpu_views
from .main_thread import CarryOn

LEAST_COVER = 0.05
"""Share of the views that must have covered a pixel for its colour to be made whole."""


def render_frame(
    shot: Shot,
    frame: int,
    lens: LensSettings,
    size: tuple[int, int],
    carry_on: CarryOn,
    note: Callable[[str], None],
) -> Picture | None:
    """One frame through the lens: (h, w, 4) float32, linear, premultiplied; None when `carry_on` said no.

    `carry_on(done, total)` is asked before each view, `note` is told what the user should know.
    """
    plan = plan_frame(shot.reconstruction, frame, lens, size, shot.depth)
    if plan.carried:
        note(f"Frame {frame} was not registered: its camera is carried over from its neighbours")
    picture = plan.canvas.from_source(_resized(to_linear(shot.footage.read(frame)), size))
    is_layered = lens.method == "layers" and can_be_layered(plan)
    is_whole = is_layered and bool(picture[..., 3].min() > 0.999)
    if is_layered:
        depth = _depth(shot, plan, picture)
        plan, picture = layered_plan(plan, lens.radius, picture, depth, shot.lender if lens.borrow else None)
    problem = gpu_views.gpu_problem()
    if problem:
        note(no_gpu_note(problem))
        mean = cycles_views.mean_of_views(plan, picture, carry_on)
    else:
        mean = gpu_views.mean_of_views(plan, picture, carry_on)
    if mean is not None and is_whole:
        # A gap that some view had between triangles takes the colour of the other views.
        mean /= np.maximum(mean[..., 3:], np.float32(LEAST_COVER))
    return None if mean is None else plan.canvas.to_source(mean)


def _depth(shot: Shot, plan: FramePlan, picture: Picture) -> Floats:
    """(h, w) inverse depth of every pixel of the canvas: of the user's maps, or from the clip itself."""
    if shot.depth is not None:
        told = shot.depth.inverse_depth(
            frame_features(shot.reconstruction, plan.frame, plan.canvas), plan.canvas
        )
        if told is not None:
            return told
    return enlarged(shot.dense.at(plan.frame).inverse_depth, picture)


def no_gpu_note(problem: str) -> str:
    """What the user is told where Cycles stands in."""
    return f"no GPU context ({problem}): views are drawn by Cycles, which is slower"


def _resized(picture: Picture, size: tuple[int, int]) -> Picture:
    if (picture.shape[1], picture.shape[0]) == size:
        return picture
    shrinks = size[0] < picture.shape[1]
    resampled = cv2.resize(picture, size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC)
    return np.maximum(np.asarray(resampled, dtype=np.float32), 0)
