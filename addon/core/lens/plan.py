"""The plan of one frame: its warp mesh and the views of the virtual cameras. Rendering only follows it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..camera.canvas import Canvas
from ..camera.reconstruction import Floats
from ..warp.mesh import WarpMesh
from .aperture import Aperture
from .focus import Focus
from .highlights import RESTORED, HighlightSettings
from .quality import NORMAL, Quality
from .thin_lens import ThinLens


@dataclass(frozen=True)
class LensSettings:
    """What the user asks of the lens."""

    focus: Focus
    radius: float
    """Radius of the virtual aperture in scene units."""
    views: int = 0
    """Number of virtual cameras; 0 takes as many as the largest blur disc of the frame needs."""
    method: str = "layers"
    """Name of the mesher, a key of `meshers.MESHERS`."""
    seed: int = 0
    """Of the random positions of the thesis's method."""
    borrow: bool = True
    """What a frame does not show is taken from the frames that do."""
    error: float = 0.0
    """PSNR in dB that a frame is to have against one of infinitely many views, which takes the place of the
    number of views; 0 leaves that as it is."""
    aperture: Aperture = field(default_factory=Aperture)
    """Its shape."""
    highlights: HighlightSettings = RESTORED
    """How bright what is clipped becomes."""
    quality: Quality = NORMAL
    """What the frame may cost; a number of views, or an error, is kept to whatever it says of views."""


@dataclass(frozen=True)
class FramePlan:
    """Everything that the renderer needs besides the texture of the mesh."""

    frame: int
    canvas: Canvas
    lens: ThinLens
    mesh: WarpMesh
    """Its inverse depths are `lens.untilted`."""
    offsets: Floats
    """(N, 2) virtual camera positions in scene units along the actual camera's x (right) and y (down), as
    `ThinLens.sheared_positions`."""
    registration: Floats
    """(N, 2, 3) maps from pixels of a synthesized view to pixels in register with the focal plane."""
    blur: float
    """Diameter of the frame's largest blur disc in pixels: 99 % of its pixels (or samples) are smaller."""
    pose_interpolated: bool
    """Whether the frame was not registered; its camera comes from its neighbours."""
    weights: Floats | None = None
    """(N,) share of the aperture's light that each view has; None where all have the same."""
    spread: float = 1.0
    """Radius of a disc as large as the open part of the aperture, in shares of the aperture's."""
    vignetting: float = 0.0
    """As of `Aperture`."""

    def displace(self, xy: Floats, inverse_depth: Floats) -> Floats:
        """(N, V, 2) where the views see vertices (V, 2) of inverse depth (V,), after registration."""
        moved = xy - (self.canvas.pinhole.focal * self.offsets)[:, None, :] * inverse_depth[:, None]
        turned = np.einsum("nij,nvj->nvi", self.registration[:, :, :2], moved)
        return np.asarray(turned + self.registration[:, None, :, 2])
