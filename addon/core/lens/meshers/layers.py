"""Layers: depth of every pixel, and what silhouettes hide on a surface of its own."""

from __future__ import annotations

import numpy as np

from ...base.arrays import LinearRGB, LinearRGBA, Map, Mask
from ...base.progress import stage
from ...warp.disocclusion_fill import HiddenColours
from ...warp.layered_depth_image import Fill
from ...warp.layered_mesh import LayeredMeshOptions, layer_mesh
from ..thin_lens import ThinLens
from .mesher import FrameGeometry, Mesher, Surface, equal_share_views

FILLED = 0.25
"""Share of the mesher's time that is over once hidden colours are found: `frame_costs`, 1920x1080."""


def can_be_layered(lens: ThinLens, blur: float) -> bool:
    """Whether blur discs of `blur` pixels leave anything of a frame's surfaces to be drawn by layers."""
    return blur / 2 < LayeredMeshOptions.widest * max(lens.pinhole.width, lens.pinhole.height)


def make(geometry: FrameGeometry) -> Surface:
    """The mesh of the frame's layered depth image, with other frames' colours for what it does not show."""
    assert geometry.depth is not None
    lens, picture, past = geometry.lens, geometry.picture, geometry.depth.past_border
    inverse_depth = lens.untilted_raster(geometry.depth.inverse_depth)
    scale = lens.radius * lens.pinhole.fx
    hidden = None
    if geometry.settings.borrow:
        with stage("Hidden surfaces", 0.0, FILLED):
            hidden = geometry.clip.hidden_colours(
                geometry.frame, geometry.canvas, picture, geometry.depth, geometry.settings.highlights
            )

    with stage("Mesh", FILLED, 1.0):
        mesh, texture, layers = layer_mesh(
            picture, scale * inverse_depth, scale * lens.focus, scale, lens.snap_displacement,
            _fill(hidden, picture, lens, scale) if hidden else None,
            geometry.settings.quality.mesh, geometry.clip.texture_memory,
            None if past is None else scale * lens.untilted_raster(past), lens.stretch,
        )  # fmt: skip
    return Surface(mesh, texture, bool(picture[..., 3].min() > 0.999), layers)


def _fill(hidden: HiddenColours, picture: LinearRGBA, lens: ThinLens, scale: float) -> Fill:
    """Hidden colours as a raster around the picture asks for them: by disparity, `scale` times inverse depth
    relative to that of the focal plane."""

    def fill(disparity: Map, asked: Mask) -> tuple[LinearRGB, Mask]:
        row, column = np.nonzero(asked)
        corner = (np.array(disparity.shape) - picture.shape[:2]) // 2
        places = np.column_stack([column - corner[1], row - corner[0]]) + 0.5
        colour, found = np.zeros((*disparity.shape, 3), np.float32), np.zeros(disparity.shape, bool)
        inverse = lens.focus + disparity[row, column] / np.float64(scale)
        colour[row, column], found[row, column] = hidden(places, lens.tilted(inverse, places))
        return colour, found

    return fill


MESHER = Mesher(
    "layers", 2, "Depth of every pixel; what lies behind silhouettes on a layer of its own", make,
    equal_share_views, needs_pixel_depth=True, is_prefiltered=True, settings=("borrow",),
)  # fmt: skip
