"""The warp mesh of a frame whose every pixel's depth is known: two layers in one mesh, with their picture."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np

from .layers import Fill, Layers, Picture, layered
from .quadtree import Surfaces, triangulate
from .reconstruction import Floats, Ints
from .warpmesh import WarpMesh

ERROR, RELATIVE = 0.33, 0.03
"""Pixels by which a view may see a place of the mesh beside where its depth puts it, and how much of the
blur's radius there beside."""
JUMP, JUMPS = 0.19, (1.0, 3.0)
"""Of the largest blur's radius, by which neighbours must be displaced apart to be cut; in these bounds."""
FINER = 2
"""Times as fine as the frame is its texture: a view loses less by looking between its pixels."""
LARGEST_TEXTURE = 24_000_000
"""Pixels; a larger one stays as coarse as the frame."""
WIDEST = 0.25
"""Of the long side; surfaces that are displaced farther from the focal plane than that come back to it."""


def layer_mesh(
    picture: Picture,
    shift: Floats,
    focus: float,
    scale: float,
    settle: Callable[[Floats], Floats] = lambda shift: shift,
    fill: Fill | None = None,
) -> tuple[WarpMesh, Picture, Layers]:
    """A mesh, its texture (h, w, 4), and the layers it was made of.

    `picture` (H, W, 4) is the canvas picture, linear and premultiplied; `shift` (H, W) the displacement in
    pixels of every pixel at the rim of the aperture, and `focus` that of the focal plane; displacement over
    `scale` is inverse depth. `settle` moves displacements (H, W) that are drawn elsewhere than they are, as
    into the focal plane; `fill` tells other frames' colours, on a raster that is so much larger than the
    picture as needs be, its middle on the picture's. Triangles are ordered from far to near.
    """
    reach = WIDEST * max(shift.shape)
    shift = np.clip(shift, focus - reach, focus + reach)
    margin = int(np.ceil(np.abs(shift - focus).max())) + 2
    wide = np.pad(picture, ((margin, margin), (margin, margin), (0, 0)), mode="symmetric")
    shift = np.pad(shift, margin, mode="edge")
    lent = None
    if fill is not None:
        beyond = np.ones(shift.shape, bool)
        beyond[margin:-margin, margin:-margin] = False
        colour, lent = fill(shift, beyond)
        wide[lent, :3] = colour[lent]
    jump = float(np.clip(JUMP * np.abs(shift - focus).max(), *JUMPS))
    layers = layered(wide, shift, fill, jump)
    surfaces = Surfaces(
        settle(layers.front_shift), settle(layers.near_shift), settle(layers.back_shift),
        layers.mixed, layers.is_far, layers.hidden,
    )  # fmt: skip
    # Settling can double what neighbours differ by.
    triangles = triangulate(surfaces, 2 * jump, ERROR + RELATIVE * np.abs(surfaces.far - focus))
    mesh = _joined(
        (
            (surfaces.far, triangles.far, 1),
            (surfaces.near, triangles.near, 0),
            (surfaces.own, triangles.cut, 0),
        ),
        margin,
        scale,
    )
    front = layers.front.copy()
    # Past its silhouettes the near surface is transparent.
    front[layers.is_far & triangles.before] = 0
    layers = replace(layers, front=front, lent=lent)
    finer = 2 * front[..., 0].size * FINER**2 <= LARGEST_TEXTURE
    texture = _texture(wide, layers) if finer else np.concatenate([layers.front, layers.back])
    if finer:
        # A pixel's middle is the middle of a texel: in the focal plane views show the frame's own pixels.
        mesh = replace(mesh, texture_xy=FINER * (mesh.texture_xy - 0.5) + 0.5)
    return mesh, texture, layers


def _texture(picture: Picture, layers: Layers) -> Picture:
    """(2 h, w, 4) the front layer above the back one, finer than the picture (H, W, 4).

    Each is interpolated where it is smooth: the front is what the fine picture has more than the back behind
    it. Interpolated by itself it would ring along every silhouette, where it ends.
    """
    whole, back = (np.maximum(texels(part, cv2.INTER_LANCZOS4), 0) for part in (picture, layers.back))
    alpha = texels(layers.front[..., 3], cv2.INTER_LINEAR)
    back[..., 3] = 1
    front = np.maximum(whole - (1 - alpha)[..., None] * back, 0)
    front[..., 3] = alpha
    return np.concatenate([front, back])


def texels(picture: Picture, flags: int) -> Picture:
    """The texture of a picture (H, W[, c]) whose pixels are every `FINER`th of it, first one included."""
    height, width = picture.shape[:2]
    scale = np.array([[1 / FINER, 0, 0], [0, 1 / FINER, 0]])
    return np.asarray(
        cv2.warpAffine(
            picture, scale, (FINER * width, FINER * height), flags=flags | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        ),
        np.float32,
    )  # fmt: skip


def _joined(surfaces: tuple[tuple[Floats, Ints, int], ...], margin: int, scale: float) -> WarpMesh:
    """One mesh of surfaces, each displacements (H, W), triangles (T, 3) of pixels, and which of the pictures
    below each other in the texture is painted on it; the first one is whole."""
    height, width = surfaces[0][0].shape
    xy, texture, inverse, triangles = [], [], [], []
    first = 0
    for shift, rows, number in surfaces:
        used, renamed = np.unique(rows, return_inverse=True)
        row, column = np.divmod(used, width)
        place = np.column_stack([column, row]) + 0.5
        xy.append(place - margin)
        texture.append(place + np.array([0, number * height]))
        inverse.append(shift.ravel()[used] / scale)
        triangles.append(renamed.reshape(-1, 3) + first)
        first += len(used)
    depth, joined = np.concatenate(inverse), np.concatenate(triangles)
    # What may be half covered comes last; whole triangles hide it where they are nearer.
    last = np.arange(len(joined)) >= len(triangles[0])
    order = np.lexsort((depth[joined].min(axis=1), last))
    return WarpMesh(np.concatenate(xy), np.concatenate(texture), depth, joined[order].astype(np.int32))
