"""The clip's noise given back to what the blur took it from.

Averaging views averages noise away where they disagree, so what is out of focus looks pasted in beside what
is sharp. How much of the noise is left follows from the blur disc and the noise's spectrum; painted on the
frame's own mesh, and seen by its own views, that knows silhouettes, too.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from ..base.arrays import Indices, LinearRGB, LinearRGBA, Map
from ..camera.canvas import Canvas
from ..media.clip import decode_srgb, encode_srgb
from ..media.noise import Noise
from ..warp.mesh import WarpMesh
from .detail import painted
from .inspection import fewer_views
from .warped_frame import WarpedFrame

VIEWS = 8
"""Views that tell what is lost: steps of an eighth at silhouettes, in the strength of noise, are not seen."""
FINE = 2.0
"""Pixels of a disc that takes the same part of the spectrum as all smaller ones; larger ones take more of the
whole."""
LEAST = 1e-3
"""Share that counts as nothing: resampling for a lens with distortion rings by as much."""


def lost_frame(warped: WarpedFrame, noise: Noise, scale: float = 1.0) -> WarpedFrame:
    """A frame's mesh through fewer views, half as large, painted with the share of each component's standard
    deviation that blur takes: red, green and blue of the views' mean. Exactly 0 where all is in focus; 1 on
    CG objects.

    `scale` times as large is the picture that the noise is of, of a frame that was drawn smaller.
    """

    def lost(displacement: Map) -> LinearRGB:
        return 1 - noise.left(np.float32(2 * scale) * np.abs(displacement))

    # CG objects have none of it, in focus or not.
    return _smaller(painted(fewer_views(warped, VIEWS), lost, 1.0))


def _smaller(warped: WarpedFrame) -> WarpedFrame:
    """A frame as its views see it at a half of its width and height."""
    plan = warped.plan
    large, camera = plan.canvas.pinhole, plan.canvas.camera
    canvas = Canvas(camera.scaled(-(-camera.width // 2), -(-camera.height // 2)))
    small = canvas.pinhole
    size = small.focal / large.focal
    moved = small.principal_point - size * large.principal_point
    registration = plan.registration.copy()
    registration[:, :, :2] *= size[:, None] / size
    registration[:, :, 2] = plan.registration[:, :, 2] * size + moved - registration[:, :, :2] @ moved

    def within(mesh: WarpMesh) -> WarpMesh:
        return replace(mesh, xy=mesh.xy * size + moved)

    plan = replace(plan, canvas=canvas, mesh=within(plan.mesh), registration=registration)
    return replace(warped, plan=plan, cg=tuple(replace(each, mesh=within(each.mesh)) for each in warped.cg))


def grained(picture: LinearRGBA, lost: Map, noise: Noise, frame: int, amount: float) -> LinearRGBA:
    """A picture (H, W, 4) with `amount` of the noise that it lacks, by the mean (H, W, 3) of `lost_frame`.

    Made anew for each frame, the same for the same one. Where nothing is lost, nothing is changed.
    """
    rows, columns = np.nonzero(cv2.max(cv2.max(lost[..., 0], lost[..., 1]), lost[..., 2]) > LEAST)
    if not len(rows):
        return picture
    height, width = picture.shape[:2]
    result, part = picture.copy(), picture[rows, columns]
    components = _lacking(lost[rows, columns], noise, (width, height), frame, (rows, columns))
    alpha = np.maximum(part[:, 3:], np.float32(1e-6))
    shown = encode_srgb(part[:, :3] / alpha).astype(np.float32)
    shown += np.float32(amount) * noise.coloured(components, shown.mean(axis=1))
    result[rows, columns, :3] = decode_srgb(np.maximum(shown, 0)) * part[:, 3:]
    return result


def _lacking(lost: Map, noise: Noise, size: tuple[int, int], frame: int, at: tuple[Indices, Indices]) -> Map:
    """(n, 3) components of the noise that pixels at rows and columns (n,) lack, of a picture (width, height),
    by the shares (n, 3) of their standard deviation that are lost."""
    fine = noise.taken(FINE)
    # Of variances, which add: 1 - (1 - lost)^2.
    share = np.clip(lost, 0, 1)
    share *= 2 - share
    small = 1 - noise.left(np.full(1, FINE, np.float32)) ** 2
    whole = np.clip((share - small) / (1 - small), 0, 1)
    # Both are made of the same white noise.
    common = (noise.kernels * fine.kernels).sum(axis=(1, 2))
    variance = whole**2 + (1 - whole) ** 2 + 2 * common * whole * (1 - whole)
    coarse, finer = (each.components(size, frame)[at] for each in (noise, fine))
    return np.asarray((whole * coarse + (1 - whole) * finer) * np.sqrt(share / variance), np.float32)
