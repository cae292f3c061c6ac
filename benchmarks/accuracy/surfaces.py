"""Surfaces that fool stereo, each by itself: `python -m benchmarks.special surfaces`.

PSNR against the real lens at 32 px with true cameras, within half of that of each of `surfaces.PLACES`: with
depth that is found, and with the true depth; and the share of the place's own pixels whose found depth is
wrong. Pictures go into `build/bench/pictures`.
"""

from __future__ import annotations

import argparse
from functools import cached_property
from pathlib import Path

import bpy
import cv2
import numpy as np

from sample_scenes import filming, surfaces

from .. import store
from . import metrics
from .cases import GroundTruth
from .completed import true_cameras
from .dense_depth import OFF
from .judge import save_picture
from .methods import METHODS
from .scenes import Floats, Staged

BLUR = 32
VIEWS = 64
NOISE = 0.02
SAMPLES = 64
"""Of Cycles for a pixel of the clip: what is mirrored is noisy with fewer."""


class Fooling(Staged):
    """The scene of `sample_scenes/surfaces.py`."""

    def __init__(self, noise: float) -> None:
        super().__init__(surfaces.NAME, noise)

    @cached_property
    def scene(self) -> bpy.types.Scene:
        return surfaces.build(self.stage)

    @cached_property
    def folder(self) -> str:
        code = store.sources("sample_scenes/gloss.py", "sample_scenes/surfaces.py")
        return f"{super().folder}-{store.digest(code, SAMPLES)}"

    def _film(self, frame: int) -> Path:
        path = self._clip_folder / f"frame_{frame:04d}.png"
        return path if path.exists() else filming.film_frame(self.scene, frame, self._clip_folder, SAMPLES)

    def shows(self, place: str, frame: int) -> metrics.Mask:
        """(H, W) where one of `surfaces.PLACES` is seen."""
        names = surfaces.PLACES[place]
        numbers = [i for i, thing in enumerate(self.stage.things) if thing.name in names]
        return np.isin(self.geometry(frame).thing, numbers)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=1, help="of those judged")
    arguments = parser.parse_args()
    scene = Fooling(NOISE)
    true, rows = GroundTruth(scene), dict[str, list[Floats]]()
    around = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (BLUR + 1, BLUR + 1))
    for frame, found, _ in true_cameras(scene, arguments.frames):
        truth, depth = scene.truth(frame, BLUR).picture, 1 / scene.depth(frame)
        cases = {"found": found, "true": true.case(frame, BLUR)}
        pictures = [METHODS["layers"].run(case, VIEWS).picture for case in cases.values()]
        for name, picture in zip((*cases, "lens"), (*pictures, truth), strict=True):
            save_picture(surfaces.NAME, name, BLUR, "layers", frame, picture)
        inverse = found.clip.stereo.at(frame).inverse_depth
        wrong = np.abs(inverse - depth) > OFF * np.ptp(depth)
        places = {"all": np.ones_like(wrong)} | {name: scene.shows(name, frame) for name in surfaces.PLACES}
        for name, own in places.items():
            near = cv2.dilate(own.astype(np.uint8), around) > 0
            scores = [metrics.psnr(picture, truth, near) for picture in pictures]
            rows.setdefault(name, []).append(np.array([*scores, 100 * wrong[own].mean()]))
    print("| place | found depth | true depth | wrong |\n|---|---|---|---|")
    for name, each in rows.items():
        one, other, share = np.mean(each, axis=0)
        print(f"| {name} | {one:.2f} | {other:.2f} | {share:.1f} % |")


if __name__ == "__main__":
    main()
