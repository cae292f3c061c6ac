"""Lenses and looks as Blender's presets: the aperture's shape and highlights, never the focus.

The f-stop of a preset counts where the aperture was set by its f-stop.
Shipped ones lie in `presets/virtual_aperture/lens`, a user's own in the folder of Blender's presets.
"""

import re
from pathlib import Path

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel

from ...core.base.errors import UserError
from ...core.frame.options import APERTURE_OPTIONS
from ...scene.base.paths import absolute
from ..base.operators import Acts, Named, may_change, polls
from . import bokeh

ROOT = Path(__file__).resolve().parents[2]
"""Holds the folder `presets`."""
WIDE = 13
"""Width of the popover in Blender's units of 20 pixels: the longest name of a preset is complete."""
THUMBNAIL = 1.6
"""Rows that a preset is high. Chosen by inspection."""


class VIRTUAL_APERTURE_OT_use_lens_preset(Acts, bpy.types.Operator):  # noqa: N801
    """Set the aperture shape and highlights to this preset, and the f-stop if one is set"""

    bl_label = "Use Lens Preset"
    # Blender's own operator for presets cannot be undone.
    bl_options = {"UNDO"}  # noqa: RUF012

    filepath: bpy.props.StringProperty(name="Preset", subtype="FILE_PATH", options={"SKIP_SAVE"})

    poll = polls(may_change)

    def act(self, context: bpy.types.Context) -> str:
        if not self.filepath:
            raise UserError("no preset has been chosen")
        name = bpy.path.display_name(self.filepath, title_case=False)
        settings = context.scene.virtual_aperture
        kept = ("highlights", "f_stop") if settings.by_f_stop else ("highlights",)
        try:
            preset = bokeh.read_preset(Path(self.filepath))
            for key in (*APERTURE_OPTIONS, "image"):
                # Unsetting the whole group frees memory that others refer to.
                settings.shape.property_unset(key)
            for key, value in preset["shape"].items():
                setattr(settings.shape, key, value)
            for key in kept:
                if key in preset["settings"]:
                    setattr(settings, key, preset["settings"][key])
        except (OSError, SyntaxError, ValueError, TypeError, AttributeError, UserError) as error:
            # A user may have written it.
            raise UserError(f"the preset {name} cannot be used: {error}") from error
        return f"Lens preset: {name}"


class VIRTUAL_APERTURE_OT_add_lens_preset(Named, AddPresetBase, bpy.types.Operator):  # noqa: N801
    """Save the aperture shape, highlights and f-stop as a preset, or remove a saved one"""

    bl_label = "Add Lens Preset"
    preset_menu = "VIRTUAL_APERTURE_PT_lens_presets"
    preset_subdir = "virtual_aperture/lens"

    def add(self, context: bpy.types.Context, filepath: str) -> None:
        """Write a preset, as Blender does, but with a path that is right in any other .blend."""
        settings = context.scene.virtual_aperture
        image = str(absolute(settings.shape.image, context.scene)) if settings.shape.image else ""
        lines = [
            "import bpy",
            "settings = bpy.context.scene.virtual_aperture",
            *(f"settings.shape.{name} = {getattr(settings.shape, name)!r}" for name in APERTURE_OPTIONS),
            f"settings.shape.image = {image!r}",
            *(f"settings.{name} = {getattr(settings, name)!r}" for name in ("highlights", "f_stop")),
        ]
        Path(filepath).write_text("\n".join(lines) + "\n", encoding="utf-8")


class VIRTUAL_APERTURE_PT_lens_presets(PresetPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Lens Presets"
    bl_ui_units_x = WIDE
    preset_subdir = VIRTUAL_APERTURE_OT_add_lens_preset.preset_subdir
    preset_operator = VIRTUAL_APERTURE_OT_use_lens_preset.bl_idname
    preset_add_operator = VIRTUAL_APERTURE_OT_add_lens_preset.bl_idname

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw presets like Blender, with the picture of each aperture."""
        layout = self.layout
        layout.emboss = "PULLDOWN_MENU"
        layout.operator_context = "EXEC_DEFAULT"
        column = layout.column(align=True)
        for file in sorted(preset_files(), key=lambda file: _by_number(file.name)):
            name = bpy.path.display_name(str(file), title_case=False)
            row = column.row(align=True)
            row.template_icon(icon_value=bokeh.preset_icon(file), scale=THUMBNAIL)
            sub = row.row(align=True)
            sub.scale_y = THUMBNAIL
            sub.operator(
                VIRTUAL_APERTURE_OT_use_lens_preset.bl_idname, text=name, translate=False
            ).filepath = str(file)
            if ROOT not in file.parents:
                remove = sub.operator(VIRTUAL_APERTURE_OT_add_lens_preset.bl_idname, text="", icon="REMOVE")
                remove.name, remove.remove_name = name, True
        layout.separator()
        row = layout.row()
        name_field = row.row()
        name_field.emboss = "NORMAL"
        manager = bpy.context.window_manager
        name_field.prop(manager, "preset_name", text="")
        row.operator(
            VIRTUAL_APERTURE_OT_add_lens_preset.bl_idname, text="", icon="ADD"
        ).name = manager.preset_name


def preset_files() -> list[Path]:
    """List the files of the presets of the lens: the extension's, then the user's, without hidden ones."""
    folders = map(Path, bpy.utils.preset_paths(VIRTUAL_APERTURE_PT_lens_presets.preset_subdir))
    return [file for folder in folders for file in folder.glob("*.py") if not file.name.startswith(".")]


def _by_number(name: str) -> list[tuple[int, str]]:
    """A key by which 85 mm comes before 100 mm."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name.lower())]
