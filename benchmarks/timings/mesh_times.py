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
from numpy.typing import NDArray

from addon.core.camera.reconstruction import Reconstruction
from addon.core.depth.multi_view_stereo import COARSE, PlaneSweepStereo
from addon.core.depth.temporal_fusion import TemporalFusion
from addon.core.lens.focus import Focus
from addon.core.lens.frame import warp_frame
from addon.core.lens.plan import LensSettings
from addon.core.media.clip import open_footage, to_linear
from addon.core.warp.disocclusion_fill import DisocclusionFill

from ..accuracy.cases import Known
from ..accuracy.scenes import Staged
from ..cost import measured

SIZES = ((640, 360), (1920, 1080))
SCENE, NOISE, BLUR = "bars", 0.01, 0.05
FRAMES = range(14, 22)
"""The first of them finds what those after it share."""


class Clip:
    """What `warp_frame` asks, of pictures in memory."""

    depth = None

    def __init__(self, cameras: Reconstruction, pictures: dict[int, NDArray[np.uint8]]) -> None:
        read = pictures.__getitem__
        self.reconstruction = cameras
        """With the features of the frame that is asked for."""
        self.dense = TemporalFusion(cameras, PlaneSweepStereo(cameras, read))
        self.disocclusion = DisocclusionFill(cameras, read, PlaneSweepStereo(cameras, read, COARSE).moving)


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
        cameras = replace(
            scene.cameras, cameras=tuple(lens.scaled(width, height) for lens in scene.cameras.cameras)
        )
        print(row(scene, Clip(cameras, pictures), pictures, (width, height)), flush=True)


def row(scene: Staged, clip: Clip, pictures: dict[int, NDArray[np.uint8]], size: tuple[int, int]) -> str:
    middle = FRAMES[len(FRAMES) // 2]
    focus = scene.focus_depth(middle, 16)
    contrast = np.abs(1 / scene.depth(middle) - 1 / focus).max()
    image, _ = clip.reconstruction.image_at(middle)
    radius = BLUR * size[0] / (2 * clip.reconstruction.intrinsics(image).fx * contrast)
    lens = LensSettings(Focus(distance=focus), float(radius), 64)
    times, costs, shares, depths = [], [], [], []
    for frame in FRAMES:
        clip.reconstruction = featured(scene, frame, size)
        start = time.perf_counter()
        made, cost = measured(partial(warp_frame, clip, frame, lens, size, to_linear(pictures[frame])))
        times.append(time.perf_counter() - start)
        costs.append(cost)
        depths.append(made.depth_seconds)
        shares.append(len(made.plan.mesh.triangles) / (2 * size[0] * size[1]))
    cpu = np.mean([cost.cpu_s for cost in costs[1:]])
    return (
        f"| {size[0]}x{size[1]} | {times[0]:.1f} | {np.mean(times[1:]):.1f} | {cpu:.1f} |"
        f" {np.mean(depths[1:]):.1f} | {100 * np.mean(shares):.1f} % | {max(c.peak_mb for c in costs):.0f} |"
    )


def featured(scene: Staged, frame: int, size: tuple[int, int]) -> Reconstruction:
    """The frame's camera and the corners found in it, for a picture of another size."""
    given = Known(scene).given(frame, 16).reconstruction
    (image,), (lens,) = given.images, given.cameras
    zoom = size[0] / lens.width
    return replace(given, cameras=(lens.scaled(*size),), images=(replace(image, xy=zoom * image.xy),))


if __name__ == "__main__":
    main()
