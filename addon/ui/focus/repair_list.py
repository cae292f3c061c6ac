"""The brush and the list of repairs of the depth."""

import bpy

from ...core.frame.repairs import KINDS
from ..picking import paint_repair


class VIRTUAL_APERTURE_UL_repairs(bpy.types.UIList):  # noqa: N801
    """Kind and frame of each repair."""

    def draw_item(
        self, _context: bpy.types.Context, layout: bpy.types.UILayout, _data: object,
        repair: bpy.types.PropertyGroup, _icon: int, _active_data: object, _active: str, index: int = 0,
    ) -> None:  # fmt: skip
        row = layout.split(factor=0.65)
        row.label(text=KINDS[repair.kind.lower()], icon="BRUSH_DATA")
        row.label(text=f"frame {repair.frame}")


def draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the brush, its operator, and the list of repairs."""
    group = context.scene.virtual_aperture.repairs
    layout.prop(group, "kind")
    layout.prop(group, "radius")
    amount = layout.row()
    amount.active = group.kind in {"NEARER", "FARTHER"}
    amount.prop(group, "amount")
    layout.operator(paint_repair.VIRTUAL_APERTURE_OT_paint_repair.bl_idname, icon="BRUSH_DATA")
    if len(group.items):
        row = layout.row()
        row.template_list(
            "VIRTUAL_APERTURE_UL_repairs", "", group, "items", group, "active",
            rows=max(2, min(len(group.items), 5)),
        )  # fmt: skip
        remove = paint_repair.VIRTUAL_APERTURE_OT_remove_repair.bl_idname
        row.operator(remove, text="", icon="REMOVE")
