"""All options of a frame by name: as .blend files, the command line and presets call them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ..base.options import Option, check, options_of
from ..optics.aperture import Aperture
from .highlights import HighlightSettings
from .meshers import MESHERS
from .plan import FrameOptions

FRAME_OPTIONS: dict[str, Option] = {
    **{name: replace(each, name=name) for name, each in options_of(FrameOptions).items()},
    **{each.name: each for each in options_of(HighlightSettings).values()},
}
"""Options of a frame that stand beside each other."""
FRAME_OPTIONS["method"] = replace(FRAME_OPTIONS["method"], choices=MESHERS)
APERTURE_OPTIONS: dict[str, Option] = options_of(Aperture)
"""Options of the aperture's shape, which stand in a group of their own."""


def frame_values(values: dict[str, Any]) -> dict[str, Any]:
    """Arguments of `FrameOptions` from values by the names of `FRAME_OPTIONS`, choices as identifiers."""
    own = {name: FRAME_OPTIONS[name].chosen(values[name]) for name in options_of(FrameOptions)}
    light = {field: values[each.name] for field, each in options_of(HighlightSettings).items()}
    return {**own, "highlights": HighlightSettings(**light)}


def check_options(options: FrameOptions) -> None:
    """UserError for options that are beyond their bounds, and a method that does not exist."""
    check(options)
    check(options.highlights)
    FRAME_OPTIONS["method"].check(options.method)
