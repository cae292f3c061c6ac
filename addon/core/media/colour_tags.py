"""Tags of picture files for their colours: transfer function and primaries, or a colour profile.

PNG's cICP, gAMA and cHRM (PNG, third edition, 2025), ICC profiles with a matrix (ICC.1:2022), OpenEXR's
chromaticities and the identifiers of the Color Interop Forum.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Floats

type Transfer = str | float | bytes
"""From stored values to light: a space of Blender's with that curve, an exponent, or part of a profile."""
Primaries = tuple[float, ...]
"""x and y of red, green, blue and white, or the nine numbers of a matrix to the XYZ of profiles, by rows."""
D65, DCI_WHITE, D60 = (0.3127, 0.3290), (0.314, 0.351), (0.32168, 0.33767)
REC_709 = (0.640, 0.330, 0.300, 0.600, 0.150, 0.060, *D65)
P3 = (0.680, 0.320, 0.265, 0.690, 0.150, 0.060)
REC_2020 = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, *D65)
EXPONENT = 2.4
"""Exponent of a display for BT.709, BT.2020 and their relatives (ITU-R BT.1886)."""
LINEAR = 1.0
_PRIMARIES = {
    1: REC_709, 4: (0.67, 0.33, 0.21, 0.71, 0.14, 0.08, 0.310, 0.316),
    5: (0.64, 0.33, 0.29, 0.60, 0.15, 0.06, *D65), 6: (0.630, 0.340, 0.310, 0.595, 0.155, 0.070, *D65),
    7: (0.630, 0.340, 0.310, 0.595, 0.155, 0.070, *D65), 9: REC_2020, 11: (*P3, *DCI_WHITE), 12: (*P3, *D65),
    22: (0.630, 0.340, 0.295, 0.605, 0.155, 0.077, *D65),
}  # fmt: skip
"""By the code of colour primaries (ITU-T H.273, table 2)."""
_TRANSFERS: dict[int, Transfer] = {
    1: EXPONENT, 4: 2.2, 5: 2.8, 6: EXPONENT, 7: EXPONENT, 8: LINEAR, 11: EXPONENT, 13: "sRGB", 14: EXPONENT,
    15: EXPONENT, 16: "Rec.2100-PQ", 18: "Rec.2100-HLG",
}  # fmt: skip
"""By the code of transfer characteristics (ITU-T H.273, table 3)."""
_INTEROP_TRANSFERS: dict[str, Transfer] = {
    "lin": LINEAR, "srgb": "sRGB", "g18": 1.8, "g22": 2.2, "g24": 2.4, "g26": 2.6, "pq": "Rec.2100-PQ",
    "hlg": "Rec.2100-HLG",
}  # fmt: skip
AP0 = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, *D60)
_INTEROP_PRIMARIES = {
    "rec709": REC_709, "p3d65": (*P3, *D65), "rec2020": REC_2020, "ap0": AP0,
    "ap1": (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, *D60),
    "adobergb": (0.640, 0.330, 0.210, 0.710, 0.150, 0.060, *D65),
    "ciexyzd65": (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, *D65),
}  # fmt: skip
ADOBE_RGB = _INTEROP_PRIMARIES["adobergb"]
ADOBE_EXPONENT = 563 / 256
"""Exponent of Adobe RGB (1998)."""
APPROXIMATE = 0.45455
"""The gAMA that writers of sRGB add for decoders that know no other curve."""
_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
_D50 = np.array([0.9642, 1.0, 0.8249])
"""White of the XYZ of profiles (ICC.1:2022, 7.2.16)."""


@dataclass(frozen=True)
class ColourTag:
    """The transfer function and the primaries with which a file stores its colours."""

    transfer: Transfer
    primaries: Primaries = REC_709

    @property
    def curve(self) -> Floats:
        """(65536,) light of the tag's own primaries for every stored value of 16 bits, unless it is named."""
        values = np.linspace(0, 1, 65536)
        if isinstance(self.transfer, bytes):
            return _profile_curve(self.transfer, values)
        assert isinstance(self.transfer, float), "Blender knows the curve"
        return np.asarray(values**self.transfer)

    @property
    def to_rec_709(self) -> Floats:
        """(3, 3) from light of its primaries to linear Rec.709; white stays white (Bradford)."""
        own = np.reshape(self.primaries, (3, 3)) if len(self.primaries) == 9 else _to_xyz(self.primaries)
        return np.asarray(np.linalg.solve(_to_xyz(REC_709), own))


def of_codes(primaries: int, transfer: int) -> ColourTag | None:
    """Return the tag of codes (ITU-T H.273), None where they name none; ValueError for one not known here."""
    if 2 in (primaries, transfer):
        return None
    if primaries not in _PRIMARIES or transfer not in _TRANSFERS:
        raise ValueError(f"color primaries {primaries} with transfer function {transfer} are not known")
    # As in Blender: it is of displays, whose curve is sRGB's.
    curve = "sRGB" if (primaries, transfer) == (12, 1) else _TRANSFERS[transfer]
    return ColourTag(curve, _PRIMARIES[primaries])


def of_gamma(encoding: float | None, chromaticities: Sequence[float] | None) -> ColourTag | None:
    """Return the tag of an exponent of encoding, and of x and y as `Primaries`; None without both.

    sRGB's usual approximation means its curve, as programs that write sRGB add that number.
    """
    if not encoding and chromaticities is None:
        return None
    plain = not encoding or abs(encoding - APPROXIMATE) < 1e-3
    return ColourTag("sRGB" if plain or not encoding else 1 / encoding, _checked(chromaticities or REC_709))


def of_interop_id(name: str) -> ColourTag:
    """Return the tag of an identifier such as "lin_ap1_scene"; ValueError for one that is not known."""
    transfer, _, rest = name.rpartition(":")[2].partition("_")
    primaries = rest.rpartition("_")[0]
    if transfer not in _INTEROP_TRANSFERS or primaries not in _INTEROP_PRIMARIES:
        raise ValueError(f"the color space {name!r} is not known")
    return ColourTag(_INTEROP_TRANSFERS[transfer], _INTEROP_PRIMARIES[primaries])


def of_chromaticities(values: Sequence[float]) -> ColourTag:
    """Return the tag of light whose primaries and white have x and y; ValueError for impossible ones."""
    return ColourTag(LINEAR, _checked(values))


def of_profile(data: bytes) -> ColourTag | None:
    """Return the tag of an ICC profile of RGB or gray, None where its own code names none.

    ValueError, with the reason, for one of tables alone and for damaged ones.
    """
    try:
        count = struct.unpack_from(">I", data, 128)[0]
        entries = (struct.unpack_from(">4sII", data, 132 + 12 * at) for at in range(min(count, 1000)))
        parts = {name: data[start : start + size] for name, start, size in entries}
        if b"cicp" in parts:
            return of_codes(parts[b"cicp"][8], parts[b"cicp"][9])
        if data[16:20] == b"GRAY":
            tag = ColourTag(parts[b"kTRC"])
        elif data[16:20] != b"RGB ":
            raise ValueError(f"its color profile is for {data[16:20].decode('latin-1').strip()}")
        elif b"rXYZ" not in parts:
            raise ValueError("its color profile has tables alone")
        elif len({parts[name] for name in (b"rTRC", b"gTRC", b"bTRC")}) > 1:
            raise ValueError("its color profile has a curve for each color")
        else:
            columns = [struct.unpack_from(">3i", parts[name], 8) for name in (b"rXYZ", b"gXYZ", b"bXYZ")]
            tag = ColourTag(parts[b"rTRC"], tuple((np.array(columns).T / 65536).ravel().tolist()))
            np.linalg.inv(tag.to_rec_709)
        if not np.isfinite(tag.curve).all():
            raise ValueError("its color profile is damaged")
    except (struct.error, IndexError, KeyError, ZeroDivisionError, np.linalg.LinAlgError):
        raise ValueError("its color profile is damaged") from None
    return tag


def _profile_curve(element: bytes, values: Floats) -> Floats:
    """Light (n,) of values (n,) in [0, 1] by a profile's `curv` or `para` (ICC.1:2022, 10.6 and 10.18)."""
    if element[:4] == b"curv":
        count = struct.unpack_from(">I", element, 8)[0]
        if count == 1:
            return np.asarray(values ** (struct.unpack_from(">H", element, 12)[0] / 256))
        table = np.frombuffer(element, ">u2", min(count, len(element) // 2), 12) / 65535
        return np.asarray(np.interp(values, np.linspace(0, 1, count), table) if count else values)
    kind = struct.unpack_from(">H", element, 8)[0]
    if element[:4] != b"para" or kind > 4:
        raise struct.error
    held = [each / 65536 for each in struct.unpack_from(f">{(1, 3, 4, 5, 7)[kind]}i", element, 12)]
    g, a, b, c, d, e, f = held + [1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0][len(held) :]
    if kind in (1, 2):
        # The straight part is constant, up to where the power begins.
        c, d, e, f = 0.0, -b / a, c, c
    light: Floats = np.where(values >= d, np.maximum(a * values + b, 0) ** g + e, c * values + f)
    return light


def _checked(values: Sequence[float]) -> Primaries:
    found = tuple(map(float, values))
    if not np.isfinite(found).all() or min(found[1::2][3], abs(np.linalg.det(_columns(found)))) < 1e-6:
        raise ValueError("its chromaticities are impossible")
    return found


def _columns(primaries: Primaries) -> Floats:
    """(3, 3) x, y and z of red, green and blue."""
    x, y = np.array(primaries[:6]).reshape(3, 2).T
    return np.stack([x, y, 1 - x - y])


def _to_xyz(primaries: Primaries) -> Floats:
    """(3, 3) from light of primaries to the XYZ of profiles, to whose white theirs is adapted (Bradford)."""
    columns, (x, y) = _columns(primaries), primaries[6:]
    white = np.array([x / y, 1, (1 - x - y) / y])
    gains = (_BRADFORD @ _D50) / (_BRADFORD @ white)
    adapted = np.linalg.solve(_BRADFORD, gains[:, None] * _BRADFORD)
    return np.asarray(adapted @ columns * np.linalg.solve(columns, white))
