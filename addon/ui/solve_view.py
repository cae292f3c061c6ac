"""The clip in the 3D viewport while it is solved, with the features that are found in it."""

from __future__ import annotations

from typing import Any

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ..core.sfm.watching import Sight
from ..render.gpu_views import upload
from ..render.message import Rectangle, draw, fill, free_part
from .operators import running_solve
from .pick_view import GREEN

SHARE = 0.9
"""Of the free part of a viewport, that the picture takes."""
SIZE = 3.0
"""Pixels across of a feature, at a resolution scale of 1."""

_handler: Any = None
_shown: tuple[Sight, Any] | None = None
"""What is shown, and the texture of its picture."""


def register() -> None:
    """Draw from now on; there is nothing to draw in without a window."""
    global _handler
    if not bpy.app.background:
        _handler = bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_PIXEL")


def unregister() -> None:
    """Undo `register`."""
    global _handler, _shown
    if _handler is not None:
        bpy.types.SpaceView3D.draw_handler_remove(_handler, "WINDOW")
    _handler = _shown = None


def place(free: Rectangle, width: int, height: int) -> Rectangle:
    """Left, bottom, right, top of a picture (width, height) in the middle of what is free, as large as it
    takes."""
    left, bottom, right, top = free
    scale = SHARE * min((right - left) / width, (top - bottom) / height)
    x, y = (left + right) / 2, (bottom + top) / 2
    across, up = scale * width / 2, scale * height / 2
    return x - across, y - up, x + across, y + up


def _draw() -> None:
    global _shown
    running = running_solve()
    sight = None if running is None else running.sight
    if running is None or sight is None:
        _shown = None
        return
    if _shown is None or _shown[0] is not sight:
        encoded = np.flipud(np.insert(sight.picture / np.float32(255), 3, 1.0, axis=2))
        _shown = sight, upload(encoded.astype(np.float32))
    context = bpy.context
    scale = context.preferences.system.ui_scale
    # What is in the scene is of another clip, or of no use now.
    fill((0.0, 0.0, float(context.region.width), float(context.region.height)))
    height, width = sight.picture.shape[:2]
    where = place(free_part(context.area, context.region), width, height)
    _draw_picture(_shown[1], where)
    _draw_features(sight, where, SIZE * scale)
    # How far it is says the panel: to draw all this for it again would cost the solve.
    draw(f"{running.step.stage} (ESC cancels)", context.area, context.region, scale)


def _draw_picture(texture: Any, where: Rectangle) -> None:
    """A texture that is encoded as the screen is."""
    left, bottom, right, top = where
    corners = [(left, bottom), (right, bottom), (right, top), (left, top)]
    shader: Any = gpu.shader.from_builtin("IMAGE")
    shader.bind()
    shader.uniform_sampler("image", texture)
    content = {"pos": corners, "texCoord": [(0, 0), (1, 0), (1, 1), (0, 1)]}
    batch_for_shader(shader, "TRI_FAN", content).draw(shader)


def _draw_features(sight: Sight, where: Rectangle, size: float) -> None:
    left, bottom, right, top = where
    if not len(sight.places):
        return
    pixels = np.array([left, top]) + sight.places * np.array([right - left, bottom - top])
    shader: Any = gpu.shader.from_builtin("POINT_UNIFORM_COLOR")
    shader.bind()
    shader.uniform_float("color", GREEN)
    gpu.state.point_size_set(size)
    places = np.pad(pixels, ((0, 0), (0, 1))).astype(np.float32)
    batch_for_shader(shader, "POINTS", {"pos": places}).draw(shader)
    gpu.state.point_size_set(1.0)
