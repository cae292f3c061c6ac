"""Digests of a frame's inputs besides files."""

import hashlib

import numpy as np

from ...core.camera.reconstruction import Reconstruction
from .masks import DrawnMask


def reconstruction_digest(reconstruction: Reconstruction) -> str:
    """Return 64 hexadecimal digits of cameras and points."""
    digest = hashlib.sha256()
    digest.update(repr(reconstruction.cameras).encode())
    if not reconstruction.is_ordered:
        digest.update(b"stills")
    if any(reconstruction.readout):
        digest.update(repr(reconstruction.readout).encode())
    for image in reconstruction.images:
        digest.update(f"{image.frame} {image.camera}".encode())
        for array in (image.rotation, image.translation, image.xy, image.points, image.visible):
            digest.update(np.ascontiguousarray(array).tobytes())
    digest.update(np.ascontiguousarray(reconstruction.points.xyz).tobytes())
    return digest.hexdigest()


def drawn_digest(drawn: DrawnMask) -> str:
    """Return 64 hexadecimal digits of the outlines and feathers of a drawn mask, over all frames."""
    digest = hashlib.sha256()
    for frame, layers in sorted(drawn.layers.items()):
        for layer in layers:
            own = layer.falloff, layer.alpha, layer.blend, layer.is_inverted, layer.overlaps
            digest.update(repr((frame, own)).encode())
            for outline in (*layer.outlines, *layer.feathers):
                digest.update(np.ascontiguousarray(outline).tobytes())
    return digest.hexdigest()
