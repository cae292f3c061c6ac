"""Sizes in pixels of what Blender's render settings ask for."""

from __future__ import annotations

import bpy

from ..core.camera.reconstruction import Reconstruction


def render_size(render: bpy.types.RenderSettings) -> tuple[int, int]:
    """(width, height) in pixels of the whole rendered frame."""
    share = render.resolution_percentage / 100
    return max(1, int(render.resolution_x * share)), max(1, int(render.resolution_y * share))


def set_size(render: bpy.types.RenderSettings, reconstruction: Reconstruction, frame: int) -> None:
    """Render as large as a frame's own picture, which photos have each; UserError where the frame has no
    camera."""
    camera = reconstruction.intrinsics(reconstruction.image_at(frame)[0])
    render.resolution_x, render.resolution_y = camera.width, camera.height


def written_size(render: bpy.types.RenderSettings) -> tuple[int, int]:
    """(width, height) of the picture that Blender writes: the frame, or its border where that is cropped."""
    size = render_size(render)
    if not (render.use_border and render.use_crop_to_border):
        return size
    across, down = (
        round(high * n) - round(low * n)
        for n, low, high in zip(
            size, (render.border_min_x, render.border_min_y), (render.border_max_x, render.border_max_y),
            strict=True,
        )
    )  # fmt: skip
    return across, down
