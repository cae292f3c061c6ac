"""The amount of blur in the panels: the stored number, and its results as a text."""

import bpy

from ...scene.lens import lens, scale
from ..base.operators import Edits, has_focus, may_change, polls
from ..base.text import wrapped
from . import lens_presets

FIELDS = {"BLUR": "blur_percent", "F_STOP": "f_stop", "RADIUS": "aperture_radius"}
"""The setting by each of which the amount of blur can be stored."""
KINDS = (
    ("BLUR", "Blur", "Store the blur as a share of the picture's width"),
    ("F_STOP", "F-Stop", "Store the aperture as an f-stop"),
    ("RADIUS", "Radius", "Store the aperture as its radius in scene units"),
)
FASTEST = 0.5
"""Least f-stop of a lens in air: light then comes from a whole half space."""


class VIRTUAL_APERTURE_OT_set_amount_by(Edits, bpy.types.Operator):  # noqa: N801
    """Choose the number that stays when focus, frame and solve change. The picture stays"""

    bl_label = "Set Blur By"

    kind: bpy.props.EnumProperty(name="Kind", items=KINDS)

    poll = polls(may_change, has_focus)

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        return next(text for kind, _, text in KINDS if kind == properties.kind)

    def act(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        if self.kind == "BLUR":
            settings.blur = lens.blur_of_radius(settings)
        else:
            setattr(settings, FIELDS[self.kind], getattr(settings, FIELDS[self.kind]))


def stored_by(settings: bpy.types.PropertyGroup) -> str:
    """Return the one of `KINDS` by which the amount of blur is stored."""
    if not lens.has_radius(settings):
        return "BLUR"
    return "F_STOP" if settings.by_f_stop else "RADIUS"


def amount_words(settings: bpy.types.PropertyGroup) -> str:
    """Return the stored amount of blur as a text, with the f-stop where the scale is known."""
    stop = _stop_words(settings) if scale.known_scale(settings) > 0 else ""
    stored = f"{settings.blur_percent:.2g} %" if stored_by(settings) == "BLUR" else ""
    return "  ".join(filter(None, (stored, stop))) or f"radius {settings.aperture_radius:.3g}"


def _stop_words(settings: bpy.types.PropertyGroup) -> str:
    return f"f/{settings.f_stop:.2g}" + " (guess)" * (not settings.metres_per_unit > 0)


def draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the stored number and its results; with a known scale, also the choice of another number."""
    settings = context.scene.virtual_aperture
    kind, is_guess = stored_by(settings), not settings.metres_per_unit > 0
    stop = "F-Stop (guess)" if is_guess else "F-Stop"
    if scale.known_scale(settings) > 0 or kind != "BLUR":
        draw_kinds(layout, kind)
    row = layout.row(align=True)
    # Whole names are cut off in a sidebar of the default width.
    row.prop(settings, FIELDS[kind], text=stop if kind == "F_STOP" else kind.title())
    lens_presets.VIRTUAL_APERTURE_PT_lens_presets.draw_panel_header(row)
    results = [] if kind == "BLUR" else [f"background blur {settings.blur_percent:.3g} % here"]
    if kind != "F_STOP" and scale.known_scale(settings) > 0:
        results.append(_stop_words(settings))
        results += ["faster than any lens"] if settings.f_stop < FASTEST else []
    if results:
        wrapped(layout, context, f"Gives {', '.join(results)}")


def draw_kinds(layout: bpy.types.UILayout, kind: str) -> None:
    """Draw a button for each number that can be stored."""
    row = layout.row(align=True)
    for each, label, _ in KINDS:
        button = row.operator(VIRTUAL_APERTURE_OT_set_amount_by.bl_idname, text=label, depress=each == kind)
        button.kind = each
