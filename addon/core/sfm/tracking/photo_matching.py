"""Features of photos in no order, matched each with all others.

SIFT's keypoints (`sift`), of each pair those that are each other's best match. Photos have sizes of their
own; places are in pixels of each, the first pixel's middle at (0.5, 0.5).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import cv2
import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats, Ints
from ...base.counting import counted
from ...base.errors import UserError
from ...media.clip import MOST_STILLS, Footage
from ...media.light import to_gray8
from ...media.picture_file import Pixels
from ..steps import progress
from .sift import Descriptors, keypoints, make_sift, matched
from .tracks import colours_at

# Chosen by inspection of solved photos.
LONG_SIDE = 1600
"""Longer side, in pixels, to which larger photos are reduced before their features are detected."""
FEATURES = 4000
"""The strongest keypoints of a photo that are matched, of up to `FEW` photos."""
FEW = 30
"""Photos past which fewer of their keypoints are matched, so that all pairs take minutes, not hours."""
LEAST_FEATURES = 2000
"""The strongest keypoints of a photo that are matched, of many photos."""


@dataclass(frozen=True)
class Photo:
    """The features of one picture."""

    frame: int
    name: str
    width: int
    height: int
    xy: Floats
    """(n, 2) pixels."""
    descriptors: Descriptors
    """(n, 128)"""
    rgb: NDArray[np.uint8]
    """(n, 3) sRGB."""


def find_features(footage: Footage) -> list[Photo]:
    """Return the features of all photos.

    Raises:
        UserError: There are too few photos or too many, or one cannot be read.
    """
    count = len(footage.frames)
    if not 2 <= count <= MOST_STILLS:
        raise UserError(
            f"{footage.path.name} has {counted(count, 'photo')}; 2 to {MOST_STILLS} can be matched with"
            " each other; put those of one scene in a folder"
        )
    most = FEATURES if count <= FEW else LEAST_FEATURES
    sift, found = make_sift(0.01), []
    for done, frame in enumerate(footage.frames):
        progress("Finding features", done, count)
        found.append(_features(sift, footage.read(frame), frame, footage.file(frame).name, most))
    return found


def _features(sift: cv2.SIFT, picture: Pixels, frame: int, name: str, most: int) -> Photo:
    height, width = picture.shape[:2]
    gray = to_gray8(picture, LONG_SIDE)
    points = keypoints(sift, gray)
    points = points.kept(np.sort(np.argsort(-points.response, kind="stable")[:most]))
    scale = np.array([width / gray.shape[1], height / gray.shape[0]])
    xy = (points.places.astype(np.float64) + 0.5) * scale
    return Photo(frame, name, width, height, xy, points.descriptors, colours_at(picture, xy))


def match_all(photos: Sequence[Photo]) -> dict[tuple[int, int], Ints]:
    """Return rows (n, 2) of the features that match in two photos, by numbers (i, j) of photos, i < j."""
    pairs = list(combinations(range(len(photos)), 2))
    found = {}
    for done, (i, j) in enumerate(pairs):
        progress("Matching photos", done, len(pairs))
        found[i, j] = np.column_stack(matched(photos[i].descriptors, photos[j].descriptors)).astype(np.int32)
    return found
