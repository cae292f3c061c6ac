"""Colour spaces of clips: from values as they are stored to scene-linear light.

A camera's space is a curve for each channel and a matrix of its primaries; Rec.2100-HLG has a system gamma of
the luminance between them (ITU-R BT.2100-3, table 5). Which curve and which matrix is not written down here:
Blender's own colour configuration is asked (`scene/colour_space.py`).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import UserError
from .picture_file import Pixels

SRGB = ""
"""What a clip without other tags is taken for: Rec.709 primaries, decoded as sRGB, as Blender does it."""
_TRANSFERS = {16: "Rec.2100-PQ", 18: "Rec.2100-HLG"}
"""Names in Blender's configuration by the code of transfer characteristics (ITU-T H.273, table 3)."""
_PRIMARIES = {9: "Rec.2020", 12: "Display P3"}
"""The same by the code of colour primaries (ITU-T H.273, table 2), where the transfer is none of those."""
TOP = 65535
"""Largest stored value of 16 bits, to which a curve reaches."""


def of_tags(transfer: int, primaries: int) -> str:
    """The name in Blender's configuration of a video's colour space by its tags (ITU-T H.273); `SRGB` for
    what is usual or untagged, as clips in a camera's log mostly are."""
    return _TRANSFERS.get(transfer, _PRIMARIES.get(primaries, SRGB))


@dataclass(frozen=True)
class ColourSpace:
    """How stored values become linear light of Blender's working space: with E = curve(stored) for each
    channel, light = matrix (E Y^(system_gamma - 1)), where Y = luminance E."""

    name: str
    """In Blender's colour configuration."""
    curve: NDArray[np.float32]
    """(65536,) linear light of the space's own primaries, for every stored value of 16 bits."""
    matrix: Floats
    """(3, 3) from the space's own primaries to those of the working space."""
    system_gamma: float = 1.0
    """1 but for HLG."""
    luminance: tuple[float, float, float] = (0.2627, 0.6780, 0.0593)
    """Weights of Y; those of BT.2020, whose primaries HLG has."""

    @property
    def is_linear(self) -> bool:
        """Whether stored values are light already, of other primaries."""
        line = np.linspace(self.curve[0], self.curve[-1], len(self.curve))
        return bool(np.abs(self.curve - line).max() <= 1e-4 * np.abs(self.curve).max())

    def to_light(self, stored: Pixels) -> NDArray[np.float32]:
        """(H, W, 3 or 4) as stored -> the same in linear light, alpha premultiplied; below 0 where a colour
        lies outside of the working space's gamut.

        UserError for floats, which EXR holds and which are light already, in a space that is not linear.
        """
        colour = stored[..., :3]
        if stored.dtype == np.float32:
            if not self.is_linear:
                raise UserError(
                    f"the clip's pictures hold linear light, which is not {self.name}; choose a linear color"
                    " space, or none"
                )
            light = colour * np.float32(self.curve[-1])
        elif stored.dtype == np.uint8:
            light = self.curve[257 * np.arange(256)][colour]
        else:
            light = self.curve[colour]
        if self.system_gamma != 1:
            y = cv2.transform(light, np.array([self.luminance], np.float32))
            light = light * np.maximum(y, 1e-9).reshape(*y.shape[:2], 1) ** np.float32(self.system_gamma - 1)
        light = np.asarray(cv2.transform(light, self.matrix.astype(np.float32)), np.float32)
        if stored.shape[2] == 3:
            return light
        alpha = stored[..., 3:].astype(np.float32)
        if stored.dtype != np.float32:
            alpha /= 255 if stored.dtype == np.uint8 else TOP
            light *= alpha
        return np.concatenate([light, alpha], axis=2)
