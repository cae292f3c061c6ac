"""Settings of the lens: focus, blur and aperture."""

from typing import Any

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatProperty, PointerProperty, StringProperty

from .base.option_properties import hidden
from .focus import focus_marks
from .focus.focus_marks import VirtualApertureFocusMarks
from .lens import aperture_cloud, depth_of_field, lens, scale
from .lens.aperture_shape import VirtualApertureShape
from .lens.repairs import VirtualApertureRepairs

MOST_TILT = 1.57
"""Radians, a little less than a right angle, at which the focal plane holds the optical axis."""


def aperture_changed(settings: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    """Update the virtual cameras after a property was edited."""
    aperture_cloud.update(settings)


def _distance_set(settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    if focus_marks.have_distance(settings):
        aperture_changed(settings, context)
    else:
        focus_marks.take_distance(settings)


def _blur_set(settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    lens.store_blur(settings)
    aperture_changed(settings, context)


def _radius_set(settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    settings.by_f_stop = False
    aperture_changed(settings, context)


LEAST_BOOST, MOST_BOOST = -4.0, 9.0
"""Stops: from a sixteenth of the estimate, which cannot be seen, to half of `MOST_GAIN`."""


def _boost(settings: bpy.types.PropertyGroup) -> float:
    """The stops by which highlights are brighter than estimated; 0 if they are not restored."""
    gain = settings.highlights
    return float(np.clip(np.log2(gain), LEAST_BOOST, MOST_BOOST)) if gain > 0 else 0.0


def _restore(settings: bpy.types.PropertyGroup, on: bool) -> None:
    """Restore highlights as estimated, or leave the clip as it is."""
    if on != (settings.highlights > 0):
        settings.highlights = 1.0 if on else 0.0


def _lean(name: str, side: str) -> Any:
    return FloatProperty(
        name=name,
        description=f"How far the {side} of the focal plane leans away from the camera, pivoting on the"
        " optical axis",
        subtype="ANGLE",
        min=-MOST_TILT,
        max=MOST_TILT,
        update=aperture_changed,
    )


class LensProperties:
    """Focus, blur and aperture."""

    repairs: PointerProperty(
        type=VirtualApertureRepairs, name="Repairs", description="Strokes that mend mistakes of the depth"
    )
    marks: PointerProperty(
        type=VirtualApertureFocusMarks,
        name="Focus Marks",
        description="What is in focus, and at which frames",
    )
    focus_distance: FloatProperty(
        name="Focus Distance",
        description="Distance from the camera to the focal plane, in scene units; an imported model brings"
        " its own unit. Picking focus sets it; editing it replaces the pick. Animate it to pull focus",
        min=0.0,
        soft_max=100.0,
        precision=3,
        update=_distance_set,
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
        update=aperture_changed,
    )
    focus_tilt: _lean("Tilt", "top")
    focus_swing: _lean("Swing", "right side")
    blur: FloatProperty(
        name="Blur",
        description="Diameter of the farthest background's blur disc, as a fraction of the image width, with"
        " the first focus mark in focus. The aperture is the same in all frames. When animated, the blur is"
        " that of each frame. While an aperture is set, the blur that results at this frame",
        min=0.0001,
        soft_max=0.1,
        max=1.0,
        default=0.03,
        precision=4,
        step=0.1,
        get_transform=lens.shown_blur,
        update=_blur_set,
    )
    blur_percent: FloatProperty(
        name="Background Blur",
        description="Diameter of the farthest background's blur disc, in per cent of the image width, with"
        " the first focus mark in focus",
        subtype="PERCENTAGE",
        get=lambda settings: 100 * settings.blur,
        set=lambda settings, value: setattr(settings, "blur", value / 100),
        min=0.01,
        soft_max=10.0,
        max=100.0,
        precision=2,
        step=10,
        options=set(),
    )
    by_f_stop: hidden(BoolProperty, "By F-Stop", "The stored aperture was set as an f-stop")
    object_distance: hidden(
        FloatProperty, "Object Distance",
        "Distance of the focus object when it was put in focus, at which the blur is measured",
    )  # fmt: skip
    object_name: hidden(StringProperty, "Object", "Name of that object")
    aperture_radius: FloatProperty(
        name="Aperture Radius",
        description="Radius of the virtual aperture, in scene units; an imported model brings its own unit."
        " Constant throughout the clip unless animated. Set it in place of the blur; 0 goes back to the blur",
        min=0.0,
        precision=4,
        get_transform=lens.shown_radius,
        update=_radius_set,
    )
    metres_per_unit: FloatProperty(
        name="Meters per Unit",
        description="Size of one scene unit in meters; Blender then shows lengths in meters, too. 0 if"
        " unknown: a solve has an arbitrary scale, and f-stops assume one",
        min=0.0,
        soft_max=10.0,
        precision=4,
        update=lambda settings, _context: depth_of_field.on_scale(settings),
        options=set(),
    )
    guessed_scale: hidden(
        FloatProperty, "Guessed Scale",
        "Size of one scene unit in meters by the height of people in the clip; 0 without a guess",
    )  # fmt: skip
    subject_metres: FloatProperty(
        name="Subject Distance",
        description="How far away what is in focus is, in meters. Until it is given, here or by Set Scale, a"
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
    f_stop_format: EnumProperty(
        name="F-Stop On",
        description="Camera whose f-stops are meant: f/1.8 on a full frame blurs as f/1.2 on Super 35. The"
        " picture stays, its f-stop changes. Lens and Sensor, in Solve, replaces it",
        items=[
            (identifier, f"{label} ({width:g} mm)", cameras)
            for identifier, (label, width, cameras) in scale.FORMATS.items()
        ],
        default=scale.FULL_FRAME,
        options=set(),
    )
    restore_highlights: BoolProperty(
        name="Restore",
        description="Give highlights that the clip shows as white an estimate of their light back, so that"
        " they turn into bright bokeh discs",
        get=lambda settings: settings.highlights > 0,
        set=_restore,
        options=set(),
    )
    highlight_boost: FloatProperty(
        name="Highlight Boost",
        description="Stops by which restored highlights are brighter than estimated; each one doubles them",
        get=_boost,
        set=lambda settings, stops: setattr(settings, "highlights", 2.0**stops),
        min=LEAST_BOOST,
        max=MOST_BOOST,
        soft_min=-2.0,
        soft_max=4.0,
        precision=1,
        options=set(),
    )
    shape: PointerProperty(
        type=VirtualApertureShape, name="Aperture Shape", description="Shape of the blur discs"
    )
