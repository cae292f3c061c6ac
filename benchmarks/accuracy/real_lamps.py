"""Highlights of a real clip: `python -m benchmarks.special real_lamps CLIP [--work FOLDER]` (real data).

**Light.** A frame is the short exposure of a bracket: lamps that it does not clip are known. The same frames,
brighter by some stops and clipped as a camera clips, are the long exposure, from which the product restores
them. A lamp's energy is that of its clipped pixels and two around them, restored over true: its median, the
root mean square of its logarithm, and its spread (standard deviation of that), which is also the spread among
equal lamps.

**Discs.** The frame is drawn as a wall behind the focal plane, so that no surface hides a disc, which has a
radius of `--radius` pixels. Lamps whose disc touches no other one are measured in the light that the product
adds to the mean of the views. *Radius*: of the area that is brighter than half of the disc's middle. *Ring*:
light between 60 and 90 % of the radius over that within 50 %. *Square*: fourth harmonic of the outline's
radius, as a share of it.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from addon.core.base.arrays import Floats, LinearRGB, LinearRGBA
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.depth.source import DepthSource, PixelDepth
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.frame_path import mesh_frame
from addon.core.frame.highlight_discs import SmallHighlight
from addon.core.frame.highlights import RESTORED
from addon.core.frame.plan import FrameOptions
from addon.core.frame.warped_frame import WarpedFrame
from addon.core.media.clip import Footage, open_footage
from addon.core.media.light import decode_srgb, encode_srgb, to_linear
from addon.core.sfm.workspace import load_solve
from addon.render.views.average import draw_mean

from .. import store

LARGEST = 120
"""Clipped pixels of a lamp, at most."""
ANGLES = 64
"""Directions in which an outline is measured."""
WALL = 2.0
"""Distance of the wall over that of the focal plane."""


@dataclass(frozen=True)
class Wall(DepthSource):
    """A depth source: every pixel is as far."""

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth:
        """The wall's inverse depth."""
        return PixelDepth(np.full((canvas.pinhole.height, canvas.pinhole.width), 1 / WALL, np.float32))


@dataclass(frozen=True)
class Brighter:
    """A clip as a longer exposure."""

    clip: ClipContext
    stops: float

    def read(self, frame: int) -> np.ndarray:
        """(h, w, 3) 8 bits, clipped."""
        light = to_linear(self.clip.read(frame))[..., :3] * np.float32(2**self.stops)
        return np.rint(255 * encode_srgb(np.clip(light, 0, 1))).astype(np.uint8)


def light_row(clip: ClipContext, frame: int, stops: float) -> str:
    """A row of the first table."""
    true = to_linear(clip.read(frame))[..., :3]
    longer = Brighter(clip, stops)
    seen = decode_srgb(longer.read(frame) / np.float32(255))
    found = replace(clip, read=longer.read).picture(frame, RESTORED)[..., :3]
    clipped = (seen.max(axis=2) >= RESTORED.threshold).astype(np.uint8)
    count, label, stats, _ = cv2.connectedComponentsWithStats(clipped, connectivity=8)
    around = cv2.dilate(label.astype(np.float32), np.ones((5, 5))).astype(int)
    energies = [_sums(around, picture, count) for picture in (found, seen, true * 2**stops)]
    peak = np.zeros(count)
    np.maximum.at(peak, around.ravel(), true.max(axis=2).ravel())
    known = (peak < RESTORED.threshold) & (stats[:, cv2.CC_STAT_AREA] <= LARGEST) & (np.arange(count) > 0)
    logs = np.log(energies[0][known] / energies[2][known])
    before = np.exp(np.median(np.log(energies[1][known] / energies[2][known])))
    return (
        f"| {stops:g} | {known.sum()} | {before:.2f} | {np.exp(np.median(logs)):.2f} |"
        f" {np.sqrt(np.mean(logs**2)):.2f} | {np.std(logs):.2f} |"
    )


def _sums(label: np.ndarray, picture: LinearRGB, count: int) -> Floats:
    """(count,) light of labelled pixels."""
    return np.bincount(label.ravel(), picture.mean(axis=2, dtype=np.float64).ravel(), count)


@dataclass(frozen=True)
class Measured:
    """A disc."""

    wanted: float
    """Its radius in pixels by the lens."""
    radius: float
    ring: float
    square: float

    @property
    def off(self) -> float:
        """Pixels by which the radius is too large."""
        return self.radius - self.wanted


def discs(warped: WarpedFrame) -> tuple[list[Measured], int]:
    """Discs that touch no other one, and how many there are."""
    held = warped.highlight_discs
    assert held is not None
    places = np.array([one.place for one in held.found])
    reach = np.array([abs(one.displacement) + max(one.light.shape[:2]) / 2 for one in held.found])
    found = []
    for one, place, own in zip(held.found, places, reach, strict=True):
        if np.sum(np.hypot(*(places - place).T) < reach + own) == 1:
            alone = replace(held, found=(one,)).light(warped.plan, warped.layers)
            found.append(measured(one, alone.sum(axis=2, dtype=np.float64)))
    return found, len(held.found)


def measured(one: SmallHighlight, light: Floats) -> Measured:
    """A disc's shape from its light (h, w)."""
    y, x = np.nonzero(light > 0)
    weight = light[y, x]
    centre = np.array([np.average(x, weights=weight), np.average(y, weights=weight)])
    away = np.hypot(x - centre[0], y - centre[1])
    wanted = abs(one.displacement)
    middle = weight[away < wanted / 2].mean()
    radius = float(np.sqrt(np.count_nonzero(weight > middle / 2) / np.pi))
    rim = weight[(away > 0.6 * wanted) & (away < 0.9 * wanted)].mean()
    angle = np.arange(ANGLES) * 2 * np.pi / ANGLES
    steps = np.arange(0, 1.6 * wanted, 0.1)
    along = centre[:, None, None] + np.stack([np.cos(angle), np.sin(angle)])[..., None] * steps
    seen = cv2.remap(
        light.astype(np.float32), along[0].astype(np.float32), along[1].astype(np.float32), cv2.INTER_LINEAR
    )
    outline = 0.1 * (seen > middle / 2).sum(axis=1)
    square = 2 * abs(np.mean(outline * np.exp(-4j * angle))) / outline.mean()
    return Measured(wanted, radius, float(rim / middle), float(square))


def main() -> None:
    """Print both tables and keep a picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clip", type=Path)
    parser.add_argument("--work", type=Path, help="folder of its solve; without it light alone, by one frame")
    parser.add_argument("--frame", type=int, default=50)
    parser.add_argument("--stops", type=float, nargs="*", default=[2.0, 4.0, 6.0])
    parser.add_argument("--radius", type=float, default=15.3, help="pixels of the discs; 0 for none")
    options = parser.parse_args()
    if options.work is None:
        footage = open_footage(options.clip)
        clip = ClipContext(_alone(footage, options.frame), footage.read)
    else:
        solve = load_solve(options.work, options.clip)
        footage = open_footage(solve.footage)
        clip = ClipContext(solve.reconstruction, footage.read)
    if options.stops:
        print("| stops | lamps | clipped / true | restored / true | error of its log | spread |")
        print("|---|---|---|---|---|---|")
    for stops in options.stops:
        print(light_row(clip, options.frame, stops), flush=True)
    if options.radius:
        alone = _alone(footage, options.frame)
        wall = ClipContext(alone, footage.read, Wall())
        picture = clip.picture(options.frame, RESTORED)
        clipped = to_linear(clip.read(options.frame))[..., :3].max(axis=2) >= RESTORED.threshold
        stats = cv2.connectedComponentsWithStats(clipped.astype(np.uint8), connectivity=8)[2]
        print(f"{np.count_nonzero(stats[1:, cv2.CC_STAT_AREA] <= LARGEST)} lamps are clipped", end=", ")
        print_discs(wall, picture, options.frame, options.radius, options.clip.stem)


def print_discs(clip: ClipContext, picture: LinearRGBA, frame: int, radius: float, name: str) -> None:
    """Draw a frame (h, w, 4) with discs of a radius in pixels, keep its picture, and print their shape."""
    image, _ = clip.reconstruction.image_at(frame)
    camera = clip.reconstruction.intrinsics(image)
    aperture = radius / (camera.fx * (1 - 1 / WALL))
    lens = FrameOptions(Focus(distance=1.0), aperture, borrow=False, grain=0.0)
    size = camera.width, camera.height
    warped = (meshed := mesh_frame(clip, frame, lens, size, picture)).through(meshed.views)
    shown = np.rint(255 * encode_srgb(np.clip(draw_mean(warped)[..., :3], 0, 1))).astype(np.uint8)
    folder = store.FOLDER / "pictures"
    folder.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(folder / f"real-lamps-{name}.png"), shown[..., ::-1])
    if warped.highlight_discs is None:
        print("no lamp became a disc")
        return
    found, all_of_them = discs(warped)
    print(f"{all_of_them} are drawn as discs, and {len(found)} of these touch no other one")
    for kind in ("off", "ring", "square") if found else ():
        values = np.array([getattr(each, kind) for each in found])
        low, middle, high = np.percentile(values, [5, 50, 95])
        print(f"{kind}: {middle:.3f} in the median, {low:.3f} to {high:.3f} for 90 %")


def _alone(footage: Footage, frame: int) -> Reconstruction:
    """A frame without others, whose rims alone tell of its lamps."""
    width, height = footage.width, footage.height
    camera = Intrinsics(width, height, width, width, width / 2, height / 2)
    image = Image(frame, np.eye(3), np.zeros(3), np.zeros((0, 2)), np.zeros(0, np.int32))
    points = Points(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0))
    return Reconstruction((camera,), (image,), points)


if __name__ == "__main__":
    main()
