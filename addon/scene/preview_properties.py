"""Settings of the preview."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty

from .base import redraw
from .solve import point_cloud


def _redraw_viewports(_settings: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    redraw.viewports()


SHOWN_VIEWS = 64
"""To begin with, where the number of views is no longer to be found."""


def _set_auto_views(settings: bpy.types.PropertyGroup, auto: bool) -> None:
    if auto:
        settings.views = 0
    elif settings.views == 0:
        # Their values so far.
        shown = settings.aperture.data if settings.aperture is not None else None
        settings.views = (len(shown.vertices) if shown else 0) or SHOWN_VIEWS


def _show_points(settings: bpy.types.PropertyGroup, shown: bool) -> None:
    if settings.points is not None:
        point_cloud.show(settings.points, shown)


class PreviewProperties:
    """The picture in the viewport."""

    use_auto_views: BoolProperty(
        name="Automatic Views",
        description="Use as many virtual cameras as the largest blur disc needs",
        get=lambda settings: settings.views == 0,
        set=_set_auto_views,
        options=set(),
    )
    viewport_shows: EnumProperty(
        name="Show",
        description="What the preview shows",
        items=[
            ("LENS", "Through the Lens", "The frame with its new depth of field", 0),
            (
                "FOCUS",
                "In Focus",
                "The clip, clear where it is in focus, blue where nearer, green where farther",
                1,
            ),
            ("BLUR", "Blur Discs", "Circles of confusion: white in focus, warm nearer, cool farther", 2),
            ("DEPTH", "Depth", "Inverse depth: red is near, blue is far", 3),
            (
                "SOURCES",
                "Sources",
                "Where pixels come from: gray this frame, green other frames, red invented",
                4,
            ),
        ],
        options=set(),
        update=_redraw_viewports,
    )
    viewport_wipe: FloatProperty(
        name="Compare",
        description="Show the clip as it was shot over this much of the preview, from the left",
        subtype="FACTOR",
        min=0.0,
        max=1.0,
        options=set(),
        update=_redraw_viewports,
    )
    show_points: BoolProperty(
        name="Show Points",
        description="Show the feature points in the viewport. They are also seen in Edit Mode",
        get=lambda settings: settings.points is not None and point_cloud.is_shown(settings.points),
        set=_show_points,
        options=set(),
        update=_redraw_viewports,
    )
