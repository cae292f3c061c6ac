"""Faces of people."""

import cv2
import numpy as np

from ..base.arrays import Bytes, Floats, Mask
from .networks import Networks

HEAD = 1 / 3
"""Share of a person's height, from the top, that holds the face."""
LEAST = 0.5
"""Least probability of a face."""


def face_of(networks: Networks, picture: Bytes, person: Mask) -> Floats | None:
    """Find a person's face.

    Args:
        networks: Face detector.
        picture: (H, W, 3) uint8 RGB, display-encoded.
        person: (h, w) mask of the person, at any size; not empty.

    Returns:
        (4,) left, top, right, bottom in shares of the picture, (0, 0) top left; None without a face on the
        person.
    """
    mask = cv2.resize(person.astype(np.uint8), picture.shape[1::-1], interpolation=cv2.INTER_NEAREST) > 0
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    bottom = rows[0] + max(round(HEAD * len(range(rows[0], rows[-1] + 1))), 1)
    upper = np.s_[rows[0] : bottom, columns[0] : columns[-1] + 1]
    height, width = mask.shape
    for face in networks.faces(np.ascontiguousarray(picture[upper]), LEAST) if networks.exist else ():
        box = face.box + np.tile([columns[0], rows[0]], 2)
        x, y = (box[:2] + box[2:]) / 2
        if 0 <= x < width and 0 <= y < bottom and mask[int(y), int(x)]:
            return np.asarray(box / [width, height, width, height])
    return None
