"""Layers: the surfaces of a frame and its CG objects, as views draw them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, LinearRGBA, Map, Mask
from .mesh import WarpMesh

INPAINTED, BORROWED, OWN = range(3)
"""Sources of light: inpainted or mirrored; other frames; the frame itself."""


@dataclass(frozen=True)
class Layer:
    """A surface with its picture, which is transparent past its silhouettes."""

    mesh: WarpMesh
    """Its triangles from far to near; inverse depths are `ThinLens.rectified`."""
    picture: LinearRGBA
    """(n h, n w, 4) linear and premultiplied, with n texels a pixel along each axis; sampled by the mesh."""
    is_opaque: bool = True
    """True if nothing shows through its triangles."""
    disparity: Map = field(default_factory=lambda: np.zeros((0, 0), np.float32))
    """(h, w) pixels at the aperture's rim relative to the focal plane; empty if only the mesh knows them."""
    alpha: Map = field(default_factory=lambda: np.zeros((0, 0), np.float32))
    """(h, w) opacity, 0 where another surface goes on."""
    covered: Mask = field(default_factory=lambda: np.zeros((0, 0), bool))
    """(h, w) pixels covered by its triangles, rim included."""
    buried: Mask = field(default_factory=lambda: np.zeros((0, 0), bool))
    """(h, w) pixels behind which no view sees anything."""
    origin: NDArray[np.uint8] = field(default_factory=lambda: np.zeros((0, 0), np.uint8))
    """(h, w) sources of its light, such as `OWN`."""
    jump: float = np.inf
    """Pixels of disparity above which its neighbours are cut."""

    @property
    def finer(self) -> int:
        """Texels a pixel along each axis."""
        return int(self.picture.shape[1] // self.disparity.shape[1])

    def painted(self, colour: Map | float) -> Layer:
        """Replace its colours by those of its pixels (h, w, 3), or by one value: with 0 it only occludes."""
        finer, mesh = self.finer if self.disparity.size else 1, self.mesh
        # A pixel's centre is a texel's centre.
        alpha = self.picture[::finer, ::finer, 3:]
        values = np.broadcast_to(np.asarray(colour, np.float32), (*alpha.shape[:2], 3))
        mesh = replace(mesh, texture_xy=(mesh.texture_xy - 0.5) / finer + 0.5)
        return replace(self, picture=np.concatenate([alpha * values, alpha], axis=2), mesh=mesh)


def joined(layers: Sequence[Layer]) -> WarpMesh:
    """Join the meshes of layers, whose pictures lie below each other in one texture, as in `atlas`.

    Opaque triangles come first, in their order. The others follow from far to near, so that they blend in the
    order of depth.
    """
    if len(layers) == 1:
        return layers[0].mesh
    layers = [_within(each) for each in layers]
    meshes = [each.mesh for each in layers]
    above = np.cumsum([0, *(each.picture.shape[0] for each in layers)])
    first = np.cumsum([0, *(len(each.xy) for each in meshes)])
    order: Floats = np.concatenate([each.nearness for each in meshes])
    triangles = np.concatenate([each.triangles + n for each, n in zip(meshes, first, strict=False)])
    opaque = np.repeat([each.is_opaque for each in layers], [len(each.triangles) for each in meshes])
    # The sort is stable, so that opaque triangles, which are equal, keep their order.
    nearness = np.where(opaque, -np.inf, order[triangles].min(axis=1))
    return WarpMesh(
        np.concatenate([each.xy for each in meshes]),
        np.concatenate([each.texture_xy + np.array([0, n]) for each, n in zip(meshes, above, strict=False)]),
        np.concatenate([each.inverse_depth for each in meshes]),
        triangles[np.argsort(nearness, kind="stable")].astype(np.int32), order,
    )  # fmt: skip


def atlas(layers: Sequence[Layer]) -> LinearRGBA:
    """Return the pictures of layers below each other in one texture (h, w, 4)."""
    if len(layers) == 1:
        return layers[0].picture
    parts = [_within(each).picture for each in layers]
    width = max(each.shape[1] for each in parts)
    return np.concatenate([np.pad(each, ((0, 0), (0, width - each.shape[1]), (0, 0))) for each in parts])


def _within(layer: Layer) -> Layer:
    """Extend a picture by mirroring as far as its mesh uses it."""
    mesh, picture = layer.mesh, layer.picture
    beyond = np.maximum(-mesh.texture_xy, mesh.texture_xy - picture.shape[1::-1]).max(initial=-1)
    if beyond <= 0:
        return layer
    margin = int(np.ceil(beyond)) + 1
    wide = np.pad(picture, ((margin, margin), (margin, margin), (0, 0)), mode="symmetric")
    return replace(layer, mesh=replace(mesh, texture_xy=mesh.texture_xy + margin), picture=wide)
