"""What virtual cameras see, by the thesis's method and ours: its sections 4.6 and 4.7, and its blocks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from addon.core.base.arrays import Floats
from addon.core.depth.sparse import frame_features
from addon.core.focus.focus import Focus, radius_for_blur
from addon.core.frame.frame import Frame
from addon.core.frame.frame_path import mesh_frame
from addon.core.frame.meshers.thesis import fitted_registration
from addon.core.frame.plan import FrameOptions
from addon.core.optics.aperture_sampling import exact_registration
from addon.render.views.average import draw_mean, render_frame

from ..accuracy.metrics import psnr
from . import marks as draw
from .clips import Clip
from .marks import Figure

Linear = NDArray[np.float32]

METHODS = {"thesis": "the thesis's\nmethod", "layers": "ours"}
THESIS_VIEWS = 32
"""The thesis took 20 to 40."""
BLURS = (0.0125, 0.025, 0.05)
"""Shares of the picture's width into which the farthest background is spread, the near subject in focus."""
SHOWN = 320
"""Width of a picture in a sheet."""


# The mesh


def triangulations(clip: Clip, answers: str) -> Figure:
    """The frame's triangles, by the thesis's method and ours."""
    frame = clip.middle
    focus = clip.pick(clip.stage.focus[frame - 1], frame)
    radius = radius_for_blur(clip.reconstruction, focus, frame, BLURS[1])
    meshes = [_warped(clip, frame, FrameOptions(focus, radius, 1, method)).mesh for method in METHODS]
    backdrop = draw.muted(clip.frame(frame))
    drawn = [draw.mesh(backdrop, mesh.xy, mesh.triangles, draw.YELLOW) for mesh in meshes]
    sizes = [f"{len(mesh.xy)} vertices, {len(mesh.triangles)} triangles" for mesh in meshes]
    page = draw.sheet(
        [drawn],
        [f"thesis: {sizes[0]}", f"ours: {sizes[1]}"],
        [""],
        f"{clip.name}, frame {frame}: triangulation",
    )
    return Figure(
        f"triangulation_{clip.name}.png", page,
        "The triangles that the middle frame is cut into. The thesis maps the image's corners to themselves;"
        " our mesh is as fine as the depth asks for, double at silhouettes, and goes on past the border.",
        answers, f"The thesis's mesh has {sizes[0]}, ours {sizes[1]}.",
    )  # fmt: skip


# Novel views


def novel_views(clip: Clip, beside: Sequence[float], answers: str) -> Figure:
    """The middle frame from cameras to the left and right by `beside` metres, with the truth below."""
    frame = clip.middle
    focus = clip.pick(clip.stage.focus[frame - 1], frame)
    depth = float(clip.stage.focus_depth[frame - 1])
    far = sorted((-x for x in beside), reverse=False) + sorted(beside)
    truths = [clip.from_beside(frame, (x, 0.0), depth) for x in far]
    rows, said = [], []
    for method in METHODS:
        views = [_view(clip, frame, method, focus, np.array([x, 0.0])) for x in far]
        scores = [psnr(view[..., :3], true) for view, true in zip(views, truths, strict=True)]
        said.append(f"{method.replace('layers', 'ours')} " + ", ".join(f"{score:.1f}" for score in scores))
        rows.append([_shown(view) for view in views])
    rows.append([_shown(true) for true in truths])
    names = [f"{100 * abs(x):.0f} cm to the {'left' if x < 0 else 'right'}" for x in far]
    page = draw.sheet(
        rows, names, [*METHODS.values(), "true"], f"{clip.name}, frame {frame}: views from virtual cameras"
    )
    still = psnr(clip.picture(frame)[..., :3], truths[-1])
    return Figure(
        f"novel_views_{clip.name}.png", page,
        "The middle frame as virtual cameras to the left and right see it, in register at the subject; the"
        " last row is Cycles' picture from there.",
        answers,
        f"PSNR against the true view, dB, from left to right: {'; '.join(said)}; the frame itself, not"
        f" warped, has {still:.1f} against the last.",
    )  # fmt: skip


def _view(clip: Clip, frame: int, method: str, focus: Focus, offset: Floats) -> Linear:
    """(H, W, 4) from a camera `offset` metres to the right and down."""
    moved = clip.unit * offset[None]
    radius = float(np.linalg.norm(moved))
    warped = _warped(clip, frame, FrameOptions(focus, radius, 1, method))
    views = warped.views
    if method == "thesis":
        features = frame_features(clip.reconstruction, frame, views.canvas)
        registration = fitted_registration(clip.reconstruction, features, views.canvas, moved, focus)
    else:
        registration = exact_registration(views.canvas, moved, views.lens.focus)
    warped = replace(warped, views=replace(views, offsets=moved, registration=registration))
    mean = draw_mean(warped)
    return views.canvas.to_source(mean)


def _warped(clip: Clip, frame: int, lens: FrameOptions) -> Frame:
    return mesh_frame(clip.shot.context, frame, lens, clip.size, clip.picture(frame)).through()


def _shown(picture: Linear) -> draw.Picture:
    recorded = draw.recorded(picture)
    return draw.enlarged(recorded, SHOWN / recorded.shape[1])


# Apertures


def apertures(clip: Clip, near: Floats, far: Floats, names: tuple[str, str], answers: str) -> Figure:
    """Growing apertures down, focus on a near and a far point of the world across, by both methods."""
    frame = clip.middle
    focus = [clip.pick(point, frame) for point in (near, far)]
    radii = [radius_for_blur(clip.reconstruction, focus[0], frame, share) for share in BLURS]
    rows, said = [], []
    for radius in radii:
        pictures, scores = [], []
        for point, picked in zip((near, far), focus, strict=True):
            true = _true_lens(clip, frame, radius, point)
            both = [_through(clip, frame, method, picked, radius) for method in METHODS]
            pictures += [draw.recorded(picture) for picture in both]
            scores.append(" / ".join(f"{psnr(picture, true):.1f}" for picture in both))
        rows.append(pictures)
        said.append(f"radius {1000 * radius / clip.unit:.0f} mm {scores[0]} and {scores[1]}")
    page = draw.sheet(
        rows,
        [f"{who}, focus on the {name}" for name in names for who in ("thesis", "ours")],
        [f"radius\n{1000 * radius / clip.unit:.0f} mm" for radius in radii],
        f"{clip.name}, frame {frame}: images over apertures",
    )
    return Figure(
        f"apertures_{clip.name}.png", page,
        f"Depth of field made from the middle frame: a larger aperture in each row, focus on the {names[0]}"
        f" at the left and on the {names[1]} at the right; the thesis's method with {THESIS_VIEWS} random"
        " views, ours with as many as it takes itself.",
        answers,
        "PSNR against Cycles' true lens, dB, thesis / ours, near and far focus: " + "; ".join(said) + ".",
    )  # fmt: skip


def racked(clip: Clip, points: Floats, names: Sequence[str], share: float, answers: str) -> Figure:
    """Focus on one point of the world (n, 3) after another, by both methods and through a true lens."""
    frame = clip.middle
    focus = [clip.pick(point, frame) for point in points]
    radius = radius_for_blur(clip.reconstruction, focus[0], frame, share)
    rows, said = [], []
    for point, picked, name in zip(points, focus, names, strict=True):
        true = _true_lens(clip, frame, radius, point)
        both = [_through(clip, frame, method, picked, radius) for method in METHODS]
        rows.append([draw.recorded(picture) for picture in (*both, true)])
        said.append(f"{name} " + " / ".join(f"{psnr(picture, true):.1f}" for picture in both))
    page = draw.sheet(
        rows, ["the thesis's method", "ours", "true lens"], [name.replace(" ", "\n") for name in names],
        f"{clip.name}, frame {frame}: focus on one after another, radius {1000 * radius / clip.unit:.0f} mm",
    )  # fmt: skip
    return Figure(
        f"focus_{clip.name}.png", page,
        "Focus on each of the three blocks in turn, through one aperture; at the right Cycles' true lens.",
        answers, f"PSNR against the true lens, dB, thesis / ours: {'; '.join(said)}.",
    )  # fmt: skip


def _through(clip: Clip, frame: int, method: str, focus: Focus, radius: float) -> Linear:
    """(h, SHOWN, 3) of the frame through an aperture of `radius` units of the solve."""
    lens = FrameOptions(focus, radius, THESIS_VIEWS if method == "thesis" else 0, method)
    size = (SHOWN, round(SHOWN * clip.size[1] / clip.size[0]))
    picture = render_frame(clip.shot.context, frame, lens, size, lambda note: None)
    return picture[..., :3]


def _true_lens(clip: Clip, frame: int, radius: float, point: Floats) -> Linear:
    """Through the same aperture in metres, focused on the surface seen at a point of the world."""
    x, y = clip.seen(point, frame)
    depth = clip.depth(frame)[int(y * clip.size[1]), int(x * clip.size[0])]
    return clip.through_lens(frame, radius / clip.unit, float(depth), SHOWN)
