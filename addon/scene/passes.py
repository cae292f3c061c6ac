"""Which passes a view layer asks for, besides those that Blender itself has switches of."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, PointerProperty

DEPTH = "Depth"
"""Blender's own name of the pass, and its switch is `ViewLayer.use_pass_z`."""
CIRCLE_OF_CONFUSION, IN_FOCUS = "Circle of Confusion", "In Focus"


class VirtualAperturePasses(bpy.types.PropertyGroup):
    """Passes of a view layer that only our engine renders."""

    use_circle_of_confusion: BoolProperty(
        name=CIRCLE_OF_CONFUSION,
        description="Signed diameter of each pixel's blur disc in pixels: positive where nearer than the"
        " focus, negative where farther",
        options=set(),
    )
    use_in_focus: BoolProperty(
        name=IN_FOCUS,
        description="Matte of what is sharp: 1 where no blur is visible, 0 where it is",
        options=set(),
    )


def wanted(layer: bpy.types.ViewLayer) -> tuple[str, ...]:
    """Return the names of our passes besides Combined that a view layer has enabled."""
    ours = layer.virtual_aperture_passes
    switches = {
        DEPTH: layer.use_pass_z,
        CIRCLE_OF_CONFUSION: ours.use_circle_of_confusion,
        IN_FOCUS: ours.use_in_focus,
    }
    return tuple(name for name, is_on in switches.items() if is_on)


def register() -> None:
    """Give view layers their switches."""
    bpy.utils.register_class(VirtualAperturePasses)
    bpy.types.ViewLayer.virtual_aperture_passes = PointerProperty(type=VirtualAperturePasses)


def unregister() -> None:
    """Undo `register`."""
    del bpy.types.ViewLayer.virtual_aperture_passes
    bpy.utils.unregister_class(VirtualAperturePasses)
