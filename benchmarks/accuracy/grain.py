"""Noise of known kinds, blurred and given back: `python -m benchmarks.accuracy.grain`.

A picture of soft shades and leaves moves before a camera; its left half is in focus, its right half far out
of it. It is recorded with noise that is white, correlated, stronger in shadows, or coded by H.264, and drawn
with the noise given back and without. Less the same picture recorded without noise, each is its noise. The
columns are the blur disc in pixels; the clip's standard deviation in the blurred half, of 255; what share of
it is there without grain, and with it; that of four bands of the spatial spectrum, from coarse to fine; the
largest correlation of what is added to two frames that follow each other; and the largest change in focus,
of 255.
`--clips FOLDER ...` prints real clips instead: the noise that is found in the whole clip and in each third of
it, and what that takes; and high-pass noise of 255 in the flattest places of the middle frame of what has the
most: of the source, and behind a lens that blurs all of it alike, without grain and with it. Both results get
Blender's dither of 1. Cameras and depth are made up, so no clip need be solved.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from operator import itemgetter
from pathlib import Path

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.base.arrays import LinearRGBA, Map
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.depth.source import PixelDepth
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.highlights import HighlightSettings
from addon.core.frame.plan import FrameOptions
from addon.core.media.clip import open_footage
from addon.core.media.light import encode_srgb, to_linear
from addon.render.views.average import render_frame

from ..gallery import metrics

Picture = NDArray[np.uint8]

SIZE = (640, 360)
FOCAL, NEAR, FAR = 560.0, 8.0, 20.0
RADIUS = 0.4
"""Scene units: discs of 34 pixels at `FAR`, with focus at `NEAR`."""
SMALL = (0.0125, 0.03, 0.05, 0.1)
"""The same, of small discs: 1.1, 2.5, 4.2 and 8.4 pixels."""
PARTS = 3
"""Of a real clip, each with noise of its own: a solve may have only some of its frames."""
DISC = 16.0
"""Pixels of the blur disc everywhere in a frame of a real clip."""
FRAMES, FRAME = 24, 9
PACE = 1.3
"""Pixels that the picture moves by from a frame to the next."""
SIGMA = 4.0
"""Of 255, standard deviation of the noise."""
BORDER = 24
"""Pixels that are not judged, at the borders and on either side of the silhouette; the discs' radius more."""
BANDS = (0.0, 0.125, 0.25, 0.375, 0.5)
"""Cycles a pixel between which bands lie."""


@dataclass(frozen=True)
class Halves:
    """Depth of the left and the right half of a picture."""

    left: float
    right: float

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth:
        """Of a picture (H, W, 4) of any size."""
        rows, columns = picture.shape[:2]
        inverse = np.where(np.arange(columns) < columns / 2, 1 / self.left, 1 / self.right)
        return PixelDepth(np.tile(inverse, (rows, 1)), np.ones((rows, columns), np.float32))

    def kept(self, frame: int, canvas: Canvas) -> None:
        """Nothing: it need not be."""

    def samples(self, frame: int, canvas: Canvas) -> None:
        """Nothing: layers need none."""


def scene(frame: int) -> Map:
    """(h, w, 3) display values in [0, 255] of what the camera sees, without noise."""
    width, height = SIZE
    rows, columns = np.mgrid[:height, :width].astype(np.float32)
    columns += PACE * frame
    shade = 110 + 70 * np.sin(columns / 260) * np.cos(rows / 170)
    random = np.random.default_rng(3)
    leaves = cv2.resize(random.random((60, 200), np.float32), (2000, 600), interpolation=cv2.INTER_CUBIC)
    textured = cv2.remap(leaves, columns, rows, cv2.INTER_LINEAR)
    band = np.clip((rows - 0.6 * height) / 8, 0, 1)
    grey = shade + band * 60 * (textured - 0.5)
    return np.asarray(grey[..., None] * np.array([1.0, 0.92, 0.8]), np.float32)


def reconstruction(camera: Intrinsics, frames: Sequence[int], depth: Halves) -> Reconstruction:
    """Cameras that move sideways, and a few points."""
    random = np.random.default_rng(1)
    xy = random.uniform((0, 0), (camera.width, camera.height), (100, 2))
    away = np.where(xy[:, 0] < camera.width / 2, depth.left, depth.right)
    xyz = np.column_stack([(xy - camera.principal_point) / camera.focal, np.ones(100)]) * away[:, None]
    images = []
    for frame in frames:
        moved = np.array([-0.001 * frame, 0.0, 0.0])
        images.append(
            Image(frame, np.eye(3), moved, camera.project(xyz + moved), np.arange(100, dtype=np.int32))
        )
    points = Points(xyz, np.full((100, 3), 128, np.uint8), np.full(100, 0.1))
    return Reconstruction((camera,), tuple(images), points)


def white(frame: int, shown: Map) -> Map:
    """Noise (h, w, 3) of the same strength everywhere, no pixel like its neighbour."""
    return np.random.default_rng(frame).standard_normal(shown.shape, np.float32) * np.float32(SIGMA)


def correlated(frame: int, shown: Map) -> Map:
    """Noise over about three pixels, its colours coarser and half alike."""
    random = np.random.default_rng(frame)
    noise = np.zeros_like(shown)
    for spread, colour in ((0.7, (1, 1, 1)), (1.5, (0.6, 0.0, -0.6)), (1.5, (-0.3, 0.3, -0.3))):
        grey = cv2.GaussianBlur(random.standard_normal(shown.shape[:2], np.float32), (0, 0), spread)
        noise += (grey / grey.std())[..., None] * np.array(colour, np.float32)
    return np.asarray(noise * np.float32(SIGMA), np.float32)


def in_shadows(frame: int, shown: Map) -> Map:
    """Noise that is three times as strong in black as in white."""
    return np.asarray(white(frame, shown) * (1.5 - shown / 255), np.float32)


def none(frame: int, shown: Map) -> Map:
    """No noise."""
    return np.zeros_like(shown)


KINDS: dict[str, tuple[Callable[[int, Map], Map], int | None]] = {
    "none": (none, None),
    "white": (white, None),
    "correlated": (correlated, None),
    "in shadows": (in_shadows, None),
    "white, H.264 crf 16": (white, 16),
    "white, H.264 crf 23": (white, 23),
    "none, H.264 crf 23": (none, 23),
}
"""What noise is recorded, and the rate factor of H.264 that it is coded by."""


def recorded(noise: Callable[[int, Map], Map], rate: int | None) -> dict[int, Picture]:
    """The clip's frames (h, w, 3) by number, from 1 on."""
    frames = {}
    for frame in range(1, FRAMES + 1):
        shown = scene(frame)
        frames[frame] = np.clip(np.rint(shown + noise(frame, shown)), 0, 255).astype(np.uint8)
    return frames if rate is None else _coded(frames, rate)


def _coded(frames: dict[int, Picture], rate: int) -> dict[int, Picture]:
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "clip.mp4")
        with av.open(path, "w") as file:
            stream = file.add_stream("libx264", rate=Fraction(24), options={"crf": str(rate)})
            stream.width, stream.height, stream.pix_fmt = *SIZE, "yuv420p"
            for picture in frames.values():
                file.mux(stream.encode(av.VideoFrame.from_ndarray(picture, "rgb24")))
            file.mux(stream.encode())
        footage = open_footage(path)
        found = {frame: np.asarray(footage.read(frame), np.uint8) for frame in footage.frames}
        footage.close()
        return found


def made(frames: dict[int, Picture]) -> ClipContext:
    """A clip of frames of `scene`."""
    camera, depth = Intrinsics(*SIZE, FOCAL, FOCAL, SIZE[0] / 2, SIZE[1] / 2), Halves(NEAR, FAR)
    return ClipContext(reconstruction(camera, tuple(frames), depth), frames.__getitem__, depth)


def drawn(clip: ClipContext, frame: int, grain: float, radius: float) -> Map:
    """(h, w, 3) a frame through a lens of an aperture's radius, of 255."""
    camera = clip.reconstruction.cameras[0]
    lens = FrameOptions(
        Focus(distance=NEAR), radius, borrow=False, highlights=HighlightSettings(gain=0.0), grain=grain
    )
    linear = render_frame(clip, frame, lens, (camera.width, camera.height), lambda note: None)[..., :3]
    return np.asarray(255 * encode_srgb(np.clip(linear, 0, 1)), np.float32)


def written(shown: Map) -> Picture:
    """A picture (h, w, 3), of 255, as Blender writes it to 8 bits with a dither of 1."""
    dither = np.random.default_rng(2).uniform(-0.5, 0.5, (2, *shown.shape[:2], 1)).sum(axis=0)
    return np.clip(np.rint(shown + dither), 0, 255).astype(np.uint8)


def spectrum(noise: Map) -> NDArray[np.float64]:
    """(4,) power of noise (h, w, 3) in `BANDS`."""
    window = np.outer(np.hanning(noise.shape[0]), np.hanning(noise.shape[1]))[..., None]
    power = (np.abs(np.fft.fft2(noise * window, axes=(0, 1))) ** 2).sum(axis=2)
    down, across = np.fft.fftfreq(noise.shape[0])[:, None], np.fft.fftfreq(noise.shape[1])
    radius = np.hypot(down, across)
    return np.array([power[(radius >= low) & (radius < high)].mean() for low, high in pairwise(BANDS)])


def judged(kind: str, radius: float = RADIUS) -> str:
    """A line of the table."""
    noise, rate = KINDS[kind]
    frames, clean = recorded(noise, rate), {frame: scene(frame) for frame in (FRAME, FRAME + 1)}
    flat = np.s_[BORDER : int(0.55 * SIZE[1]), SIZE[0] // 2 + 2 * BORDER : SIZE[0] - 2 * BORDER]
    sharp = np.s_[BORDER:-BORDER, BORDER : SIZE[0] // 2 - 2 * BORDER]
    without, grained = (
        [drawn(made(frames), frame, amount, radius) for frame in (FRAME, FRAME + 1)] for amount in (0.0, 1.0)
    )
    noiseless = {**frames, FRAME: np.rint(clean[FRAME]).astype(np.uint8)}
    smooth = drawn(made(noiseless), FRAME, 0.0, radius)
    own = (frames[FRAME] - clean[FRAME])[flat]
    before, after = (each[0][flat] - smooth[flat] for each in (without, grained))
    added = [(a - b)[flat] for a, b in zip(grained, without, strict=True)]
    change = max(np.abs(a - b)[sharp].max() for a, b in zip(grained, without, strict=True))
    scale = max(float(own.std()), 1e-6)
    disc = 2 * radius * FOCAL * (1 / NEAR - 1 / FAR)
    line = f"{kind:22} {disc:4.1f} {scale:5.2f} {before.std() / scale:7.2f} {after.std() / scale:6.2f}   "
    if added[0].std() == 0:
        return line + f"nothing added{'':34} {change:.3g}"
    bands = np.sqrt(spectrum(after) / np.maximum(spectrum(own), 1e-9))
    together = _largest_correlation(*added)
    return line + " ".join(f"{band:5.2f}" for band in bands) + f"   {together:11.3f}   {change:.3g}"


def _largest_correlation(one: Map, other: Map) -> float:
    """Of two fields of noise (h, w, 3), whole pixels moved against each other by up to eight."""
    a, b = (each.mean(axis=2) - each.mean() for each in (one, other))
    size = a.shape
    both = np.fft.irfft2(np.fft.rfft2(a) * np.conj(np.fft.rfft2(b)), size) / (a.size * a.std() * b.std())
    near = np.roll(both, (8, 8), (0, 1))[:17, :17]
    return float(np.abs(near).max())


def of_clip(path: Path) -> str:
    """A line of the table of real clips."""
    footage = open_footage(path)
    source = to_linear(footage.read(footage.frames[0]))
    size = source.shape[1], source.shape[0]
    camera, depth = Intrinsics(*size, size[0], size[0], size[0] / 2, size[1] / 2), Halves(FAR, FAR)
    found, began = [], time.process_time()
    parts = np.array_split(np.array(footage.frames), PARTS)
    for frames in (footage.frames, *(tuple(map(int, part)) for part in parts)):
        clip = ClipContext(reconstruction(camera, frames, depth), footage.read, depth)
        noise = clip.noise(frames[0], size)
        found.append((noise.strength if noise else 0.0, frames[len(frames) // 2], clip))
    taken = (time.process_time() - began) / len(found)
    _, frame, clip = max(found, key=itemgetter(0))
    radius = DISC / (2 * camera.fx * (1 / NEAR - 1 / FAR))
    without, grained = (written(drawn(clip, frame, amount, radius)) for amount in (0.0, 1.0))
    before = np.rint(255 * encode_srgb(np.clip(to_linear(footage.read(frame))[..., :3], 0, 1)))
    footage.close()
    nothing = np.zeros(size[::-1], bool)
    smooth, noisy = (metrics.noise(before.astype(np.uint8), after, nothing) for after in (without, grained))
    strengths = " ".join(f"{255 * strength:.2f}" if strength else "-" for strength, *_ in found)
    line = f"| {path.stem} | {strengths} | {taken:.2f} | {frame} "
    if np.isnan(noisy.result):
        return line + "| nothing flat | | | | |"
    most = float(np.hypot(noisy.source, metrics.DITHER))
    figures = " | ".join(f"{each:.2f}" for each in (noisy.source, smooth.result, noisy.result, most))
    return line + f"| {figures} | {'yes' if noisy.result <= max(most, smooth.result) else 'NO'} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--clips", nargs="+", type=Path, metavar="PATH", help="folders and videos")
    options = parser.parse_args()
    if options.clips:
        videos = [
            video
            for path in options.clips
            for video in (sorted(path.glob("*.m*")) if path.is_dir() else [path])
        ]
        print(
            "| clip | noise found | CPU s | source | without grain | with | source and dither | no noisier |"
        )
        print("|---|---|---|---|---|---|---|---|")
        for video in videos:
            print(of_clip(video), flush=True)
        return
    print("noise                  disc sigma without   with   bands, coarse to fine     correlation   change")
    for kind in KINDS:
        print(judged(kind), flush=True)
    for radius in SMALL:
        for kind in ("white", "correlated"):
            print(judged(kind, radius), flush=True)


if __name__ == "__main__":
    main()
