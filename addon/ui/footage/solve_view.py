"""The clip in the 3D viewport while it is solved, with the features that are found in it."""

from typing import Any

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ...core.sfm.steps import Sight
from ...render.viewport.overlay import Rectangle, draw_message, draw_texture, fill, free_part
from ...render.views.gpu_views import upload
from ..base.solving import running_solve
from ..picking.pick_view import GREEN

SHARE = 0.9
"""Share of the free part of a viewport that the picture covers."""
SIZE = 3.0
"""Pixels across of a feature, at a resolution scale of 1."""
_shown: list[tuple[Sight, Any]] = []
"""The shown sight, and the texture of its picture; empty without one."""


def place(free: Rectangle, width: int, height: int) -> Rectangle:
    """Return left, bottom, right, top of a picture (width, height) in the middle of a free rectangle."""
    left, bottom, right, top = free
    scale = SHARE * min((right - left) / width, (top - bottom) / height)
    x, y = (left + right) / 2, (bottom + top) / 2
    across, up = scale * width / 2, scale * height / 2
    return x - across, y - up, x + across, y + up


def draw() -> None:
    """Draw the clip, while it is being solved."""
    running = running_solve()
    sight = None if running is None else running.sight
    if running is None or sight is None:
        _shown.clear()
        return
    if not _shown or _shown[0][0] is not sight:
        encoded = np.flipud(np.insert(sight.picture / np.float32(255), 3, 1.0, axis=2))
        _shown[:] = [(sight, upload(encoded.astype(np.float32)))]
    context = bpy.context
    scale = context.preferences.system.ui_scale
    # The scene holds another clip, or an old solve.
    fill((0.0, 0.0, float(context.region.width), float(context.region.height)))
    height, width = sight.picture.shape[:2]
    where = place(free_part(context.area, context.region), width, height)
    draw_texture(_shown[0][1], where)
    _draw_features(sight, where, SIZE * scale)
    # The panel shows the progress: drawing all this for it would take time from the solve.
    draw_message(f"{running.step.stage} (ESC cancels)", context.area, context.region, scale)


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
