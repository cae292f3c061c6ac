"""One frame made ready for its views: the mesh that its geometry allows, and the picture painted on it."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Protocol

import cv2
import numpy as np

from ..base.arrays import Map
from ..base.progress import stage
from ..camera.canvas import Picture
from ..camera.reconstruction import Floats, Reconstruction
from ..depth.joint_upsampling import upsampled
from ..depth.multi_view_stereo import DenseDepth
from ..depth.sparse import MappedDepth, frame_features
from ..warp.disocclusion_fill import DisocclusionFill
from ..warp.layered_depth_image import LayeredDepthImage
from .plan import FramePlan, LensSettings, can_be_layered, edged_plan, layered_plan, plan_frame

SURE, FEWEST_SURE = 0.1, 0.05
"""Confidence from which on a pixel's depth is known, and the share of the picture that must have it."""


PLANNED, DEEP, LENT = 0.02, 0.6, 0.7
"""Shares of a frame's time without its views that are over after planning, depth and what is hidden: from
`python -m benchmarks.timings.mesh_times`, 1920x1080."""


class Dense(Protocol):
    """Depth of every pixel, from the clip itself."""

    def at(self, frame: int) -> DenseDepth: ...


class Clip(Protocol):
    """What other frames know about one."""

    @property
    def reconstruction(self) -> Reconstruction: ...

    @property
    def depth(self) -> MappedDepth | None:
        """The user's depth maps."""

    @property
    def dense(self) -> Dense: ...

    @property
    def disocclusion(self) -> DisocclusionFill: ...


@dataclass(frozen=True)
class WarpedFrame:
    """Everything that a renderer needs."""

    plan: FramePlan
    texture: Picture
    """(h, w, 4) what is painted on the plan's mesh, linear and premultiplied."""
    method: str
    """That made the mesh."""
    why: str
    """Why it is not the one that was asked for, or nothing."""
    is_whole: bool
    """No view may see through the mesh."""
    inverse_depth: Floats | None = None
    """(H, W) of every pixel of the canvas, where the method has it,"""
    confidence: Map | None = None
    """(H, W) and how sure it is; None of the user's maps."""
    layers: tuple[LayeredDepthImage, ...] = ()
    """That the mesh was made of, near ones first."""
    depth_seconds: float = 0.0
    """What finding the depth took,"""
    mesh_seconds: float = 0.0
    """and the mesh and its texture."""


def warp_frame(
    clip: Clip, frame: int, lens: LensSettings, size: tuple[int, int], source: Picture
) -> WarpedFrame:
    """The frame's mesh for a rendered frame of size (width, height), of its picture (height, width, 4).

    Raises UserError as `plan_frame` does.
    """
    began = time.perf_counter()
    with stage("Plan", 0.0, PLANNED):
        plan = plan_frame(clip.reconstruction, frame, lens, size, clip.depth)
    picture = plan.canvas.from_source(source)
    plain = WarpedFrame(plan, picture, lens.method, "", False)
    if lens.method == "layers" and not can_be_layered(plan):
        plain = replace(plain, method="features", why="its blur discs are too large for layers")
    if plain.method == "edges":
        plain = replace(plain, plan=edged_plan(plan, clip.reconstruction, lens.radius, picture, clip.depth))
    if plain.method != "layers":
        return replace(plain, mesh_seconds=time.perf_counter() - began)
    planned = time.perf_counter()
    with stage("Depth", PLANNED, DEEP):
        inverse, confidence = _depth(clip, plan, picture)
    found = time.perf_counter()
    plain = replace(plain, inverse_depth=inverse, confidence=confidence, depth_seconds=found - planned)
    if confidence is not None and float(np.mean(confidence > SURE)) < FEWEST_SURE:
        grid = plan_frame(clip.reconstruction, frame, replace(lens, method="grid"), size, clip.depth)
        made = replace(
            plain, plan=grid, method="grid",
            why=f"the depth of less than {100 * FEWEST_SURE:g} % of its pixels can be told from the clip",
        )  # fmt: skip
    else:
        hidden_colours = None
        if lens.borrow:
            with stage("Hidden surfaces", DEEP, LENT):
                hidden_colours = clip.disocclusion.reprojected(frame, plan.canvas, picture, inverse).colours
        with stage("Mesh", LENT, 1.0):
            layered, texture, layers = layered_plan(plan, lens.radius, picture, inverse, hidden_colours)
        is_whole = bool(picture[..., 3].min() > 0.999)
        made = replace(plain, plan=layered, texture=texture, is_whole=is_whole, layers=layers)
    return replace(made, mesh_seconds=time.perf_counter() - found + planned - began)


def _depth(clip: Clip, plan: FramePlan, picture: Picture) -> tuple[Floats, Map | None]:
    """(h, w) inverse depth of every pixel of the canvas, and confidence if it is the clip's own."""
    if clip.depth is not None:
        features = frame_features(clip.reconstruction, plan.frame, plan.canvas)
        told = clip.depth.inverse_depth(features, plan.canvas)
        if told is not None:
            return told, None
    found = clip.dense.at(plan.frame)
    size = (picture.shape[1], picture.shape[0])
    return upsampled(found.inverse_depth, picture), cv2.resize(found.confidence, size)
