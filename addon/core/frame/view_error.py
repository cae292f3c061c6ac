"""Number of views for a target error, estimated from a few views.

The error of a frame is its PSNR in dB relative to infinitely many views, in sRGB values from 0 to 1. Two sets
of views differ by about the error of each, and its fall with their number has been measured.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..base.arrays import Floats, LinearRGBA
from ..base.progress import stage
from ..media.light import encode_srgb
from ..optics.aperture_sampling import MAX_VIEWS
from .warped_frame import MeshedFrame, WarpedFrame

PILOT = 4
"""Views in each of the pilot's two sets: another ring would cost more than it saves. Chosen by inspection."""
MEAN_GAIN = 1.0
"""Least gain in dB of the mean of both sets over their difference: 0.97 to 4.8, measured as `FIRST_GAIN`."""
PILOTED = 0.3
"""Share of the time of drawing that has passed once the number of views is known. Chosen by inspection."""
FIRST, FIRST_GAIN, DOUBLING = 8, 5.6, 3.9
"""Gain in dB of a prefiltered frame of `FIRST` views over the difference of the two sets, 5.3 to 7.9, and
gain of every doubling: 9.5 to 11.8 with 16 views, 13.1 to 15.3 with 32. So a target is met within a decibel.
From bars, fence and walk with true depth at 16, 32 and 64 pixels, a scratch script; confirmed by `python -m
benchmarks.timings.view_error` with targets."""
PLAIN_GAIN, PLAIN_DOUBLING = 1.0, 3.0
"""The same for plain views, from the pilot's number on: as independent random positions, the slowest."""


def views_to_error(
    meshed: MeshedFrame, wished: float, draw: Callable[[WarpedFrame], LinearRGBA]
) -> tuple[WarpedFrame, LinearRGBA]:
    """Draw a frame with as many views as an error needs.

    Args:
        meshed: The frame.
        wished: Error in dB.
        draw: Draws the mean (h, w, 4) of a frame's views in its canvas.

    Returns:
        The frame, and the mean of its views.
    """
    first = meshed.through(PILOT)
    second = other_views(meshed, first)
    with stage("Views", 0.0, PILOTED):
        one, other = draw(first), draw(second)
    count = views_for_error(difference(one, other), wished, meshed.geometry.mesher.is_prefiltered)
    if not count:
        both = replace(
            first.plan,
            offsets=np.concatenate([first.plan.offsets, second.plan.offsets]),
            registration=np.concatenate([first.plan.registration, second.plan.registration]),
            weights=_joined(first.plan.weights, second.plan.weights),
        )
        return replace(first, plan=both), (one + other) / np.float32(2)
    warped = meshed.through(count, reuse=True)
    with stage("Views", PILOTED, 1.0):
        return warped, draw(warped)


def _joined(one: Floats | None, other: Floats | None) -> Floats | None:
    """Join the weights (N,) and (M,) of two sets of views with equal shares."""
    return None if one is None or other is None else np.concatenate([one, other]) / 2


def other_views(meshed: MeshedFrame, warped: WarpedFrame) -> WarpedFrame:
    """Prepare a meshed frame for as many other views, with the same texture."""
    plan, geometry = warped.plan, meshed.geometry
    views = geometry.mesher.views(geometry, len(plan.offsets), 1)
    return replace(
        warped,
        plan=replace(plan, offsets=views.offsets, registration=views.registration, weights=views.weights),
    )


def difference(one: LinearRGBA, other: LinearRGBA) -> float:
    """Return the PSNR in dB of two displayed pictures (h, w, 4); infinite if they are equal."""
    first, second = (encode_srgb(np.clip(picture[..., :3], 0, 1)) for picture in (one, other))
    squared = float(np.mean((first - second) ** 2))
    return float("inf") if squared == 0 else float(-10 * np.log10(squared))


def views_for_error(between: float, wished: float, prefiltered: bool) -> int:
    """Return the number of views for an error, or 0 if the mean of the two pilot sets suffices.

    Args:
        between: Difference of the two sets in dB.
        wished: Error in dB.
        prefiltered: True for a prefiltered texture.
    """
    if between + MEAN_GAIN >= wished:
        return 0
    if prefiltered:
        doublings = max(0.0, (wished - between - FIRST_GAIN) / DOUBLING)
        return int(np.clip(np.ceil(FIRST * 2**doublings), FIRST, MAX_VIEWS))
    doublings = (wished - between - PLAIN_GAIN) / PLAIN_DOUBLING
    return int(np.clip(np.ceil(PILOT * 2**doublings), PILOT, MAX_VIEWS))
