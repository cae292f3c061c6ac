"""A frame before its depth is known: its lens and samples, and a forecast from these."""

from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Floats, LinearRGBA
from ..base.errors import UserError
from ..depth.source import NO_PICTURE
from ..depth.sparse import frame_features
from .clip_context import ClipContext
from .frame import Frame
from .meshers import MESHERS
from .meshers.layers import can_be_layered
from .options import check_options
from .plan import FrameOptions
from .views import Views


def drawn_size(options: FrameOptions, size: tuple[int, int], has_cg: bool = False) -> tuple[int, int]:
    """Return the (width, height) at which a frame of a size is drawn.

    A quality may draw it smaller, with sharp pixels from the frame itself.
    """
    can_be_small = MESHERS[options.method].needs_pixel_depth and not options.stabilize
    return options.quality.drawn_size(size, has_cg) if can_be_small else size


@dataclass(frozen=True)
class Forecast:
    """A forecast of a frame from samples of its depth, without its picture."""

    views: int
    """The selected number of views, or about the automatic one."""
    is_too_large: bool
    """True if the frame is drawn by layers and its blur discs are too large for them."""


def forecast(clip: ClipContext, number: int, options: FrameOptions, size: tuple[int, int]) -> Forecast:
    """Forecast a frame's layers; raises the errors of `mesh_frame`."""
    frame = open_frame(clip, number, options, drawn_size(options, size))
    is_too_large = frame.is_layered and not can_be_layered(frame.lens, frame.blur)
    if is_too_large:
        frame = replace(frame, mesher=MESHERS["features"])
    return Forecast(frame.count, is_too_large)


def view_offsets(clip: ClipContext, number: int, options: FrameOptions, size: tuple[int, int]) -> Floats:
    """Return (N, 2) positions of a frame's views on the aperture, in scene units, x right and y down.

    An automatic number is about that of the drawn frame. Raises UserError as `forecast` does.
    """
    frame = open_frame(clip, number, options, drawn_size(options, size))
    return frame.lens.aperture_positions(frame.mesher.views(frame, frame.count).offsets)


def open_frame(
    clip: ClipContext,
    number: int,
    options: FrameOptions,
    size: tuple[int, int],
    source: LinearRGBA = NO_PICTURE,
) -> Frame:
    """Open a frame before its depth; raises UserError for a lens that does not fit it."""
    if not (np.isfinite(options.radius) and options.radius > 0):
        raise UserError(f"the aperture radius is {options.radius:g}; it must be greater than zero")
    check_options(options)
    reconstruction, mesher = clip.reconstruction, MESHERS[options.method]
    canvas = reconstruction.canvas(number, size)
    if mesher.uses_given_depth:
        samples = clip.samples(number, canvas)
    else:
        samples = frame_features(reconstruction, number, canvas)
    lens = options.focus.lens(reconstruction, number, canvas.pinhole, options.radius)
    lens = replace(lens.curved(options.aperture.field_curvature), zone=options.zone)
    wished = {
        "support a tilted focal plane": lens.is_tilted,
        "support an in-focus zone": options.zone.is_active,
        "support field curvature or breathing": options.aperture.field_curvature or options.breathes,
        "stabilize": options.stabilize,
    }
    if not mesher.takes_tilt and (
        what := next((words for words, is_wished in wished.items() if is_wished), "")
    ):
        raise UserError(f"the method {options.method} does not {what}; choose another one")
    samples = replace(samples, inverse_depth=lens.rectified(samples.inverse_depth, samples.observed))
    lens.check(number, samples.inverse_depth)
    picture = canvas.from_source(source) if source.size else source
    return Frame(
        number, clip, options, mesher, canvas, picture, source, source, lens, samples, Views(canvas, lens),
        blur=lens.largest_disc(samples.inverse_depth),
    )  # fmt: skip
