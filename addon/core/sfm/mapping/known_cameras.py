"""Files of cameras without points, between the reader's process and the worker.

Also thins out clouds that no picture observes.
"""

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from ...base.arrays import Ints
from ...camera.intrinsics import Intrinsics
from ...camera.reconstruction import NO_POINTS, Image, Points, Reconstruction, seen_by

CELLS = (24, 16)
"""Across and down a picture; one point of each is enough for focus and range. Chosen by inspection."""
MOST_POINTS = 20_000
"""Most points of an unobserved cloud. Chosen by inspection."""


def write_cameras(path: Path, cameras: Reconstruction) -> None:
    """Write poses and lenses as JSON, exact to the last bit; frame numbers may be negative."""
    rows = [
        [int(image.frame), image.camera, image.rotation.tolist(), image.translation.tolist()]
        for image in cameras.images
    ]
    written = {"lenses": [asdict(lens) for lens in cameras.cameras], "images": rows}
    path.write_text(json.dumps(written), encoding="utf-8")


def read_cameras(path: Path) -> Reconstruction:
    """Read the file of `write_cameras`."""
    read = json.loads(path.read_text(encoding="utf-8"))
    images = tuple(
        Image(frame, np.array(rotation), np.array(translation), camera=camera)
        for frame, camera, rotation, translation in read["images"]
    )
    lenses = tuple(Intrinsics(**{**lens, "terms": tuple(lens["terms"])}) for lens in read["lenses"])
    return Reconstruction(lenses, images, NO_POINTS)


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
