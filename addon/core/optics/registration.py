"""How a view from a place on the aperture is brought into register with the focal plane."""

from __future__ import annotations

import numpy as np

from ..base.arrays import Floats
from ..camera.canvas import Canvas


def exact_registration(canvas: Canvas, offsets: Floats, inverse_depth: float) -> Floats:
    """(N, 2, 3) shears that bring the plane 1/inverse_depth into register, for offsets (N, 2) in scene units.

    A point moves by -f (dx, dy) / z when the camera moves by (dx, dy); the shear adds the focal plane's
    share back, which in Blender is `shift_x`, `shift_y`.
    """
    registration = np.zeros((len(offsets), 2, 3))
    registration[:, 0, 0] = registration[:, 1, 1] = 1.0
    registration[:, :, 2] = canvas.pinhole.focal * offsets * inverse_depth
    return registration
