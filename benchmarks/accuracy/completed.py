"""What maps of a depth network add to a clip's own depth: `python -m benchmarks.accuracy.completed`.

PSNR against the real lens at 32 px with stereo alone, with the maps alone (the stand-in of `network_depth`),
and with both; of the whole picture, and of where stereo is not sure. Cameras are found from the video, but
true in scenes whose video is refused.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from addon.core.base.errors import UserError
from addon.core.depth.temporal_fusion import FusionOptions
from addon.core.frame.clip_context import ClipContext

from . import metrics
from .cases import BenchmarkCase, FromVideo, GroundTruth
from .methods import METHODS
from .network_depth import network_depth
from .scenes import Staged

SCENES = ("bars", "walk", "blocks", "fence", "boxes", "plain")
BLUR = 32
VIEWS = 64
NOISE = 0.02


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="*", default=list(SCENES))
    parser.add_argument("--frames", type=int, default=3, help="of those judged")
    arguments = parser.parse_args()
    print("| scene | cameras | not sure | stereo | maps | both | there: stereo | maps | both |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name in arguments.scenes:
        with tempfile.TemporaryDirectory() as folder:
            print(row(Staged(name, NOISE), Path(folder), arguments.frames), flush=True)


def row(scene: Staged, folder: Path, count: int) -> str:
    """A line of the table: means over the judged frames."""
    cameras, cases = "solved", list[tuple[int, BenchmarkCase, ClipContext]]()
    try:
        video = FromVideo(scene)
        cases = [(frame, video.case(frame, BLUR), video.clip) for frame in scene.judged(BLUR)[:count]]
    except UserError:
        cameras, cases = "true", list(true_cameras(scene, count))
    scores = []
    for frame, case, clip in cases:
        maps = network_depth(scene, clip.reconstruction, folder)
        confidence = clip.stereo.at(frame).confidence
        truth = scene.truth(frame, BLUR).picture
        unsure = cv2.resize((confidence < FusionOptions().unsure).astype(np.uint8), truth.shape[1::-1]) > 0
        clips = (clip, replace(clip, given_depth=maps), replace(clip, maps=maps))
        pictures = [METHODS["layers"].run(replace(case, clip=each), VIEWS).picture for each in clips]
        there = [metrics.psnr(each, truth, unsure) for each in pictures]
        scores.append([unsure.mean(), *(metrics.psnr(each, truth) for each in pictures), *there])
    share, *psnr = np.mean(scores, axis=0)
    return (
        f"| {scene.name} | {cameras} | {100 * share:.1f} % | " + " | ".join(f"{x:.2f}" for x in psnr) + " |"
    )


def true_cameras(scene: Staged, count: int) -> Iterator[tuple[int, BenchmarkCase, ClipContext]]:
    """Frames of a clip whose cameras and corners are true, and whose depth is found."""
    true = GroundTruth(scene)
    frames = [int(frame) for frame in scene.cameras.frames]
    clip = ClipContext(true.reconstruction(frames), true.whole.read)
    for frame in scene.judged(BLUR)[:count]:
        yield frame, replace(true.case(frame, BLUR), clip=clip), clip


if __name__ == "__main__":
    main()
