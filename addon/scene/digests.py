"""Digests of what a frame depends on: by the contents of files, not by their names and places."""

from __future__ import annotations

import hashlib

import numpy as np

from ..core.base.digest import file_digest, files_digest
from ..core.camera.reconstruction import Reconstruction
from ..core.media.clip import Footage
from .masks import DrawnMask


def clip_digest(footage: Footage) -> str:
    """64 hexadecimal digits of a clip's pictures."""
    return file_digest(footage.path) if footage.is_video else files_digest(footage.files)


def reconstruction_digest(reconstruction: Reconstruction) -> str:
    """64 hexadecimal digits of cameras and points."""
    digest = hashlib.sha256()
    digest.update(repr(reconstruction.cameras).encode())
    for image in reconstruction.images:
        digest.update(f"{image.frame} {image.camera}".encode())
        for array in (image.rotation, image.translation, image.xy, image.points, image.visible):
            digest.update(np.ascontiguousarray(array).tobytes())
    digest.update(np.ascontiguousarray(reconstruction.points.xyz).tobytes())
    return digest.hexdigest()


def drawn_digest(drawn: DrawnMask) -> str:
    """64 hexadecimal digits of the outlines of a mask that is drawn in Blender, over all frames."""
    digest = hashlib.sha256()
    for frame, layers in sorted(drawn.layers.items()):
        for layer in layers:
            digest.update(repr((frame, layer.alpha, layer.blend, layer.is_inverted, layer.overlaps)).encode())
            for outline in layer.outlines:
                digest.update(np.ascontiguousarray(outline).tobytes())
    return digest.hexdigest()
