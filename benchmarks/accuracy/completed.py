"""What maps of a depth network add to a clip's own depth: `python -m benchmarks.special completed`.

PSNR against the real lens at 32 px with stereo alone, with the maps alone (the stand-in of `network_depth`),
and with both; of the whole picture, and of where stereo is not sure, or of what shines. Cameras are found
from the video, but true in scenes whose video is refused.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import bpy
import cv2
import numpy as np

from addon.core.base.errors import UserError
from addon.core.depth.source import SURE
from addon.core.frame.clip_context import ClipContext
from sample_scenes import gloss

from .. import store
from . import metrics
from .cases import BenchmarkCase, FromVideo, GroundTruth
from .methods import METHODS
from .network_depth import network_depth
from .scenes import Staged

SCENES = ("bars", "walk", "blocks", "fence", "boxes", "plain", "gloss")
BLUR = 32
VIEWS = 64
NOISE = 0.02


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="*", default=list(SCENES))
    parser.add_argument("--frames", type=int, default=3, help="of those judged")
    arguments = parser.parse_args()
    print("| scene | cameras | stereo | maps | both | where | share | stereo | maps | both |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for name in arguments.scenes:
        scene = Shining(NOISE) if name == gloss.NAME else Staged(name, NOISE)
        with tempfile.TemporaryDirectory() as folder:
            print("\n".join(rows(scene, Path(folder), arguments.frames)), flush=True)


class Shining(Staged):
    """The scene in which things mirror others."""

    def __init__(self, noise: float) -> None:
        super().__init__(gloss.NAME, noise)

    @cached_property
    def scene(self) -> bpy.types.Scene:
        return gloss.build(self.stage)

    @cached_property
    def folder(self) -> str:
        return f"{super().folder}-{store.digest(store.sources('sample_scenes/gloss.py'))}"

    def shows(self, name: str, frame: int) -> metrics.Mask:
        """(H, W) where a thing is seen."""
        (number,) = (i for i, thing in enumerate(self.stage.things) if thing.name == name)
        return np.asarray(self.geometry(frame).thing == number)


def rows(scene: Staged, folder: Path, count: int) -> list[str]:
    """Lines of the table: means over the judged frames, a line for each place that is scored by itself."""
    cameras, cases = "solved", list[tuple[int, BenchmarkCase, ClipContext]]()
    try:
        video = FromVideo(scene)
        cases = [(frame, video.case(frame, BLUR), video.clip) for frame in scene.judged(BLUR)[:count]]
    except UserError:
        cameras, cases = "true", list(true_cameras(scene, count))
    scores, places = [], dict[str, metrics.Mask]()
    for frame, case, clip in cases:
        maps = network_depth(scene, clip.reconstruction, folder)
        confidence = clip.stereo.at(frame).confidence
        truth = scene.truth(frame, BLUR).picture
        unsure = cv2.resize((confidence < SURE).astype(np.uint8), truth.shape[1::-1]) > 0
        clips = (clip, replace(clip, given_depth=maps), replace(clip, maps=maps))
        pictures = [METHODS["layers"].run(replace(case, clip=each), VIEWS).picture for each in clips]
        places = {"not sure": unsure}
        if isinstance(scene, Shining):
            places |= {name: scene.shows(name, frame) for name in gloss.GLOSS}
        scores.append([
            [*(metrics.psnr(each, truth) for each in pictures), 100 * where.mean(),
             *(metrics.psnr(each, truth, where) for each in pictures)] for where in places.values()
        ])  # fmt: skip
    lines = zip(places, np.mean(scores, axis=0), strict=True)
    return [
        f"| {scene.name} | {cameras} | " + " | ".join(f"{x:.2f}" for x in line[:3])
        + f" | {where} | {line[3]:.1f} % | " + " | ".join(f"{x:.2f}" for x in line[4:]) + " |"
        for where, line in lines
    ]  # fmt: skip


def true_cameras(scene: Staged, count: int) -> Iterator[tuple[int, BenchmarkCase, ClipContext]]:
    """Frames of a clip whose cameras and corners are true, and whose depth is found."""
    true = GroundTruth(scene)
    frames = [int(frame) for frame in scene.cameras.frames]
    clip = ClipContext(true.reconstruction(frames), true.whole.read)
    for frame in scene.judged(BLUR)[:count]:
        yield frame, replace(true.case(frame, BLUR), clip=clip), clip


if __name__ == "__main__":
    main()
