"""The user's settings, kept in the .blend as property groups of the scene."""

from __future__ import annotations

from collections.abc import Callable

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
from .base.option_properties import with_options
from .focus import focus_marks
from .focus.focus_marks import VirtualApertureFocusMarks, VirtualApertureFocusPoint
from .lens import aperture_cloud, depth_of_field, highlight_stops, lens
from .lens.aperture_shape import VirtualApertureShape
from .solve import point_cloud
from .sources import colour_space, subjects
from .sources.subjects import VirtualApertureSubjects

MOST_TILT = 1.57
"""Radians, a little less than a right angle, at which the focal plane holds the optical axis."""


def _aperture_changed(settings: VirtualApertureSettings, _context: bpy.types.Context) -> None:
    aperture_cloud.update(settings)


def _redraw_viewports(_settings: VirtualApertureSettings, _context: bpy.types.Context) -> None:
    redraw.viewports()


def _edited(
    follow: Callable[[VirtualApertureSettings], None],
) -> Callable[[VirtualApertureSettings, bpy.types.Context], None]:
    """An update callback that lets the rest of the lens follow an edit by hand or by a script."""

    def update(settings: VirtualApertureSettings, context: bpy.types.Context) -> None:
        if lens.is_writing():
            return
        with lens.writing():
            follow(settings)
        _aperture_changed(settings, context)

    return update


def _follow_distance(settings: VirtualApertureSettings) -> None:
    lens.on_distance(settings)
    focus_marks.on_distance(settings)


def _scale_changed(settings: VirtualApertureSettings, _context: bpy.types.Context) -> None:
    depth_of_field.on_scale(settings)


def _blur_now(settings: VirtualApertureSettings, stored: float, _is_set: bool) -> float:
    return lens.blur_now(settings, stored)


SHOWN_VIEWS = 64
"""To begin with, where the number of views is no longer to be found."""


def _has_auto_views(settings: VirtualApertureSettings) -> bool:
    return bool(settings.views == 0)


def _set_auto_views(settings: VirtualApertureSettings, auto: bool) -> None:
    if auto:
        settings.views = 0
    elif settings.views == 0:
        # Their values so far.
        shown = settings.aperture.data if settings.aperture is not None else None
        settings.views = (len(shown.vertices) if shown else 0) or SHOWN_VIEWS


def _shows_points(settings: VirtualApertureSettings) -> bool:
    return settings.points is not None and point_cloud.is_shown(settings.points)


def _show_points(settings: VirtualApertureSettings, shown: bool) -> None:
    if settings.points is not None:
        point_cloud.show(settings.points, shown)


MOVE_VIEWS = ("method", "quality", "views", "seed")
"""Options that determine the virtual cameras."""


class VirtualApertureHidden(bpy.types.PropertyGroup):
    """An object in a list. Not its name: that changes when it is renamed or its scene is copied."""

    thing: PointerProperty(type=bpy.types.Object)


def _colour_spaces(_settings: object, _context: object, _typed: str) -> list[str]:
    return colour_space.names()


@with_options(FRAME_OPTIONS, _aperture_changed, MOVE_VIEWS)
class VirtualApertureSettings(bpy.types.PropertyGroup):
    """The clip, what is in focus, and how much blur."""

    # The default is not written into files, so a saved version never equals it.
    version: IntProperty(default=1, options={"HIDDEN"})
    footage: StringProperty(
        name="Clip",
        description="Video file, image folder, or a pattern such as shot_####.png",
        subtype="FILE_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    work_dir: StringProperty(
        name="Working Folder",
        description="Folder for the solve. Leave empty to keep it next to the .blend, named after the clip,"
        " or in the Cache Folder of the preferences",
        subtype="DIR_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    stills: BoolProperty(
        name="Unordered Photos",
        description="The images are photos taken from different places, not a clip. Each one is matched"
        " with every other",
    )
    lens: EnumProperty(
        name="Lens",
        description="What is known about the clip's focal length",
        items=[
            ("FIND", "From the Clip", "Estimate the focal length from the clip", 0),
            ("GIVEN", "35 mm Equivalent", "Known and constant, as a 35 mm equivalent", 1),
            ("SENSOR", "Lens and Sensor", "Known and constant, along with the sensor width", 3),
            ("ZOOM", "Zoom Lens", "The focal length changes during the clip", 2),
        ],
    )
    equivalent: FloatProperty(
        name="Focal Length",
        description="35 mm equivalent in millimetres, as phones and cameras report it",
        min=1.0,
        soft_max=400.0,
        default=26.0,
    )
    focal_mm: FloatProperty(
        name="Focal Length",
        description="Focal length as marked on the lens",
        subtype="DISTANCE_CAMERA",
        min=0.1,
        soft_max=400.0,
        default=35.0,
    )
    sensor_mm: FloatProperty(
        name="Sensor Width",
        description="Width of the sensor area the clip was recorded with",
        subtype="DISTANCE_CAMERA",
        min=0.1,
        soft_max=70.0,
        default=36.0,
    )
    depth_maps: StringProperty(
        name="Depth Maps",
        description="Your own depth maps: a folder of EXR, 16-bit PNG or .npz files, or a single .npz or"
        " .zip. Depth, inverse depth or disparity at any scale; the feature points settle which. A depth"
        " network (.onnx) is run on the clip. Leave empty to use depth found from the clip alone",
        subtype="FILE_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
        update=_aperture_changed,
    )
    colour_space: StringProperty(
        name="Color Space",
        description="What the clip was recorded in, such as S-Log3 S-Gamut3.Cine: cameras that record a log"
        " rarely say so in the file. Empty: what the file says, else sRGB",
        search=_colour_spaces,
        update=_aperture_changed,
    )
    masks: StringProperty(
        name="Masks",
        description="Mattes of moving objects: a folder, or one image of a sequence. White or opaque moves,"
        " gray moves in part. Leave empty to rely on what is found in the clip",
        subtype="FILE_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    mask: PointerProperty(
        type=bpy.types.Mask,
        name="Mask",
        description="Mask drawn around moving objects in the Image or Movie Clip Editor, feather included."
        " Tracks that drive its points are ignored",
    )
    subjects: PointerProperty(
        type=VirtualApertureSubjects, name="Subjects", description="Moving subjects marked by strokes"
    )
    root: PointerProperty(type=bpy.types.Object, name="Root")
    camera: PointerProperty(type=bpy.types.Object, name="Camera")
    points: PointerProperty(type=bpy.types.Object, name="Point Cloud")
    aperture: PointerProperty(type=bpy.types.Object, name="Virtual Cameras")
    clip_identity: StringProperty(
        name="Identity", description="Fingerprint of the solved clip", options={"HIDDEN"}
    )
    clip_name: StringProperty(name="Name", description="Name of the solved clip", options={"HIDDEN"})
    clip_notes: StringProperty(
        name="Notes", description="Remarks about the solved clip, one per line", options={"HIDDEN"}
    )
    clip_first: IntProperty(name="First Frame", description="First solved frame", options={"HIDDEN"})
    clip_last: IntProperty(name="Last Frame", description="Last solved frame", options={"HIDDEN"})
    clip_step: IntProperty(
        name="Frame Step",
        description="Step from one solved frame to the next",
        default=1,
        options={"HIDDEN"},
    )
    focus_by: EnumProperty(
        name="Focus By",
        description="What the focal plane follows",
        items=[
            (
                "POINTS",
                "Points",
                "The picked points, followed through the clip, or the distance if there are none",
            ),
            ("DISTANCE", "Distance", "The focus distance, which can be animated"),
        ],
        update=_edited(lens.on_focus),
    )
    marks: PointerProperty(
        type=VirtualApertureFocusMarks,
        name="Focus Marks",
        description="What is in focus, and at which frames",
    )
    focus_points: CollectionProperty(type=VirtualApertureFocusPoint)
    focus_frame: IntProperty(name="Focus Frame", description="Frame the focus was picked in")
    focus_distance: FloatProperty(
        name="Focus Distance",
        description="Distance from the camera to the focal plane, in scene units; an imported model brings"
        " its own unit. Picking focus sets it; editing it replaces the pick. Animate it to pull focus",
        min=0.0,
        soft_max=100.0,
        default=0.0,
        precision=3,
        update=_edited(_follow_distance),
    )
    focus_length: FloatProperty(
        name="Focus Distance",
        description="The same as a length, where the scene's scale is given",
        subtype="DISTANCE",
        get=lambda settings: settings.focus_distance,
        set=lambda settings, length: setattr(settings, "focus_distance", length),
        min=0.0,
        soft_max=100.0,
        precision=3,
        options=set(),
    )
    focus_through_points: BoolProperty(
        name="Plane Through Points",
        description="Tilt the focal plane to pass through the picked points (three or more)",
        default=False,
        update=_edited(lens.on_focus),
    )
    focus_tilt: FloatProperty(
        name="Tilt",
        description="How far the top of the focal plane leans away from the camera, pivoting on the optical"
        " axis",
        subtype="ANGLE",
        min=-MOST_TILT,
        max=MOST_TILT,
        default=0.0,
        update=_edited(lens.on_focus),
    )
    focus_swing: FloatProperty(
        name="Swing",
        description="How far the right side of the focal plane leans away from the camera, pivoting on the"
        " optical axis",
        subtype="ANGLE",
        min=-MOST_TILT,
        max=MOST_TILT,
        default=0.0,
        update=_edited(lens.on_focus),
    )
    blur: FloatProperty(
        name="Blur",
        description="Diameter of the farthest background's blur disc, as a fraction of the image width, at"
        " the current frame and focus; it changes during a focus pull. Setting it sets the aperture radius,"
        " which stays constant. When animated, the blur itself is kept",
        min=0.0001,
        soft_max=0.1,
        max=1.0,
        default=0.03,
        precision=lens.BLUR_DIGITS,
        step=0.1,
        get_transform=_blur_now,
        update=_edited(lens.on_blur),
    )
    blur_percent: FloatProperty(
        name="Background Blur",
        description="Diameter of the farthest background's blur disc, in per cent of the image width, at the"
        " current frame and focus",
        subtype="PERCENTAGE",
        get=lens.blur_percent,
        set=lens.set_blur_percent,
        min=0.01,
        soft_max=10.0,
        max=100.0,
        precision=2,
        step=10,
        options=set(),
    )
    follows_blur: BoolProperty(
        name="Follows Blur",
        description="The radius follows the blur while the first distance is dragged",
        options={"HIDDEN"},
    )
    aperture_radius: FloatProperty(
        name="Aperture Radius",
        description="Radius of the virtual aperture, in scene units; an imported model brings its own unit."
        " Constant throughout the clip unless animated. 0 until the first focus sets it from the blur",
        min=0.0,
        default=0.0,
        precision=4,
        update=_edited(lens.on_radius),
    )
    metres_per_unit: FloatProperty(
        name="Metres per Unit",
        description="Size of one scene unit in metres; Blender then shows lengths in metres, too. 0 if"
        " unknown: a solve has an arbitrary scale, and f-stops assume one",
        min=0.0,
        soft_max=10.0,
        default=0.0,
        precision=4,
        update=_scale_changed,
        options=set(),
    )
    subject_metres: FloatProperty(
        name="Subject Distance",
        description="How far away what is in focus is, in metres. Until it is given, here or by Set Scale, a"
        " distance is assumed with which an f-stop blurs as it does on a 50 mm lens",
        get=depth_of_field.subject_metres,
        set=depth_of_field.set_subject_metres,
        min=0.0,
        soft_min=0.01,
        soft_max=100.0,
        precision=2,
        step=1,
        options=set(),
    )
    f_stop: FloatProperty(
        name="F-Stop",
        description="Focal length divided by aperture diameter, as on a lens. If the sensor is unknown, a"
        " full frame (36 mm wide) is assumed; if the scale is not set, one is assumed. To animate it, animate"
        " the aperture radius",
        get=depth_of_field.f_stop,
        set=depth_of_field.set_f_stop,
        min=0.0,
        soft_min=0.1,
        soft_max=128.0,
        precision=2,
        step=10,
        options=set(),
    )
    restore_highlights: BoolProperty(
        name="Restore",
        description="Give highlights that the clip shows as white an estimate of their light back, so that"
        " they turn into bright bokeh discs",
        get=highlight_stops.are_restored,
        set=highlight_stops.restore,
        options=set(),
    )
    highlight_boost: FloatProperty(
        name="Highlight Boost",
        description="Stops by which restored highlights are brighter than estimated; each one doubles them",
        get=highlight_stops.boost,
        set=highlight_stops.set_boost,
        min=highlight_stops.LEAST,
        max=highlight_stops.MOST,
        soft_min=-2.0,
        soft_max=4.0,
        precision=1,
        options=set(),
    )
    shape: PointerProperty(
        type=VirtualApertureShape, name="Aperture Shape", description="Shape of the blur discs"
    )
    use_auto_views: BoolProperty(
        name="Automatic Views",
        description="Use as many virtual cameras as the largest blur disc needs",
        get=_has_auto_views,
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
        description="Show the feature points in the viewport. They are also seen in Edit Mode and while focus"
        " is picked",
        get=_shows_points,
        set=_show_points,
        options=set(),
        update=_redraw_viewports,
    )
    finds_depth: BoolProperty(
        name="Finds Depth",
        description="The clip's depth is being found in the background, and continues when the file is"
        " opened again",
        options={"HIDDEN"},
    )
    render_as: EnumProperty(
        name="Render As",
        description="What Render Clip writes",
        items=[
            ("MOVIE", "Movie", "One file with the clip's frame rate and sound, as deep as the clip", 0),
            ("FRAMES", "Frames", "What Blender's Output properties say, such as a PNG for each frame", 1),
        ],
        options=set(),
    )
    output: StringProperty(
        name="Output",
        description="Render output set by the solve, until the user sets another",
        options={"HIDDEN"},
    )
    summary: StringProperty(name="Summary", description="One-line summary of the solve", options={"HIDDEN"})
    advice: StringProperty(name="Advice", description="What would improve the solve most", options={"HIDDEN"})
    hidden: CollectionProperty(
        type=VirtualApertureHidden,
        name="Hidden",
        description="Objects hidden because they blocked the camera",
    )


CLASSES = (
    VirtualApertureHidden,
    *focus_marks.CLASSES,
    *subjects.CLASSES,
    VirtualApertureShape,
    VirtualApertureSettings,
)


def register() -> None:
    """Register the property groups, and the settings of scenes."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.virtual_aperture = PointerProperty(type=VirtualApertureSettings)


def unregister() -> None:
    """Remove the settings of scenes, and unregister the property groups."""
    del bpy.types.Scene.virtual_aperture
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
