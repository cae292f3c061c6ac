"""The noise of a clip, measured in what is flat of a few of its frames, and noise of the same kind made anew.

All values are display-encoded by the sRGB curve, 1 being white, whatever the clip is stored in: there the
noise of a sensor is about as strong at all levels, and what a codec left of it has its steps. Noise that
was coded is not white, and coarser in colour than in brightness. So it is described by three components
that are not correlated with each other (principal axes of its colours), a spectrum for each, and a standard
deviation of red, green and blue by the level of grey.

Flat blocks are those whose variance is the least of their level, for texture adds to it (Norkin and Birkbeck
measure noise for AV1 in blocks like these, "Film grain synthesis for AV1 video codec", 2018). Where all of it
is texture the least is, too; but texture is there a few frames on, moved, and noise is not: what a block has
in common with the later frame, by optical flow, is not counted. So noise that a codec carries from frame to
frame counts as texture, as it looks.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import cv2
import numpy as np

from ..base.arrays import Floats, Indices, Map, Mask
from ..base.progress import checkpoint
from .clip import encode_srgb, to_gray8
from .picture_file import Pixels

BLOCK = 16
"""Pixels of a block's side: noise that was coded is correlated over a few."""
BLOCKS = 2500
"""Of a frame, at random places, so that they do not lie on a codec's; of a small frame `OVERLAP` a pixel."""
OVERLAP = 8
"""Blocks that a pixel is in at most, in the mean: more of them take memory and tell nothing new."""
PAIRS = 4
"""Of frames, spread over the clip: each costs up to a quarter of a second at 1920x1080."""
LATER = 3
"""Frames from one of a pair to the other. Of the variance of flat blocks of four coded clips a half to 0.8 is
found one frame on, a third to 0.6 after three, and after eight a tenth to 0.4; of texture in the sample
scenes 0.9, 0.85 and 0.5 to 0.9, for flow loses it."""
FLOW_SIDE = 960
"""Pixels of the longer side, down to which optical flow is found."""
LEVELS = 8
"""Of grey, equally far apart, at which noise is measured."""
FEWEST = 24
"""Flat blocks of a level without which it is not measured: the variance of so many is right to 5 %."""
QUIETEST = 0.05
"""Share of a level's blocks that are taken for flat at first. By eye."""
ALIKE = 1.4
"""Times the variance of flat blocks, up to which a block is flat: white noise in a block varies by 9 %, noise
over three pixels by 25 %."""
ROUNDS = 8
"""Of finding flat blocks by the variance of those found before: it stays the same from the fifth on."""
BEYOND = 3.0
"""Times the standard deviation of the level that has least in common with the later frame, over which that of
another level is of texture that flow did not find again: a sensor's noise differs by less. By eye."""
COMMON = 0.45
"""Share of the variance of a level's flat blocks that may be found in the later frame: more is texture. It is
0.47 and more in sample scenes without flat parts, and 0.43 and less in those of coded clips."""
VISIBLE = 0.5 / 255
"""Standard deviation below which noise is not seen, nor told from rounding to 8 bits, of 0.29 / 255."""
CLIPPED = 0.02
"""Levels so near to black and white are clipped, and tell less noise than there is. By eye."""
TILE = 256
"""Pixels of the sides of made noise that is measured at another size."""
WIDEST = 24.0
"""Pixels of a blur disc of which nothing of the noise is left."""
ENTRIES = 256
"""Of tables of what is left by diameter, and of strength by level: as many as display values have."""
FAINT = 1e-3
"""Of the variance of the strongest component, and of the strongest frequency: the least that there is, where
an estimate may be below zero."""
TINY = 1e-8
"""The least variance of red, green and blue, for the same reason."""
NODES = 64
"""Of the integral that is a disc's transform: more than its largest argument, pi times 24 times 0.7."""
MOST = 1500
"""Blocks of which the spectrum is taken: its bins are right to 3 %."""
LEAST = 0.2
"""Of the power at other frequencies: what little is left of the coarsest is not raised by more. By eye."""
SEED = 0x6772
"""Begins the seeds of frames."""


@dataclass(frozen=True)
class Noise:
    """What the noise of a clip is like, at a size of its pictures."""

    sigma: Floats
    """(LEVELS, 3) standard deviation of red, green and blue, by the level of grey."""
    axes: Floats
    """(3, 3) red, green and blue, in shares of their standard deviation, from components in columns."""
    kernels: Map
    """(3, BLOCK - 1, BLOCK - 1) filters that make white noise of the variance 1 into a component."""

    @property
    def strength(self) -> float:
        """Standard deviation of the noise, in the middle of its levels."""
        return float(np.median(self.sigma.mean(axis=1)))

    @property
    def is_visible(self) -> bool:
        """Whether it is seen."""
        return self.strength >= VISIBLE

    def components(self, size: tuple[int, int], seed: int) -> Map:
        """(h, w, 3) made noise of a size (width, height), each component of the variance 1; the same for the
        same seed."""
        random = np.random.default_rng((SEED, seed))
        margin = BLOCK // 2
        shape = size[1] + 2 * margin, size[0] + 2 * margin
        made = [
            cv2.filter2D(random.standard_normal(shape, np.float32), -1, kernel)[
                margin:-margin, margin:-margin
            ]
            for kernel in self.kernels
        ]
        return np.asarray(cv2.merge(made), np.float32)

    def coloured(self, components: Map, grey: Map) -> Map:
        """(n, 3) red, green and blue to be added, of components (n, 3) at levels of grey (n,)."""
        steps = (np.arange(ENTRIES) + 0.5) * LEVELS / ENTRIES - 0.5
        table = np.stack([np.interp(steps, np.arange(LEVELS), each) for each in self.sigma.T], axis=1)
        at = np.clip(grey * np.float32(ENTRIES), 0, ENTRIES - 1).astype(np.uint8)
        return np.asarray(self._mixed(components[None])[0] * table.astype(np.float32)[at])

    def left(self, disc: Map) -> Map:
        """(..., 3) share of each component's standard deviation that is left of it in a blur disc, of
        diameters in pixels: 1 of none."""
        # Square roots of diameters are equally far apart.
        at = np.sqrt(np.minimum(np.abs(disc) / np.float32(WIDEST), 1)) * np.float32(ENTRIES - 1)
        return np.asarray(self._left[at.astype(np.uint8)])

    @cached_property
    def _left(self) -> Map:
        """(ENTRIES, 3) what is `left`."""
        power = np.abs(np.fft.fft2(self.kernels, (2 * BLOCK, 2 * BLOCK))).reshape(3, -1) ** 2
        disc = _disc_transfers(WIDEST * np.linspace(0, 1, ENTRIES) ** 2)
        left = np.asarray(np.sqrt((disc**2 @ power.T) / power.sum(axis=1)), np.float32)
        left[0] = 1
        return left

    def taken(self, disc: float) -> Noise:
        """Noise as strong, with the spectrum of what a blur disc of a diameter in pixels takes: the finer
        part of it."""
        side = 2 * BLOCK
        size = np.abs(np.fft.fft2(self.kernels, (side, side)))
        size *= np.sqrt(np.maximum(1 - _disc_transfers(np.array([disc])) ** 2, 0)).reshape(side, side)
        middle = slice(BLOCK - BLOCK // 2 + 1, BLOCK + BLOCK // 2)
        kernels = np.fft.fftshift(np.fft.ifft2(size).real, axes=(1, 2))[:, middle, middle]
        return Noise(self.sigma, self.axes, _of_power_one(kernels))

    def at_scale(self, scale: float) -> Noise:
        """What it is in pictures that are `scale` times as large, resampled as those are."""
        if scale == 1:
            return self
        side = int(np.ceil(max(TILE, 6 * BLOCK / scale)))
        how = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
        to = max(round(side * scale), BLOCK + 1)
        tile = self._tile(side)
        resampled = np.asarray(cv2.resize(tile, (to, to), interpolation=how), np.float32)
        blocks = _residual(_blocks(resampled, 0))[1]
        found = _components(blocks, np.zeros_like(blocks))
        sigma = self.sigma * resampled.std(axis=(0, 1)) / tile.std(axis=(0, 1))
        return Noise(sigma, *found)

    def with_plane(self) -> Noise:
        """As strong as it is with the plane that was taken from each block: a part of coarse noise."""
        tile = self._tile(TILE)
        left = _residual(_blocks(tile, 0))[1].std(axis=(0, 2, 3))
        return Noise(self.sigma * tile.std(axis=(0, 1)) / left, self.axes, self.kernels)

    def _tile(self, side: int) -> Map:
        """(side, side, 3) made noise in shares of the standard deviations of red, green and blue."""
        return self._mixed(self.components((side, side), 0))

    def _mixed(self, components: Map) -> Map:
        """(h, w, 3) red, green and blue of components (h, w, 3)."""
        return np.asarray(cv2.transform(components, self.axes.astype(np.float32)), np.float32)


def measured(read: Callable[[int], Pixels], frames: Sequence[int]) -> Noise | None:
    """The noise of a clip's frames, which `read` gives as stored (H, W, 3 or 4); None where nothing is flat,
    or there is but one frame. Errors as of `read`. Passes checkpoints.
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
    level, blocks, moved = (np.concatenate(part) for part in zip(*found, strict=True))
    return _of_blocks(level, blocks, moved, 1 / 255 if pair[0].dtype == np.uint8 else 0.0)


def _pair_blocks(picture: Pixels, other: Pixels, seed: int) -> tuple[Floats, Map, Map]:
    """The grey (n,) of a picture's blocks, and what a plane leaves (n, 3, BLOCK, BLOCK) of them and of what
    the other picture, moved by optical flow, has in their places."""
    height, width = picture.shape[:2]
    scale = min(1.0, FLOW_SIDE / max(height, width))
    small = [cv2.resize(to_gray8(each), None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
             for each in (picture, other)]  # fmt: skip
    search = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
    flow = cv2.resize(search.calc(*small, None), (width, height)) / np.float32(scale)  # type: ignore[call-overload]
    grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(np.float32)
    moved = cv2.remap(_encoded(other), grid + flow, None, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)  # type: ignore[call-overload]
    level, own = _residual(_blocks(_encoded(picture), seed))
    return level, own, _residual(_blocks(np.asarray(moved, np.float32), seed))[1]


def _of_blocks(level: Floats, blocks: Map, moved: Map, step: float) -> Noise | None:
    """The noise of blocks (n, 3, BLOCK, BLOCK) of a level of grey (n,), of which `moved` has the texture and
    other noise; stored in steps of `step`."""
    bright, later = blocks.mean(axis=1), moved.mean(axis=1)
    variance = (bright**2).mean(axis=(1, 2))
    common = (bright * later).mean(axis=(1, 2))
    known = (level > CLIPPED) & (level < 1 - CLIPPED) & (variance > 0)
    at = np.minimum((LEVELS * level).astype(int), LEVELS - 1)
    flat = {n: _flat(variance, known & (at == n)) for n in range(LEVELS)}
    shared = {
        n: float(common[rows].sum() / variance[rows].sum()) for n, rows in flat.items() if len(rows) >= FEWEST
    }
    power = {
        n: _power(blocks[flat[n]], moved[flat[n]]) for n, share in sorted(shared.items()) if share <= COMMON
    }
    if not power:
        return None
    most = BEYOND**2 * power[min(power, key=shared.__getitem__)].mean()
    trusted = [n for n, each in power.items() if each.mean() <= most]
    sigma = {n: np.sqrt(np.maximum(power[n] - step**2 / 12, TINY)) for n in trusted}
    at_levels = np.stack(
        [np.interp(np.arange(LEVELS), trusted, [sigma[n][c] for n in trusted]) for c in range(3)], axis=1
    )
    one = [1 / sigma[n][:, None, None].astype(np.float32) for n in trusted]
    unit, later = (
        np.concatenate([each[flat[n]] * scale for n, scale in zip(trusted, one, strict=True)])
        for each in (blocks, moved)
    )
    return Noise(at_levels, *_components(unit, later)).with_plane()


def _flat(variance: Map, mask: Mask) -> Indices:
    """Rows of flat blocks of those in a mask (n,), by their variance (n,)."""
    rows = np.flatnonzero(mask)
    if not len(rows):
        return rows
    own = variance[rows]
    typical = float(np.quantile(own, QUIETEST))
    for _ in range(ROUNDS):
        typical = float(own[own <= ALIKE * typical].mean())
    return rows[own <= ALIKE * typical]


def _power(blocks: Map, moved: Map) -> Floats:
    """(3,) variance of blocks (n, 3, BLOCK, BLOCK) that is not found in `moved`."""
    return np.asarray((blocks * (blocks - moved)).mean(axis=(0, 2, 3), dtype=float))


def _blocks(picture: Map, seed: int) -> Map:
    """(n, c, BLOCK, BLOCK) blocks at random places of a picture (H, W, c)."""
    random = np.random.default_rng((SEED, seed))
    count = min(BLOCKS, OVERLAP * picture.shape[0] * picture.shape[1] // BLOCK**2)
    rows, columns = (random.integers(0, side - BLOCK + 1, count) for side in picture.shape[:2])
    windows = np.lib.stride_tricks.sliding_window_view(picture, (BLOCK, BLOCK), axis=(0, 1))
    return np.asarray(windows[rows, columns])


def _encoded(picture: Pixels) -> Map:
    """(H, W, 3) display values of a picture (H, W, 3 or 4) as stored."""
    colour = picture[..., :3].astype(np.float32)
    if picture.dtype == np.float32:
        return encode_srgb(np.maximum(colour, 0)).astype(np.float32)
    return colour / np.float32(255 if picture.dtype == np.uint8 else 65535)


def _residual(values: Map) -> tuple[Floats, Map]:
    """The mean (n,) of blocks (n, c, BLOCK, BLOCK), and what a plane in each channel leaves of them."""
    ramp = (np.arange(BLOCK) - (BLOCK - 1) / 2).astype(np.float32)
    whole = np.float32(BLOCK * (ramp**2).sum())
    mean = values.mean(axis=(2, 3), keepdims=True)
    rest = values - mean
    across = (rest.sum(axis=2) @ ramp / whole)[..., None, None] * ramp
    down = (rest.sum(axis=3) @ ramp / whole)[..., None, None] * ramp[:, None]
    grey = np.asarray(mean.mean(axis=(1, 2, 3)), np.float64)
    return grey, np.asarray(rest - across - down, np.float32)


def _components(blocks: Map, moved: Map) -> tuple[Floats, Map]:
    """`Noise.axes` and `Noise.kernels` of blocks of noise (n, 3, BLOCK, BLOCK) of about the variance 1, less
    what is found in `moved`."""
    few = slice(None, None, -(-len(blocks) // MOST))
    blocks = blocks[few]
    alone = blocks - moved[few]
    covariance = np.einsum("nikl,njkl->ij", blocks, alone, dtype=float) / blocks[:, 0].size
    value, vector = np.linalg.eigh((covariance + covariance.T) / 2)
    size: Floats = np.sqrt(np.maximum(value, FAINT * value.max()))
    window, white = _window()
    own, rest = (
        np.fft.fft2(np.einsum("nikl,ij->njkl", each, (vector / size).astype(np.float32)) * window)
        for each in (blocks, alone)
    )
    power = (own * rest.conj()).real.mean(axis=0) / white
    power = np.maximum(power, FAINT * power.max(axis=(1, 2), keepdims=True))
    kernel = np.fft.fftshift(np.fft.ifft2(np.sqrt(power)).real, axes=(1, 2))[:, 1:, 1:]
    axes = vector * size
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return np.asarray(axes, np.float64), _of_power_one(kernel)


def _of_power_one(kernels: Floats) -> Map:
    """Filters (3, n, n) that leave white noise its variance."""
    return np.asarray(kernels / np.sqrt((kernels**2).sum(axis=(1, 2), keepdims=True)), np.float32)


def _disc_transfers(diameter: Floats) -> Floats:
    """(n, m) transforms of discs of diameters (n,) in pixels, at the m frequencies of a square of twice
    `BLOCK` pixels."""
    across = np.fft.fftfreq(2 * BLOCK)
    frequency, at = np.unique(np.round(np.hypot(across[:, None], across).ravel(), 6), return_inverse=True)
    return np.asarray(_disc_transfer(np.pi * diameter[:, None] * frequency)[:, at])


@cache
def _window() -> tuple[Map, Floats]:
    """(BLOCK, BLOCK) weights of a block's pixels, and the power (BLOCK, BLOCK) by frequency of white noise
    that is so weighted, once a plane was taken from it: little where that lies."""
    window = np.outer(*[np.hanning(BLOCK + 2)[1:-1]] * 2)
    pixels = np.eye(BLOCK**2, dtype=np.float32).reshape(-1, 1, BLOCK, BLOCK)
    power = (np.abs(np.fft.fft2(_residual(pixels)[1] * window)) ** 2).sum(axis=(0, 1))
    return window.astype(np.float32), np.maximum(power, LEAST * power.max())


def _disc_transfer(x: Floats) -> Floats:
    """2 J1(x) / x, the transform of a disc at pi times its diameter times the frequency, of any shape."""
    # (2 / pi) times the integral of sin^2 t cos(x cos t) over half a turn, by the midpoint rule.
    t = (np.arange(NODES) + 0.5) * np.pi / NODES
    return np.asarray(np.cos(x[..., None] * np.cos(t)) @ (np.sin(t) ** 2) * (2 / NODES))
