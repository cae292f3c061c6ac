"""Diagnostic pictures of a frame: depth, sources, blur and focus.

All are (H, W, 3) uint8 sRGB in the geometry of the source frame.
"""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Bytes, Floats, LinearRGBA, Mask
from ..camera.canvas import Canvas
from ..media.light import to_rgb8
from ..optics.aperture import ApertureSamples
from ..optics.aperture_sampling import vogel_disc
from ..warp.layer import INPAINTED, OWN, Layer
from ..warp.mesh import at_pixels
from .frame import Frame

NAMES = ("depth", "sources", "blur", "focus")
"""All pictures, in display order."""
SOURCES = ("inpainted", "borrowed", "own")
"""Sources of light by `Layer.origin`, in red, green and blue."""
SOURCE_VIEWS = 16
"""Views for the shares of the sources."""
LARGEST_TEXTURE = 4096
"""Longest side in pixels of a texture that separates inside from outside."""
TINT = 0.45
"""Largest share of the tint."""
GREEN, RED = (0.0, 0.8, 0.2), (0.95, 0.1, 0.1)
WARM, COLD = (0.9, 0.2, 0.0), (0.0, 0.3, 0.9)
"""Colours of the largest discs in front of the focal plane, and behind it."""
SHARE = 99.0
"""Per cent of the pixels within the scales of depth and blur; others have the last colour."""


def pictures(frame: Frame, shares: LinearRGBA) -> dict[str, Bytes]:
    """Make all available pictures of a frame by name.

    `shares` (H, W, 3) are those of `shares_of`.
    """
    made = {name: picture(name, frame, shares) for name in NAMES}
    return {name: shown for name, shown in made.items() if shown is not None}


def picture(name: str, frame: Frame, shares: LinearRGBA | None = None) -> Bytes | None:
    """Make one of `pictures` (H, W, 3), or None if it is not available; only "sources" needs the shares."""
    canvas, shown = frame.views.canvas, to_rgb8(frame.small)
    match name:
        case "depth":
            return _in_source(_depth(inverse_depth(frame)), canvas)
        case "sources" if shares is not None:
            return _sources(shares, shown)
        case "blur":
            return _in_source(_blur(blur_discs(frame)), canvas)
        case "focus":
            return _focus(_in_source(_focus_tint(frame), canvas), shown)
    return None


def inverse_depth(frame: Frame) -> Floats:
    """Return the inverse depth (H, W) with which the canvas is drawn; NaN in empty pixels."""
    if frame.is_layered and frame.depth is not None and frame.steadied is None:
        return frame.depth.inverse_depth
    mesh, pinhole = frame.mesh, frame.views.canvas.pinhole
    inverse = frame.views.lens.unrectified(mesh.inverse_depth, mesh.xy)
    return at_pixels(mesh.xy, inverse, mesh.triangles, (pinhole.height, pinhole.width))


def blur_discs(frame: Frame) -> Floats:
    """Return signed diameters (H, W) in pixels of the canvas's blur discs, as `ThinLens.blur_disc`."""
    lens = frame.views.lens
    return lens.blur_disc(lens.rectified_raster(inverse_depth(frame)))


# Sources


def fewer_views(frame: Frame, most: int = SOURCE_VIEWS) -> Frame:
    """Limit a frame's views to `most`, evenly over the whole disc of its aperture."""
    views = frame.views
    if len(views.offsets) <= most:
        return frame
    if frame.mesher.name == "thesis":
        # Its positions are random and its registration is fitted, so any views suffice.
        views = replace(views, offsets=views.offsets[:most], registration=views.registration[:most])
    else:
        views = views.placed(ApertureSamples(vogel_disc(most)))
    return replace(frame, views=replace(views, weights=None, vignetting=0.0, matte_box=(0.0, 0.0)))


def source_frame(frame: Frame) -> Frame:
    """Paint a frame's layers with the sources of its colours, for fewer views.

    The mean of the views has in red, green and blue the shares of `SOURCES`, premultiplied by coverage.
    """
    frame = fewer_views(frame)
    own = _own(frame.canvas)
    paint = _with_origin if frame.is_layered else _with_border
    # The channels are not colours.
    views = replace(frame.views, axial_colour=0.0)
    layers = tuple(paint(each, own) for each in frame.layers)
    return replace(frame, views=views, layers=layers, highlight_discs=None, cg_layers=())


def shares_of(mean: LinearRGBA, canvas: Canvas) -> LinearRGBA:
    """Return the share (H, W, 3) in [0, 1] of each of `SOURCES` in a source frame's pixels.

    `mean` (h, w, 4) is that of the views of `source_frame`; the shares sum to 1 in covered pixels.
    """
    drawn = np.clip(canvas.to_source(mean), 0, 1)
    total = drawn[..., :3].sum(axis=2)
    # Resampling rings beside silhouettes.
    return np.asarray(drawn[..., :3] * (drawn[..., 3] / np.maximum(total, 1e-6))[..., None], np.float32)


def _own(canvas: Canvas) -> Mask:
    """Return (h, w) pixels of the canvas within the source frame; others are mirrored."""
    if not canvas.camera.is_distorted:
        return np.ones((canvas.pinhole.height, canvas.pinhole.width), bool)
    place = canvas.canvas_map() + 0.5
    return np.asarray(np.all((place >= 0) & (place <= [canvas.camera.width, canvas.camera.height]), axis=2))


def _with_origin(layer: Layer, own: Mask) -> Layer:
    """Paint a layer with the sources of its light; `own` (h, w) is in the middle of its raster."""
    inside = np.zeros(layer.origin.shape, bool)
    top, left = ((n - m) // 2 for n, m in zip(inside.shape, own.shape, strict=True))
    inside[top : top + own.shape[0], left : left + own.shape[1]] = own
    origin = np.where((layer.origin == OWN) & ~inside, INPAINTED, layer.origin)
    return layer.painted(np.eye(len(SOURCES), dtype=np.float32)[origin])


def _with_border(layer: Layer, own: Mask) -> Layer:
    """Paint the mirrored canvas picture of a coarse mesh with its sources."""
    mesh, size = layer.mesh, np.array(own.shape[::-1])
    beyond = np.maximum(-mesh.texture_xy, mesh.texture_xy - size).max(initial=0)
    margin = int(np.ceil(min(beyond, 1e9))) + 2
    # A wide aperture sees far past the border, where all pixels are alike.
    scale = min(1.0, LARGEST_TEXTURE / float((size + 2 * margin).max()))
    wide = np.maximum(np.round(scale * (size + 2 * margin)).astype(int), 1)
    x, y = (np.floor((np.arange(n) + 0.5) / scale - margin).astype(int) for n in wide)
    inside = ((y >= 0) & (y < size[1]))[:, None] & ((x >= 0) & (x < size[0]))
    inside &= own[np.clip(y, 0, size[1] - 1)[:, None], np.clip(x, 0, size[0] - 1)]
    colours = np.eye(len(SOURCES), dtype=np.float32)[np.where(inside, OWN, INPAINTED)]
    picture = np.concatenate([colours, np.ones((*inside.shape, 1), np.float32)], axis=2)
    xy = scale * (mesh.texture_xy + margin)
    return replace(layer, mesh=replace(mesh, texture_xy=xy), picture=picture)


# Pictures


def _depth(inverse: Floats) -> Bytes:
    """Colour near pixels red, far ones blue and empty ones black."""
    known = np.isfinite(inverse)
    if not known.any():
        return np.zeros((*inverse.shape, 3), np.uint8)
    low, high = np.percentile(inverse[known], [100 - SHARE, SHARE])
    share = np.where(known, inverse - low, 0) / (high - low if high > low else 1.0)
    colour = cv2.applyColorMap(_bytes(share), cv2.COLORMAP_TURBO)[..., ::-1]
    return np.where(known[..., None], colour, 0).astype(np.uint8)


def _sources(shares: LinearRGBA, frame: Bytes) -> Bytes:
    """Show the frame's own light in grey, other frames' in green and inpainted light in red."""
    grey = cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY)[..., None] / np.float32(255)
    own = (0.04 + 0.7 * grey**2.2) * np.array([0.45, 0.6, 1.0], np.float32)
    light = shares[..., 2:] * own
    light += shares[..., :1] * np.array(RED, np.float32) + shares[..., 1:2] * np.array(GREEN, np.float32)
    return to_rgb8(light)


def _blur(signed: Floats) -> Bytes:
    """Colour signed diameters (H, W): white in focus, warm in front, cold behind, black for NaN."""
    known = np.isfinite(signed)
    full = largest_shown(signed)
    share = np.where(known, signed, 0) / full if full > 0 else np.zeros(signed.shape)
    end = np.where((share > 0)[..., None], WARM, COLD)
    colour = 1 + np.minimum(np.abs(share), 1)[..., None] * (end - 1)
    return np.where(known[..., None], _bytes(colour), 0).astype(np.uint8)


def _focus_tint(frame: Frame) -> Bytes:
    """(H, W, 4) tints of unsharp pixels of the canvas, and their shares in [0, `TINT`] by disc size."""
    signed = np.nan_to_num(blur_discs(frame))
    least = frame.views.lens.acceptable_disc
    share = TINT * (1 - 1 / np.maximum(np.abs(signed) / least, 1))
    colour = np.where((signed > 0)[..., None], COLD, GREEN)
    return _bytes(np.concatenate([colour, share[..., None]], axis=2))


def _focus(tint: Bytes, frame: Bytes) -> Bytes:
    """Tint the frame (H, W, 3): clear in focus, blue in front of it, green behind."""
    share = tint[..., 3:] / np.float32(255)
    return np.asarray(np.round((1 - share) * frame + share * tint[..., :3]), np.uint8)


def largest_shown(signed: Floats) -> float:
    """Return the diameter in pixels of the last colour in the picture of blur, for discs (h, w)."""
    known = np.abs(signed[np.isfinite(signed)])
    return float(np.percentile(known, SHARE)) if len(known) else 0.0


def _bytes(share: NDArray[np.floating]) -> Bytes:
    return np.asarray(np.round(255 * np.clip(share, 0, 1)), np.uint8)


def _in_source(picture: Bytes, canvas: Canvas) -> Bytes:
    """Resample a picture (h, w[, 3]) of the canvas in the source frame's geometry (H, W[, 3])."""
    if not canvas.camera.is_distorted:
        return picture
    at = canvas.source_map()
    return np.asarray(cv2.remap(picture, at, None, cv2.INTER_LINEAR), np.uint8)  # type: ignore[call-overload]
