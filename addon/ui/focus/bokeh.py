"""Pictures of apertures as icons: a point of light out of focus, in panels and beside presets."""

import ast
from functools import lru_cache
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...core.base.errors import UserError
from ...core.frame.options import APERTURE_OPTIONS
from ...core.media.light import encode_srgb
from ...core.optics.aperture import Aperture
from ...core.optics.bokeh import bokeh_picture
from ...scene.lens.aperture_shape import aperture_image
from ..base.icons import MOST, Icons

SIDE = 128
"""Pixels of an icon: a panel shows it half as large."""
ICONS = Icons(SIDE)


def icon(aperture: Aperture) -> int:
    """Return the icon of an aperture, 0 where nobody sees it; made in some 10 ms, once."""
    return ICONS.icon(repr(aperture), lambda: pixels(aperture))


def pixels(aperture: Aperture) -> np.ndarray:
    """Return (SIDE, SIDE, 4) display values, top row first."""
    made = np.ones((SIDE, SIDE, 4), np.float32)
    made[..., :3] = encode_srgb(bokeh_picture(aperture, SIDE))
    return made


def preset_icon(file: Path) -> int:
    """Return the icon of a preset's aperture; 0 if the preset has none."""
    try:
        return icon(preset_aperture(file))
    except (OSError, ValueError, TypeError, SyntaxError, UserError):
        # A user may have written the preset; using it shows the error.
        return 0


def preset_aperture(file: Path) -> Aperture:
    """Return the aperture that a preset sets; errors as of `read_preset`, and TypeError and UserError."""
    shape = read_preset(file)["shape"]
    image = aperture_image(Path(bpy.path.abspath(shape["image"]))) if shape.get("image") else None
    return Aperture(**{name: shape[name] for name in APERTURE_OPTIONS if name in shape}, image=image)


def read_preset(file: Path) -> dict[str, dict[str, Any]]:
    """Return the values that a preset sets, by name in `shape` and in `settings`; it is read and not run.

    Raises:
        OSError: The file cannot be read.
        SyntaxError: It is not Python.
        ValueError: It has a value that is not written out.
    """
    return _read(file, file.stat().st_mtime_ns)


@lru_cache(maxsize=MOST)
def _read(file: Path, _written: int) -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, Any]] = {"shape": {}, "settings": {}}
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and isinstance(target := node.targets[0], ast.Attribute):
            owner = ast.unparse(target.value).rpartition(".")[2]
            found["shape" if owner == "shape" else "settings"][target.attr] = ast.literal_eval(node.value)
    return found
