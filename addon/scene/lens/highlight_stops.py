"""Brightness of restored highlights in a photographer's unit: stops over the estimate."""

from __future__ import annotations

import bpy
import numpy as np

LEAST, MOST = -4.0, 9.0
"""Stops: from a sixteenth of the estimate, which is seen no more, to half of `MOST_GAIN`."""


def boost(settings: bpy.types.PropertyGroup) -> float:
    """Return the stops by which highlights are brighter than estimated; 0 if they are not restored."""
    gain = settings.highlights
    return float(np.clip(np.log2(gain), LEAST, MOST)) if gain > 0 else 0.0


def are_restored(settings: bpy.types.PropertyGroup) -> bool:
    """Return whether clipped highlights are restored."""
    return bool(settings.highlights > 0)


def restore(settings: bpy.types.PropertyGroup, on: bool) -> None:
    """Restore highlights as estimated, or leave the clip as it is."""
    if on != are_restored(settings):
        settings.highlights = 1.0 if on else 0.0
