"""What the stability cases run, and what they measure of it."""

from __future__ import annotations

import numpy as np

from addon.core.base.arrays import Floats, LinearRGBA
from addon.core.camera.reconstruction import Reconstruction
from addon.core.focus.focus import Focus, radius_for_blur
from addon.core.frame.clip_context import ClipContext, no_picture
from addon.core.frame.frame_path import mesh_frame
from addon.core.frame.plan import FrameOptions
from addon.render.views import gpu_views

from ..displaced import displaced
from .__main__ import Measure
from .reference import (
    FAR,
    LENS,
    NEAR,
    Ints,
    Plan,
    displacement_error,
    map_picture,
    places,
    plane_picture,
    plane_places,
    psnr,
    rendered,
)

SIZE = (LENS.width, LENS.height)
PICKS = Focus(points=(20, 50, 70, 90))
DEPTH, FOCUS = 8.0, 6.0
"""A frontal plane, and the focus before it."""
WIDE = 16000
BAD = 5
"""Features of 150 that are spoilt: more than the two percent that percentiles forgive."""


def draw(plan: Plan) -> LinearRGBA:
    """The GPU's mean of views of the map picture."""
    problem = gpu_views.gpu_problem()
    if problem:
        raise RuntimeError(f"no GPU context: {problem}")
    pinhole = plan.views.canvas.pinhole
    mean = gpu_views.mean_of_views(*plan.painted(map_picture(pinhole.width, pinhole.height)))
    return mean


def pixels(value: float, limit: float = 0.01) -> Measure:
    return Measure(value, "px", limit)


def decibels(value: float, limit: float = 60.0) -> Measure:
    return Measure(value, "dB", limit, is_least=True)


def compared(picture: LinearRGBA, reference: Floats | LinearRGBA, rows: Ints | None = None) -> list[Measure]:
    """Displacement and PSNR of a picture without folds against its reference, or with some rows of it."""
    size = picture.shape[1], picture.shape[0]
    part = picture if rows is None else picture[rows]
    return [pixels(displacement_error(part, reference, size)), decibels(psnr(part, reference))]


def folded(plan: Plan) -> list[Measure]:
    """PSNR against the float64 renderer alone, where triangles hide each other.

    Single pixels at their edges belong to one or the other by the last bit.
    """
    pinhole = plan.views.canvas.pinhole
    return [decibels(psnr(draw(plan), rendered(plan, map_picture(pinhole.width, pinhole.height))), 50)]


def planned(
    rec: Reconstruction,
    focus: Focus = PICKS,
    blur: float = 0.05,
    radius: float | None = None,
    views: int = 16,
    method: str = "features",
    frame: int = 1,
) -> Plan:
    """As a user would: the aperture from the blur in the frame, unless its radius is given."""
    if radius is None:
        radius = radius_for_blur(rec, focus, frame, blur)
    camera = rec.cameras[0]
    settings, blank = FrameOptions(focus, radius, views, method), np.zeros((camera.height, camera.width, 4))
    clip = ClipContext(rec, no_picture)
    made = mesh_frame(
        clip, frame, settings, (camera.width, camera.height), blank.astype(np.float32)
    ).through()
    return Plan(made.views, made.mesh)


def frontal(plan: Plan, depth: float = DEPTH, focus: float = 1 / FOCUS) -> list[Measure]:
    """A plan of a frontal plane against the closed form."""
    return plane(plan, 1 / depth, (0.0, 0.0), focus)


def plane(plan: Plan, inverse: float, slope: tuple[float, float], focus: float) -> list[Measure]:
    """A plan of a plane against the closed form; of wide pictures only four rows are compared."""
    pinhole = plan.views.canvas.pinhole
    rows = np.unique(
        np.linspace(0, pinhole.height - 1, min(pinhole.height, 4 if pinhole.width >= WIDE else 192)).astype(
            int
        )
    )
    shown = plane_places(pinhole, inverse, slope, focus, plan.views.offsets, rows)
    return compared(draw(plan), plane_picture(shown, map_picture(pinhole.width, pinhole.height)), rows)


def as_gpu(plan: Plan) -> Floats:
    """(N, V, 2) the vertex shader's arithmetic in float32, from what it is given."""
    pinhole = plan.views.canvas.pinhole
    picture = np.zeros((pinhole.height, pinhole.width, 4), np.float32)
    vertices, views = gpu_views.vertex_arrays(*plan, picture), gpu_views.view_rows(*plan)
    x, y = vertices["xy"].T[:, None, :, None]
    a, b, c, d = np.moveaxis(views, 2, 0)[:, :, None, :]
    seen = a * x + b * y + c - d * vertices["contrast"][:, None]
    assert seen.dtype == np.float32
    return np.asarray(seen, dtype=np.float64)


def vertices(plan: Plan) -> list[Measure]:
    """The shader's float32 against the float64 displacement, for vertices in the picture or near it."""
    pinhole, exact = plan.views.canvas.pinhole, displaced(plan.views, plan.mesh.xy, plan.mesh.inverse_depth)
    near = np.all(np.abs(exact) < 5 * max(pinhole.width, pinhole.height), axis=2)
    return [pixels(float(np.abs(as_gpu(plan) - exact)[near].max()))]


def own_mesh(rec: Reconstruction, **change: object) -> list[Measure]:
    """A shot planned and drawn, against the float64 renderer on the plan's mesh."""
    return folded(planned(rec, **change))  # type: ignore[arg-type]


def spoilt(depth: float) -> Floats:
    """(150,) depths of the plane that recedes, but for the first few."""
    share = places(LENS)[:, 0] / LENS.width
    depths = 1 / ((1 - share) / NEAR + share / FAR)
    depths[:BAD] = depth
    return np.asarray(depths)
