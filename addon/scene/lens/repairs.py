"""Repairs of depth as they are kept in the .blend."""

from collections.abc import Sequence
from typing import Any

import bpy
from bpy.props import CollectionProperty, EnumProperty, FloatProperty, FloatVectorProperty, IntProperty

from ...core.frame.repairs import KINDS, Repair
from ..base import redraw
from ..sources.subjects import VirtualApertureStrokePlace, changed

BRUSH = Repair("nearer", 1, ((0.5, 0.5),))
"""Gives the brush its defaults."""
AMOUNT: Any = {
    "name": "Amount", "description": "How much nearer or farther: 0.25 is a quarter of the distance",
    "default": BRUSH.amount, "min": 0.01, "max": 10.0, "soft_max": 1.0, "precision": 2,
}  # fmt: skip
HELP = {
    "same": "Paint with the depth of the place that you click first",
    "nearer": "Bring what you paint nearer",
    "farther": "Take what you paint farther away",
    "sharp": "Put what you paint in focus",
    "soft": "Take what you paint to the background",
}
"""Tooltips of the kinds."""
ITEMS = [(kind.upper(), name, HELP[kind], number) for number, (kind, name) in enumerate(KINDS.items())]


def _changed(repair: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    redraw.viewports()


class VirtualApertureRepair(bpy.types.PropertyGroup):
    """One stroke of a brush over a mistake: a `Repair`."""

    kind: EnumProperty(name="Repair", description="What the stroke does", items=ITEMS, update=_changed)
    frame: IntProperty(name="Frame", description="Frame it was painted in")
    radius: FloatProperty(
        name="Brush Size", description="Radius of the brush, a share of the image width", default=BRUSH.radius
    )
    amount: FloatProperty(**AMOUNT, update=_changed)
    reference: FloatVectorProperty(
        name="Reference", description="Place with the right depth", size=2, default=(-1, -1)
    )
    places: CollectionProperty(type=VirtualApertureStrokePlace)


class VirtualApertureRepairs(bpy.types.PropertyGroup):
    """The repairs of a clip, in their order, and the brush."""

    items: CollectionProperty(type=VirtualApertureRepair)
    active: IntProperty(name="Active Repair", options={"HIDDEN"})
    kind: EnumProperty(name="Brush", description="What the next stroke does", items=ITEMS)
    radius: FloatProperty(
        name="Brush Size",
        description="Radius of the brush, a share of the image width; [ and ] change it while you paint",
        default=BRUSH.radius,
        min=0.002,
        max=0.5,
        soft_max=0.1,
        precision=3,
    )
    amount: FloatProperty(**AMOUNT)


def repairs_of(settings: bpy.types.PropertyGroup) -> tuple[Repair, ...]:
    """Return the repairs as the core has them."""
    return tuple(map(_repair, settings.repairs.items))


def _repair(kept: bpy.types.PropertyGroup) -> Repair:
    places = tuple((float(place.xy[0]), float(place.xy[1])) for place in kept.places)
    x, y = map(float, kept.reference)
    return Repair(kept.kind.lower(), kept.frame, places, kept.radius, kept.amount, (x, y) if x >= 0 else None)


def add_repairs(settings: bpy.types.PropertyGroup, repairs: Sequence[Repair]) -> None:
    """Add repairs after those that are there; the last one becomes the active one."""
    group = settings.repairs
    for each in repairs:
        kept = group.items.add()
        kept.name = KINDS[each.kind]
        kept.kind, kept.frame = each.kind.upper(), each.frame
        kept.radius, kept.amount = each.radius, each.amount
        if each.reference is not None:
            kept.reference = each.reference
        for place in each.places:
            kept.places.add().xy = place
    group.active = max(len(group.items) - 1, 0)
    changed(group)


CLASSES = (VirtualApertureRepair, VirtualApertureRepairs)
