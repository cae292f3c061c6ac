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
from ..optics.aperture_sampling import exact_registration, vogel_disc
from ..warp.layered_mesh import FINER
from ..warp.mesh import WarpMesh, at_pixels
from .warped_frame import WarpedFrame

NAMES = ("depth", "sources", "blur", "focus")
"""All pictures, in display order."""
SOURCES = ("inpainted", "borrowed", "own")
"""Sources of light, in red, green and blue: inpainted or mirrored; other frames; the frame itself."""
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


def pictures(warped: WarpedFrame, source: LinearRGBA, shares: LinearRGBA) -> dict[str, Bytes]:
    """Make all available pictures of a frame by name, for a linear frame (H, W, 4).

    `shares` (H, W, 3) are those of `shares_of`.
    """
    made = {name: picture(name, warped, source, shares) for name in NAMES}
    return {name: shown for name, shown in made.items() if shown is not None}


def picture(
    name: str, warped: WarpedFrame, source: LinearRGBA, shares: LinearRGBA | None = None
) -> Bytes | None:
    """Make one of `pictures` (H, W, 3), or None if it is not available; only "sources" needs the shares."""
    plan, frame = warped.plan, to_rgb8(source)
    match name:
        case "depth":
            return _in_source(_depth(inverse_depth(warped)), plan.canvas)
        case "sources" if shares is not None:
            return _sources(shares, frame)
        case "blur":
            return _in_source(_blur(blur_discs(warped)), plan.canvas)
        case "focus":
            return _focus(_in_source(_focus_tint(warped), plan.canvas), frame)
    return None


def inverse_depth(warped: WarpedFrame) -> Floats:
    """Return the inverse depth (H, W) with which the canvas is drawn; NaN in empty pixels."""
    if warped.layers and warped.depth is not None and warped.steadied is None:
        return warped.depth.inverse_depth
    mesh, pinhole = warped.plan.mesh, warped.plan.canvas.pinhole
    inverse = warped.plan.lens.unrectified(mesh.inverse_depth, mesh.xy)
    return at_pixels(mesh.xy, inverse, mesh.triangles, (pinhole.height, pinhole.width))


def blur_discs(warped: WarpedFrame) -> Floats:
    """Return signed diameters (H, W) in pixels of the canvas's blur discs, as `ThinLens.blur_disc`."""
    lens = warped.plan.lens
    return lens.blur_disc(lens.rectified_raster(inverse_depth(warped)))


# Sources


def fewer_views(warped: WarpedFrame, most: int = SOURCE_VIEWS) -> WarpedFrame:
    """Limit a frame's views to `most`, evenly over the whole disc of its aperture."""
    plan = warped.plan
    if len(plan.offsets) <= most:
        return warped
    offsets = plan.lens.sheared_positions(plan.lens.radius * vogel_disc(most))
    registration = exact_registration(plan.canvas, offsets, plan.lens.focus)
    if warped.method == "thesis":
        # Its positions are random and its registration is fitted, so any views suffice.
        offsets, registration = plan.offsets[:most], plan.registration[:most]
    plan = replace(
        plan, offsets=offsets, registration=registration, weights=None, vignetting=0.0, matte_box=(0.0, 0.0)
    )
    return replace(warped, plan=plan)


def source_frame(warped: WarpedFrame) -> WarpedFrame:
    """Paint a frame's mesh with the sources of its colours, for fewer views.

    The mean of the views has in red, green and blue the shares of `SOURCES`, premultiplied by coverage.
    """
    warped = fewer_views(warped)
    if warped.plan.axial_colour:
        # The channels are not colours.
        warped = replace(warped, plan=replace(warped.plan, axial_colour=0.0))
    if warped.layers:
        return replace(warped, texture=_layers_sources(warped), highlight_discs=None, cg=())
    mesh, texture = _plain_sources(warped)
    return replace(warped, plan=replace(warped.plan, mesh=mesh), texture=texture, cg=())


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


def _painted(own: Mask, foreign: Mask) -> LinearRGBA:
    """Return (H, W, 3) red, green or blue."""
    return np.stack([~own & ~foreign, foreign, own & ~foreign], axis=2).astype(np.float32)


def _layers_sources(warped: WarpedFrame) -> LinearRGBA:
    """Return the sources of the layers' texture, with its alpha."""
    texture = warped.texture
    painted = [_painted(own, foreign) for own, foreign in _origins(warped)]
    if texture.shape[1] != painted[0].shape[1]:
        painted = [_finer(part) for part in painted]
    alpha = texture[..., 3:]
    return np.concatenate([np.concatenate(painted) * alpha, alpha], axis=2)


def _finer(picture: LinearRGBA) -> LinearRGBA:
    """Enlarge a picture (H, W, 3) to the texture's resolution, aligned with its texels."""
    height, width = picture.shape[:2]
    scale = np.array([[1 / FINER, 0, 0], [0, 1 / FINER, 0]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    size = FINER * width, FINER * height
    return np.asarray(cv2.warpAffine(picture, scale, size, flags=flags, borderMode=cv2.BORDER_REPLICATE))


def _origins(warped: WarpedFrame) -> list[tuple[Mask, Mask]]:
    """Return own and foreign pixels (H, W) for every surface of a mesh of layers, near to far."""
    canvas, margin_reprojected = warped.plan.canvas, warped.layers[0].margin_reprojected
    own = np.zeros_like(warped.layers[0].disoccluded)
    foreign = own.copy() if margin_reprojected is None else margin_reprojected
    own[warped.layers[0].inner(canvas.pinhole.width, canvas.pinhole.height)] = _own(canvas)
    found = [(own, foreign)]
    for layers in warped.layers:
        own = own & ~layers.occluded
        foreign = np.where(layers.occluded, layers.reprojected, foreign)
        found.append((own, foreign))
    return found


def _plain_sources(warped: WarpedFrame) -> tuple[WarpMesh, LinearRGBA]:
    """Return a mesh painted with the mirrored canvas picture, and its sources in the same texture."""
    mesh, own = warped.plan.mesh, _own(warped.plan.canvas)
    size = np.array(own.shape[::-1])
    beyond = np.maximum(-mesh.texture_xy, mesh.texture_xy - size).max(initial=0)
    margin = int(np.ceil(min(beyond, 1e9))) + 2
    # A wide aperture sees far past the border, where all pixels are alike.
    scale = min(1.0, LARGEST_TEXTURE / float((size + 2 * margin).max()))
    wide = np.maximum(np.round(scale * (size + 2 * margin)).astype(int), 1)
    xy = scale * (mesh.texture_xy + margin)
    x, y = (np.floor((np.arange(n) + 0.5) / scale - margin).astype(int) for n in wide)
    inside = ((y >= 0) & (y < size[1]))[:, None] & ((x >= 0) & (x < size[0]))
    inside &= own[np.clip(y, 0, size[1] - 1)[:, None], np.clip(x, 0, size[0] - 1)]
    painted = _painted(inside, np.zeros_like(inside))
    alpha = np.ones((*inside.shape, 1), np.float32)
    return replace(mesh, texture_xy=xy), np.concatenate([painted, alpha], axis=2)


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


def opaque_triangles(warped: WarpedFrame) -> int:
    """Return the number of opaque triangles of a frame's mesh, which are the first."""
    mesh = warped.plan.mesh
    if not warped.layers:
        return len(mesh.triangles)
    # Those of the farthest surface, whose rows are the last of the texture.
    row = mesh.texture_xy[mesh.triangles[:, 0], 1]
    height = warped.texture.shape[0] / (len(warped.layers) + 1)
    return int(np.count_nonzero(row // height == len(warped.layers)))


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


def _focus_tint(warped: WarpedFrame) -> Bytes:
    """(H, W, 4) tints of unsharp pixels of the canvas, and their shares in [0, `TINT`] by disc size."""
    signed = np.nan_to_num(blur_discs(warped))
    least = warped.plan.lens.acceptable_disc
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
