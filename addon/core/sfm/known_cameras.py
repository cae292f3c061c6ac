"""Cameras without points as a file, from the process that knows them to the one that finds their points."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np

from ..camera.intrinsics import Intrinsics
from ..camera.reconstruction import Image, Points, Reconstruction


def bare(images: tuple[Image, ...], lenses: tuple[Intrinsics, ...]) -> Reconstruction:
    """Cameras alone: what images observe is left out."""
    none, nowhere = np.zeros((0, 2)), np.zeros(0, dtype=np.int32)
    stripped = (Image(i.frame, i.rotation, i.translation, none, nowhere, i.camera) for i in images)
    points = Points(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0))
    return Reconstruction(lenses, tuple(sorted(stripped, key=lambda image: image.frame)), points)


def write_cameras(path: Path, cameras: Reconstruction) -> None:
    """Write poses and lenses as JSON, exact to the last bit; frame numbers may be negative."""
    rows = [
        [int(image.frame), image.camera, image.rotation.tolist(), image.translation.tolist()]
        for image in cameras.images
    ]
    written = {"lenses": [asdict(lens) for lens in cameras.cameras], "images": rows}
    path.write_text(json.dumps(written), encoding="utf-8")


def read_cameras(path: Path) -> Reconstruction:
    """What `write_cameras` wrote."""
    read = json.loads(path.read_text(encoding="utf-8"))
    none, nowhere = np.zeros((0, 2)), np.zeros(0, dtype=np.int32)
    images = tuple(
        Image(frame, np.array(rotation), np.array(translation), none, nowhere, camera)
        for frame, camera, rotation, translation in read["images"]
    )
    lenses = tuple(Intrinsics(**{**lens, "terms": tuple(lens["terms"])}) for lens in read["lenses"])
    return bare(images, lenses)
