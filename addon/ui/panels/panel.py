"""Common code of the panels of the sidebar."""

from typing import Any

import bpy

from ...scene.base import version
from ..base.operators import label_of

PRIMARY = 1.4
"""Height of the button that a panel is about."""


class Panel:
    """A panel in the sidebar of the 3D viewport, labelled by its name unless it has another label."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Virtual Aperture"

    def __init_subclass__(cls: Any) -> None:
        super().__init_subclass__()
        cls.bl_label = vars(cls).get("bl_label") or label_of(cls)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene is not of a newer version, whose settings may have another meaning."""
        return not version.is_newer(context.scene.virtual_aperture)


def split(layout: bpy.types.UILayout, with_keys: bool = False) -> bpy.types.UILayout:
    """Return a panel's layout with names beside properties, and `with_keys` the buttons that key them."""
    layout.use_property_split = True
    layout.use_property_decorate = with_keys
    return layout


class ClosedPanel(Panel):
    """One that is not for everybody: closed to begin with."""

    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012
