"""Models from tables of poses and lenses without points."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..base.arrays import Floats
from ..base.errors import UserError
from ..base.numbers import LARGEST
from ..camera.reconstruction import NO_POINTS, Image, Intrinsics, Reconstruction, matrix_from_quaternion
from .building import rotation_from
from .parsing import wrong

OPENGL = np.diag([1.0, -1.0, -1.0])
"""Rotation from a camera that looks along -z with y up (OpenGL, Blender, nerfstudio, ARKit) to ours."""
OPENCV = np.eye(3)
"""Rotation from a camera that looks along +z with y down to ours."""
DIGITS = 3
"""Digits of a pixel that distinguish the lenses of frames: a phone's focus changes constantly."""


def finite(value: object, shape: tuple[int, ...], place: str, what: str) -> Floats:
    """Convert to an array of a shape, -1 for any length; raises UserError "PLACE: expected WHAT"."""
    try:
        # JSON may hold ragged lists, text, or whole numbers of any size.
        array = np.asarray(value, dtype=np.float64)
        fits = array.ndim == len(shape) and all(a in (-1, b) for a, b in zip(shape, array.shape, strict=True))
    except (ValueError, TypeError, OverflowError):
        fits = False
    if not fits or not np.all(np.abs(array) <= LARGEST):
        raise wrong(place, f"{what}, of numbers up to {LARGEST:g}")
    return array


def lens(place: str, model: str, size: tuple[float, float], values: Sequence[float]) -> Intrinsics:
    """Call `Intrinsics.from_parameters`, and add the place to its errors."""
    width, height = size
    if not np.all(np.abs(np.asarray(values, np.float64)) <= LARGEST):
        raise wrong(place, f"camera parameters up to {LARGEST:g}")
    if not (width % 1 == 0 and height % 1 == 0):
        raise wrong(place, f"a size in whole pixels, not {width:g} x {height:g}")
    try:
        return Intrinsics.from_parameters(model, int(width), int(height), values)
    except UserError as error:
        raise wrong(place, str(error).removeprefix("expected ")) from None


def cameras(to_world: Floats, axes: Floats, lenses: Sequence[Intrinsics], place: str) -> Reconstruction:
    """Make a model without points from camera-to-world matrices; `Image.frame` is the row.

    Args:
        to_world: (n, 3 or 4, 4) matrices.
        axes: (3, 3) rotation from the file's camera space to ours.
        lenses: One for each row.
        place: Place of a row for errors, with `{}` for its number.

    Raises:
        UserError: A matrix is not a rotation.
    """
    kinds: dict[Intrinsics, int] = {}
    images = []
    for row, (matrix, seen_by) in enumerate(zip(to_world, lenses, strict=True)):
        problem = wrong(place.format(row), "a camera-to-world matrix of a rotation and a position")
        rotation = axes @ rotation_from(matrix[:3, :3], problem).T
        number = kinds.setdefault(seen_by, len(kinds))
        images.append(Image(row, rotation, -rotation @ matrix[:3, 3], camera=number))
    return Reconstruction(tuple(kinds), tuple(images), NO_POINTS)


def to_world(quaternions: Floats, positions: Floats, place: Path) -> Floats:
    """Return (n, 3, 4) camera-to-world matrices of quaternions x, y, z, w (n, 4) and positions (n, 3)."""
    length = np.linalg.norm(quaternions, axis=1)
    if not np.all(length > 1e-6):
        raise UserError(f"{place}: pose {int(np.argmin(length))} has a quaternion that is zero")
    rotations = [matrix_from_quaternion(each) for each in quaternions[:, [3, 0, 1, 2]]]
    return np.concatenate([np.reshape(rotations, (-1, 3, 3)), positions[..., None]], axis=2)
