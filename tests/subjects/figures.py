"""Drawn people that the networks recognise."""

from __future__ import annotations

import cv2
import numpy as np


def figure(height: int = 240, width: int = 320) -> np.ndarray:
    """(h, w, 3) a drawn person with a head, a body and limbs on a plain ground."""
    picture = np.full((height, width, 3), (120, 150, 110), np.uint8)
    skin, shirt, trousers = (205, 160, 130), (40, 60, 150), (50, 45, 45)
    cv2.line(picture, (150, 140), (140, 215), trousers, 16, cv2.LINE_AA)
    cv2.line(picture, (170, 140), (180, 215), trousers, 16, cv2.LINE_AA)
    cv2.line(picture, (145, 80), (115, 140), skin, 10, cv2.LINE_AA)
    cv2.line(picture, (175, 80), (205, 140), skin, 10, cv2.LINE_AA)
    cv2.rectangle(picture, (138, 70), (182, 145), shirt, -1)
    cv2.ellipse(picture, (160, 48), (15, 20), 0, 0, 360, skin, -1, cv2.LINE_AA)
    return picture
