"""Meshes of quads as plain arrays: boxes, turned bodies, tubes and leaves.

Nothing here knows Blender, so that a benchmark can ray-cast the same geometry.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

UNIT_RECT = (0.0, 0.0, 1.0, 1.0)
"""The whole texture, as (left, bottom, right, top)."""


@dataclass(frozen=True)
class Shape:
    """Vertices (V, 3), quads (F, 4) of indices into them, and texture coordinates (F, 4, 2)."""

    vertices: Floats
    faces: NDArray[np.int32]
    uv: Floats

    def turned(self, degrees: float, axis: str = "z") -> Shape:
        """Turned about a coordinate axis through the origin."""
        angle = np.radians(degrees)
        i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
        matrix = np.eye(3)
        matrix[[i, i, j, j], [i, j, i, j]] = np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)
        return Shape(self.vertices @ matrix.T, self.faces, self.uv)

    def moved(self, x: float, y: float, z: float) -> Shape:
        return Shape(self.vertices + np.array([x, y, z]), self.faces, self.uv)


def join(shapes: Sequence[Shape]) -> Shape:
    """One shape of many, so that a shelf of books is one object."""
    offsets = np.cumsum([0] + [len(shape.vertices) for shape in shapes[:-1]])
    return Shape(
        np.concatenate([shape.vertices for shape in shapes]),
        np.concatenate(
            [shape.faces + offset for shape, offset in zip(shapes, offsets, strict=True)], dtype=np.int32
        ),
        np.concatenate([shape.uv for shape in shapes]),
    )


def box(
    size: tuple[float, float, float], rect: tuple[float, float, float, float] = UNIT_RECT, margin: float = 0.0
) -> Shape:
    """An upright box standing on z = 0, centred in x and y; `rect` of the texture is on every side.

    With a `margin`, all sides but the front (-y) show only the outermost `margin` of the rectangle's
    width: the plain cloth of a book's cover beside the lettering of its spine.
    """
    corners = np.array([[x, y, z] for z in (0.0, 1.0) for y in (-0.5, 0.5) for x in (-0.5, 0.5)])
    faces = np.array([[0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6], [4, 5, 7, 6], [2, 3, 1, 0]])
    left, bottom, right, top = rect
    uv = np.tile([[left, bottom], [right, bottom], [right, top], [left, top]], (6, 1, 1)).astype(np.float64)
    if margin:
        uv[1:, :, 0] = left + (uv[1:, :, 0] - left) * margin
    return Shape(corners * size, faces.astype(np.int32), uv)


def _sheet(points: Floats, wrap_rows: bool = False) -> Shape:
    """A grid of points (rows, columns, 3) as quads, the texture stretched over it."""
    rows, columns = points.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    if wrap_rows:
        index = np.concatenate([index, index[:1]])
    faces = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=-1)
    v, u = np.meshgrid(
        np.linspace(0, 1, index.shape[0]), np.linspace(0, 1, index.shape[1]), indexing="ij"
    )  # fmt: skip
    uv = np.stack([u, v], axis=-1)
    corners = np.stack([uv[:-1, :-1], uv[:-1, 1:], uv[1:, 1:], uv[1:, :-1]], axis=2)
    return Shape(points.reshape(-1, 3), faces.reshape(-1, 4).astype(np.int32), corners.reshape(-1, 4, 2))


def turned_body(profile: ArrayLike, segments: int = 48) -> Shape:
    """The outline (P, 2) of (radius, height) pairs turned about the z axis.

    The texture runs once around, its left edge at the back (+y), and up the outline by arc length.
    """
    outline = np.asarray(profile, dtype=np.float64)
    angles = np.linspace(0, 2 * np.pi, segments + 1) + np.pi / 2
    radius, height = np.maximum(outline[:, 0], 1e-4), outline[:, 1]
    # The seam's vertices are doubled: one vertex cannot have both ends of the texture.
    points = np.stack(
        [
            radius[:, None] * np.cos(angles),
            radius[:, None] * np.sin(angles),
            np.broadcast_to(height[:, None], (len(radius), len(angles))),
        ],
        axis=-1,
    )
    body = _sheet(points)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(outline, axis=0), axis=1))])
    uv = body.uv.copy()
    uv[..., 1] = np.interp(uv[..., 1], np.linspace(0, 1, len(length)), length / length[-1])
    return Shape(body.vertices, body.faces, uv)


def sphere(radius: float, segments: int = 64) -> Shape:
    """A ball about the origin with an equirectangular texture."""
    latitude = np.linspace(-np.pi / 2, np.pi / 2, segments // 2 + 1)
    return turned_body(radius * np.stack([np.cos(latitude), np.sin(latitude)], axis=1), segments)


def tube(path: ArrayLike, radius: float, segments: int = 10, up: ArrayLike = (0.0, 1.0, 0.0)) -> Shape:
    """A round rod along a path (P, 3) that never runs parallel to `up`."""
    centres = np.asarray(path, dtype=np.float64)
    tangent = np.gradient(centres, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.cross(tangent, np.asarray(up, dtype=np.float64))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    over = np.cross(side, tangent)
    angles = np.linspace(0, 2 * np.pi, segments, endpoint=False)[:, None, None]
    return _sheet(centres + radius * (np.cos(angles) * side + np.sin(angles) * over), wrap_rows=True)


def leaf(length: float, width: float, lift: float, droop: float) -> Shape:
    """A leaf from the origin along +x: rising by `lift`, then bending down by `droop` towards its tip."""
    along, across = np.linspace(0, 1, 9)[:, None], np.linspace(-1, 1, 5)[None, :]
    half = 0.5 * width * np.sin(np.pi * np.clip(along, 0.02, 0.99)) ** 0.8
    points = np.stack(
        [
            length * along + 0 * across,
            half * across,
            lift * along - droop * along**2 + 0.25 * half * np.abs(across),
        ],
        axis=-1,
    )
    return _sheet(points)
