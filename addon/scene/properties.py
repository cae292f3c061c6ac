"""What the user sets, kept in the .blend as property groups of the scene."""

from __future__ import annotations

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

from ..core.focal import Focal, from_equivalent, from_sensor
from ..core.focus import Focus, radius_for_blur
from ..core.reconstruction import Reconstruction
from ..core.views import LensSettings

VERSION = 1


def _aperture_changed(settings: VirtualApertureSettings, _context: bpy.types.Context) -> None:
    from . import aperture_cloud

    aperture_cloud.update(settings)


class VirtualApertureFocusPoint(bpy.types.PropertyGroup):
    """One picked feature point."""

    point: IntProperty(
        name="Point", description="ID of the point: its vertex index in the point cloud", min=0
    )


class VirtualApertureSettings(bpy.types.PropertyGroup):
    """The clip, what is in focus, and how much blur."""

    version: IntProperty(default=VERSION, options={"HIDDEN"})
    footage: StringProperty(
        name="Clip",
        description="Video file, folder of images, or a pattern such as shot_####.png",
        subtype="FILE_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    work_dir: StringProperty(
        name="Working Folder",
        description="Where the solve is kept; empty: beside the clip's name in the .blend's folder",
        subtype="DIR_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
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
        description="What is written on the lens",
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
        description="Folder of EXR or 16-bit PNG with depth, inverse depth or disparity of any scale; the"
        " feature points tell which. Empty: depth found from the clip",
        subtype="DIR_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
        update=_aperture_changed,
    )
    masks: StringProperty(
        name="Masks",
        description="Folder of pictures, or one of them: white moves by itself. Empty: found from the clip",
        subtype="FILE_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    mask: PointerProperty(
        type=bpy.types.Mask,
        name="Mask",
        description="Drawn in the Image or Movie Clip Editor around what moves by itself; feather and tracks"
        " are ignored",
    )
    root: PointerProperty(type=bpy.types.Object, name="Root")
    camera: PointerProperty(type=bpy.types.Object, name="Camera")
    points: PointerProperty(type=bpy.types.Object, name="Point Cloud")
    aperture: PointerProperty(type=bpy.types.Object, name="Virtual Cameras")
    clip_identity: StringProperty(
        name="Identity", description="What the solved clip is recognised by", options={"HIDDEN"}
    )
    clip_name: StringProperty(name="Name", description="Name of the solved clip", options={"HIDDEN"})
    clip_first: IntProperty(
        name="First Frame", description="Of the frames that were solved", options={"HIDDEN"}
    )
    clip_last: IntProperty(
        name="Last Frame", description="Of the frames that were solved", options={"HIDDEN"}
    )
    method: EnumProperty(
        name="Method",
        description="How views are synthesized",
        items=[
            (
                "layers",
                "Layers",
                "Depth of every pixel; what lies behind silhouettes on a layer of its own",
                2,
            ),
            ("features", "Features", "Warp mesh over the feature points, carried on past the border", 0),
            (
                "thesis",
                "Thesis",
                "The 2010 baseline: pinned corners, random positions, fitted registration",
                1,
            ),
            (
                "grid",
                "Grid",
                "One regular mesh that follows the features as stiffly as the picture allows (Liu 2009)",
                3,
            ),
            ("edges", "Edges", "Triangles along image edges (thesis, section 5.2)", 4),
        ],
        default="layers",
        update=_aperture_changed,
    )
    focus_points: CollectionProperty(type=VirtualApertureFocusPoint)
    focus_frame: IntProperty(
        name="Focus Frame", description="Frame in which the focus was picked; the blur is measured there"
    )
    focus_distance: FloatProperty(
        name="Focus Distance",
        description="Depth of the focal plane where no points are picked",
        subtype="DISTANCE",
        min=0.0,
        default=0.0,
        update=_aperture_changed,
    )
    blur: FloatProperty(
        name="Blur",
        description="Diameter of the farthest background's blur disc as a share of the image width",
        min=0.0001,
        soft_max=0.1,
        max=1.0,
        default=0.03,
        precision=4,
        step=0.1,
        update=_aperture_changed,
    )
    use_radius: BoolProperty(
        name="Set Radius",
        description="Give the aperture's radius in scene units instead of the blur",
        update=_aperture_changed,
    )
    aperture_radius: FloatProperty(
        name="Aperture Radius",
        description="Radius of the virtual aperture",
        subtype="DISTANCE",
        min=0.0,
        default=0.1,
        precision=4,
        update=_aperture_changed,
    )
    views: IntProperty(
        name="Views",
        description="Number of virtual cameras; 0 takes as many as the largest blur disc needs",
        min=0,
        soft_max=256,
        max=4096,
        default=0,
        update=_aperture_changed,
    )
    borrow: BoolProperty(
        name="Borrow",
        description="Take what a frame does not show, behind silhouettes and past the border, from the frames"
        " that do; without, it is made up from beside",
        default=True,
    )
    seed: IntProperty(
        name="Seed",
        description="Of the thesis's random positions",
        min=0,
        default=0,
        update=_aperture_changed,
    )


def focal_of(settings: VirtualApertureSettings) -> Focal | None:
    """What the settings tell of the clip's focal length."""
    if settings.lens == "GIVEN":
        equivalent = settings.equivalent
        return lambda width, height: from_equivalent(equivalent, width, height)
    if settings.lens == "SENSOR":
        focal, sensor = settings.focal_mm, settings.sensor_mm
        return lambda width, _: from_sensor(focal, sensor, width)
    return None


def focus_of(settings: VirtualApertureSettings) -> Focus:
    """The focus that the settings describe; without picked points and distance, one that raises when used."""
    return Focus(
        points=tuple(entry.point for entry in settings.focus_points),
        distance=settings.focus_distance if settings.focus_distance > 0 else None,
    )


def set_focus(settings: VirtualApertureSettings, focus: Focus, frame: int) -> None:
    """Write a focus into the settings."""
    settings.focus_points.clear()
    for point in focus.points:
        settings.focus_points.add().point = point
    settings.focus_frame = frame
    settings.focus_distance = focus.distance or 0.0


def lens_settings(settings: VirtualApertureSettings, reconstruction: Reconstruction) -> LensSettings:
    """The lens that the settings describe; UserError where they mean nothing."""
    focus = focus_of(settings)
    if settings.use_radius:
        radius = settings.aperture_radius
    else:
        frame = settings.focus_frame
        if frame not in reconstruction.frames:
            frame = int(reconstruction.frames[0])
        radius = radius_for_blur(reconstruction, focus, frame, settings.blur)
    return LensSettings(focus, radius, settings.views, settings.method, settings.seed, settings.borrow)


CLASSES = (VirtualApertureFocusPoint, VirtualApertureSettings)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.virtual_aperture = PointerProperty(type=VirtualApertureSettings)


def unregister() -> None:
    del bpy.types.Scene.virtual_aperture
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
