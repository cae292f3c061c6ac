"""Having our panels drawn again, and nothing else."""

from __future__ import annotations

import bpy


def panels() -> None:
    """Draw the sidebars of all 3D viewports again, not what the viewports show: that takes far longer."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                for region in area.regions:
                    if region.type == "UI":
                        region.tag_redraw()
