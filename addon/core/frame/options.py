"""All options of a frame by their names in .blend files, command line and presets."""

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
"""Options of a frame on the same level."""
GONE = {"grid": "features", "edges": "features"}
"""Methods of version 1.0, and the one most like each."""
FRAME_OPTIONS["method"] = replace(FRAME_OPTIONS["method"], choices=MESHERS, words=GONE)
APERTURE_OPTIONS: dict[str, Option] = options_of(Aperture)
"""Options of the aperture's shape, in a group of their own."""


def frame_values(values: dict[str, Any]) -> dict[str, Any]:
    """Make arguments of `FrameOptions` from values by `FRAME_OPTIONS`' names, choices as identifiers."""
    own = {name: FRAME_OPTIONS[name].chosen(values[name]) for name in options_of(FrameOptions)}
    light = {field: values[each.name] for field, each in options_of(HighlightSettings).items()}
    return {**own, "highlights": HighlightSettings(**light)}


def check_options(options: FrameOptions) -> None:
    """Raise UserError for options outside their bounds and for an unknown method."""
    check(options)
    check(options.highlights)
    FRAME_OPTIONS["method"].check(options.method)
