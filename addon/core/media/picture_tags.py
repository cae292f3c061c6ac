"""Tags of picture files: their orientation, the shape of a pixel, and their colours."""

import math
import struct
import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from . import colour_tags, exif
from .colour_tags import ColourTag
from .exr_parts import COLOURS, Part

SQUARE = 0.01
"""Relative difference of two densities up to which pixels are square: scanners round to whole dots."""
MOST_ASPECT = 4.0
"""Ratio of a pixel's sides above which it is a mistake: lenses squeeze by 2, faxes by 2.1, fields by 2."""
MOST_PROFILE = 16 << 20
"""Bytes of a profile as it is unpacked."""
MIRRORED, UPSIDE_DOWN = (2, 3, 6, 7), (3, 4, 7, 8)
"""Orientations whose columns, or rows, are reversed; from 5 on rows are columns (Exif 2.32, 4.6.5)."""


@dataclass(frozen=True)
class PictureTags:
    """The tags of a picture file."""

    orientation: int = 1
    """1 to 8, of Exif; 1 is upright."""
    pixel_aspect: float = 1.0
    """Width of a stored pixel by its height, before the picture is turned."""
    colour: ColourTag | None = None
    """None for sRGB, and linear Rec.709 in floats."""
    is_narrow: bool = False
    """True if black and white are at 16 and 235 of 255."""
    is_float: bool = False
    """True if it holds floats, which are light unless a tag names another curve."""
    notes: tuple[str, ...] = ()
    """Tags that cannot be honoured, as notes for the user after the file's name."""


def tags_of(data: bytes, is_float: bool) -> PictureTags:
    """Return the tags of a PNG, JPEG or TIFF file by its bytes; a damaged tag counts as missing."""
    chunks = exif.parts(data)
    tiff = exif.directory(chunks.get(b"eXIf", b""))
    colour, problem = _first(_colours(chunks, tiff))
    aspect, odd = _aspect(_densities(chunks, tiff))
    turn = int(tiff.get(exif.ORIENTATION, (1,))[0])
    narrow = len(chunks.get(b"cICP", b"")) == 4 and not chunks[b"cICP"][3] and not problem
    notes = [f"{problem}: its colors are taken for sRGB"] if problem else []
    return PictureTags(turn if 1 <= turn <= 8 else 1, aspect, colour, narrow, is_float, (*notes, *odd))


def exr_tags(part: Part) -> PictureTags:
    """Return the tags of a part of an OpenEXR file."""
    held = {name: value for name, (_, value) in part.attributes.items()}
    ratio = held.get("pixelAspectRatio", b"")
    aspect, odd = _aspect([struct.unpack("<f", ratio)[0]] if len(ratio) == 4 else [])
    ways: dict[str, Callable[[bytes], ColourTag]] = {
        "colorInteropID": lambda value: colour_tags.of_interop_id(value.decode("latin-1")),
        "chromaticities": lambda value: colour_tags.of_chromaticities(struct.unpack("<8f", value)),
        "acesImageContainerFlag": lambda _: colour_tags.of_chromaticities(colour_tags.AP0),
    }
    found = (lambda name=name: ways[name](held[name]) for name in COLOURS if name in held)
    colour, problem = _first(found)
    notes = [f"{problem}: its light is taken for linear Rec.709"] if problem else []
    return PictureTags(1, aspect, colour, False, True, (*notes, *odd))


def _first(ways: Iterable[Callable[[], ColourTag | None]]) -> tuple[ColourTag | None, str]:
    """The tag of the first way that there is, and else why it cannot be used."""
    for way in ways:
        try:
            if (found := way()) is not None:
                return found, ""
        except (ValueError, struct.error) as error:
            return None, str(error)
    return None, ""


def _colours(
    chunks: dict[bytes, bytes], tiff: dict[int, tuple[float, ...]]
) -> Iterable[Callable[[], ColourTag | None]]:
    """The ways to know a file's colours, the most reliable first (PNG, third edition, 4.3)."""
    code, profile = chunks.get(b"cICP", b""), chunks.get(b"iCCP", b"")
    if len(code) == 4:
        yield lambda: colour_tags.of_codes(code[0], code[1])
    if profile:
        yield lambda: colour_tags.of_profile(_unpacked(profile))
    elif exif.PROFILE in tiff:
        yield lambda: colour_tags.of_profile(bytes(map(int, tiff[exif.PROFILE])))
    elif b"ICC" in chunks:
        yield lambda: colour_tags.of_profile(chunks[b"ICC"])
    if b"sRGB" in chunks:
        yield lambda: ColourTag("sRGB")
    if exif.is_adobe_rgb(chunks.get(b"eXIf", b"")):
        yield lambda: ColourTag(colour_tags.ADOBE_EXPONENT, colour_tags.ADOBE_RGB)
    gamma, chrm = chunks.get(b"gAMA", b""), chunks.get(b"cHRM", b"")
    corners = tuple(value / 1e5 for value in struct.unpack(">8I", chrm)) if len(chrm) == 32 else ()
    if exif.PRIMARIES in tiff and exif.WHITE in tiff:
        corners = (*tiff[exif.WHITE], *tiff[exif.PRIMARIES])
    power = struct.unpack(">I", gamma)[0] / 1e5 if len(gamma) == 4 else None
    yield lambda: colour_tags.of_gamma(power, [*corners[2:], *corners[:2]] if len(corners) == 8 else None)


def _unpacked(chunk: bytes) -> bytes:
    """The profile of an iCCP chunk: a name, 0, the method and compressed bytes."""
    packed = chunk.partition(b"\0")[2][1:]
    try:
        return zlib.decompressobj().decompress(packed, MOST_PROFILE)
    except zlib.error:
        raise ValueError("its color profile is damaged") from None


def _densities(chunks: dict[bytes, bytes], tiff: dict[int, tuple[float, ...]]) -> Iterable[float]:
    """Ratios of a pixel's width to its height: densities are dots a unit."""
    places = ((b"pHYs", ">II", 9), (b"JFIF", ">HH", 4))
    for name, form, size in places:
        if len(chunks.get(name, b"")) == size:
            across, down = struct.unpack_from(form, chunks[name])
            yield down / across if across and down else 1.0
    across, down = (tiff.get(tag, (0.0,))[0] for tag in (exif.X_RESOLUTION, exif.Y_RESOLUTION))
    yield down / across if across and down else 1.0


def _aspect(ratios: Iterable[float]) -> tuple[float, list[str]]:
    """The first ratio that is not 1, and a note on one that cannot be."""
    odd = []
    for ratio in ratios:
        if not (math.isfinite(ratio) and 1 / MOST_ASPECT <= ratio <= MOST_ASPECT):
            odd = [f"its pixels are {ratio:.4g} times as wide as high, which cannot be: they count as square"]
        elif abs(ratio - 1) > SQUARE:
            return ratio, []
    return 1.0, odd


def turned[T: np.generic](picture: np.ndarray[tuple[int, ...], np.dtype[T]], orientation: int):  # type: ignore[no-untyped-def]
    """Return a stored picture (H, W, ...) upright."""
    upright = picture.swapaxes(0, 1) if orientation > 4 else picture
    upright = upright[::-1] if orientation in UPSIDE_DOWN else upright
    return np.ascontiguousarray(upright[:, ::-1] if orientation in MIRRORED else upright)
