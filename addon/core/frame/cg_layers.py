"""CG objects in a frame: layers beside those of the clip, drawn by the same views."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..base.arrays import LinearRGB, LinearRGBA
from ..camera.canvas import Canvas
from ..camera.reconstruction import Intrinsics
from ..depth.source import PixelDepth
from ..warp.cg_layer import CGLayer
from ..warp.mesh import WarpMesh


@dataclass(frozen=True)
class CGObjects:
    """CG objects as the frame's camera sees them."""

    layers: tuple[CGLayer, ...] = ()
    shadow: LinearRGB | None = None
    """(h, w, 3) share of the clip's light in their shadow, over the canvas; None without shadows."""

    def scaled(self, before: Intrinsics, after: Intrinsics) -> CGObjects:
        """Scale to another canvas with the same pinhole at another size."""
        if before == after:
            return self
        shadow = self.shadow
        if shadow is not None:
            size = after.width, after.height
            shadow = np.asarray(cv2.resize(shadow, size, interpolation=cv2.INTER_AREA), np.float32)
        return CGObjects(tuple(each.scaled(before, after) for each in self.layers), shadow)

    def shaded(self, picture: LinearRGBA) -> LinearRGBA:
        """Return the canvas's picture (h, w, 4) with their shadows."""
        if self.shadow is None:
            return picture
        return np.concatenate([picture[..., :3] * self.shadow, picture[..., 3:]], axis=2)


NO_CG = CGObjects()
DrawCG = Callable[[int, Canvas, PixelDepth | None], CGObjects]
"""Draws the CG objects of a frame for a canvas, with its depth if known."""


@dataclass(frozen=True)
class CGSurface:
    """A layer of CG objects prepared for its views."""

    layer: CGLayer
    mesh: WarpMesh
    texture: LinearRGBA
    """(h, w, 4) linear, premultiplied."""

    def painted(self, value: float) -> CGSurface:
        """Replace its colours by one value: with 0 it only occludes."""
        return replace(self, texture=self.texture[..., 3:] * np.array([value, value, value, 1], np.float32))


def joined(
    mesh: WarpMesh, texture: LinearRGBA, opaque: int, surfaces: Sequence[CGSurface]
) -> tuple[WarpMesh, LinearRGBA]:
    """Join a frame's mesh and texture (h, w, 4) with those of CG objects, which lie below in the texture.

    The first `opaque` triangles come first. The others, which may be half covered, and those of the CG
    objects follow from far to near, so that they blend in the order of depth.
    """
    mesh, texture = _within(mesh, texture)
    width = max(each.shape[1] for each in (texture, *(one.texture for one in surfaces)))
    parts, meshes = [_widened(texture, width)], [mesh]
    height, first = texture.shape[0], len(mesh.xy)
    for each in surfaces:
        below = replace(
            each.mesh,
            texture_xy=each.mesh.texture_xy + np.array([0, height]),
            triangles=each.mesh.triangles + first,
        )
        parts.append(_widened(each.texture, width))
        meshes.append(below)
        height, first = height + each.texture.shape[0], first + len(each.mesh.xy)
    inverse = np.concatenate([each.inverse_depth for each in meshes])
    order = np.concatenate([each.nearness for each in meshes])
    triangles = np.concatenate([each.triangles for each in meshes])
    nearness = order[triangles].min(axis=1)
    # The sort is stable, so that the first triangles, which are equal, keep their order.
    nearness[:opaque] = -np.inf
    ordered = triangles[np.argsort(nearness, kind="stable")]
    whole = WarpMesh(
        np.concatenate([each.xy for each in meshes]), np.concatenate([each.texture_xy for each in meshes]),
        inverse, ordered.astype(np.int32), order if any(each.order is not None for each in meshes) else None,
    )  # fmt: skip
    return whole, np.concatenate(parts)


def _within(mesh: WarpMesh, texture: LinearRGBA) -> tuple[WarpMesh, LinearRGBA]:
    """Extend a texture (h, w, 4) by mirroring as far as its mesh uses it."""
    size = np.array(texture.shape[1::-1])
    beyond = np.maximum(-mesh.texture_xy, mesh.texture_xy - size).max(initial=-1)
    if beyond <= 0:
        return mesh, texture
    margin = int(np.ceil(beyond)) + 1
    wide = np.pad(texture, ((margin, margin), (margin, margin), (0, 0)), mode="symmetric")
    return replace(mesh, texture_xy=mesh.texture_xy + margin), wide


def _widened(texture: LinearRGBA, width: int) -> LinearRGBA:
    return np.pad(texture, ((0, 0), (0, width - texture.shape[1]), (0, 0)))
