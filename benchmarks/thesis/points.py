"""Feature points and where cameras project them, drawn on the frame: the thesis's section 4.5."""

from __future__ import annotations

import numpy as np

from . import marks as draw
from .clips import Clip
from .marks import Figure

ZOOM = 1.5
SIDES = {
    "left": ((-1.0, 0.0), draw.BLACK, "black"),
    "right": ((1.0, 0.0), draw.BLUE, "blue"),
    "up": ((0.0, -1.0), draw.GREEN, "green"),
    "down": ((0.0, 1.0), draw.YELLOW, "yellow"),
}  # fmt: skip
"""Where the virtual camera is (x right, y down), and the thesis's colour for it."""
APART = 30
"""Pixels between the features that are drawn with all their projections."""


def reprojections(clip: Clip, answers: str) -> Figure:
    """Observed features '+' and their 3D points 'x', by the actual camera."""
    image, _ = clip.reconstruction.image_at(clip.middle)
    projected = clip.lens.project(image.to_camera(clip.reconstruction.points.xyz[image.points]))
    error = np.linalg.norm(projected - image.xy, axis=1)
    page = draw.enlarged(draw.muted(clip.frame(clip.middle)), ZOOM)
    page = draw.marks(page, image.xy, "+", draw.WHITE, ZOOM, arm=5)
    page = draw.marks(page, projected, "x", draw.RED, ZOOM, arm=4)
    title = f"{clip.name}, frame {clip.middle}: features, white +, and their 3D points projected, red x"
    return Figure(
        f"reprojections_{clip.name}.png", draw.sheet([[page]], [""], [""], title),
        "The features of the middle frame (white +) and their 3D points projected by the actual camera"
        " (red x).",
        answers,
        f"{len(error)} features; distance between the two {np.median(error):.2f} px in the median,"
        f" {np.percentile(error, 95):.2f} px for 95 %, {error.max():.2f} px at most.",
    )  # fmt: skip


def virtual_cameras(clip: Clip, beside: float, answers: str) -> Figure:
    """Features, and where cameras `beside` metres to each side see them."""
    features = clip.features(clip.middle)
    kept = draw.spread(features.observed, APART)
    xy, inverse = features.observed[kept], features.inverse_depth[kept]
    page = draw.enlarged(draw.muted(clip.frame(clip.middle)), ZOOM)
    for (across, down), colour, _ in SIDES.values():
        shift = clip.lens.focal * clip.unit * beside * np.array([across, down])
        seen = xy - shift * inverse[:, None]
        page = draw.lines(page, np.stack([xy, seen], axis=1), colour, ZOOM)
        page = draw.marks(page, seen, "x", colour, ZOOM, arm=2.5, thick=2)
    page = draw.marks(page, xy, "+", draw.WHITE, ZOOM, arm=3, thick=2)
    colours = ", ".join(f"{name} {word}" for name, (_, _, word) in SIDES.items())
    title = f"{clip.name}, frame {clip.middle}: features from cameras {100 * beside:.0f} cm beside; {colours}"
    moved = clip.lens.fx * clip.unit * beside * features.inverse_depth
    return Figure(
        f"virtual_cameras_{clip.name}.png", draw.sheet([[page]], [""], [""], title),
        f"Features of the middle frame (white +, one in {APART} px) and where cameras {100 * beside:.0f} cm"
        f" to the left (black), right (blue), above (green) and below (yellow) see them: near ones move far,"
        " and against the camera.",
        answers,
        f"The {len(features.inverse_depth)} features move by {moved.min():.1f} to {moved.max():.1f} px.",
    )  # fmt: skip
