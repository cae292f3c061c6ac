"""A stand-in for a depth network's maps: the true inverse depth, bent, drifting and soft at edges."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.camera.reconstruction import Reconstruction
from addon.core.depth.user_depth import UserDepth
from addon.core.depth.user_maps import open_depth
from addon.core.media.clip import open_footage

from .scenes import Floats, Scene

BEND = 0.1
"""Of the range of inverse depths: how far scale and shift bend over the picture, and again over the clip: as
much as networks of relative depth are off by after an affine fit, 5 to 10 %."""
PERIOD = 40.0
"""Frames in which that drift comes back."""
SOFT = 0.005
"""Of the width: standard deviation of the blur across edges."""
LONG_SIDE = 518
"""Pixels that the network works at: that of Depth-Anything's vision transformer."""
AROUND = 4
"""Frames on either side of the judged ones that have a map, too."""


def network_depth(scene: Scene, reconstruction: Reconstruction, folder: Path) -> UserDepth:
    """Maps of the judged frames of a scene and those around them, written to a folder and read by the product
    as anybody's."""
    judged = scene.judged(scene.blurs[0])
    folder.mkdir(parents=True, exist_ok=True)
    for frame in range(judged[0] - AROUND, judged[-1] + AROUND + 1):
        np.savez(folder / f"depth_{frame:04d}.npz", depth=as_seen(1 / scene.depth(frame), frame))
    return UserDepth.of(open_depth(folder, open_footage(scene.clip())), reconstruction)


def as_seen(inverse: Floats, frame: int) -> NDArray[np.float32]:
    """(h, w) what a network makes of a frame's inverse depth (H, W)."""
    height, width = inverse.shape
    low, high = np.percentile(inverse, [1, 99])
    zoom = min(1.0, LONG_SIDE / max(width, height))
    size = round(width * zoom), round(height * zoom)
    seen = cv2.resize((inverse - low) / (high - low), size, interpolation=cv2.INTER_AREA)
    seen = cv2.GaussianBlur(seen, (0, 0), SOFT * size[0])
    x, y = np.meshgrid(np.linspace(0, 1, size[0]), np.linspace(0, 1, size[1]))
    phase = 2 * np.pi * frame / PERIOD
    scale = 1 + BEND * (np.cos(np.pi * x + 0.3) * np.sin(1.5 * np.pi * y) + np.sin(phase))
    shift = BEND * (np.sin(np.pi * (x + 0.5 * y)) + np.cos(phase))
    return np.asarray(scale * seen + shift + 1, np.float32)
