"""How a view from a place on the aperture is brought into register with the focal plane."""

import numpy as np

from ..base.arrays import Floats
from ..camera.canvas import Canvas


def exact_registration(canvas: Canvas, offsets: Floats, inverse_depth: float) -> Floats:
    """Return the shears (N, 2, 3) that bring a plane of an inverse depth into register for offsets (N, 2).

    A point moves by -f (dx, dy) / z when the camera moves by (dx, dy) in scene units; the shear adds the
    focal plane's motion back, which in Blender is `shift_x`, `shift_y`.
    """
    registration = np.zeros((len(offsets), 2, 3))
    registration[:, 0, 0] = registration[:, 1, 1] = 1.0
    registration[:, :, 2] = canvas.pinhole.focal * offsets * inverse_depth
    return registration
