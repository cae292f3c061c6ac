"""VisualSFM's N-view match files: NVM_V3, with FixedK, and COLMAP's variant.

Camera: focal length, world-to-camera quaternion w x y z and projection centre, axes as ours. VisualSFM's
features are relative to the principal point, and its radial parameter r undistorts, x_u = x_d (1 + r x_d^2)
(Wu et al., "Multicore bundle adjustment", 2011). COLMAP writes absolute pixels, which are not negative, and
-k1.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import UserError
from ..camera.reconstruction import Image, Intrinsics, matrix_from_quaternion
from .building import ACCURATE, assemble, check_size, observations_of, picture_size, undistorting
from .matching import Imported
from .parsing import Numbers, Text, beginning

FORMAT = "VisualSFM NVM"
NUMBERS = 10
"""Numbers of a camera after its name: focal length, quaternion, centre, radial distortion and 0."""
NEGATIVE = 0.05
"""Largest share of negative coordinates in absolute pixels; relative to the centre it is about half."""
MISS = 0.05
"""Largest median reprojection error as a share of the picture's width; a wrong clip has more. Chosen by
inspection of imported models."""


def recognises(path: Path) -> bool:
    """Return whether a file is an .nvm, by its suffix or first line."""
    start = beginning(path)
    return start is not None and (start.startswith(b"NVM_V") or path.suffix.lower() == ".nvm")


def read(path: Path, size: tuple[int, int]) -> Imported:
    """Read the largest model of a file; see `Reader.read`. A listed picture's size has priority."""
    text = Text(path)
    fixed = _fixed(text)
    model, notes = _largest_model(text)
    if not model.cameras:
        raise UserError(f"{path} has no registered camera; solve the clip again")
    if not len(model.starts):
        raise UserError(f"{path} has no points: export it again with its 3D points")
    columns = model.starts[:, None] + np.arange(3)
    xyz, rgb = model.numbers.values[columns], model.numbers.values[columns + 3]
    images = [replace(camera.image, camera=index) for index, camera in enumerate(model.cameras)]
    observations, lost = observations_of(model.numbers, model.starts, len(model.names), images)
    size = picture_size(path.parent, list(model.names)) or size
    point = np.array(fixed[1:4:2]) if fixed else np.array(size) / 2
    is_absolute = int(np.count_nonzero(observations.xy < 0)) <= NEGATIVE * observations.xy.size
    if is_absolute:
        notes.append("features are in absolute pixels, as COLMAP writes them")
    lenses, converted = _lenses(text, fixed, model, point, is_absolute, size)
    observations = replace(observations, xy=observations.xy + (0 if is_absolute else point))
    notes += [*lost, *converted, *check_size(path, size, observations.xy)]
    reconstruction = assemble(lenses, images, observations, xyz, rgb)
    miss = float(np.median(reconstruction.points.error))
    if not miss < MISS * size[0]:
        raise UserError(
            f"{path}: the points project {miss:.0f} pixels from their features in pictures of"
            f" {size[0]}x{size[1]}; give the footage that was solved"
        )
    return Imported(reconstruction, f"{FORMAT} (NVM_V3)", tuple(notes), model.names)


@dataclass(frozen=True)
class _Camera:
    image: Image
    """`Image.frame` is the index in the model."""
    focal: float
    radial: float
    line: int


@dataclass(frozen=True)
class _Model:
    names: tuple[str, ...]
    cameras: list[_Camera]
    numbers: Numbers
    starts: NDArray[np.int64]
    """(points,) index of each point's first number."""


def _fixed(text: Text) -> list[float] | None:
    """Return fx, cx, fy, cy and r of the header, shared by all cameras; None without FixedK."""
    words = text.demand("NVM_V3").split()
    if (version := words.pop(0)) != "NVM_V3":
        raise text.wrong(f"NVM_V3, not {version[:40]!r}")
    if not words:
        words = text.demand("the number of cameras").split()
        if words[0] != "FixedK":
            text.back()
            return None
    if words[0] != "FixedK" or len(words) not in (5, 6):
        raise text.wrong("nothing after the version, or FixedK fx cx fy cy r")
    fixed = [*text.row(words[1:], len(words) - 1, "numbers").tolist(), 0.0][:5]
    if not (fixed[0] > 0 and fixed[2] > 0):
        raise text.wrong("FixedK with focal lengths greater than zero")
    return fixed


def _largest_model(text: Text) -> tuple[_Model, list[str]]:
    """Return the model with the most registered cameras, and notes."""
    best: _Model | None = None
    sizes: list[int] = []
    while True:
        row = text.next()
        # A list of PLY files may follow the models.
        if row is None or row == "0" or row.startswith("#"):
            break
        count = text.count(row, "cameras", 2 * (NUMBERS + 1))
        names, cameras = _cameras(text, count)
        sizes.append(len(cameras))
        row = text.next()
        points = 0 if row is None else text.count(row, "points", 14)
        if best is None or len(cameras) > len(best.cameras):
            best = _model(text, names, cameras, points)
        else:
            for number in range(points):
                text.demand(f"{points - number} more points")
    if best is None:
        raise text.ends("the number of cameras") if row is None else text.wrong("at least one camera")
    others = len(sizes) - 1
    left_out = sum(sizes) - len(best.cameras)
    are = "camera of the others is" if left_out == 1 else "cameras of the others are"
    note = f"the file has {len(sizes)} models; the largest is imported, {left_out} {are} left out"
    return best, [note] if others else []


def _cameras(text: Text, count: int) -> tuple[tuple[str, ...], list[_Camera]]:
    names: list[str] = []
    cameras: list[_Camera] = []
    for index in range(count):
        # From the right, because a name may have spaces.
        parts = text.demand(f"camera {index + 1} of {count}").rsplit(maxsplit=NUMBERS)
        if len(parts) != NUMBERS + 1:
            raise text.wrong(f"a file name and {NUMBERS} numbers")
        values = text.row(parts[1:], NUMBERS, f"{NUMBERS} numbers")
        # VisualSFM writes a space in a name as a quotation mark.
        names.append(parts[0].strip('"').replace('"', " "))
        focal = float(values[0])
        if focal == 0:
            continue
        if focal < 0:
            raise text.wrong("a focal length greater than zero")
        if not np.linalg.norm(values[1:5]) > 1e-9:
            raise text.wrong("a quaternion that is not zero")
        rotation = matrix_from_quaternion(values[1:5])
        image = Image(index, rotation, -rotation @ values[5:8])
        cameras.append(_Camera(image, focal, float(values[-2]), text.line))
    return tuple(names), cameras


def _model(text: Text, names: tuple[str, ...], cameras: list[_Camera], points: int) -> _Model:
    numbers = text.numbers(points)
    per_line = np.diff(numbers.ends, prepend=0)
    filled = np.flatnonzero(per_line)
    per_line = per_line[filled]
    starts = numbers.ends[filled] - per_line
    short = np.flatnonzero(per_line < 7)
    if len(short):
        raise text.wrong("X Y Z R G B, a count and features", int(numbers.lines[filled[short[0]]]))
    views = numbers.values[starts + 6]
    wrong = np.flatnonzero(views * 4 + 7 != per_line)
    if len(wrong):
        row = wrong[0]
        expected = f"{views[row]:g} features of 4 numbers each, not {per_line[row] - 7} numbers"
        raise text.wrong(expected, int(numbers.lines[filled[row]]))
    return _Model(names, cameras, numbers, starts)


def _lenses(
    text: Text,
    fixed: list[float] | None,
    model: _Model,
    point: Floats,
    is_absolute: bool,
    size: tuple[int, int],
) -> tuple[list[Intrinsics], list[str]]:
    """Return the cameras' lenses with the principal point (2,), and notes on the error of conversion."""
    lenses: list[Intrinsics] = []
    worst = 0.0
    for camera in model.cameras:
        fx, _, fy, _, radial = fixed or (camera.focal, 0.0, camera.focal, 0.0, camera.radial)
        lens = Intrinsics(*size, fx, fy, float(point[0]), float(point[1]))
        if is_absolute or radial == 0:
            lenses.append(replace(lens, k1=-radial) if radial else lens)
            continue
        found = undistorting(lens, radial, 0.0)
        if found is None:
            raise text.wrong(
                "the radial distortion of a lens, under which the picture does not fold", camera.line
            )
        lenses.append(found[0])
        worst = max(worst, found[1])
    if worst <= ACCURATE:
        return lenses, []
    return lenses, [
        f"the lens distortion is converted with an error of up to {worst:.2f} pixels in the corners"
    ]
