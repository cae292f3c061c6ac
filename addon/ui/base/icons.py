"""Icons of panels that are made of pixels."""

from collections.abc import Callable
from typing import Any

import bpy
import bpy.utils.previews
import numpy as np

MOST = 64
"""Icons of a kind that are kept: dragging a slider makes one at each step."""


class Icons:
    """Icons of one kind by name; none without a window, as nobody sees them."""

    def __init__(self, side: int) -> None:
        """Prepare for icons of `side` pixels; a panel shows them half as large."""
        self._side = side
        self.kept: Any = None

    def icon(self, name: str, pixels: Callable[[], np.ndarray]) -> int:
        """Return the icon of a name, which is made once; 0 without a window.

        Args:
            name: Name of the icon.
            pixels: Returns its pixels (side, side, 4), display values, top row first.
        """
        if bpy.app.background:
            return 0
        if self.kept is None:
            self.kept = bpy.utils.previews.new()
        if name not in self.kept:
            while len(self.kept) >= MOST:
                del self.kept[next(iter(self.kept))]
            preview = self.kept.new(name)
            preview.image_size = (self._side, self._side)
            # Blender's icons begin with the bottom row.
            preview.image_pixels_float.foreach_set(pixels()[::-1].ravel())
        return int(self.kept[name].icon_id)

    def forget(self) -> None:
        """Forget all of them."""
        if self.kept is not None:
            bpy.utils.previews.remove(self.kept)
            self.kept = None
