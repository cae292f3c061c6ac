"""Dense depth in layers, with hidden surfaces behind silhouettes."""

from ...base.progress import stage
from ...optics.thin_lens import ThinLens
from ...warp.disocclusion_fill import HiddenColours
from ...warp.layer import Layer
from ...warp.layered_mesh import WIDEST, layer_mesh
from ..frame import Frame, Mesher, equal_share_views

FILLED = 0.25
"""Share of the mesher's time for hidden colours: `frame_costs`, 1920x1080."""


def can_be_layered(lens: ThinLens, blur: float) -> bool:
    """Return whether a frame with blur discs of `blur` pixels can be drawn by layers."""
    return blur / 2 < WIDEST * max(lens.pinhole.width, lens.pinhole.height)


def hidden_colours(frame: Frame) -> HiddenColours | None:
    """Return other frames' colours for hidden positions; None if they are not asked for."""
    assert frame.depth is not None
    if not frame.options.borrow:
        return None
    with stage("Hidden surfaces", 0.0, FILLED):
        return frame.clip.hidden_colours(
            frame.number, frame.canvas, frame.picture, frame.depth, frame.options.highlights
        )


def make(frame: Frame) -> tuple[Layer, ...]:
    """Make the layers of the frame's depth, with hidden colours from other frames."""
    assert frame.depth is not None
    hidden, most = hidden_colours(frame), frame.options.quality.largest_texture
    with stage("Mesh", FILLED, 1.0):
        return layer_mesh(frame.picture, frame.depth, frame.lens, hidden, most, frame.beyond)


MESHER = Mesher(
    "layers", 2, "Depth for every pixel, with separate layers for what lies behind silhouettes", make,
    equal_share_views, needs_pixel_depth=True, is_prefiltered=True, settings=("borrow",),
)  # fmt: skip
