"""A sharp frame in two layers for other programs: visible and hidden surfaces."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..base.arrays import LinearRGBA, Map, pixel_centres
from ..base.errors import UserError
from ..optics.thin_lens import ThinLens
from .clip_context import ClipContext
from .frame_path import mesh_frame
from .passes import distances, in_source
from .plan import FrameOptions
from .warped_frame import MeshedFrame


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


def two_layers(clip: ClipContext, frame: int, options: FrameOptions, size: tuple[int, int]) -> TwoLayers:
    """Make the layers of a frame at the clip's size (width, height); passes checkpoints.

    The hidden layer extends behind silhouettes as far as the lens of the options sees. Raises UserError as
    `mesh_frame` does, and if the frame cannot be layered.
    """
    picture = clip.picture(frame, options.highlights)
    # Restored light stays in the picture: no discs are drawn here, and no steadier path.
    unlit = replace(options.highlights, gain=0.0)
    plain = replace(options, method="layers", highlights=unlit, stabilize=0.0, sensor=0.0)
    meshed = mesh_frame(clip, frame, plain, size, picture)
    if meshed.why:
        raise UserError(f"frame {frame} cannot be exported in layers: {meshed.why}")
    return layers_of(meshed)


def layers_of(meshed: MeshedFrame) -> TwoLayers:
    """Reduce the layers of a meshed frame to the two nearest."""
    geometry, splits = meshed.geometry, meshed.surface.layers
    canvas = geometry.canvas
    own = splits[0].inner(canvas.pinhole.width, canvas.pinhole.height)
    front, shift = geometry.picture.copy(), splits[0].front_disparity[own].copy()
    hidden = np.zeros_like(front)
    behind = np.zeros_like(shift)
    # The first split has the largest silhouettes: it comes last.
    for split in reversed(splits):
        at = (split.occluded | split.mixed)[own]
        front[at], shift[at] = split.front[own][at], split.front_disparity[own][at]
        hidden[at], behind[at] = split.back[own][at], split.back_disparity[own][at]
    depth = partial(_inverse_depth, geometry.lens)
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
