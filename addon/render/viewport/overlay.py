"""Drawing over 3D viewports, in pixels of their main region, (0, 0) bottom left."""

from collections.abc import Callable, Iterator
from typing import Any

import blf
import bpy
import gpu
from gpu_extras.batch import batch_for_shader

Rectangle = tuple[float, float, float, float]
GROUND = (0.0, 0.0, 0.0, 0.75)
TOP_DOWN = (0.0, 1.0, 1.0, 0.0)
"""The whole of a texture whose first row is the top one."""
_handlers: dict[Callable[[], None], Any] = {}
FONT = 0
POINTS, SMALL = 11, 9
"""Sizes of the interface's text, and of a label's."""
WIDEST = 0.7
"""Largest share of the width between headers and sidebars that a message has."""
PADDING, SPACING = 8.0, 16.0
"""Pixels from the text to the ground's border, and from line to line, at a resolution scale of 1."""
LIGHT = (1.0, 1.0, 1.0, 1.0)


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


def lines(text: str, width: float, scale: float = 1.0) -> list[str]:
    """Return the text in lines of at most `width` pixels; wider words, such as paths, are broken."""
    blf.size(FONT, POINTS * scale)
    found: list[str] = []
    for word in text.split():
        longer = f"{found[-1]} {word}" if found else word
        if found and blf.dimensions(FONT, longer)[0] <= width:
            found[-1] = longer
        else:
            found.extend(_pieces(word, width))
    return found


def _pieces(word: str, width: float) -> Iterator[str]:
    while len(word) > 1 and blf.dimensions(FONT, word)[0] > width:
        sizes = range(len(word) - 1, 1, -1)
        size = next((size for size in sizes if blf.dimensions(FONT, word[:size])[0] <= width), 1)
        yield word[:size]
        word = word[size:]
    yield word


def free_part(area: bpy.types.Area, region: bpy.types.Region) -> Rectangle:
    """Return left, bottom, right, top of an area's main region without headers and sidebars, in pixels."""
    left, bottom, right, top = 0.0, 0.0, float(region.width), float(region.height)
    for other in area.regions:
        if other.type == "WINDOW" or min(other.width, other.height) <= 1:
            continue
        x, y = other.x - region.x, other.y - region.y
        if other.alignment == "LEFT":
            left = max(left, x + other.width)
        elif other.alignment == "RIGHT":
            right = min(right, x)
        elif other.alignment == "TOP":
            top = min(top, y)
        elif other.alignment == "BOTTOM":
            bottom = max(bottom, y + other.height)
    return left, bottom, right, top


def ground(text: str, free: Rectangle, scale: float) -> tuple[list[str], Rectangle]:
    """Return the lines of a message, and left, bottom, right, top of its background.

    It is in the middle of the lower border of the free part, where Blender writes nothing.
    """
    left, bottom, right, _ = free
    wrapped = lines(text, WIDEST * (right - left), scale)
    half = max(blf.dimensions(FONT, line)[0] for line in wrapped) / 2 + PADDING * scale
    middle, lower = (left + right) / 2, bottom + PADDING * scale
    height = (len(wrapped) * SPACING + PADDING) * scale
    return wrapped, (middle - half, lower, middle + half, lower + height)


def draw_message(text: str, area: bpy.types.Area, region: bpy.types.Region, scale: float) -> None:
    """Draw a message, which must hold a word, where the GPU draws into the region's pixels."""
    wrapped, (left, bottom, right, top) = ground(text, free_part(area, region), scale)
    fill((left, bottom, right, top))
    blf.color(FONT, *LIGHT)
    for number, line in enumerate(wrapped, 1):
        blf.position(FONT, left + PADDING * scale, top - number * SPACING * scale, 0)
        blf.draw(FONT, line)


def draw_label(
    text: str, frame: Rectangle, area: bpy.types.Area, region: bpy.types.Region, scale: float
) -> None:
    """Draw a short label in the upper left corner of the visible part of a frame.

    The frame is (left, bottom, width, height) in the region's pixels.
    """
    free = free_part(area, region)
    blf.size(FONT, SMALL * scale)
    width, height = blf.dimensions(FONT, text)[0], blf.dimensions(FONT, "Ag")[1]
    gap = PADDING / 2 * scale
    left = max(frame[0], free[0]) + gap
    top = min(frame[1] + frame[3], free[3]) - gap
    fill((left, top - height - 2 * gap, left + width + 2 * gap, top))
    blf.color(FONT, *LIGHT)
    blf.position(FONT, left + gap, top - gap - 0.8 * height, 0)
    blf.draw(FONT, text)
