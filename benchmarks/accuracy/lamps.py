"""Scenes with lamps through a real lens: `python -m benchmarks.accuracy.lamps`.

`bars` and `foreground` have paper lanterns, of 6 times white, `bulbs` bare bulbs of 40, 150 and 800 times
white, `street` both. Cameras and depth are true, so that what is missing is light: PSNR against Cycles' thin
lens of the frame as it was recorded, of the same with highlights, and of what no highlight can reach. "coded"
is the same clip as H.264.
"""

from __future__ import annotations

import argparse
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.frame.highlights import HighlightSettings
from addon.core.frame.plan import FrameOptions
from addon.core.media.clip import Footage, open_footage
from addon.core.media.light import encode_srgb
from addon.render.views.quiet import quiet
from sample_scenes import truth
from sample_scenes.shapes import sphere

from .. import store
from ..coded import CRF, encode
from . import metrics
from .cases import GroundTruth
from .methods import through
from .scenes import FILM_SAMPLES, Picture, Staged

SCENES = ("bars", "foreground", "bulbs", "street")
BLUR = 32
"""Pixels, largest disc."""
VIEWS = 64
NOISE = 0.02
BARE = 20.0
"""Times white, from which on lamps are small balls that are drawn into the clip."""
FINER = 16
"""Parts of a pixel that they are drawn by."""


class Filmed(Staged):
    """A scene whose small lamps are drawn into the clip as a sensor sees them: of 16 samples, a pixel that a
    bright lamp covers a little is either clipped or dark, which tells of no lamp at all."""

    @property
    def _clip_folder(self) -> Path:
        return store.FOLDER / self.folder / f"clip-lamps-{self.key}"

    def _film(self, frame: int) -> Path:
        path = self._clip_folder / f"frame_{frame:04d}.png"
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(path), truth.recorded(self._light(frame), frame)[..., ::-1])
        return path

    def _light(self, frame: int) -> Picture:
        """(H, W, 3) what arrives at the sensor: the picture without lamps, and each lamp that is seen."""
        lamps = [number for number, thing in enumerate(self.stage.things) if thing.glow >= BARE]
        things = {thing.pass_index - 1: thing for thing in self.scene.objects if thing.pass_index}
        seen, light = self.geometry(frame).thing, None
        for number in lamps:
            things[number].visible_camera = False
        try:
            with quiet(1):
                light = truth.pinhole(self.scene, frame, FILM_SAMPLES, frame)
        finally:
            for number in lamps:
                things[number].visible_camera = True
        cameras = self.stage.cameras
        for number in lamps:
            thing = self.stage.things[number]
            balls = thing.shape.vertices.reshape(-1, len(sphere(1.0, 12).vertices), 3)
            middles = balls.mean(axis=1)
            radii = np.linalg.norm(balls[:, 0] - middles, axis=1)
            depth = cameras.to_camera(middles)[frame - 1, :, 2]
            for (x, y), radius in zip(
                cameras.project(middles)[frame - 1], cameras.focal * radii / depth, strict=True
            ):
                row, column = int(y), int(x)
                reach = int(radius) + 4
                if not (
                    0 <= row < seen.shape[0] and 0 <= column < seen.shape[1] and seen[row, column] == number
                ):
                    continue
                top, left = max(0, row - reach), max(0, column - reach)
                part = light[top : row + reach + 1, left : column + reach + 1]
                covered = coverage(x - left, y - top, radius, part.shape[:2])[..., None]
                part += covered * (thing.glow * thing.picture[0, 0] - part)
        return light


def coverage(x: float, y: float, radius: float, size: tuple[int, int]) -> Picture:
    """(h, w) of pixels by a disc, through the pixel filter of Cycles: Blackman-Harris, three pixels wide."""
    height, width = size
    at = [(np.arange(FINER * n) + 0.5) / FINER for n in (width, height)]
    disc = (np.hypot(at[0] - x, at[1][:, None] - y) <= radius).astype(np.float64)
    down, across = (_filter(n) for n in size)
    return np.asarray(down @ disc @ across.T, np.float32)


def _filter(size: int) -> NDArray[np.float64]:
    """(n, FINER n) matrix of the filter for a row of pixels."""
    away = (np.arange(FINER * size) + 0.5) / FINER - (np.arange(size) + 0.5)[:, None]
    place = 2 * np.pi * (away / 3 + 0.5)
    terms = ((0.35875, 0), (-0.48829, 1), (0.14128, 2), (-0.01168, 3))
    weight = np.where(np.abs(away) < 1.5, sum(share * np.cos(n * place) for share, n in terms), 0.0)
    return np.asarray(weight / weight.sum(axis=1, keepdims=True).max())


class Coded(Filmed):
    """The same as a video."""

    def clip(self) -> Path:
        """The video's path."""
        folder = super().clip()
        path = folder.with_name(f"{folder.name}-{CRF}.mp4")
        if not path.exists():
            encode(map(super().frame, range(1, len(self.stage.cameras) + 1)), path)
        return path

    @cached_property
    def _footage(self) -> Footage:
        return open_footage(self.clip())

    def frame(self, frame: int) -> NDArray[np.uint8]:
        """(H, W, 3) as the product reads it."""
        return np.asarray(self._footage.read(frame), np.uint8)


def pictures(scene: Staged, given: GroundTruth, frame: int) -> tuple[Picture, Picture, Picture]:
    """A frame's truth (H, W, 3), what is drawn without highlights, and with them."""
    case = given.case(frame, BLUR)
    drawn = [
        through(case, case.clip, FrameOptions(case.focus, case.radius, VIEWS, highlights=settings)).picture
        for settings in (HighlightSettings(gain=0), HighlightSettings())
    ]
    return scene.truth(frame, BLUR).picture, drawn[0], drawn[1]


def show(name: str, *rows: Picture) -> None:
    """Keep pictures beside each other, for looking at."""
    folder = store.FOLDER / "pictures"
    folder.mkdir(parents=True, exist_ok=True)
    shown = np.rint(255 * encode_srgb(np.clip(np.hstack(rows), 0, 1))).astype(np.uint8)
    cv2.imwrite(str(folder / f"lamps-{name}.png"), shown[..., ::-1])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=SCENES)
    parser.add_argument("--frames", type=int, default=1, help="how many are judged, three at most")
    options = parser.parse_args()
    print("| scene | clip | ceiling | without | with highlights | beside them |\n|---|---|---|---|---|---|")
    for name in options.scenes:
        for kind in (Filmed, Coded):
            scene = kind(name, NOISE)
            given, scores = GroundTruth(scene), []
            for frame in scene.judged(BLUR)[: options.frames]:
                true, *drawn = pictures(scene, given, frame)
                show(f"{name}-{kind.__name__.lower()}-{frame}", drawn[1], true)
                beside = metrics.unclipped(scene.frame(frame), given.case(frame, BLUR).disc)
                ceiling = metrics.noise_ceiling(*scene.truth(frame, BLUR).seeds)
                scores.append([ceiling, *(metrics.psnr(each, true) for each in drawn),
                               metrics.psnr(drawn[1], true, beside)])  # fmt: skip
            figures = " | ".join(f"{each:.2f}" for each in np.mean(scores, axis=0))
            print(f"| {name} | {'coded' if kind is Coded else 'clean'} | {figures} |", flush=True)


if __name__ == "__main__":
    main()
