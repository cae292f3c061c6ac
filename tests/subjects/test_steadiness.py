"""Whether what moves is one thing from frame to frame."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from addon.core.base.arrays import Mask
from addon.core.subjects.steadiness import jumps, likeness


def figure(x: float, legs: float = 1.0, head: bool = True, size: float = 1.0) -> Mask:
    """(90, 160) someone who stands at x, whose legs are that far apart."""
    mask = np.zeros((90, 160), np.uint8)
    at, tall = int(x), int(50 * size)
    cv2.ellipse(mask, (at, 70 - tall // 2), (int(9 * size), tall // 3), 0, 0, 360, 1, -1)
    for side in (-1, 1):
        cv2.line(mask, (at, 70 - tall // 3), (int(at + side * 8 * legs), 75), 1, 5)
    if head:
        cv2.circle(mask, (at, 70 - tall), int(7 * size), 1, -1)
    return mask > 0


def test_one_who_walks_does_not_jump() -> None:
    walk = [figure(20 + 3 * t, np.cos(t), size=1 + 0.01 * t) for t in range(30)]
    assert jumps(walk) == []
    assert likeness(walk[0], walk[0]) == 1
    # Only the place differs.
    assert likeness(figure(40), figure(120)) == pytest.approx(1)


def test_what_is_lost_and_found_again_jumps() -> None:
    frames = [figure(40 + t) for t in range(8)]
    frames[3] = np.zeros_like(frames[3])
    frames[6] = frames[6] & (np.arange(90)[:, None] > 62)
    assert jumps(frames) == [3, 4, 6, 7]


def test_nothing_that_moves_does_not_jump() -> None:
    nothing = np.zeros((90, 160), bool)
    speck = nothing.copy()
    speck[3, 3:6] = True
    assert jumps([nothing, nothing, speck, nothing]) == []
    assert jumps([]) == []
