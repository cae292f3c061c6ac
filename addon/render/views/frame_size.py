"""Sizes in pixels of Blender's render settings."""

import bpy


def render_size(render: bpy.types.RenderSettings) -> tuple[int, int]:
    """Return (width, height) in pixels of the whole rendered frame."""
    share = render.resolution_percentage / 100
    return max(1, int(render.resolution_x * share)), max(1, int(render.resolution_y * share))


def shape_problem(size: tuple[int, int], clip: tuple[int, int]) -> str:
    """Return why a clip of one size cannot be rendered at another, each (width, height) in pixels.

    Empty where both have the same shape, to a pixel; else the picture would be stretched.
    """
    if abs(size[0] * clip[1] - size[1] * clip[0]) <= max(*size, *clip):
        return ""
    return (
        f"the render size {size[0]}x{size[1]} has another shape than the clip's {clip[0]}x{clip[1]}; use the"
        " clip's size: the percentage scales the picture, and a cropped render region takes a part"
    )


def written_size(render: bpy.types.RenderSettings) -> tuple[int, int]:
    """Return (width, height) of the picture that Blender writes: the frame, or its cropped border."""
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
