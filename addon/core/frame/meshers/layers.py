"""Dense depth in layers, with hidden surfaces behind silhouettes."""

from ...base.progress import stage
from ...optics.thin_lens import ThinLens
from ...warp.layered_mesh import WIDEST, layer_mesh
from .mesher import FrameGeometry, Mesher, Surface, equal_share_views

FILLED = 0.25
"""Share of the mesher's time for hidden colours: `frame_costs`, 1920x1080."""


def can_be_layered(lens: ThinLens, blur: float) -> bool:
    """Return whether a frame with blur discs of `blur` pixels can be drawn by layers."""
    return blur / 2 < WIDEST * max(lens.pinhole.width, lens.pinhole.height)


def make(geometry: FrameGeometry) -> Surface:
    """Make the mesh of the frame's layered depth image, with hidden colours from other frames."""
    assert geometry.depth is not None
    hidden = None
    if geometry.settings.borrow:
        with stage("Hidden surfaces", 0.0, FILLED):
            hidden = geometry.clip.hidden_colours(
                geometry.frame,
                geometry.canvas,
                geometry.picture,
                geometry.depth,
                geometry.settings.highlights,
            )
    quality = geometry.settings.quality
    with stage("Mesh", FILLED, 1.0):
        mesh, texture, layers = layer_mesh(
            geometry.picture, geometry.depth, geometry.lens, hidden, quality.largest_texture,
            geometry.beyond,
        )  # fmt: skip
    return Surface(mesh, texture, bool(geometry.picture[..., 3].min() > 0.999), layers)


MESHER = Mesher(
    "layers", 2, "Depth for every pixel, with separate layers for what lies behind silhouettes", make,
    equal_share_views, needs_pixel_depth=True, is_prefiltered=True, settings=("borrow",),
)  # fmt: skip
