"""How long one view takes on this machine's GPU: python -m benchmarks.timings.view_times [--views 64]

Prints the renderer, and for each picture size the whole frame's time (upload, views, sum, download) and
the time that one more view costs, from the difference between N and 2 N views, each the best of three.
"""

from __future__ import annotations

import argparse
import time

import bpy
import numpy as np

from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.focus.focus import Focus
from addon.core.frame.plan import FramePlan
from addon.render import gpu_views

from ..stability.runs import planned

SIZES = ((640, 360), (884, 1080), (1920, 1080), (3840, 2160))
FEATURES = 1500


def slanted_plane(width: int, height: int) -> Reconstruction:
    """Random features on a plane that recedes to the right, seen by one camera."""
    camera = Intrinsics(width, height, 0.85 * width, 0.85 * width, width / 2, height / 2)
    xy = np.random.default_rng(0).uniform([0, 0], [width, height], (FEATURES, 2))
    depth = 5 + 7 * xy[:, 0] / width
    xyz = np.column_stack([(xy - camera.principal_point) / camera.focal, np.ones(FEATURES)]) * depth[:, None]
    image = Image(1, np.eye(3), np.zeros(3), xy, np.arange(FEATURES, dtype=np.int32))
    points = Points(xyz, np.zeros((FEATURES, 3), np.uint8), np.zeros(FEATURES))
    return Reconstruction((camera,), (image,), points)


def seconds(plan: FramePlan, picture: np.ndarray) -> float:
    """Best of three."""
    times = []
    for _ in range(3):
        start = time.perf_counter()
        gpu_views.mean_of_views(plan, picture)
        times.append(time.perf_counter() - start)
    return min(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--views", type=int, default=64)
    options = parser.parse_args()
    problem = gpu_views.gpu_problem()
    if problem:
        raise SystemExit(f"no GPU context: {problem}")
    import gpu

    print(
        f"{gpu.platform.renderer_get()}, {gpu.platform.backend_type_get()}, Blender {bpy.app.version_string}"
    )
    print(f"{FEATURES} features, {options.views} views, 32-bit float")
    print("| picture | frame, ms | one more view, ms |\n|---|---|---|")
    for width, height in SIZES:
        rec = slanted_plane(width, height)
        picture = np.random.default_rng(1).random((height, width, 4), dtype=np.float32)
        radius = 0.02 * width / (2 * 0.85 * width * (1 / 5 - 1 / 8))
        plans = [
            planned(rec, Focus(distance=8.0), radius=radius, views=count)
            for count in (options.views, 2 * options.views)
        ]
        once, twice = (seconds(plan, picture) for plan in plans)
        print(
            f"| {width}x{height} | {1e3 * once:.1f} | {1e3 * (twice - once) / options.views:.3f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
