"""The shape of the aperture in the .blend, and as the core sees it."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import bpy
import cv2
import numpy as np

from ...core.base.arrays import Map
from ...core.base.file_names import checked_name
from ...core.frame.options import APERTURE_OPTIONS
from ...core.media.light import to_linear
from ...core.media.picture_file import read_picture
from ...core.optics.aperture import FINEST, Aperture, ApertureImage
from ..base.option_properties import path_property, values_of, with_options
from ..base.paths import absolute
from . import aperture_cloud


def _edited(shape: VirtualApertureShape, _context: bpy.types.Context) -> None:
    aperture_cloud.update(shape.id_data.virtual_aperture)


@with_options(APERTURE_OPTIONS, _edited)
class VirtualApertureShape(bpy.types.PropertyGroup):
    """The shape of the aperture, with the names and units of Blender's `Camera.dof` where it has them."""

    image: path_property(
        "Image",
        "Image used as the aperture instead of blades, white where light passes. Strong blur takes on its"
        " shape",
        update=_edited,
    )

    @property
    def aperture(self) -> Aperture:
        """The shape as the core sees it; UserError for a picture that cannot be read, or is black."""
        image = aperture_image(absolute(self.image, self.id_data)) if self.image else None
        return Aperture(**values_of(self, APERTURE_OPTIONS), image=image)


def aperture_image(path: Path) -> ApertureImage:
    """Return the picture of an aperture in a file; UserError where it cannot be read."""
    checked_name(path)
    try:
        written = path.stat().st_mtime_ns
    except OSError:
        # Reading it raises the reason.
        written = 0
    return _read(path, written)


@lru_cache(maxsize=4)
def _read(path: Path, _written: int) -> ApertureImage:
    linear = to_linear(read_picture(path))
    light: Map = np.asarray(linear[..., :3].mean(axis=2), np.float32)
    if max(light.shape) > FINEST:
        # Where light passes a hole of a pixel, some must be left.
        width, height = (max(1, round(side * FINEST / max(light.shape))) for side in light.shape[::-1])
        light = np.asarray(cv2.resize(light, (width, height), interpolation=cv2.INTER_AREA), np.float32)
    return ApertureImage(np.maximum(light, 0))
