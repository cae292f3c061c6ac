"""The view of HDR clips on ordinary displays: a curve of Blender's own color management, before its view.

Blender applies it to pictures that it shows or writes in 8 bits, such as PNG. EXR holds the light itself.
"""

import contextlib

import bpy
import numpy as np

from ...core.base.arrays import LinearRGBA
from ...core.base.errors import UserError
from ...core.media.tone_mapping import PEAK, WHITE, tone_mapped
from .shot import shot_of

HDR = ("Rec.2100-HLG", "Rec.2100-PQ")
"""Color spaces of clips that hold light above white by their standard."""
STEPS = 48
"""Points of the curve, evenly in the cube root of light: 8 bits are right within 0.2."""
SAME = 1e-4
"""Largest difference of a point that Blender keeps as a float."""


LEAST = 0.005
"""Least share of pixels that is named, half a percent: less is not seen in its whole number."""
WAYS_OUT = "write OpenEXR or an HDR movie, or choose a view that maps them, such as AgX"


def set_view(scene: bpy.types.Scene, space: str) -> None:
    """Give a scene the curve for a clip of an HDR color space, or take ours away; the user's own stays."""
    view = scene.view_settings
    if has_curve(view) and space not in HDR:
        view.use_curve_mapping = False
        _fill(view.curve_mapping, [(0.0, 0.0), (1.0, 1.0)])
    elif space in HDR and not view.use_curve_mapping and scene.display_settings.display_device == "sRGB":
        view.use_curve_mapping = True
        _fill(view.curve_mapping, _points())


def follow(scene: bpy.types.Scene) -> None:
    """Set the view for the scene's clip, where it has one that can be opened."""
    with contextlib.suppress(UserError):
        space = shot_of(scene).space
        set_view(scene, space.name if space is not None else "")


def has_curve(view: bpy.types.ColorManagedViewSettings) -> bool:
    """Return whether a view has our curve."""
    if not view.use_curve_mapping:
        return False
    for curve in view.curve_mapping.curves[:3]:
        found = np.array([point.location[:] for point in curve.points])
        if found.shape != (STEPS, 2) or np.abs(found - _points()).max() > SAME:
            return False
    return True


def lost(scene: bpy.types.Scene, space: str, light: LinearRGBA) -> float:
    """Return the share of pixels (h, w, 4) of a clip that the view cuts off at white, before the compositor.

    Args:
        scene: The scene, whose view may map them: all views but Standard and Raw do.
        space: The clip's color space; 0 is returned where it is not of `HDR`.
        light: The pixels' linear light.
    """
    view = scene.view_settings
    is_kept = scene.render.image_settings.file_format in ("OPEN_EXR", "OPEN_EXR_MULTILAYER", "HDR")
    is_kept |= scene.display_settings.display_device in HDR
    is_mapped = view.use_curve_mapping or view.view_transform not in ("Standard", "Raw")
    if space not in HDR or is_kept or is_mapped:
        return 0.0
    share = float(np.mean(light[..., :3].max(axis=2) * 2**view.exposure > 1))
    return share if share >= LEAST else 0.0


def _points() -> list[tuple[float, float]]:
    light = np.linspace(0, (PEAK / WHITE) ** (1 / 3), STEPS) ** 3
    return [(x, y) for x, y in zip(light.tolist(), tone_mapped(light).tolist(), strict=True)]


def _fill(mapping: bpy.types.CurveMapping, points: list[tuple[float, float]]) -> None:
    """Replace the points of red, green and blue: Blender evaluates the combined curve up to 1 only."""
    mapping.use_clip, mapping.extend = False, "HORIZONTAL" if len(points) > 2 else "EXTRAPOLATED"
    for curve in mapping.curves[:3]:
        while len(curve.points) > 2:
            curve.points.remove(curve.points[1])
        curve.points[0].location, curve.points[1].location = points[0], points[-1]
        for x, y in points[1:-1]:
            curve.points.new(x, y)
        for point in curve.points:
            point.handle_type = "VECTOR"
    mapping.update()
