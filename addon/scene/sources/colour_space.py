"""Colour spaces as Blender's own colour configuration knows them, taken apart for the core."""

from dataclasses import replace
from functools import cache

import bpy
import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.base.arrays import Floats
from ...core.base.errors import UserError
from ...core.media.clip import Footage
from ...core.media.colour_space import SRGB, TOP, ColourSpace
from ...core.media.colour_tags import ColourTag

HLG_GAMMA = 1.2
"""System gamma of HLG on a display of 1,000 cd/m2, for which Blender's Rec.2100-HLG is (ITU-R BT.2100-3)."""
PROBE = np.random.default_rng(1).integers(0, TOP + 1, (16, 16, 3)).astype(np.uint16)
"""Stored values with which colour spaces are compared."""
TAGGED = (
    "sRGB", "Linear Rec.709", "Display P3", "Rec.2100-PQ", "Rec.2100-HLG", "Rec.2020", "Rec.1886",
    "Gamma 2.2 Encoded AdobeRGB", "Gamma 2.2 Encoded Rec.709", "Gamma 1.8 Encoded Rec.709",
    "Linear Rec.2020", "Linear DCI-P3 D65", "ACEScg", "ACES2065-1", "Linear Adobe RGB",
)  # fmt: skip
"""Spaces of Blender's that files' tags can mean, the most usual ones first."""
SAME, DARK = 4e-3, 1e-4
"""Differences up to which a tag means such a space, as a share of the probe's light and beside it. Profiles
round, by 0.001 at most; the nearest two of these spaces differ by 0.038
(`tests/scene/test_picture_colours.py`)."""
REC_709 = "Linear Rec.709"
"""The working space of a new .blend."""
ALIKE = 2e-3
"""Largest difference from Blender, as a share of a probe's light. HLG, whose curve Blender has in a table,
differs by 5e-4, and every camera's log by less than 1e-5; view transforms such as AgX, which mix channels,
differ by 0.05 and more (`tests/scene/test_colour_space.py`)."""


def names() -> list[str]:
    """Return the colour spaces of Blender's configuration that pictures may have."""
    listed = bpy.types.ColorManagedInputColorspaceSettings.bl_rna.properties["name"]
    assert isinstance(listed, bpy.types.EnumProperty)
    return [item.identifier for item in listed.enum_items]


def checked(name: str) -> str:
    """Return Blender's spelling of a colour space's name, in any case of letters.

    Raises:
        UserError: Blender has none of this name.
    """
    known = {each.casefold(): each for each in names()}
    if name.casefold() not in known:
        raise UserError(f"there is no color space {name!r}; Blender has {', '.join(known.values())}")
    return known[name.casefold()]


class DrawingError(UserError):
    """A color space is taken apart for the first time while Blender draws, which allows no writing."""


def space_of(settings: bpy.types.PropertyGroup, footage: Footage) -> ColourSpace | None:
    """Return the colour space of a clip by the user's setting, else by its tags; UserError if it is unusable.

    None for sRGB, and for light of the working space in floats, which the core decodes itself.
    """
    tags = footage.tags
    if not settings.colour_space and tags.colour is not None:
        return _tagged(tags.colour, tags.is_float, working_space())
    name = settings.colour_space or footage.colour_space
    return None if name in (SRGB, "sRGB") else colour_space(name)


def image_space(settings: bpy.types.PropertyGroup, footage: Footage) -> str:
    """Return the name of `space_of` in which Blender shows the pictures; empty where it has none.

    It knows that of a video without other tags by itself.
    """
    space = space_of(settings, footage)
    if space is not None or footage.is_video:
        return settings.colour_space if space is None else space.name
    return working_space() if footage.tags.is_float else "sRGB"


def working_space() -> str:
    """Return the space of linear light that Blender works in, which each .blend chooses."""
    return str(bpy.data.colorspace.working_space)


def from_rec_709() -> Floats | None:
    """Return (3, 3) from the primaries of Rec.709 to those of the working space; None where it has them."""
    return None if working_space() == REC_709 else colour_space("sRGB").matrix


def colour_space(name: str) -> ColourSpace:
    """Return a colour space of Blender's as curve, matrix to the working space and system gamma.

    UserError where Blender has none of this name, or it is of another kind (a view transform, no data).
    """
    return _taken_apart(checked(name), working_space())


@cache
def _tagged(tag: ColourTag, is_float: bool, working: str) -> ColourSpace | None:
    """The colour space of a file's tag: Blender's own of the same light, else one without a name."""
    named = colour_space(tag.transfer) if isinstance(tag.transfer, str) else None
    curve = tag.curve if named is None else named.curve
    matrix = (np.eye(3) if (to := from_rec_709()) is None else to) @ tag.to_rec_709
    gamma = 1.0 if named is None else named.system_gamma
    space = ColourSpace("", curve.astype(np.float32), matrix, gamma, True)
    light = space.to_light(PROBE)
    for name in TAGGED:
        known = colour_space(name)
        if np.all(np.abs(known.to_light(PROBE) - light) <= SAME * light.max(axis=2, keepdims=True) + DARK):
            return None if name == (working if is_float else "sRGB") else replace(known, is_tagged=True)
    return space


@cache
def _taken_apart(name: str, _working: str) -> ColourSpace:
    gamma = HLG_GAMMA if name == "Rec.2100-HLG" else 1.0
    gray = _converted(np.arange(TOP + 1, dtype=np.uint16).reshape(256, 256, 1).repeat(3, 2), name)
    curve = gray.reshape(-1, 3).mean(axis=1)
    if gamma != 1:
        curve = np.maximum(curve, 0) ** (1 / gamma)
    # Each primary alone, at three quarters: with the others at black, which is not always 0 in a log.
    stored = np.zeros((1, 3, 3), np.uint16)
    stored[0, range(3), range(3)] = 3 * TOP // 4
    unmixed = ColourSpace(name, curve.astype(np.float32), np.eye(3), gamma).to_light(stored)[0].astype(float)
    matrix = np.linalg.solve(unmixed, _converted(stored, name)[0].astype(float)).T
    space = ColourSpace(name, curve.astype(np.float32), matrix, gamma)
    truth = _converted(PROBE, name)
    scale = np.abs(truth).max(axis=2, keepdims=True)
    off = np.abs(space.to_light(PROBE) - truth) / np.maximum(scale, 1e-3)
    if not np.isfinite(off).all() or off.max() > ALIKE:
        raise UserError(
            f"the color space {name} is for views or data, not for a clip; choose that of the camera, or"
            " leave it empty to use the clip's own"
        )
    return space


def _converted(picture: NDArray[np.uint16], name: str) -> Floats:
    """A picture (h, w, 3) of a colour space in linear light of the working space, by Blender."""
    height, width = picture.shape[:2]
    packed = cv2.imencode(".png", picture[..., ::-1])[1].tobytes()
    image = bpy.data.images.new("Virtual Aperture Color Space", width, height)
    try:
        image.pack(data=packed, data_len=len(packed))  # type: ignore[arg-type]
        try:
            image.source = "FILE"
        except AttributeError:
            raise DrawingError(f"the color space {name} is being read") from None
        image.colorspace_settings.name = name
        light = np.empty(height * width * 4, np.float32)
        image.pixels.foreach_get(light)  # type: ignore[arg-type]
    finally:
        bpy.data.images.remove(image)
    return light.reshape(height, width, 4)[::-1, :, :3]
