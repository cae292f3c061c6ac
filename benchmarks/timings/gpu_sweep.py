"""The plane sweep on the processor and on the GPU, their times and how far they are apart:
`python -m benchmarks.special gpu_sweep`.

Of a picture of noise with six neighbours, as large as those of small clips, of the sample scenes, and what
larger ones are worked at in. The GPU's time ends with the winners in the processor's memory. Its first four
levels hold what comes before: shaders, and pictures brought there.
"""

from __future__ import annotations

import time

import bpy
import gpu
import numpy as np

from addon.core.base.progress import reporting
from addon.core.depth import matching
from addon.render.views import gpu_views
from addon.scene.gpu import gpu_matcher, gpu_sweep

from ..cost import measured

SIZES = ((320, 180, 32), (640, 360, 48), (960, 540, 64))
"""Width, height and depth levels."""
TITLE = (
    "| picture, levels | processor, CPU s | wall s | GPU, wall s | first four levels | each four more |"
    " sums | winners | over half a level | most |"
)


def row(width: int, height: int, levels: int) -> str:
    """A line of the table."""
    picture, views, inverse, guide, known = gpu_matcher.sample(width, height, levels)
    given = picture, views * 2, inverse, guide, known
    ours, cost = measured(lambda: matching.winning_levels(*given))
    ends = [time.perf_counter()]
    with reporting(lambda _stage, _share: ends.append(time.perf_counter())):
        its = gpu_sweep.winning_levels(*given)
    taken = np.diff([*ends, time.perf_counter()])
    sweep, sums, won = taken[: -(-levels // 4)], taken[-(-levels // 4) : -1], taken[-1]
    off = np.abs(ours.level - its.level)
    return (
        f"| {width}x{height}, {levels} | {cost.cpu_s:.2f} | {cost.wall_s:.2f} | {taken.sum():.3f}"
        f" | {sweep[0]:.3f} | {np.median(sweep[1:]):.4f} | {sums.sum():.3f} | {won:.3f}"
        f" | {100 * np.mean(off > 0.5):.3f} % | {off.max():.3f} levels |"
    )


def main() -> None:
    """Print the table."""
    gpu_views.check_gpu()
    real = "a GPU" if gpu_matcher.is_real() else "software, which leaves the sweep to the processor"
    print(f"Blender {bpy.app.version_string}, {gpu.platform.backend_type_get()}")
    print(f"{gpu.platform.renderer_get()}: {real}")
    print(f"compared at a small size: {gpu_matcher.difference() or 'alike'}\n\n{TITLE}\n{'|---' * 10}|")
    for size in SIZES:
        print(row(*size), flush=True)


if __name__ == "__main__":
    main()
