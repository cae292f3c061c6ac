"""Colour spaces by their makers' own papers, and clips that are written in them, 10 bits deep."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray

type Array = NDArray[np.float64]

WHITE = (0.3127, 0.3290)
"""D65, which all of them have."""
REC_709 = ((0.640, 0.330), (0.300, 0.600), (0.150, 0.060))
REC_2020 = ((0.708, 0.292), (0.170, 0.797), (0.131, 0.046))
S_GAMUT3_CINE = ((0.766, 0.275), (0.225, 0.800), (0.089, -0.087))
V_GAMUT = ((0.730, 0.280), (0.165, 0.840), (0.100, -0.030))


def to_xyz(primaries: tuple[tuple[float, float], ...]) -> Array:
    """(3, 3) from linear RGB of primaries, as x and y, to XYZ (SMPTE RP 177)."""
    columns = np.array([[x / y, 1, (1 - x - y) / y] for x, y in primaries]).T
    white = np.array([WHITE[0] / WHITE[1], 1, (1 - WHITE[0] - WHITE[1]) / WHITE[1]])
    return np.asarray(columns * np.linalg.solve(columns, white))


def pq(light: Array) -> Array:
    """SMPTE ST 2084 of light whose 1 is 203 cd/m2 (ITU-R BT.2408)."""
    power = (np.maximum(light, 0) * 203 / 10000) ** 0.1593017578125
    return np.asarray(((0.8359375 + 18.8515625 * power) / (1 + 18.6875 * power)) ** 78.84375)


def hlg(light: Array) -> Array:
    """ITU-R BT.2100 HLG of display light whose 1 is 203 of 1,000 cd/m2."""
    shown = np.maximum(light, 0) * 0.203
    y = shown @ np.array([0.2627, 0.6780, 0.0593])
    scene = shown * np.maximum(y, 1e-12)[..., None] ** (1 / 1.2 - 1)
    a, b, c = 0.17883277, 0.28466892, 0.55991073
    return np.where(scene <= 1 / 12, np.sqrt(3 * scene), a * np.log(np.maximum(12 * scene - b, 1e-9)) + c)


def s_log3(light: Array) -> Array:
    """Sony's S-Log3 of reflectance, as a share of 10 bits' 1023."""
    log = (420 + np.log10(np.maximum(light + 0.01, 1e-9) / 0.19) * 261.5) / 1023
    return np.where(light >= 0.01125, log, (light * (171.2102946929 - 95) / 0.01125 + 95) / 1023)


def v_log(light: Array) -> Array:
    """Panasonic's V-Log of reflectance."""
    log = 0.241514 * np.log10(np.maximum(light + 0.00873, 1e-9)) + 0.598206
    return np.where(light < 0.01, 5.6 * light + 0.125, log)


def apple_log(light: Array) -> Array:
    """Apple Log of reflectance."""
    start, turn = -0.05641088, 0.01
    log = 0.08550479 * np.log2(np.maximum(light + 0.00964052, 1e-9)) + 0.69336945
    return np.where(light < turn, 47.28711236 * np.maximum(light - start, 0) ** 2, log)


@dataclass(frozen=True)
class Recorded:
    """How a camera records: its name in Blender, its curve and primaries, and a video's tags."""

    name: str
    curve: Callable[[Array], Array]
    primaries: tuple[tuple[float, float], ...]
    transfer: int = 2
    """Code of ITU-T H.273; 2 is unspecified, as of most logs."""

    def stored(self, light: Array) -> Array:
        """(..., 3) values in [0, 1] of linear Rec.709."""
        own = light @ (np.linalg.inv(to_xyz(self.primaries)) @ to_xyz(REC_709)).T
        return np.clip(self.curve(own), 0, 1)


HLG, PQ = Recorded("Rec.2100-HLG", hlg, REC_2020, 18), Recorded("Rec.2100-PQ", pq, REC_2020, 16)
LOGS = (
    Recorded("S-Log3 S-Gamut3.Cine", s_log3, S_GAMUT3_CINE),
    Recorded("V-Log V-Gamut", v_log, V_GAMUT),
    Recorded("Apple Log", apple_log, REC_2020),
)


def write_clip(
    path: Path, pictures: list[Array], space: Recorded, codec: str = "prores_ks", full: bool = False
) -> None:
    """A video of pictures (H, W, 3) in linear Rec.709: 10 bits, 4:4:4, BT.2020's matrix for its primaries and
    BT.709's for others, as ITU-T H.273 says."""
    wide = space.primaries is REC_2020
    red, blue = (0.2627, 0.0593) if wide else (0.2126, 0.0722)
    with av.open(str(path), "w") as file:
        stream = file.add_stream(codec, rate=Fraction(24))
        stream.height, stream.width = pictures[0].shape[:2]
        stream.pix_fmt = "yuv444p10le"
        context = stream.codec_context
        context.color_trc, context.color_primaries = space.transfer, 9 if wide else 1
        context.colorspace, context.color_range = 9 if wide else 1, 2 if full else 1
        if codec == "libx265":
            stream.options = {"x265-params": "lossless=1:bframes=0:log-level=none"}
        for number, light in enumerate(pictures):
            r, g, b = np.moveaxis(space.stored(light), -1, 0)
            y = red * r + (1 - red - blue) * g + blue * b
            planes = y, (b - y) / (2 - 2 * blue), (r - y) / (2 - 2 * red)
            frame = av.VideoFrame(stream.width, stream.height, "yuv444p10le")
            # Without these times, or with B frames, x265 invents times, which MOV refuses at random.
            frame.pts, frame.time_base = number, Fraction(1, 24)
            frame.colorspace, frame.color_range = context.colorspace, context.color_range
            frame.color_trc, frame.color_primaries = context.color_trc, context.color_primaries
            ranges = ((1023, 0), (1023, 512)) if full else ((876, 64), (896, 512))
            for index, plane in enumerate(planes):
                scale, offset = ranges[index > 0]
                code = np.clip(np.round(plane * scale + offset), 0, 1023).astype("<u2")
                row = frame.planes[index].line_size // 2
                padded = np.zeros((stream.height, row), "<u2")
                padded[:, : stream.width] = code
                frame.planes[index].update(padded.tobytes())
            file.mux(stream.encode(frame))
        file.mux(stream.encode(None))
