"""Drawing over 3D viewports, in pixels of their main region, (0, 0) bottom left."""

from collections.abc import Callable
from typing import Any

import bpy
import gpu
from gpu_extras.batch import batch_for_shader

Rectangle = tuple[float, float, float, float]
GROUND = (0.0, 0.0, 0.0, 0.75)
TOP_DOWN = (0.0, 1.0, 1.0, 0.0)
"""The whole of a texture whose first row is the top one."""
_handlers: dict[Callable[[], None], Any] = {}


def show(draw: Callable[[], None], when: str = "POST_PIXEL") -> None:
    """Have `draw` called from now on; there is nothing to draw in without a window."""
    if not bpy.app.background:
        _handlers[draw] = bpy.types.SpaceView3D.draw_handler_add(draw, (), "WINDOW", when)


def hide(draw: Callable[[], None]) -> None:
    """Undo `show`, if it was called."""
    if draw in _handlers:
        bpy.types.SpaceView3D.draw_handler_remove(_handlers.pop(draw), "WINDOW")


def hide_all() -> None:
    """Undo all calls of `show`."""
    for draw in list(_handlers):
        hide(draw)


def fill(
    rectangle: Rectangle, colour: tuple[float, float, float, float] = GROUND, blend: str = "ALPHA"
) -> None:
    """Fill left, bottom, right, top with a colour, by its alpha or as `blend` has it."""
    shader: Any = gpu.shader.from_builtin("UNIFORM_COLOR")
    gpu.state.blend_set(blend)
    shader.bind()
    shader.uniform_float("color", colour)
    batch_for_shader(shader, "TRI_FAN", {"pos": _corners(rectangle)}).draw(shader)
    gpu.state.blend_set("NONE")


def draw_texture(
    texture: Any, rectangle: Rectangle, blend: str = "NONE", part: Rectangle = (0.0, 0.0, 1.0, 1.0)
) -> None:
    """Draw a part of a texture, whose first row is at 0, into left, bottom, right, top."""
    shader: Any = gpu.shader.from_builtin("IMAGE")
    gpu.state.blend_set(blend)
    shader.bind()
    shader.uniform_sampler("image", texture)
    content = {"pos": _corners(rectangle), "texCoord": _corners(part)}
    batch_for_shader(shader, "TRI_FAN", content).draw(shader)
    gpu.state.blend_set("NONE")


def _corners(rectangle: Rectangle) -> list[tuple[float, float]]:
    left, bottom, right, top = rectangle
    return [(left, bottom), (right, bottom), (right, top), (left, top)]
