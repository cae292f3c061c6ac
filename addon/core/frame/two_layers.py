"""A sharp frame in two layers for other programs: visible and hidden surfaces."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..base.arrays import LinearRGBA, Map, pixel_centres
from ..base.errors import UserError
from ..optics.thin_lens import ThinLens
from ..warp.layered_mesh import cut
from .clip_context import ClipContext
from .forecast import open_frame
from .frame import Frame
from .frame_path import prepared
from .meshers.layers import hidden_colours
from .passes import distances, in_source
from .plan import FrameOptions


@dataclass(frozen=True)
class TwoLayers:
    """The layers of a frame in the source frame's geometry.

    Colours (H, W, 4) are linear and premultiplied. Depths (H, W) are distances along the camera's axis in
    scene units, `passes.INFINITE` in empty pixels. Front over hidden is the frame.
    """

    front: LinearRGBA
    front_depth: Map
    hidden: LinearRGBA
    """Surfaces behind silhouettes, transparent elsewhere."""
    hidden_depth: Map

    def channels(self) -> dict[str, Map]:
        """Return channels by their names in Blender's multi-layer EXR: layer, pass, channel."""
        layers = {"Front": (self.front, self.front_depth), "Hidden": (self.hidden, self.hidden_depth)}
        return {
            f"{layer}.{name}": values
            for layer, (colour, depth) in layers.items()
            for name, values in [
                *((f"Combined.{each}", colour[..., number]) for number, each in enumerate("RGBA")),
                ("Depth.Z", depth),
            ]
        }


def two_layers(clip: ClipContext, number: int, options: FrameOptions, size: tuple[int, int]) -> TwoLayers:
    """Make the layers of a frame at the clip's size (width, height); passes checkpoints.

    The hidden layer extends behind silhouettes as far as the lens of the options sees. Raises UserError as
    `mesh_frame` does, and if the frame cannot be layered.
    """
    picture = clip.picture(number, options.highlights)
    # Restored light stays in the picture: no discs are drawn here, and no steadier path.
    unlit = replace(options.highlights, gain=0.0)
    plain = replace(options, method="layers", highlights=unlit, stabilize=0.0, sensor=0.0)
    frame = prepared(open_frame(clip, number, plain, size, picture))
    if frame.why:
        raise UserError(f"frame {number} cannot be exported in layers: {frame.why}")
    return layers_of(frame)


def layers_of(frame: Frame) -> TwoLayers:
    """Cut a prepared frame, and reduce its layers to the two nearest."""
    assert frame.depth is not None
    canvas, lens = frame.canvas, frame.lens
    splits, wide, _ = cut(frame.picture, frame.depth, lens, hidden_colours(frame), frame.beyond)
    margin = (wide.shape[0] - frame.picture.shape[0]) // 2
    own = (slice(margin, -margin),) * 2
    front, shift = frame.picture.copy(), splits[0].front_disparity[own].copy()
    hidden = np.zeros_like(front)
    behind = np.zeros_like(shift)
    # The first split has the largest silhouettes: it comes last.
    for split in reversed(splits):
        at = (split.occluded | split.mixed)[own]
        front[at], shift[at] = split.front[own][at], split.front_disparity[own][at]
        hidden[at], behind[at] = split.back[own][at], split.back_disparity[own][at]
    depth = partial(_inverse_depth, lens)
    nothing = hidden[..., 3] == 0
    back = np.where(nothing, np.float32(0), depth(behind))
    return TwoLayers(
        canvas.to_source(front), distances(in_source(depth(shift), canvas)),
        canvas.to_source(hidden), distances(in_source(back, canvas)),
    )  # fmt: skip


def _inverse_depth(lens: ThinLens, disparity: Map) -> Map:
    """Convert disparities (H, W) relative to the focal plane to inverse depth."""
    inverse = lens.focus + disparity / np.float64(lens.disparity_scale)
    return np.asarray(lens.unrectified(inverse, pixel_centres(*disparity.shape[::-1])), np.float32)
