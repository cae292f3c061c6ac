"""What the user sets, kept in the .blend as property groups of the scene."""

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
from . import aperture_cloud, depth_of_field, focus_marks, lens, redraw, subjects
from .aperture_shape import VirtualApertureShape
from .focus_marks import VirtualApertureFocusMarks, VirtualApertureFocusPoint
from .option_properties import with_options
from .subjects import VirtualApertureSubjects

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
        # What they were until now.
        shown = settings.aperture.data if settings.aperture is not None else None
        settings.views = (len(shown.vertices) if shown else 0) or SHOWN_VIEWS


MOVE_VIEWS = ("method", "quality", "views", "seed")
"""Options that say where the virtual cameras stand."""


class VirtualApertureName(bpy.types.PropertyGroup):
    """A name in a list; `name` is every property group's own."""


@with_options(FRAME_OPTIONS, _aperture_changed, MOVE_VIEWS)
class VirtualApertureSettings(bpy.types.PropertyGroup):
    """The clip, what is in focus, and how much blur."""

    # The default is not written into files: it is the version of those that hold none (see `migration`).
    version: IntProperty(default=1, options={"HIDDEN"})
    footage: StringProperty(
        name="Clip",
        description="Video file, folder of images, or a pattern such as shot_####.png",
        subtype="FILE_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    work_dir: StringProperty(
        name="Working Folder",
        description="Where the solve is kept; empty: beside the .blend, under the clip's name, or in the"
        " cache folder of the preferences",
        subtype="DIR_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    stills: BoolProperty(
        name="Photos in No Order",
        description="The pictures are no clip, but photos from different places: each is matched with all"
        " others",
    )
    lens: EnumProperty(
        name="Lens",
        description="What is known of the focal length of the clip",
        items=[
            ("FIND", "From the Clip", "Found from the clip, as far as it tells", 0),
            ("GIVEN", "35 mm Equivalent", "Known, and the same throughout", 1),
            ("SENSOR", "Lens and Sensor", "Known with the sensor's width, and the same throughout", 3),
            ("ZOOM", "Zooms", "It changes over the clip", 2),
        ],
    )
    equivalent: FloatProperty(
        name="Focal Length",
        description="35 mm equivalent in millimetres, as phones and cameras state it",
        min=1.0,
        soft_max=400.0,
        default=26.0,
    )
    focal_mm: FloatProperty(
        name="Focal Length",
        description="Focal length as written on the lens",
        subtype="DISTANCE_CAMERA",
        min=0.1,
        soft_max=400.0,
        default=35.0,
    )
    sensor_mm: FloatProperty(
        name="Sensor Width",
        description="Width of the part of the sensor that the clip shows",
        subtype="DISTANCE_CAMERA",
        min=0.1,
        soft_max=70.0,
        default=36.0,
    )
    depth_maps: StringProperty(
        name="Depth Maps",
        description="Folder of EXR, 16-bit PNG or .npz, or one .npz or .zip, with depth, inverse depth or"
        " disparity of any scale; the feature points tell which. Or a depth network's .onnx, which is run."
        " Empty: depth found from the clip",
        subtype="FILE_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
        update=_aperture_changed,
    )
    masks: StringProperty(
        name="Masks",
        description="Folder of mattes, or one of them: white or opaque moves, gray in part. Empty: found in"
        " the clip",
        subtype="FILE_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    mask: PointerProperty(
        type=bpy.types.Mask,
        name="Mask",
        description="Drawn in the Image or Movie Clip Editor around moving objects, with feather; tracks are"
        " ignored",
    )
    subjects: PointerProperty(
        type=VirtualApertureSubjects, name="Subjects", description="What is marked to move by itself"
    )
    root: PointerProperty(type=bpy.types.Object, name="Root")
    camera: PointerProperty(type=bpy.types.Object, name="Camera")
    points: PointerProperty(type=bpy.types.Object, name="Point Cloud")
    aperture: PointerProperty(type=bpy.types.Object, name="Virtual Cameras")
    clip_identity: StringProperty(
        name="Identity", description="What the solved clip is recognised by", options={"HIDDEN"}
    )
    clip_name: StringProperty(name="Name", description="Name of the solved clip", options={"HIDDEN"})
    clip_notes: StringProperty(
        name="Notes", description="What is to be known of the solved clip, a line each", options={"HIDDEN"}
    )
    clip_first: IntProperty(
        name="First Frame", description="Of the frames that were solved", options={"HIDDEN"}
    )
    clip_last: IntProperty(
        name="Last Frame", description="Of the frames that were solved", options={"HIDDEN"}
    )
    clip_step: IntProperty(
        name="Frame Step",
        description="From one frame that was solved to the next",
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
                "The picked points, followed through the clip; where none are, the distance",
            ),
            ("DISTANCE", "Distance", "The focus distance, which can be keyed"),
        ],
        update=_edited(lens.on_focus),
    )
    marks: PointerProperty(
        type=VirtualApertureFocusMarks, name="Focus Marks", description="What is in focus at which frames"
    )
    focus_points: CollectionProperty(type=VirtualApertureFocusPoint)
    focus_frame: IntProperty(name="Focus Frame", description="Frame in which the focus was picked")
    focus_distance: FloatProperty(
        name="Focus Distance",
        description="Distance of the focal plane from the camera, in the scene's unit, which is an imported"
        " model's own. Picked points set it to theirs; editing it puts it in their place. Key it to pull"
        " focus",
        subtype="DISTANCE",
        min=0.0,
        soft_max=100.0,
        default=0.0,
        precision=3,
        update=_edited(_follow_distance),
    )
    focus_through_points: BoolProperty(
        name="Plane Through Points",
        description="Tilt the focal plane so that it goes through the picked points, three or more",
        default=False,
        update=_edited(lens.on_focus),
    )
    focus_tilt: FloatProperty(
        name="Tilt",
        description="How far the top of the focal plane leans away from the camera, around the point where it"
        " crosses the optical axis",
        subtype="ANGLE",
        min=-MOST_TILT,
        max=MOST_TILT,
        default=0.0,
        update=_edited(lens.on_focus),
    )
    focus_swing: FloatProperty(
        name="Swing",
        description="How far the right side of the focal plane leans away from the camera, around the point"
        " where it crosses the optical axis",
        subtype="ANGLE",
        min=-MOST_TILT,
        max=MOST_TILT,
        default=0.0,
        update=_edited(lens.on_focus),
    )
    blur: FloatProperty(
        name="Blur",
        description="Diameter of the farthest background's blur disc as a share of the image width, at this"
        " frame and with this focus: in a pull it changes with them. Setting it sets the aperture's radius,"
        " which stays; keyed, it counts itself",
        min=0.0001,
        soft_max=0.1,
        max=1.0,
        default=0.03,
        precision=lens.BLUR_DIGITS,
        step=0.1,
        get_transform=_blur_now,
        update=_edited(lens.on_blur),
    )
    follows_blur: BoolProperty(
        name="Follows Blur",
        description="The radius follows the blur while a first distance is dragged to its place",
        options={"HIDDEN"},
    )
    aperture_radius: FloatProperty(
        name="Aperture Radius",
        description="Radius of the virtual aperture, in the scene's unit, which is an imported model's own:"
        " the same throughout the clip, unless it is keyed. 0 until a focus chooses it by the blur",
        subtype="DISTANCE",
        min=0.0,
        default=0.0,
        precision=4,
        update=_edited(lens.on_radius),
    )
    metres_per_unit: FloatProperty(
        name="Metres per Unit",
        description="Length of a unit of the scene, which f-stops need; Blender shows lengths in metres then,"
        " too. 0 where it is not known: a solve has a unit of its own",
        min=0.0,
        soft_max=10.0,
        default=0.0,
        precision=4,
        update=_scale_changed,
        options=set(),
    )
    f_stop: FloatProperty(
        name="F-Stop",
        description="Focal length divided by the aperture's diameter, as on a lens. Without a known"
        " sensor it is that of a full frame, 36 mm wide. 0 where Metres per Unit is not known: then setting"
        " it changes nothing. Key the radius instead",
        get=depth_of_field.f_stop,
        set=depth_of_field.set_f_stop,
        min=0.0,
        soft_min=0.1,
        soft_max=128.0,
        precision=2,
        step=10,
        options=set(),
    )
    shape: PointerProperty(
        type=VirtualApertureShape, name="Aperture Shape", description="What blur discs look like"
    )
    use_auto_views: BoolProperty(
        name="Automatic Views",
        description="Take as many virtual cameras as the largest blur disc needs",
        get=_has_auto_views,
        set=_set_auto_views,
        options=set(),
    )
    viewport_shows: EnumProperty(
        name="Show",
        description="What a viewport in Rendered shading shows",
        items=[
            ("LENS", "Through the Lens", "The frame with depth of field", 0),
            ("FOCUS", "In Focus", "The clip: clear where it is in focus, blue before, green beyond", 1),
            ("BLUR", "Blur Discs", "Circles of confusion: white in focus, warm before it, cold beyond", 2),
            ("DEPTH", "Depth", "Inverse depth: near red, far blue", 3),
            ("WIREFRAME", "Mesh", "The warp mesh over the clip", 4),
            ("SOURCES", "Sources", "Where light comes from: grey the frame, green others, red made up", 5),
        ],
        options=set(),
        update=_redraw_viewports,
    )
    viewport_wipe: FloatProperty(
        name="Before",
        description="Share of the width, from the left, in which a viewport in Rendered shading shows the"
        " clip as it was shot",
        subtype="FACTOR",
        min=0.0,
        max=1.0,
        options=set(),
        update=_redraw_viewports,
    )
    finds_depth: BoolProperty(
        name="Finds Depth",
        description="The clip's depth is being found in the background, which goes on when the file is opened"
        " again",
        options={"HIDDEN"},
    )
    output: StringProperty(
        name="Output",
        description="The render output that a solve set, as long as the user sets no other",
        options={"HIDDEN"},
    )
    summary: StringProperty(
        name="Summary", description="What the solve found, in one line", options={"HIDDEN"}
    )
    advice: StringProperty(name="Advice", description="What would help the solve most", options={"HIDDEN"})
    hidden: CollectionProperty(
        type=VirtualApertureName,
        name="Hidden",
        description="Objects that stood in the camera's way and were hidden",
    )


CLASSES = (
    VirtualApertureName,
    *focus_marks.CLASSES,
    *subjects.CLASSES,
    VirtualApertureShape,
    VirtualApertureSettings,
)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.virtual_aperture = PointerProperty(type=VirtualApertureSettings)


def unregister() -> None:
    del bpy.types.Scene.virtual_aperture
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
