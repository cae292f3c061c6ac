"""Depth maps of single frames in the units of a reconstruction."""

from __future__ import annotations

import numpy as np

from addon.core.depth.map_fit import ClipFit, fit_depth, frame_line, steadied
from addon.core.depth.user_maps import DepthMap


def fitted(depth: DepthMap, xy: np.ndarray, inverse_depth: np.ndarray, clip: ClipFit) -> np.ndarray:
    """(H, W) inverse depth of a map by its own features (n, 2) and (n,), without frames around."""
    line = steadied([frame_line(depth, xy, inverse_depth, clip)], depth.frame, clip)
    return fit_depth(depth, xy, inverse_depth, clip, line)
