"""Parts of a mask that hang together, and which of them are one subject's."""

from __future__ import annotations

import cv2
import numpy as np

from ..base.arrays import Map, Mask


def touching(mask: Mask, those: Mask) -> Mask:
    """Connected parts of a mask (h, w) that share a pixel with another one (h, w)."""
    number, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    kept = np.zeros(number, bool)
    kept[labels[those & mask]] = True
    kept[0] = False
    return np.asarray(kept[labels])


def without_islands(mask: Mask, there: Mask, told: Map, island: float) -> Mask:
    """Connected parts of a mask (h, w) that share a pixel with another one (h, w), but for islands: less than
    that share of the largest, of which log-odds (h, w) do not tell that they contradict the static scene.

    Where a subject leaves a place, flow sticks to the ground there.
    """
    number, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    expected = np.bincount(labels[there], minlength=number) > 0
    area = stats[:, cv2.CC_STAT_AREA] * expected
    area[0] = 0
    contradicts = np.bincount(labels.ravel(), told.ravel(), number) > area
    kept = (area > island * area.max()) | (contradicts & expected)
    kept[0] = False
    return np.asarray(kept[labels])


def of_its_colours(mask: Mask, colours: Map, another: float) -> Mask:
    """A mask (h, w) without connected parts that are another subject: at least that share of the largest, and
    of other colours by log-odds (h, w); the likeliest of the large parts stays, whatever its colours."""
    number, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    area = stats[:, cv2.CC_STAT_AREA].astype(np.float64)
    area[0] = 0
    mean = np.bincount(labels.ravel(), colours.ravel(), number) / np.maximum(area, 1)
    large = (area > 0) & (area >= another * area.max())
    kept = ~large | (mean > 0)
    kept[np.where(large, mean, -np.inf).argmax()] = True
    kept[0] = False
    return np.asarray(kept[labels])
