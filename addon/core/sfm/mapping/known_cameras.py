"""Thinning of the clouds of known cameras, which no picture observes."""

from dataclasses import replace

import numpy as np

from ...base.arrays import Ints
from ...camera.reconstruction import Image, Points, Reconstruction, seen_by

CELLS = (24, 16)
"""Across and down a picture; one point of each is enough for focus and range. Chosen by inspection."""
MOST_POINTS = 20_000
"""Most points of an unobserved cloud. Chosen by inspection."""


def thinned(cloud: Reconstruction) -> Reconstruction:
    """Return a cloud computed from depth with few points, enough for focus and range.

    Each point has a frame that shows it. One observed point is kept in each of a frame's `CELLS`; unobserved
    points are projected into all frames, without a test for occlusion.
    """
    points, images = cloud.points, cloud.images
    if any(len(image.points) for image in images):
        images = tuple(_thinned(image, cloud) for image in images)
        kept = np.unique(np.concatenate([image.points for image in images]))
    else:
        kept = np.unique(np.linspace(0, len(points) - 1, min(len(points), MOST_POINTS)).round().astype(int))
        images = tuple(_projected(image, cloud, kept.astype(np.int32)) for image in images)
    number = np.zeros(len(points), np.int32)
    number[kept] = np.arange(len(kept))
    images = tuple(replace(image, points=number[image.points]) for image in images)
    return Reconstruction(
        cloud.cameras, images, Points(points.xyz[kept], points.rgb[kept], points.error[kept])
    )


def _thinned(image: Image, cloud: Reconstruction) -> Image:
    lens = cloud.intrinsics(image)
    cell = np.floor(image.xy / [lens.width, lens.height] * CELLS).astype(int)
    _, first = np.unique(cell, axis=0, return_index=True)
    first.sort()
    return replace(image, xy=image.xy[first], points=image.points[first])


def _projected(image: Image, cloud: Reconstruction, rows: Ints) -> Image:
    local, ahead = seen_by(image, cloud, rows)
    lens = cloud.intrinsics(image)
    place = lens.project(local)
    with np.errstate(invalid="ignore"):
        ahead &= np.all((place >= 0) & (place < [lens.width, lens.height]), axis=1)
    return replace(image, xy=place[ahead], points=rows[ahead])
