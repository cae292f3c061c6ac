"""What depth and mesh cost a frame: `python -m benchmarks.timings.mesh_times`.

Consecutive frames of the bars scene as they are, and enlarged to 1920x1080, with its true cameras: depth from
the clip, what moves, layers, colours lent by other frames, and triangles; reading and drawing are not in it.
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial

import cv2
import numpy as np

from addon.core.camera.reconstruction import Reconstruction
from addon.core.lens.clip_context import ClipContext
from addon.core.lens.focus import Focus
from addon.core.lens.frame import warp_frame
from addon.core.lens.plan import LensSettings
from addon.core.media.clip import open_footage, to_linear

from ..accuracy.cases import GroundTruth
from ..accuracy.scenes import Staged
from ..cost import measured

SIZES = ((640, 360), (1920, 1080))
SCENE, NOISE, BLUR = "bars", 0.01, 0.05
FRAMES = range(14, 22)
"""The first of them finds what those after it share."""


def main() -> None:
    scene = Staged(SCENE, NOISE)
    footage = open_footage(scene.clip())
    print(f"{SCENE}, frames {FRAMES.start} to {FRAMES.stop - 1}, largest disc {BLUR:g} of the width")
    print(
        "| size | first frame, s | after it, s | CPU s | depth, s | share of the grid's triangles | peak MB |"
    )
    print("|---|---|---|---|---|---|---|")
    for width, height in SIZES:
        pictures = {f: cv2.resize(footage.read(f)[..., :3], (width, height)) for f in footage.frames}
        clip = ClipContext(featured(scene, (width, height)), pictures.__getitem__)
        print(row(scene, clip, (width, height)), flush=True)


def row(scene: Staged, clip: ClipContext, size: tuple[int, int]) -> str:
    middle = FRAMES[len(FRAMES) // 2]
    focus = scene.focus_depth(middle, 16)
    contrast = np.abs(1 / scene.depth(middle) - 1 / focus).max()
    image, _ = clip.reconstruction.image_at(middle)
    radius = BLUR * size[0] / (2 * clip.reconstruction.intrinsics(image).fx * contrast)
    lens = LensSettings(Focus(distance=focus), float(radius), 64)
    times, costs, shares, depths = [], [], [], []
    for frame in FRAMES:
        start = time.perf_counter()
        made, cost = measured(partial(warp_frame, clip, frame, lens, size, to_linear(clip.read(frame))))
        times.append(time.perf_counter() - start)
        costs.append(cost)
        depths.append(made.depth_seconds)
        shares.append(len(made.plan.mesh.triangles) / (2 * size[0] * size[1]))
    cpu = np.mean([cost.cpu_s for cost in costs[1:]])
    return (
        f"| {size[0]}x{size[1]} | {times[0]:.1f} | {np.mean(times[1:]):.1f} | {cpu:.1f} |"
        f" {np.mean(depths[1:]):.1f} | {100 * np.mean(shares):.1f} % | {max(c.peak_mb for c in costs):.0f} |"
    )


def featured(scene: Staged, size: tuple[int, int]) -> Reconstruction:
    """The cameras and the corners found in the frames, for pictures of another size."""
    true = GroundTruth(scene).reconstruction(FRAMES)
    (lens,) = true.cameras
    zoom = size[0] / lens.width
    images = tuple(replace(image, xy=zoom * image.xy) for image in true.images)
    return replace(true, cameras=(lens.scaled(*size),), images=images)


if __name__ == "__main__":
    main()
