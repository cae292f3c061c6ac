"""Export of a reconstruction as a COLMAP text model, exact to the last bit.

A point's row is its POINT3D_ID. In our working folders, an image's name ends in its frame number.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from ..base.errors import UserError
from ..camera.reconstruction import Reconstruction, quaternion_from_matrix
from . import colmap_text
from .colmap_tables import assemble
from .parsing import wrong

FILES = colmap_text.FILES
LONGEST_NUMBER = 9
"""Most digits of a frame number."""


def write_model(folder: Path, reconstruction: Reconstruction, names: Mapping[int, str] | None = None) -> None:
    """Write cameras.txt, images.txt and points3D.txt, with image names by frame number, into a folder.

    Each lens is written as the simplest equivalent camera model. Raises UserError for an invalid name.
    """
    called = {image.frame: f"frame_{image.frame:06d}.png" for image in reconstruction.images}
    called |= names or {}
    for name in called.values():
        if name != name.strip() or not name.isprintable() or not name:
            raise UserError(f"an image called {name!r} cannot be written into a COLMAP text model; rename it")
    lines = ["# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]"]
    for number, lens in enumerate(reconstruction.cameras, 1):
        model, values = lens.parameters()
        lines.append(f"{number} {model} {lens.width} {lens.height} {' '.join(map(repr, values))}")
    _write(folder / "cameras.txt", lines)
    lines = ["# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME", "# POINTS2D[] as (X, Y, POINT3D_ID)"]
    seen_by: list[list[str]] = [[] for _ in range(len(reconstruction.points))]
    for number, image in enumerate(reconstruction.images, 1):
        pose = [*quaternion_from_matrix(image.rotation), *image.translation]
        words = " ".join(repr(float(v)) for v in pose)
        lines.append(f"{number} {words} {image.camera + 1} {called[image.frame]}")
        places = zip(image.xy.tolist(), image.points.tolist(), strict=True)
        lines.append(" ".join(f"{x!r} {y!r} {point}" for (x, y), point in places))
        for row, point in enumerate(image.points.tolist()):
            seen_by[point].append(f"{number} {row}")
    _write(folder / "images.txt", lines)
    points = reconstruction.points
    lines = ["# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)"]
    rows = zip(points.xyz.tolist(), points.rgb.tolist(), points.error.tolist(), seen_by, strict=True)
    for number, ((x, y, z), (r, g, b), error, track) in enumerate(rows):
        lines.append(f"{number} {x!r} {y!r} {z!r} {r} {g} {b} {error!r} {' '.join(track)}".rstrip())
    _write(folder / "points3D.txt", lines)


def read_model(folder: Path) -> Reconstruction:
    """Read a text model of our own; raises UserError with file and line."""
    model, names = assemble(colmap_text.read(folder))
    images, place = {}, str(folder / "images.txt")
    for image in model.images:
        digits = re.findall(r"\d+", names[image.frame])
        if not digits or len(digits[-1]) > LONGEST_NUMBER:
            raise wrong(place, f"image names with a frame number, not {names[image.frame]!r}")
        frame = int(digits[-1])
        if frame in images:
            raise wrong(place, f"one image of frame {frame}, not several")
        images[frame] = replace(image, frame=frame)
    return replace(model, images=tuple(images[frame] for frame in sorted(images)))


def _write(path: Path, lines: list[str]) -> None:
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
