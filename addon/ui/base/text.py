"""Longer texts in panels."""

import bpy

from ...render.viewport.overlay import lines

MARGIN = 85
"""Pixels of a panel's width that its text does not get, at a resolution scale of 1."""
UNIT = 20
"""Pixels of Blender's unit of widths, at a resolution scale of 1."""
NARROW = 240
"""Pixels of a sidebar's width, at a resolution scale of 1, below which names of two large buttons are cut
off; Blender opens it with 292. Measured in a window."""


def wrapped(
    layout: bpy.types.UILayout,
    context: bpy.types.Context,
    text: str,
    icon: str = "NONE",
    alert: bool = False,
    beside: float = 0.0,
    units: int = 0,
) -> None:
    """Draw a text as labels as wide as the panel, the icon before the first.

    `beside` is the width of something at its side, in pixels at a resolution scale of 1; `units` that of a
    popover, in units of `UNIT` such pixels.
    """
    column = layout.column(align=True)
    column.alert = alert
    column.scale_y = 0.8
    scale = _scale(context)
    width = (units * UNIT - MARGIN) * scale if units else width_of(context)
    for number, line in enumerate(lines(text, max(width - beside * scale, 1.0), scale)):
        # An icon's width of nothing keeps the lines in one column.
        column.label(text=line, icon=icon if number == 0 or icon == "NONE" else "BLANK1")


def width_of(context: bpy.types.Context) -> float:
    """Return the width of a panel's text in pixels; that of a default sidebar without a region."""
    scale = _scale(context)
    width = context.region.width if context.region is not None else 280 * scale
    return float(max(width - MARGIN * scale, 1))


def is_narrow(context: bpy.types.Context) -> bool:
    """Return whether two buttons side by side would cut their names off."""
    return bool(width_of(context) < (NARROW - MARGIN) * _scale(context))


def _scale(context: bpy.types.Context) -> float:
    """The resolution scale, which is 0 in a Blender without a window."""
    return float(context.preferences.system.ui_scale or 1.0)


def left_words(seconds: float | None) -> str:
    """Return the remaining time of work in words; empty while it is unknown."""
    if seconds is None:
        return ""
    if seconds < 90:
        return f"About {seconds:.0f} s left"
    hours, minutes = divmod(round(seconds / 60), 60)
    return f"About {hours} h {minutes:02d} min left" if hours else f"About {minutes} min left"


def list_row(layout: bpy.types.UILayout, name: str, group: bpy.types.PropertyGroup) -> bpy.types.UILayout:
    """Draw the items of a group by the list called `name`, two to five rows high; returns its row."""
    row, high = layout.row(), max(2, min(len(group.items), 5))
    row.template_list(f"VIRTUAL_APERTURE_UL_{name}", "", group, "items", group, "active", rows=high)
    return row


def progress_row(
    layout: bpy.types.UILayout,
    words: str,
    share: float,
    left: float | None,
    stop: str = "",
    icon: str = "X",
    hint: str = "",
) -> None:
    """Draw the progress of a job, the operator that stops it, and the seconds left with a hint."""
    row = layout.row(align=True)
    row.progress(factor=share, text=words)
    if stop:
        row.operator(stop, text="", icon=icon)
    if line := ", ".join(filter(None, (left_words(left), hint))):
        layout.label(text=line, icon="TIME")
