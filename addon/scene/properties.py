"""The user's settings, kept in the .blend as property groups of the scene."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ..core.frame.options import FRAME_OPTIONS
from .base import redraw
from .base.option_properties import hidden, with_options
from .cg_objects import STAYS_SHARP, STAYS_SHARP_SWITCH
from .clip_properties import ClipProperties
from .focus import focus_marks
from .lens import repairs
from .lens.aperture_shape import VirtualApertureShape
from .lens_properties import LensProperties, aperture_changed
from .passes import VirtualAperturePasses
from .solve import point_cloud
from .sources import subjects

MOVE_VIEWS = ("method", "quality", "views", "seed")
"""Options that determine the virtual cameras."""


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
    focus_by_click: BoolProperty(
        name="Focus by Click",
        description="A click on the preview's picture puts what is there in focus. Off, it selects objects",
        default=True,
        options=set(),
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


class VirtualApertureHidden(bpy.types.PropertyGroup):
    """An object in a list. Not its name: that changes when it is renamed or its scene is copied."""

    thing: PointerProperty(type=bpy.types.Object)


@with_options(FRAME_OPTIONS, aperture_changed, MOVE_VIEWS)
class VirtualApertureSettings(ClipProperties, LensProperties, PreviewProperties, bpy.types.PropertyGroup):
    """The clip, what is in focus, and how much blur."""

    # The default is not written into files, so a saved version never equals it.
    version: IntProperty(default=1, options={"HIDDEN"})
    root: PointerProperty(type=bpy.types.Object, name="Root")
    camera: PointerProperty(type=bpy.types.Object, name="Camera")
    points: PointerProperty(type=bpy.types.Object, name="Point Cloud")
    aperture: PointerProperty(type=bpy.types.Object, name="Virtual Cameras")
    finds_depth: hidden(
        BoolProperty, "Finds Depth",
        "The clip's depth is being found in the background, and continues when the file is opened again",
    )  # fmt: skip
    render_as: EnumProperty(
        name="Render As",
        description="What Render Clip writes",
        items=[
            ("MOVIE", "Movie", "One file with the clip's frame rate and sound, as deep as the clip", 0),
            ("FRAMES", "Frames", "What Blender's Output properties say, such as a PNG for each frame", 1),
        ],
        options=set(),
    )
    output: hidden(StringProperty, "Output", "Render output set by the solve, until the user sets another")
    summary: hidden(StringProperty, "Summary", "One-line summary of the solve")
    advice: hidden(StringProperty, "Advice", "What would improve the solve most")
    hidden: CollectionProperty(
        type=VirtualApertureHidden,
        name="Hidden",
        description="Objects hidden because they blocked the camera",
    )


CLASSES = (
    VirtualApertureHidden,
    *focus_marks.CLASSES,
    *subjects.CLASSES,
    *repairs.CLASSES,
    VirtualApertureShape,
    VirtualApertureSettings,
    VirtualAperturePasses,
)
OWNED = (
    (bpy.types.Scene, "virtual_aperture", PointerProperty(type=VirtualApertureSettings)),
    (bpy.types.ViewLayer, "virtual_aperture_passes", PointerProperty(type=VirtualAperturePasses)),
    (bpy.types.Object, STAYS_SHARP, STAYS_SHARP_SWITCH),
)
"""Properties of Blender's own types, with their names."""


def register() -> None:
    """Register the property groups, and the properties that Blender's own types get."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    for owner, name, made in OWNED:
        setattr(owner, name, made)


def unregister() -> None:
    """Undo `register`."""
    for owner, name, _ in OWNED:
        delattr(owner, name)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
