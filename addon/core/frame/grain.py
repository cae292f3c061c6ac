"""Grain: noise like the clip's, where blur has averaged it away.

Without it, defocused areas look pasted in beside sharp ones. The blur disc and the noise's spectrum give the
remaining noise. It is painted on the frame's own layers and drawn by its own views, so that silhouettes are
right.
"""

from dataclasses import replace

import cv2
import numpy as np

from ..base.arrays import LinearRGB, LinearRGBA, Map
from ..camera.canvas import Canvas
from ..media.light import decode_srgb, encode_srgb
from ..media.noise import AXES, Noise
from ..warp.layer import Layer
from .detail import VIEWS, painted
from .frame import Frame
from .inspection import fewer_views

LEAST = 1e-3
"""Negligible share: resampling for a lens with distortion rings by as much."""
TRANSPARENT = np.float32(1e-6)
"""Least alpha in divisions."""


def lost_frame(frame: Frame, noise: Noise, scale: float = 1.0) -> Frame:
    """Paint a frame's layers with the noise that blur removes, for fewer views of half the size.

    The mean of the views has in red, green and blue the removed share of each noise component's standard
    deviation: exactly 0 where all is in focus, 1 on CG objects. `scale` is the size of the final picture
    relative to the drawn one.
    """

    def lost(displacement: Map) -> LinearRGB:
        return 1 - noise.left(np.float32(2 * scale) * np.abs(displacement))

    # CG objects have no noise, in focus or not.
    return _smaller(painted(fewer_views(frame, VIEWS), lost, 1.0))


def _smaller(frame: Frame) -> Frame:
    """Halve the width and height of a frame's views."""
    views = frame.views
    large, camera = views.canvas.pinhole, views.canvas.camera
    canvas = Canvas(camera.scaled(-(-camera.width // 2), -(-camera.height // 2)))
    small = canvas.pinhole
    size = small.focal / large.focal
    moved = small.principal_point - size * large.principal_point
    registration = views.registration.copy()
    registration[:, :, :2] *= size[:, None] / size
    registration[:, :, 2] = views.registration[:, :, 2] * size + moved - registration[:, :, :2] @ moved

    def within(layer: Layer) -> Layer:
        return replace(layer, mesh=replace(layer.mesh, xy=layer.mesh.xy * size + moved))

    return replace(
        frame, views=replace(views, canvas=canvas, registration=registration),
        layers=tuple(map(within, frame.layers)), cg_layers=tuple(map(within, frame.cg_layers)),
    )  # fmt: skip


def grained(
    picture: LinearRGBA, lost: Map, noise: Noise, frame: int, amount: float, source: LinearRGBA
) -> LinearRGBA:
    """Add the noise that blur has removed from a picture; other pixels are not changed.

    Args:
        picture: (H, W, 4) frame through the lens.
        lost: (H, W, 3) mean of the views of `lost_frame`.
        noise: Noise of the clip at this size.
        frame: Its number: each frame has its own noise, which is reproducible.
        amount: Share of the lost noise that is added.
        source: (H, W, 4) frame of the clip, whose noise is an upper limit.

    Returns:
        (H, W, 4) picture with noise.
    """
    rows, columns = np.nonzero(cv2.max(cv2.max(lost[..., 0], lost[..., 1]), lost[..., 2]) > LEAST)
    if not len(rows):
        return picture
    height, width = picture.shape[:2]
    result, part = picture.copy(), picture[rows, columns]
    # Variances add: 1 - (1 - lost)^2.
    kept = 1 - np.clip(lost[rows, columns], 0, 1)
    strength = np.float32(amount) * np.sqrt(1 - kept**2) * noise.share(_shown(source))[rows, columns, None]
    made = (strength * noise.components((width, height), frame)[rows, columns]) @ AXES.T
    result[rows, columns, :3] = decode_srgb(np.maximum(_shown(part) + made, 0)) * part[:, 3:]
    return result


def _shown(picture: LinearRGBA) -> Map:
    """Return display values (..., 3) of a picture (..., 4)."""
    return encode_srgb(picture[..., :3] / np.maximum(picture[..., 3:], TRANSPARENT)).astype(np.float32)
