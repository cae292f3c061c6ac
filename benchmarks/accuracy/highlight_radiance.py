"""Lamps of known radiance, clipped by the camera: `python -m benchmarks.accuracy.highlight_radiance`.

A plane with a texture and round lamps is recorded as a clip is (point spread, pixels, noise, 8 bits) by a
camera that moves sideways; "coded" is the same clip as H.264. The radiance of what is clipped is estimated
in several ways, and the plane is blurred by a disc, which is what a lens does to a plane. Scores are PSNR of
that as displayed, and the energy of light sources over the true one: its median, the root of the mean square
of its logarithm, and the spread (standard deviation) of that among the lamps, which are equal. "mixed" has
paper lanterns of 5 times white and bulbs of 200.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.base.arrays import LinearRGBA
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.highlights import HighlightSettings
from addon.core.media.clip import open_footage
from addon.core.media.light import encode_srgb, to_linear
from addon.core.warp.clipped_blobs import clipped_blobs, point_spread
from addon.core.warp.footprint import disc_kernel
from addon.core.warp.highlight_kinds import RADIANCES as TRIED
from addon.core.warp.highlight_kinds import kinds_of, tints
from addon.core.warp.highlights import lost_light

from ..coded import encode
from . import metrics

RADIANCES = (2.0, 6.0, 20.0, 60.0, 200.0, 1000.0)
"""Of the lamps, times white."""
MIXED = (5.0, 200.0)
"""Of the larger lamps, which are paper lanterns, and of the smaller ones, in the clip of both kinds."""
SIZE = (640, 360)
FOCAL, DEPTH = 600.0, 10.0
FRAMES = 25
PACE = 0.37
"""Pixels from one frame to the next."""
LAMPS = (8, 5)
RADII = (0.5, 0.8, 1.2, 2.0, 3.0)
"""Pixels, a row of light sources each."""
FINER = 8
"""Parts of a pixel that lamps are drawn by."""
SPREAD = 0.45
"""Pixels, standard deviation of the point spread before the pixel's own."""
NOISE = 1.0
"""Of 255, standard deviation."""
DISC = 32
"""Pixels, diameter of the blur disc."""
SMALL = 120
"""Pixels: larger blobs are left as they are by the fixed gains."""

type Picture = NDArray[np.float32]
type Estimator = Callable[["Clip", LinearRGBA], LinearRGBA]


@dataclass(frozen=True)
class Clip:
    """Lamps before a moving camera."""

    radiances: tuple[float, ...]
    """Times white, of each row of lamps, from the smallest on."""
    coded: bool = False

    def __str__(self) -> str:
        kinds = sorted(set(self.radiances))
        return f"{kinds[0]:g}" if len(kinds) == 1 else "mixed"

    @property
    def reconstruction(self) -> Reconstruction:
        """The true cameras, and a point for each lamp."""
        camera = Intrinsics(*SIZE, FOCAL, FOCAL, SIZE[0] / 2, SIZE[1] / 2)
        xyz = np.column_stack([(_places() - camera.principal_point) / FOCAL, np.ones(len(_places()))]) * DEPTH
        images = []
        for number in range(FRAMES):
            moved = np.array([-number * PACE / FOCAL * DEPTH, 0.0, 0.0])
            seen = camera.project(xyz + moved)
            images.append(Image(number + 1, np.eye(3), moved, seen, np.arange(len(xyz), dtype=np.int32)))
        points = Points(xyz, np.full((len(xyz), 3), 128, np.uint8), np.full(len(xyz), 0.1))
        return Reconstruction((camera,), tuple(images), points)

    def light(self, frame: int, part: str = "all") -> Picture:
        """(h, w, 3) linear light that arrives at the sensor, or of the lamps alone."""
        moved = _places() - [(frame - 1) * PACE, 0]
        lamps = np.zeros((*SIZE[::-1], 3), np.float32)
        colours = np.array([[1, 0.9, 0.7], [1, 1, 1], [0.8, 0.9, 1], [1, 0.75, 0.4]], np.float32)
        for number, (x, y) in enumerate(moved):
            left, top = int(x) - 8, int(y) - 8
            place = (np.arange(16 * FINER) + 0.5) / FINER
            away = np.hypot(place[None] + left - x, place[:, None] + top - y)
            disc = (away <= RADII[number // LAMPS[0]]).astype(np.float32)
            disc = cv2.GaussianBlur(disc, (0, 0), SPREAD * FINER)
            covered = disc.reshape(16, FINER, 16, FINER).mean(axis=(1, 3))
            light = self.radiances[number // LAMPS[0]] * colours[number % 4]
            lamps[top : top + 16, left : left + 16] += covered[..., None] * light
        return lamps if part == "lamps" else _ground(frame) + lamps

    def read(self, frame: int) -> NDArray[np.uint8]:
        """(h, w, 3) as the product reads it."""
        return _recorded(self)[frame - 1]

    def sensed(self, frame: int) -> NDArray[np.uint8]:
        """(h, w, 3) as the camera records it, before it is coded."""
        shown = 255 * encode_srgb(np.clip(self.light(frame), 0, 1))
        noise = np.random.default_rng(frame).normal(0, NOISE, shown.shape)
        return np.asarray(np.rint(np.clip(shown + noise, 0, 255)), np.uint8)


@lru_cache(maxsize=2)
def _recorded(clip: Clip) -> list[NDArray[np.uint8]]:
    """A clip's frames."""
    frames = [clip.sensed(frame) for frame in range(1, FRAMES + 1)]
    if not clip.coded:
        return frames
    with tempfile.TemporaryDirectory() as folder:
        footage = open_footage(encode(frames, Path(folder) / "lamps.mp4"))
        return [np.asarray(footage.read(frame)) for frame in range(1, FRAMES + 1)]


def _places() -> NDArray[np.float64]:
    """(n, 2) of the lamps in the first frame, pixels; each lies on the pixels in another way."""
    across, down = LAMPS
    x, y = np.meshgrid(np.arange(across), np.arange(down))
    grid = np.column_stack([x.ravel(), y.ravel()])
    return grid * [68.0, 64.0] + [90, 50] + np.random.default_rng(1).uniform(0, 1, grid.shape)


@lru_cache
def _wall() -> Picture:
    """(8 h, 8 w, 3) dark panes with sharp edges, wider than the picture, `FINER` times as fine."""
    panes = np.random.default_rng(7).random((20, 36, 3)).astype(np.float32)
    size = ((SIZE[0] + 80) * FINER, SIZE[1] * FINER)
    fine = cv2.resize(0.02 + 0.25 * panes**2, size, interpolation=cv2.INTER_NEAREST)
    return np.asarray(cv2.GaussianBlur(fine, (0, 0), SPREAD * FINER), np.float32)


def _ground(frame: int) -> Picture:
    """(h, w, 3) light of the wall behind the lamps."""
    first = round((frame - 1) * PACE * FINER)
    seen = _wall()[:, first : first + SIZE[0] * FINER]
    return np.asarray(cv2.resize(seen, SIZE, interpolation=cv2.INTER_AREA), np.float32)


def _fixed(gain: float) -> Estimator:
    def estimate(_clip: Clip, seen: LinearRGBA) -> LinearRGBA:
        found = seen.copy()
        mask = (seen[..., :3].max(axis=2) >= HighlightSettings.threshold).astype(np.uint8)
        _, label, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
        found[(mask > 0) & (stats[:, cv2.CC_STAT_AREA] < SMALL)[label], :3] *= gain
        return found

    return estimate


def _by_area(_clip: Clip, seen: LinearRGBA) -> LinearRGBA:
    """A point's blob of area A at a spread s has the energy 2 pi s^2 exp(A / (2 pi s^2))."""
    found, squared = seen.copy(), point_spread(seen) ** 2
    blobs, flat = clipped_blobs(seen, HighlightSettings.threshold), found.reshape(-1, found.shape[2])
    energy = 2 * np.pi * squared * np.exp(np.minimum(blobs.area / (2 * np.pi * squared), 30.0))
    radiance = np.clip(energy / blobs.area, 1, 1000)[:, None]
    for some in blobs.patches:
        pixel, light = some.pixel[some.seen], radiance[some.number] * tints(some.rim, some.doubt)
        flat[pixel, :3] = np.maximum(flat[pixel, :3], light[np.nonzero(some.seen)[0]])
    return found


def _alone(clip: Clip, seen: LinearRGBA) -> LinearRGBA:
    """What ships, of each lamp in one frame alone."""
    found, blobs = seen.copy(), clipped_blobs(seen, HighlightSettings.threshold)
    nobody = np.zeros(len(blobs)), np.zeros((len(blobs), len(TRIED))), np.zeros((len(blobs), 3))
    lost = lost_light(blobs, HighlightSettings.threshold, nobody, kinds_of([]))
    found.reshape(-1, found.shape[2])[lost.pixel, :3] += lost.light
    return found


def _by_rim(clip: Clip, seen: LinearRGBA) -> LinearRGBA:
    """What ships, of the lamps of one frame."""
    alone = ClipContext(_of_frames(clip, 1), clip.read)
    return alone.picture(FRAMES // 2 + 1, HighlightSettings())


def _shipped(clip: Clip, seen: LinearRGBA) -> LinearRGBA:
    """What ships, of all frames."""
    return ClipContext(_of_frames(clip, FRAMES), clip.read).picture(FRAMES // 2 + 1, HighlightSettings())


def _of_frames(clip: Clip, count: int) -> Reconstruction:
    whole, middle = clip.reconstruction, FRAMES // 2
    low = middle - count // 2
    return Reconstruction(whole.cameras, whole.images[low : low + count], whole.points)


def _true(clip: Clip, seen: LinearRGBA) -> LinearRGBA:
    """The true light where the picture is clipped."""
    clipped = seen[..., :3].max(axis=2, keepdims=True) >= HighlightSettings.threshold
    light = np.maximum(clip.light(FRAMES // 2 + 1), seen[..., :3])
    return np.dstack([np.where(clipped, light, seen[..., :3]), seen[..., 3]])


ESTIMATORS: dict[str, Estimator] = {
    "none": lambda _clip, seen: seen,
    "gain 3": _fixed(3),
    "gain 8": _fixed(8),
    "area against point spread": _by_area,
    "rim, alone": _alone,
    "rims of a frame": _by_rim,
    "rims of all frames (ships)": _shipped,
    "truth where clipped": _true,
}


def row(clip: Clip, name: str) -> str:
    """An estimator's line of the table."""
    frame = FRAMES // 2 + 1
    seen, true = to_linear(clip.read(frame)), clip.light(frame)
    found = ESTIMATORS[name](clip, seen)
    pictures = [cv2.filter2D(p[..., :3].astype(np.float32), -1, disc_kernel(DISC / 2)) for p in (found, true)]
    psnr = metrics.psnr(np.clip(pictures[0], 0, 1), np.clip(pictures[1], 0, 1), None)
    lamps, ground = clip.light(frame, "lamps"), _ground(frame)
    logs = []
    for x, y in _places() - [(frame - 1) * PACE, 0]:
        around = np.s_[int(y) - 10 : int(y) + 10, int(x) - 10 : int(x) + 10, :3]
        logs.append(np.log(max(float((found[around] - ground[around]).sum()), 1e-3) / lamps[around].sum()))
    off, spread = np.sqrt(np.mean(np.square(logs))), np.std(logs)
    kind = "coded" if clip.coded else "clean"
    energy = np.exp(np.median(logs))
    return f"| {clip} | {kind} | {name} | {psnr:.2f} | {energy:.2f} | {off:.2f} | {spread:.2f} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--radiances", nargs="*", type=float, default=RADIANCES)
    parser.add_argument("--no-mixed", action="store_true")
    parser.add_argument("--estimators", nargs="+", default=list(ESTIMATORS), choices=ESTIMATORS)
    options = parser.parse_args()
    kinds = [(radiance,) * len(RADII) for radiance in options.radiances]
    if not options.no_mixed:
        kinds.append(tuple(MIXED[radius < RADII[-2]] for radius in RADII))
    print("| true radiance | clip | estimator | PSNR, dB | energy, median | error of its log | spread |")
    print("|---|---|---|---|---|---|---|")
    for kind in kinds:
        for coded in (False, True):
            for name in options.estimators:
                print(row(Clip(kind, coded), name), flush=True)


if __name__ == "__main__":
    main()
