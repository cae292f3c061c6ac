"""Lenses, poses and observations from the numbers in text formats."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import UserError
from ..base.numbers import LARGEST
from ..camera.reconstruction import Image, Intrinsics, Points, Reconstruction, nearest_rotation
from ..media.picture_file import PICTURES
from .parsing import Numbers

ACCURATE = 0.01
"""Largest error of a converted lens, in pixels, that is not reported."""
FITS = ((2, 0), (2, 1), (2, 2), (3, 3))
"""Terms of the numerator and denominator of a fitted lens, the simplest first."""
ROTATION_ERROR = 1e-2
"""Largest error of a rotation's rows from orthonormal; files with two digits are not read as rotations."""


def rotation_from(matrix: Floats, problem: UserError) -> Floats:
    """Return the rotation nearest to a printed (3, 3) matrix; raises `problem` if it is not a rotation."""
    if np.abs(matrix @ matrix.T - np.eye(3)).max() > ROTATION_ERROR or np.linalg.det(matrix) < 0:
        raise problem
    return nearest_rotation(matrix)


def undistorting(pinhole: Intrinsics, a1: float, a2: float) -> tuple[Intrinsics, float] | None:
    """Fit a lens whose undistortion is x_u = x_d (1 + a1 r_d^2 + a2 r_d^4), in the units of a pinhole's rays.

    Our lenses distort, so the inverse is fitted by the simplest lens within `ACCURATE` pixels in the whole
    picture: k1 and k2, or a quotient of polynomials (FULL_OPENCV).

    Returns:
        The lens and its largest error in pixels; None if the picture folds or the error reaches a pixel.
    """
    size = (pinhole.width, pinhole.height)
    corners = np.array([[0, 0], [size[0], 0], [0, size[1]], size])
    rim = np.linalg.norm((corners - pinhole.principal_point) / pinhole.focal, axis=1).max()
    # Denser towards the rim, like Chebyshev's nodes, because polynomials err most there.
    seen = rim * np.sin(np.linspace(0.0, np.pi / 2, 257)[1:])
    square = seen * seen
    if (1 + square * (3 * a1 + square * 5 * a2)).min() <= 0:
        return None
    true = seen * (1 + square * (a1 + square * a2))
    place = (pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy)
    for above, below in FITS:
        terms = quotient(true, seen, above, below)
        k1, k2, k3, k4, k5, k6 = terms.tolist()
        if below:
            camera = Intrinsics.from_parameters(
                "FULL_OPENCV", *size, (*place, k1, k2, 0.0, 0.0, k3, k4, k5, k6)
            )
        else:
            camera = Intrinsics(*size, *place, k1, k2)
        found = camera.distort(np.stack([true, np.zeros_like(true)], axis=-1))[:, 0]
        miss = float(np.abs(found - seen).max() * pinhole.focal.max())
        if miss <= ACCURATE:
            break
    return (camera, miss) if miss < 1 else None


def quotient(true: Floats, seen: Floats, above: int, below: int) -> Floats:
    """Fit (6,) terms of r^2, r^4, r^6 above and below the fraction line that map radii `true` to `seen` (n,).

    The weights undo the effect of linearisation on the errors (Sanathanan and Koerner, "Transfer function
    synthesis as a ratio of two complex polynomials", 1963).
    """
    # In units of the rim, to keep the precision of strong lenses.
    rim = true.max()
    unit = true / rim
    powers = unit[:, None] ** np.array([2.0, 4.0, 6.0])
    columns = np.concatenate([powers[:, :above] * true[:, None], -powers[:, :below] * seen[:, None]], axis=1)
    weight = np.ones_like(true)
    solution = np.zeros(above + below)
    for _ in range(3):
        solution = np.linalg.lstsq(columns * weight[:, None], (seen - true) * weight)[0]
        weight = 1 / np.maximum(np.abs(1 + powers[:, :below] @ solution[above:]), 1e-3)
    terms = np.zeros(6)
    terms[:above], terms[3 : 3 + below] = solution[:above], solution[above:]
    return np.asarray(terms / np.tile(rim ** np.array([2.0, 4.0, 6.0]), 2))


@dataclass(frozen=True)
class Observations:
    """Positions of points in images."""

    image: NDArray[np.int64]
    """(n,) indices of images in the file."""
    point: NDArray[np.int64]
    """(n,) rows of points."""
    xy: Floats
    """(n, 2) in pixels."""


def observations_of(
    numbers: Numbers, starts: NDArray[np.int64], cameras: int, images: list[Image]
) -> tuple[Observations, list[str]]:
    """Read the views of points that are stored as X Y Z R G B, a count, and camera, key, x, y of each view.

    `starts` (m,) are the indices of X. Views by cameras that are not in `images` are left out, with a note.
    """
    counts = numbers.values[starts + 6].astype(np.int64)
    point = np.repeat(np.arange(len(starts)), counts)
    within = np.arange(len(point)) - np.repeat(np.cumsum(counts) - counts, counts)
    where = starts[point] + 7 + 4 * within
    camera = numbers.whole(where, cameras, "a camera")
    known = np.isin(camera, [image.frame for image in images])
    lost = int(np.sum(~known))
    notes = [f"{lost} features belong to cameras that are not registered: left out"] if lost else []
    where = where[known]
    return Observations(camera[known], point[known], numbers.values[where[:, None] + [2, 3]]), notes


def assemble(
    cameras: list[Intrinsics], images: list[Image], observations: Observations, xyz: Floats, rgb: Floats
) -> Reconstruction:
    """Combine ordered images, their observations and points.

    The first observation of a point in an image counts. A point's error is its mean reprojection error over
    the images in front of which it lies. `xyz` is (m, 3), `rgb` (m, 3) in [0, 255].
    """
    _, kept = np.unique(observations.image * len(xyz) + observations.point, return_index=True)
    image, point, xy = observations.image[kept], observations.point[kept], observations.xy[kept]
    sums, counts = np.zeros(len(xyz)), np.zeros(len(xyz))
    whole = []
    for bare in images:
        start, stop = np.searchsorted(image, [bare.frame, bare.frame + 1])
        seen, place = point[start:stop].astype(np.int32), xy[start:stop]
        local = bare.to_camera(xyz[seen])
        with np.errstate(over="ignore", invalid="ignore"):
            miss = np.linalg.norm(cameras[bare.camera].project(local) - place, axis=1)
        usable = (local[:, 2] > 0) & (miss <= LARGEST)
        sums[seen[usable]] += miss[usable]
        counts[seen[usable]] += 1
        whole.append(Image(bare.frame, bare.rotation, bare.translation, place, seen, bare.camera))
    points = Points(xyz, np.clip(np.round(rgb), 0, 255).astype(np.uint8), sums / np.maximum(counts, 1))
    return Reconstruction(tuple(cameras), tuple(whole), points)


def picture_size(folder: Path, names: list[str]) -> tuple[int, int] | None:
    """Return (width, height) of the first stored picture beside a model, or None."""
    for name in names[:8]:
        relative = Path(name.replace("\\", "/"))
        for file in (folder / relative, folder / relative.name):
            # A model file may name any path; only pictures below its folder are opened.
            inside = (not relative.is_absolute() and ".." not in relative.parts) or file.parent == folder
            if not inside or file.suffix.lower() not in PICTURES or not file.is_file():
                continue
            picture = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)
            if picture is not None:
                return picture.shape[1], picture.shape[0]
    return None


def check_size(path: Path, size: tuple[int, int], xy: Floats) -> list[str]:
    """Return notes on observations (n, 2) in pixels; raises UserError if they do not fit `size`."""
    if not len(xy):
        return ["the file has no observations, so no frame has features of its own"]
    width, height = size
    outside = np.any((xy < -0.02 * np.array(size)) | (xy > 1.02 * np.array(size)), axis=1)
    if outside.mean() > 0.05:
        low, high = np.percentile(xy, 2, axis=0), np.percentile(xy, 98, axis=0)
        raise UserError(
            f"{path} was not solved from pictures of {width}x{height}: its features lie from"
            f" {low[0]:.0f}, {low[1]:.0f} to {high[0]:.0f}, {high[1]:.0f}; give the footage that was solved"
        )
    reach = np.abs(2 * xy / np.array(size) - 1).max()
    if reach < 0.65:
        return [
            f"the features reach only {reach:.0%} of the way to the picture's border; if smaller pictures"
            " than this clip's were solved, give those as the footage"
        ]
    return []
