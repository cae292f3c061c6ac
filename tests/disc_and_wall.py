"""A disc before a wall, whose displacement at the rim of the aperture is known, and the mesh over it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from addon.core.base.arrays import Floats, LinearRGB, LinearRGBA, Map, Mask
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Intrinsics, Points, Reconstruction
from addon.core.depth.source import PixelDepth
from addon.core.depth.sparse import DepthSamples
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext, no_picture
from addon.core.frame.frame import Frame
from addon.core.frame.meshers import MESHERS
from addon.core.frame.plan import FrameOptions
from addon.core.frame.views import Views
from addon.core.optics.aperture import ApertureSamples
from addon.core.optics.aperture_sampling import vogel_disc
from addon.core.optics.thin_lens import ThinLens
from addon.core.warp.disocclusion_fill import HiddenColours
from addon.core.warp.layer import Layer
from addon.core.warp.layered_depth_image import Fill
from addon.core.warp.layered_mesh import LARGEST_TEXTURE, layer_mesh
from addon.core.warp.quadtree import Surfaces

SIZE = (120, 160)
Y, X = np.mgrid[: SIZE[0], : SIZE[1]] + 0.5
LENS = Intrinsics(SIZE[1], SIZE[0], 150.0, 150.0, SIZE[1] / 2, SIZE[0] / 2)
DISC = 30.0
"""Radius of the disc in front, in pixels."""
NEAR, FAR = 9.0, 1.0
RADIUS = 1.0
"""Of an aperture whose rim displaces by what `SHIFT` says."""


def cover(shift_x: float = 0.0, shift_y: float = 0.0) -> Floats:
    """(H, W) share of each pixel that the disc covers, seen from beside."""
    far = np.hypot(X - 80 - shift_x, Y - 60 - shift_y)
    return np.asarray(np.clip(DISC - far + 0.5, 0, 1))


def wall(shift_x: float = 0.0, shift_y: float = 0.0) -> Floats:
    """(H, W, 3) what is behind, smooth."""
    x, y = X - shift_x, Y - shift_y
    return np.stack([0.4 + 0.2 * np.sin(x / 3), 0.4 + 0.2 * np.cos(y / 2.5), 0.3 + 0 * x], axis=2)


def scene(shift_x: float = 0.0, shift_y: float = 0.0) -> NDArray[np.float32]:
    """(H, W, 4) a yellow disc before the wall from a place on the aperture, in shares of its radius."""
    share = cover(NEAR * shift_x, NEAR * shift_y)[..., None]
    colour = share * [0.9, 0.8, 0.1] + (1 - share) * wall(FAR * shift_x, FAR * shift_y)
    return np.concatenate([colour, np.ones((*SIZE, 1))], axis=2).astype(np.float32)


SHIFT = np.where(cover() > 0.5, NEAR, FAR)


def interpolated(depth: Floats, triangles: NDArray[np.int32]) -> Floats:
    """The mesh's depth at every pixel, NaN where there is none."""
    height, width = depth.shape
    result = np.full(depth.shape, np.nan)
    for corners in triangles:  # a test's picture is small
        row, column = np.divmod(corners, width)
        y, x = np.mgrid[row.min() : row.max() + 1, column.min() : column.max() + 1]
        system = np.array([column, row, np.ones(3)], np.float64)
        share = np.linalg.solve(system, np.array([x.ravel(), y.ravel(), np.ones(x.size)]))
        inside = (share >= -1e-9).all(axis=0)
        result[y.ravel()[inside], x.ravel()[inside]] = (share.T @ depth.ravel()[corners])[inside]
    assert result.shape == (height, width)
    return result


def one(depth: Floats) -> Surfaces:
    """A single surface."""
    none = np.zeros(depth.shape, bool)
    return Surfaces(depth, depth, depth, none, none, none)


def make_mesh(
    picture: LinearRGBA,
    disparity: Floats,
    focus: float,
    scale: float,
    fill: Fill | None = None,
    largest_texture: int = LARGEST_TEXTURE,
    past_border: Floats | None = None,
) -> tuple[Layer, ...]:
    """`layer_mesh` of a picture whose disparities (H, W) at the rim of the aperture are known, and that of
    what is in focus, in pixels; over `scale` they are inverse depths."""
    height, width = disparity.shape
    camera = Intrinsics(width, height, scale, scale, width / 2, height / 2)
    past = None if past_border is None else (past_border / scale).astype(np.float32)
    return layer_mesh(
        picture, PixelDepth(disparity / scale, past_border=past), ThinLens(camera, 1.0, focus / scale),
        None if fill is None else _at_places(fill, focus, scale, disparity.shape), largest_texture,
    )  # fmt: skip


def _at_places(fill: Fill, focus: float, scale: float, size: tuple[int, ...]) -> HiddenColours:
    """What a raster around the picture tells by disparity relative to the focal plane, as asked for by place
    and inverse depth."""

    def hidden(places: Floats, inverse: Floats) -> tuple[LinearRGB, Mask]:
        if not len(places):
            return np.zeros((0, 3), np.float32), np.zeros(0, bool)
        column, row = np.floor(places).astype(int).T
        past = [-column.min(), column.max() + 1 - size[1], -row.min(), row.max() + 1 - size[0], 0]
        margin = int(max(past))
        at = row + margin, column + margin
        shape = size[0] + 2 * margin, size[1] + 2 * margin
        shift: Map = np.zeros(shape, np.float32)
        wanted = np.zeros(shape, bool)
        shift[at], wanted[at] = scale * inverse - focus, True
        colour, known = fill(shift, wanted)
        return colour[at], known[at]

    return hidden


def disc_and_wall(
    focus: float = NEAR,
    shift: Floats = SHIFT,
    fill: Fill | None = None,
    largest_texture: int = LARGEST_TEXTURE,
) -> Frame:
    """The scene of the layers' tests, ready to be drawn."""
    layers = make_mesh(scene(), shift, focus, LENS.fx, fill, largest_texture)
    canvas, thin, none = Canvas(LENS), ThinLens(LENS, RADIUS, focus / LENS.fx), np.zeros((0, 2))
    views = Views(canvas, thin).placed(ApertureSamples(vogel_disc(24)))
    sure = np.where(X < 80, 1, 0).astype(np.float32)
    nothing = Reconstruction((LENS,), (), Points(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0)))
    samples = DepthSamples(1, none, np.zeros(0), False)
    return Frame(
        1, ClipContext(nothing, no_picture), FrameOptions(Focus(), RADIUS), MESHERS["layers"], canvas,
        scene(), scene(), scene(), thin, samples, views, depth=PixelDepth(shift / LENS.fx, sure),
        layers=layers,
    )  # fmt: skip
