"""Pictures of apertures as icons: a point of light out of focus, in panels and beside presets."""

import ast
from functools import lru_cache
from pathlib import Path
from typing import Any

import bpy
import bpy.utils.previews
import numpy as np

from ...core.base.errors import UserError
from ...core.frame.options import APERTURE_OPTIONS
from ...core.media.light import encode_srgb
from ...core.optics.aperture import Aperture
from ...core.optics.bokeh import bokeh_picture
from ...scene.lens.aperture_shape import aperture_image

SIDE = 128
"""Pixels of an icon: a panel shows it half as large."""
MOST = 64
"""Icons that are kept: dragging a slider makes one at each step."""
_previews: Any = None


def icon(aperture: Aperture) -> int:
    """Return the icon of an aperture, 0 where nobody sees it; made in some 10 ms, once."""
    if _previews is None:
        return 0
    key = repr(aperture)
    if key not in _previews:
        while len(_previews) >= MOST:
            del _previews[next(iter(_previews))]
        preview = _previews.new(key)
        preview.image_size = (SIDE, SIDE)
        preview.image_pixels_float.foreach_set(pixels(aperture))
    return int(_previews[key].icon_id)


def pixels(aperture: Aperture) -> Any:
    """Return SIDE * SIDE * 4 display values, bottom row first."""
    made = np.ones((SIDE, SIDE, 4), np.float32)
    made[..., :3] = encode_srgb(bokeh_picture(aperture, SIDE))[::-1]
    return made.ravel()


def preset_icon(file: Path) -> int:
    """Return the icon of a preset's aperture; 0 if the preset has none."""
    try:
        return icon(preset_aperture(file))
    except (OSError, ValueError, TypeError, SyntaxError, UserError):
        # A user may have written the preset; using it shows the error.
        return 0


def preset_aperture(file: Path) -> Aperture:
    """Return the aperture that a preset sets, which is read and not run.

    Raises OSError, SyntaxError, ValueError, TypeError and UserError for a file that is none.
    """
    return _read(file, file.stat().st_mtime_ns)


@lru_cache(maxsize=MOST)
def _read(file: Path, _written: int) -> Aperture:
    shape: dict[str, Any] = {}
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign):
            owner, _, name = ast.unparse(node.targets[0]).rpartition(".")
            if owner in ("shape", "settings.shape"):
                shape[name] = ast.literal_eval(node.value)
    image = aperture_image(Path(bpy.path.abspath(shape["image"]))) if shape.get("image") else None
    return Aperture(**{name: shape[name] for name in APERTURE_OPTIONS if name in shape}, image=image)


def register() -> None:
    """Without a window nobody sees them."""
    global _previews
    if not bpy.app.background:
        _previews = bpy.utils.previews.new()


def unregister() -> None:
    """Undo `register`."""
    global _previews
    if _previews is not None:
        bpy.utils.previews.remove(_previews)
        _previews = None
