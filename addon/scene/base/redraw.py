"""Having what is shown drawn again."""

from collections.abc import Iterator

import bpy


def areas() -> Iterator[bpy.types.Area]:
    """Yield the areas of all windows; none in the background."""
    for window in bpy.context.window_manager.windows:
        yield from window.screen.areas


def viewports(shading: str = "") -> None:
    """Draw all 3D viewports again, or those in a shading, such as RENDERED."""
    for area in areas():
        if area.type == "VIEW_3D" and shading in ("", area.spaces.active.shading.type):
            area.tag_redraw()


def panels() -> None:
    """Draw the sidebars of all 3D viewports again, not what the viewports show: that takes far longer."""
    for area in areas():
        for region in area.regions:
            if area.type == "VIEW_3D" and region.type == "UI":
                region.tag_redraw()
