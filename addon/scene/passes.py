"""Which passes a view layer asks for, besides those that Blender itself has switches of."""

import bpy
from bpy.props import BoolProperty

from ..core.base.options import options_of
from ..core.frame.range_matte import Range
from .base.option_properties import values_of, with_options

DEPTH = "Depth"
"""Blender's own name of the pass, and its switch is `ViewLayer.use_pass_z`."""
CIRCLE_OF_CONFUSION, IN_FOCUS = "Circle of Confusion", "In Focus"
RANGE_MATTE = "Range Matte"
RANGE = {each.name: each for each in options_of(Range).values()}
"""Options of the range by their names in .blend files."""


@with_options(RANGE)
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
    use_range_matte: BoolProperty(
        name=RANGE_MATTE,
        description="Matte of a range of distances, as blurred as the picture: the share of each pixel's"
        " light that comes from there",
        options=set(),
    )


def wanted(layer: bpy.types.ViewLayer) -> tuple[str, ...]:
    """Return the names of our passes besides Combined that a view layer has enabled."""
    ours = layer.virtual_aperture_passes
    switches = {
        DEPTH: layer.use_pass_z,
        CIRCLE_OF_CONFUSION: ours.use_circle_of_confusion,
        IN_FOCUS: ours.use_in_focus,
        RANGE_MATTE: ours.use_range_matte,
    }
    return tuple(name for name, is_on in switches.items() if is_on)


def range_of(layer: bpy.types.ViewLayer) -> Range:
    """Return the range of a view layer's matte."""
    return Range(*values_of(layer.virtual_aperture_passes, RANGE).values())
