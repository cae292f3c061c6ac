"""The shape of the aperture in the .blend, and as the core sees it."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import bpy
import cv2
import numpy as np
from bpy.props import FloatProperty, IntProperty, StringProperty

from ..core.base.arrays import Map
from ..core.lens.aperture import FINEST, MOST_BLADES, MOST_LOST, RATIOS, Aperture, ApertureImage
from ..core.media.clip import to_linear
from ..core.media.picture_file import read_picture
from . import aperture_cloud
from .paths import absolute

NUMBERS = (
    "blades", "rotation", "roundness", "ratio", "obstruction", "apodisation", "spherical_aberration",
    "vignetting",
)  # fmt: skip
"""Properties that are fields of `Aperture`, too."""


def _edited(shape: VirtualApertureShape, _context: bpy.types.Context) -> None:
    aperture_cloud.update(shape.id_data.virtual_aperture)


class VirtualApertureShape(bpy.types.PropertyGroup):
    """The shape of the aperture, with the names and units of Blender's `Camera.dof` where it has them."""

    blades: IntProperty(
        name="Blades",
        description="Number of blades of the aperture, at least 3; 0 is round",
        min=0,
        max=MOST_BLADES,
        default=0,
        update=_edited,
    )
    rotation: FloatProperty(
        name="Rotation",
        description="By which the blades are turned, anticlockwise as seen in the picture",
        subtype="ANGLE",
        default=0.0,
        update=_edited,
    )
    roundness: FloatProperty(
        name="Roundness",
        description="Of the blades' edges: straight, or a circle's arcs",
        subtype="FACTOR",
        min=0.0,
        max=1.0,
        default=0.0,
        update=_edited,
    )
    ratio: FloatProperty(
        name="Ratio",
        description="By which blur discs are higher than wide, as an anamorphic lens makes them",
        min=RATIOS[0],
        max=RATIOS[1],
        soft_max=2.0,
        default=1.0,
        update=_edited,
    )
    obstruction: FloatProperty(
        name="Central Mirror",
        description="Radius of a mirror lens's secondary mirror, as a share of the aperture's: blur discs"
        " become rings",
        subtype="FACTOR",
        min=0.0,
        max=0.95,
        soft_max=0.7,
        default=0.0,
        update=_edited,
    )
    apodisation: FloatProperty(
        name="Apodisation",
        description="Share of the light that a filter takes at the rim: blur discs with soft edges",
        subtype="FACTOR",
        min=0.0,
        max=MOST_LOST,
        default=0.0,
        update=_edited,
    )
    spherical_aberration: FloatProperty(
        name="Spherical Aberration",
        description="Above zero blur discs are bright at the rim (soap bubbles), below it in the middle"
        " (creamy); before and behind the focus alike",
        min=-1.0,
        max=1.0,
        default=0.0,
        update=_edited,
    )
    vignetting: FloatProperty(
        name="Cat's Eyes",
        description="Optical vignetting: by how much of its radius the aperture is cut in the picture's"
        " corners. What is in focus keeps its brightness",
        subtype="FACTOR",
        min=0.0,
        max=1.0,
        default=0.0,
        update=_edited,
    )
    image: StringProperty(
        name="Picture",
        description="Picture of the aperture in place of blades, white where light passes: what is far out of"
        " focus takes its shape",
        subtype="FILE_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
        update=_edited,
    )

    @property
    def aperture(self) -> Aperture:
        """The shape as the core sees it; UserError for a picture that cannot be read, or is black."""
        image = aperture_image(absolute(self.image, self.id_data)) if self.image else None
        return Aperture(**{name: getattr(self, name) for name in NUMBERS}, image=image)


def aperture_image(path: Path) -> ApertureImage:
    """The picture of an aperture in a file; UserError where it cannot be read."""
    try:
        written = path.stat().st_mtime_ns
    except OSError:
        # Reading it tells why.
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
