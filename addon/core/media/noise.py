"""Noise of a clip, measured in the flattest parts of a few frames, and synthetic noise like it.

All values are display-encoded by the sRGB curve, 1 being white. So encoded, sensor noise is about equally
strong at every level, and the steps of a codec are equal. Noise has three components, orthogonal axes of red,
green and blue: brightness, and two similar colours. Brightness and colour each have a spectrum and a standard
deviation: coded noise is not white, and coarser in colour.

Texture adds to the variance of a block. Noise is therefore measured where a clip varies least, as for AV1
(Norkin and Birkbeck, "Film grain synthesis for AV1 video codec", 2018), and a picture gets no more than it
shows nearby. Even the flattest blocks of a clip full of texture have texture; but optical flow finds texture
again a few frames later, and noise is new in each frame.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from ..base.arrays import Floats, Map
from ..base.lru_cache import remembered
from ..base.progress import checkpoint
from .light import encode_srgb, to_gray8
from .picture_file import Pixels

BLOCK = 24
"""Side of a block in pixels. The variance of white noise in a block varies by 6 %, that of noise over three
pixels by 17 %."""
BLOCKS = 1500
"""Blocks of a frame, at random places, so that they do not align with a codec's."""
NEARBY = 16
"""Side in pixels of the square in which a picture limits its noise. With 24, flat tiles beside texture come
out 3 % noisier than the source and dither on two of 23 clips, with 16 on none."""
PAIRS = 4
"""Pairs of frames, spread over the clip: each costs up to a quarter of a second at 1920x1080."""
LATER = 3
"""Frames from one of a pair to the other: of coded noise 0.3 to 0.6 persists that long, of texture 0.85."""
FLOW_SIDE = 960
"""Longer side in pixels of the pictures that optical flow is found in."""
FLATTEST = 0.01
"""Share of a clip's blocks, those of least variance, that surely are flat."""
ALIKE = 1.4
"""Largest variance of a flat block over that of the flattest ones."""
COMMON = 0.45
"""Share of the variance of flat blocks that may be found in the later frame: more is texture. It is 0.47 and
more in sample scenes without flat parts, and 0.43 and less in coded clips with such."""
VISIBLE = 0.5 / 255
"""Standard deviation below which noise is invisible; rounding to 8 bits has 0.29 / 255."""
CLIPPED = 0.02
"""Distance from black and white within which levels are clipped and show less noise than there is."""
TILE = 256
"""Side in pixels of synthetic noise that is measured."""
WIDEST = 24.0
"""Diameter in pixels of a blur disc that leaves nothing of the noise."""
ENTRIES = 256
"""Entries of the table of the noise left by discs."""
FAINT = 1e-3
"""Least power of a frequency, as a share of the strongest one: estimates may be negative."""
MOST = 400
"""Blocks that spectra are taken of."""
SEED = 0x6772
"""First part of the seeds of frames."""
AXES: Map = np.array([[1, 1, 1], [1, -1, 1], [1, 0, -2]], np.float32)
AXES /= np.linalg.norm(AXES, axis=0)
"""(3, 3) red, green and blue of brightness and of two colours, in orthonormal columns."""
KINDS = np.array([0, 1, 1])
"""Brightness or colour, by component."""
NUMBERS = 2 + 2 * (BLOCK - 1) ** 2
"""Length of `Noise.numbers`."""


@dataclass(frozen=True)
class Noise:
    """Noise of a clip, at one size of its pictures."""

    sigma: Floats
    """(2,) standard deviation of the component of brightness, and of each of colour."""
    kernels: Map
    """(2, BLOCK - 1, BLOCK - 1) filters that make such components, of variance 1, of white noise."""

    @classmethod
    def of(cls, numbers: Floats) -> Noise | None:
        """Return the noise with these `numbers`; None for an empty row."""
        if not len(numbers):
            return None
        return cls(numbers[:2], np.reshape(numbers[2:], (2, BLOCK - 1, BLOCK - 1)).astype(np.float32))

    @property
    def numbers(self) -> Floats:
        """(NUMBERS,) all fields in one row, as they are stored."""
        return np.concatenate([self.sigma, self.kernels.ravel()]).astype(np.float64)

    @property
    def strength(self) -> float:
        """Standard deviation of red, green and blue together."""
        return float(np.sqrt((self.sigma[KINDS] ** 2).mean()))

    @property
    def is_visible(self) -> bool:
        """Return whether the noise is strong enough to be visible."""
        return self.strength >= VISIBLE

    def components(self, size: tuple[int, int], seed: int) -> Map:
        """Synthesize (h, w, 3) components for a size (width, height); a seed always gives the same."""
        random = np.random.default_rng((SEED, seed))
        margin = BLOCK // 2
        shape = size[1] + 2 * margin, size[0] + 2 * margin
        inner = np.s_[margin:-margin, margin:-margin]
        kernels = (self.sigma[:, None, None] * self.kernels)[KINDS]
        white = (random.standard_normal(shape, np.float32) for _ in kernels)
        filtered = (cv2.filter2D(one, cv2.CV_32F, kernel) for one, kernel in zip(white, kernels, strict=True))
        return np.asarray(cv2.merge([each[inner] for each in filtered]), np.float32)

    def left(self, disc: Map) -> Map:
        """Return the share (..., 3) of each component's standard deviation that blur leaves.

        Args:
            disc: (...) diameters of blur discs in pixels.
        """
        # Square roots of diameters are equally far apart.
        at = np.sqrt(np.minimum(np.abs(disc) / np.float32(WIDEST), 1)) * np.float32(ENTRIES - 1)
        return np.asarray(self._left[at.astype(np.uint8)])

    @cached_property
    def _left(self) -> Map:
        """(ENTRIES, 3) table of `left`."""
        power = np.abs(np.fft.fft2(self.kernels, (2 * BLOCK, 2 * BLOCK))).reshape(2, -1) ** 2
        disc, across = WIDEST * np.linspace(0, 1, ENTRIES) ** 2, np.fft.fftfreq(2 * BLOCK)
        # A disc leaves as much of white noise as a Gaussian blur of a quarter of its diameter.
        squared = np.exp(-np.outer((np.pi * disc / 2) ** 2, across[:, None] ** 2 + across**2))
        left = np.asarray(np.sqrt((squared @ power.T) / power.sum(axis=1)), np.float32)
        return left[:, KINDS]

    @remembered()
    def at_scale(self, scale: float) -> Noise:
        """Return the noise of pictures `scale` times as large."""
        if scale == 1:
            return self
        side = int(np.ceil(max(TILE, 4 * BLOCK / scale)))
        to, how = max(round(side * scale), BLOCK), cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
        resized = cv2.resize(self.components((side, side), 0), (to, to), interpolation=how)
        return _of_blocks(_residual(_blocks(np.asarray(resized, np.float32), 0)))

    def share(self, picture: Map) -> Map:
        """Return the share (H, W) of the noise's deviation, at most 1, that a picture shows nearby.

        `picture` (H, W, 3) has display values.
        """
        own = _finest(self.components((TILE, TILE), 0) @ AXES.T).mean()
        # Rounding makes the running sums of a box filter negative beside strong edges.
        around = cv2.blur(_finest(picture), (NEARBY, NEARBY))
        return np.asarray(np.sqrt(np.clip(around / own, 0, 1)), np.float32)


def measured(read: Callable[[int], Pixels], frames: Sequence[int]) -> Noise | None:
    """Measure the noise of frames, which `read` returns (H, W, 3 or 4) as stored; passes checkpoints.

    None where nothing is flat, and of a single frame.
    """
    later = min(LATER, len(frames) - 1)
    if later < 1:
        return None
    found = []
    for n in range(PAIRS):
        checkpoint(n / PAIRS)
        at = (2 * n + 1) * (len(frames) - later) // (2 * PAIRS)
        pair = read(frames[at]), read(frames[at + later])
        if pair[0].shape != pair[1].shape or min(pair[0].shape[:2]) <= BLOCK:
            return None
        found.append(_pair_blocks(*pair, n))
    blocks, moved = (np.concatenate(part) for part in zip(*found, strict=True))
    if not len(blocks):
        return None
    variance = (blocks[:, 0] ** 2).mean(axis=(1, 2))
    flat = variance <= ALIKE * np.quantile(variance, FLATTEST)
    blocks, moved = blocks[flat], moved[flat]
    if (blocks[:, 0] * moved[:, 0]).mean() > COMMON * variance[flat].mean():
        return None
    return _of_blocks(blocks, moved, 1 / 255 if pair[0].dtype == np.uint8 else 0.0)


def _pair_blocks(picture: Pixels, other: Pixels, seed: int) -> tuple[Map, Map]:
    """(n, 3, BLOCK, BLOCK) `_residual` of a picture, and of another one, aligned by optical flow."""
    height, width = picture.shape[:2]
    scale = min(1.0, FLOW_SIDE / max(height, width))
    small = [cv2.resize(to_gray8(each), None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
             for each in (picture, other)]  # fmt: skip
    search = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
    flow = cv2.resize(search.calc(*small, None), (width, height)) / np.float32(scale)  # type: ignore[call-overload]
    grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(np.float32)
    moved = cv2.remap(_encoded(other), grid + flow, None, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)  # type: ignore[call-overload]
    blocks, later = (_blocks(each, seed) for each in (_encoded(picture) @ AXES, np.asarray(moved) @ AXES))
    grey, own = blocks[:, 0].mean(axis=(1, 2)) * AXES[0, 0], _residual(blocks)
    known = (grey > CLIPPED) & (grey < 1 - CLIPPED) & own.any(axis=(1, 2, 3))
    return own[known], _residual(later[known])


def _blocks(picture: Map, seed: int) -> Map:
    """(n, 3, BLOCK, BLOCK) blocks at random places of a picture (H, W, 3)."""
    random = np.random.default_rng((SEED, seed))
    rows, columns = (random.integers(0, side - BLOCK + 1, BLOCKS) for side in picture.shape[:2])
    windows = np.lib.stride_tricks.sliding_window_view(picture, (BLOCK, BLOCK), axis=(0, 1))
    return np.asarray(windows[rows, columns])


def _encoded(picture: Pixels) -> Map:
    """(H, W, 3) display values of a picture (H, W, 3 or 4) as stored."""
    colour = picture[..., :3].astype(np.float32)
    if picture.dtype == np.float32:
        return encode_srgb(np.maximum(colour, 0)).astype(np.float32)
    return colour / np.float32(255 if picture.dtype == np.uint8 else 65535)


def _residual(blocks: Map) -> Map:
    """The residual of a plane in each component of blocks (n, 3, BLOCK, BLOCK)."""
    ramp = (np.arange(BLOCK) - (BLOCK - 1) / 2).astype(np.float32)
    whole = np.float32(BLOCK * (ramp**2).sum())
    rest = blocks - blocks.mean(axis=(2, 3), keepdims=True)
    across = (rest.sum(axis=2) @ ramp / whole)[..., None, None] * ramp
    down = (rest.sum(axis=3) @ ramp / whole)[..., None, None] * ramp[:, None]
    return np.asarray(rest - across - down, np.float32)


def _finest(picture: Map) -> Map:
    """(H, W) squared finest detail of the brightness of a picture (H, W, 3).

    Immerkaer, "Fast noise variance estimation", 1996.
    """
    kernel = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)
    return np.asarray(cv2.filter2D(picture @ AXES[:, 0], cv2.CV_32F, kernel) ** 2)


def _of_blocks(blocks: Map, moved: Map | float = 0.0, step: float = 0.0) -> Noise:
    """The noise of residuals (n, 3, BLOCK, BLOCK), less what is in `moved`, stored in steps of `step`."""
    fresh = blocks - moved
    variance = (blocks * fresh).mean(axis=(0, 2, 3), dtype=float) - step**2 / 12
    few = slice(None, None, -(-len(blocks) // MOST))
    window = np.outer(*[np.hanning(BLOCK + 2)[1:-1].astype(np.float32)] * 2)
    own, rest = (np.fft.fft2(each[few] * window) for each in (blocks, fresh))
    power = (own * rest.conj()).real.mean(axis=0)
    power = np.stack([power[0], power[1:].mean(axis=0)])
    power = np.maximum(power, FAINT * power.max(axis=(1, 2), keepdims=True))
    kernels = np.fft.fftshift(np.fft.ifft2(np.sqrt(power)).real, axes=(1, 2))[:, 1:, 1:]
    kernels /= np.sqrt((kernels**2).sum(axis=(1, 2), keepdims=True))
    return Noise(np.sqrt(np.maximum([variance[0], variance[1:].mean()], 0)), np.asarray(kernels, np.float32))
