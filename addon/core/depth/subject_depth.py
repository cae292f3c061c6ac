"""Depth of subjects: each gets its distance after the static scene is known, upright where it stands."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..base.arrays import Bytes, Floats, Ints, Map, Mask, pixel_centres
from ..camera.intrinsics import Intrinsics
from .completion import LEAST_WEIGHT, interpolate
from .ground_contact import GAP, NEARER, beside, contact, ground_below, upright
from .multi_view_stereo import DenseDepth

PLACED, HOVERING = 0.25, 0.15
"""Confidence in [0, 1] of a subject whose distance is known, and of one that has its surroundings' distance.
Both are above `source.SURE` and below that of matched pixels."""
TALL, WIDE = 0.7, 1.0
"""Width over height up to which a subject faces the camera, and from which on it is turned like its line of
contact: two feet of a person, one of them lifted, have no direction."""
LEAN = 1.5
"""Ratio of a subject's nearest and farthest distance to that of its contact, at most."""
APART = 6
"""Pixels between parts of one subject, at most: hair, and fingers that the background hides."""


@dataclass(frozen=True)
class Subject:
    """A moving object of a clip."""

    mask: Callable[[int], Mask]
    """Returns its pixels (h, w) in a source frame, at any size."""
    inverse_depth: Callable[[int], float | None] = lambda frame: None
    """Returns their median inverse depth in a source frame, in 1 / scene units; None where it is unknown."""


def with_subjects(
    static: DenseDepth, picture: Bytes, subjects: Sequence[tuple[Mask, float | None]]
) -> DenseDepth:
    """Give each moving pixel of a frame the depth of its subject.

    A subject that touches the ground in the picture is an upright plane there, scaled to its inverse depth if
    that is known. A subject without contact has its known inverse depth, or else the one of its surroundings;
    if the lower border cuts it off, it is nearer than these.
    Each connected part of the other moving pixels is a subject.

    Args:
        static: Depth of the static scene; its values in moving pixels are ignored.
        picture: (h, w, 3) uint8 of the frame.
        subjects: Mask (h, w) and median inverse depth of each subject. The first one has shared pixels.

    Returns:
        The depth of all pixels. Moving pixels have the confidence of their subject's distance.
    """
    if not static.moving.any():
        return static
    inverse, confidence = static.inverse_depth.copy(), static.confidence.copy()
    sure = ~static.moving & (confidence > PLACED)
    apart = sure & (cv2.dilate(static.moving.astype(np.uint8), np.ones((2 * GAP + 1,) * 2)) == 0)
    weight = np.where(static.moving, 0, confidence + np.float32(LEAST_WEIGHT)).astype(np.float32)
    guide = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY).astype(np.float32)
    around = interpolate(guide, static.inverse_depth, weight, float(np.median(inverse)))
    for mask, known in _separated(static.moving, subjects):
        standing = _standing(mask, static.inverse_depth, apart, static.pinhole)
        is_placed = known is not None or standing is not None
        hidden = max(float(np.median(around[mask])), NEARER * beside(mask, around, apart))
        middle = hidden if known is None else known
        if standing is None:
            inverse[mask] = middle
        else:
            inverse[mask] = standing[mask] * (1.0 if known is None else known / np.median(standing[mask]))
        confidence[mask] = PLACED if is_placed else HOVERING * sure.any()
    return replace(static, inverse_depth=inverse, confidence=confidence)


def connected(mask: Mask) -> Ints:
    """Return labels (h, w), from 1, of a mask's parts (h, w) that are more than `APART` from each other."""
    wide = cv2.dilate(mask.astype(np.uint8), np.ones((APART + 1, APART + 1), np.uint8))
    return np.where(mask, cv2.connectedComponents(wide, connectivity=8)[1], 0).astype(np.int32)


def _separated(
    moving: Mask, subjects: Sequence[tuple[Mask, float | None]]
) -> list[tuple[Mask, float | None]]:
    """Disjoint masks (h, w) that cover all moving pixels (h, w), with their known inverse depth."""
    rest, found = moving.copy(), list[tuple[Mask, float | None]]()
    for mask, known in subjects:
        found.append((mask & rest, known))
        rest &= ~mask
    labels = connected(rest)
    found += [(labels == label, None) for label in range(1, int(labels.max(initial=0)) + 1)]
    return [(mask, known) for mask, known in found if mask.any()]


def _standing(mask: Mask, inverse: Map, apart: Mask, pinhole: Intrinsics) -> Floats | None:
    """(h, w) inverse depth of the upright plane on the line where a subject touches the ground."""
    ground = ground_below(mask, inverse, apart, pinhole)
    touch = None if ground is None else contact(mask, ground, pinhole)
    if ground is None or touch is None:
        return None
    tall, wide = (np.count_nonzero(mask.any(axis=axis)) for axis in (1, 0))
    slope = touch.slope * float(np.clip((wide / tall - TALL) / (WIDE - TALL), 0, 1))
    base = touch.inverse_depth(slope, ground)
    if base <= 0:
        return None
    rays = pinhole.rays(pixel_centres(*mask.shape[::-1]))
    return np.clip(upright(base, touch.column, slope, ground, rays), base / LEAN, base * LEAN)
