"""The Voodoo camera tracker's text export.

A camera has 28 numbers: C A H V (position, viewing direction, and the other two axes, which include focal
length and principal point), K3 K5, pixel size, picture size, principal point, focal length in mm, field of
view and the two plain axes. A point projects to x = H(X - C) / A(X - C) + (W - 1) / 2, y likewise with V,
where 0 is the centre of the first pixel (the file's own header; CAHV: Yakimovsky and Cunningham, 1978). The
axes are ours.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..base.arrays import Floats
from ..camera.intrinsics import MAX_SIDE
from ..camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from .building import ACCURATE, rotation_from, undistorting
from .matching import Imported
from .parsing import Text, beginning
from .poses import lens

FORMAT = "Voodoo text export"
NUMBERS = 28
"""Numbers of a camera, one camera a line."""
MOST_SIGHTINGS = 10_000_000
"""Most points times frames; beyond it, every frame gets its share of the points."""
DIGITS = 6
"""Digits of a pixel."""


def recognises(path: Path) -> bool:
    """Return whether a file is Voodoo's export, by its first line."""
    return re.match(rb"#\s*text export", beginning(path) or b"", re.IGNORECASE) is not None


def read(path: Path, size: tuple[int, int]) -> Imported:
    """Read an export without 2D tracks: features are the projections of points. See `Reader.read`."""
    text = Text(path)
    if not re.match(r"#\s*text export", text.demand("'# Text export'"), re.IGNORECASE):
        raise text.wrong("'# Text export', the first line of Voodoo's text export")
    names: list[str] = []
    images: list[Image] = []
    lenses: dict[tuple[float, ...], tuple[int, Intrinsics]] = {}
    worst, distorted, name = 0.0, False, ""
    while (row := text.next()) is not None:
        if row.startswith("#"):
            found = re.match(r"#\s*timeindex\s+(-?\d+)", row, re.IGNORECASE)
            name = f"timeindex {found[1][:12]}" if found else name
            continue
        words = row.split()
        if images and len(words) == 3:
            text.back()
            break
        values = text.row(words, NUMBERS, f"the {NUMBERS} numbers of a camera")
        camera, rotation, miss = _camera(text, values)
        distorted |= camera.is_distorted
        worst = max(worst, miss)
        place = (camera.fx, camera.fy, camera.cx, camera.cy)
        key = (camera.width, camera.height, *values[12:14].tolist(), *place)
        index, _ = lenses.setdefault(key, (len(lenses), camera))
        pose = (rotation, -rotation @ values[:3])
        images.append(Image(len(images), *pose, camera=index))
        names.append(name)
        name = ""
    if not images:
        raise text.ends("a line with the 28 numbers of a camera")
    xyz = _points(text)
    cameras = [camera for _, camera in lenses.values()]
    notes = [
        "the file has no 2D tracks: a frame's features are where its points project, hidden ones included"
    ]
    step = -(-len(images) * len(xyz) // MOST_SIGHTINGS)
    if step > 1:
        notes.append(f"of the {len(xyz)} points one in {step} is a frame's feature, all would be too many")
    if distorted:
        notes.append("K3 and K5 are taken to undistort, x_u = x_d (1 + K3 r^2 + K5 r^4) with r in mm")
    if worst > ACCURATE:
        notes.append(f"the lens distortion is converted with an error of up to {worst:.2f} pixels")
    if len(cameras) > 1:
        notes.append(f"the focal length changes: {len(cameras)} lenses")
    used = np.arange(0, len(xyz), step, dtype=np.int32)
    whole = []
    for image in images:
        camera, local = cameras[image.camera], image.to_camera(xyz[used])
        xy = camera.project(local)
        inside = (local[:, 2] > 0) & np.all((xy >= 0) & (xy <= [camera.width, camera.height]), axis=1)
        whole.append(replace(image, xy=xy[inside], points=used[inside]))
    points = Points(xyz, np.full(xyz.shape, 128, dtype=np.uint8), np.zeros(len(xyz)))
    solved = Reconstruction(tuple(cameras), tuple(whole), points)
    return Imported(solved, FORMAT, tuple(notes), tuple(names), projected=True)


def _camera(text: Text, values: Floats) -> tuple[Intrinsics, Floats, float]:
    """Return lens, rotation, and the error of the converted distortion in pixels, from 28 numbers."""
    axis, across, down = values[3:6], values[6:9], values[9:12]
    size = values[16:18]
    if not np.all((size % 1 == 0) & (size >= 1) & (size <= MAX_SIDE)):
        raise text.wrong(f"a picture of 1 to {MAX_SIDE} pixels across and down as numbers 17 and 18")
    problem = text.wrong("A, H and V of a camera: H and V across the viewing direction A of length 1")
    if not abs(np.linalg.norm(axis) - 1) < 1e-2:
        raise problem
    axis = axis / np.linalg.norm(axis)
    # H is the focal length along the picture's x axis plus the principal point's offset along A; V likewise.
    offset = np.array([across @ axis, down @ axis])
    across, down = across - offset[0] * axis, down - offset[1] * axis
    fx, fy = float(np.linalg.norm(across)), float(np.linalg.norm(down))
    if not min(fx, fy) > 1e-6:
        raise problem
    rotation = rotation_from(np.stack([across / fx, down / fy, axis]), problem)
    centre = offset + size / 2
    # The last printed digits of one lens vary from frame to frame.
    place = np.round([fx, fy, *centre], DIGITS).tolist()
    camera = lens(f"{text.path}, line {text.line}", "PINHOLE", (size[0], size[1]), place)
    k3, k5, focal = values[12], values[13], values[20]
    if k3 == 0 and k5 == 0:
        return camera, rotation, 0.0
    if not focal > 0:
        raise text.wrong("a focal length in mm greater than zero as number 21")
    found = undistorting(camera, float(k3 * focal**2), float(k5 * focal**4))
    if found is None:
        raise text.wrong("K3 and K5 of a lens, under which the picture does not fold, as numbers 13 and 14")
    return found[0], rotation, found[1]


def _points(text: Text) -> Floats:
    """Read (m, 3) positions from the remaining lines."""
    numbers = text.numbers()
    per_line = np.diff(numbers.ends, prepend=0)
    wrong = np.flatnonzero((per_line != 0) & (per_line != 3))
    if len(wrong):
        raise text.wrong(f"X Y Z of a point, not {per_line[wrong[0]]} numbers", int(numbers.lines[wrong[0]]))
    if not len(numbers.values):
        raise text.ends('3D points; export again with "Export All"')
    return numbers.values.reshape(-1, 3)
