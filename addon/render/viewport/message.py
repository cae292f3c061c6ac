"""A message over a viewport's picture: light on a dark ground, in as many lines as it takes."""

from collections.abc import Iterator

import blf
import bpy

from .overlay import Rectangle, fill

FONT = 0
POINTS, SMALL = 11, 9
"""Sizes of the interface's text, and of a label's."""
WIDEST = 0.7
"""Largest share of the width between headers and sidebars that a message has."""
PADDING, SPACING = 8.0, 16.0
"""Pixels from the text to the ground's border, and from line to line, at a resolution scale of 1."""
LIGHT = (1.0, 1.0, 1.0, 1.0)


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


def draw(text: str, area: bpy.types.Area, region: bpy.types.Region, scale: float) -> None:
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
