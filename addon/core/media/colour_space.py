"""Colour spaces of clips: from values as they are stored to scene-linear light.

A camera's space is a curve for each channel and a matrix of its primaries; Rec.2100-HLG has a system gamma of
the luminance between them (ITU-R BT.2100-3, table 5). Which curve and which matrix is not written down here:
Blender's own colour configuration is asked (`scene/sources/colour_space.py`).
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import UserError
from .light import decode_srgb
from .picture_file import Pixels

SRGB = ""
"""Colour space of a clip without other tags: Rec.709 primaries, decoded as sRGB, as in Blender."""
_TRANSFERS = {16: "Rec.2100-PQ", 18: "Rec.2100-HLG"}
"""Names in Blender's configuration by the code of transfer characteristics (ITU-T H.273, table 3)."""
_PRIMARIES = {9: "Rec.2020", 12: "Display P3"}
"""The same by the code of colour primaries (ITU-T H.273, table 2), where the transfer is none of those."""
LUMINANCE = 0.2627, 0.6780, 0.0593
"""Weights of Y; those of BT.2020, whose primaries HLG has."""
TOP = 65535
"""Largest stored value of 16 bits, to which a curve reaches."""


def of_tags(transfer: int, primaries: int) -> str:
    """Return Blender's name of a video's colour space by its tags (ITU-T H.273).

    It is `SRGB` for usual or missing tags, as most clips in a camera's log have.
    """
    return _TRANSFERS.get(transfer, _PRIMARIES.get(primaries, SRGB))


@dataclass(frozen=True)
class ColourSpace:
    """The conversion from stored values to linear light of Blender's working space.

    With E = curve(stored) for each channel, light = matrix (E Y^(system_gamma - 1)), where Y = `LUMINANCE` E.
    """

    name: str
    """In Blender's colour configuration."""
    curve: NDArray[np.float32]
    """(65536,) linear light of the space's own primaries, for every stored value of 16 bits."""
    matrix: Floats
    """(3, 3) from the space's own primaries to those of the working space."""
    system_gamma: float = 1.0
    """1 but for HLG."""
    is_tagged: bool = False
    """Whether it is from the tags of the clip's files: the curve is of floats in them, too."""

    @property
    def is_linear(self) -> bool:
        """Return whether stored values are light already, of other primaries."""
        line = np.linspace(self.curve[0], self.curve[-1], len(self.curve))
        return bool(np.abs(self.curve - line).max() <= 1e-4 * np.abs(self.curve).max())

    def _of_floats(self, stored: Pixels) -> NDArray[np.float32]:
        """Light of stored floats, also above 1: Blender saves bright pictures as EXR files in sRGB."""
        line = np.linspace(0, 1, TOP + 1)
        if np.allclose(self.curve, decode_srgb(line), atol=1e-4):
            return np.asarray(decode_srgb(np.asarray(stored, np.float32)), np.float32)
        light = np.interp(stored, line, self.curve)
        # Above 1, gammas are exact and other curves go on as they rise in their upper half.
        power = np.log(self.curve[-1] / self.curve[TOP // 2]) / np.log(TOP / (TOP // 2))
        return np.asarray(light * np.maximum(stored, 1) ** power, np.float32)

    def to_light(self, stored: Pixels) -> NDArray[np.float32]:
        """Return stored values (H, W, 3 or 4) in linear light, with premultiplied alpha.

        Colours outside of the working space's gamut are below 0.

        Raises:
            UserError: Floats, which EXR holds and which are light already, in a space that is not linear.
        """
        colour = stored[..., :3]
        if stored.dtype == np.float32:
            if self.is_linear:
                light = colour * np.float32(self.curve[-1])
            elif self.is_tagged:
                light = self._of_floats(colour)
            else:
                raise UserError(
                    f"the clip's pictures hold linear light, which is not {self.name}; choose a linear color"
                    " space, or none"
                )
        elif stored.dtype == np.uint8:
            light = self.curve[257 * np.arange(256)][colour]
        else:
            light = self.curve[colour]
        if self.system_gamma != 1:
            y = cv2.transform(light, np.array([LUMINANCE], np.float32))
            light = light * np.maximum(y, 1e-9).reshape(*y.shape[:2], 1) ** np.float32(self.system_gamma - 1)
        light = np.asarray(cv2.transform(light, self.matrix.astype(np.float32)), np.float32)
        if stored.shape[2] == 3:
            return light
        alpha = stored[..., 3:].astype(np.float32)
        if stored.dtype != np.float32:
            alpha /= 255 if stored.dtype == np.uint8 else TOP
            light *= alpha
        return np.concatenate([light, alpha], axis=2)
