"""How soon a first picture is seen: parts of `python -m benchmarks.timings.speed`.

Of the bars scene with its true cameras, medians of several tries each on its own: the command line's, which
is final, from its start to the written file; and in a window that is open already, what the preview and F12
show before a frame's depth is known, the fine picture after it, and with the depth kept.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

import numpy as np

import addon
from addon.core.focus.focus import Focus
from addon.core.frame.plan import FrameOptions
from addon.core.media.clip import open_footage
from addon.render.viewport.pictures import FINE, FIRST, ROUGH, Wanted, make_picture
from addon.render.views.gpu_views import check_gpu
from addon.scene.sources.shot import Shot

from .frame_costs import enlarged
from .whole_runs import FIRST as FRAME
from .whole_runs import Clip, filmed

TRIES = 5
SCENE = "bars"
STEPS = {ROUGH: "from the feature points", FIRST: "first look", FINE: "final quality"}


def table(size: tuple[int, int]) -> str:
    """Markdown of a size (width, height)."""
    rows = ["| picture | wall, s | CPU s |", "|---|---|---|"]
    with filmed(SCENE, size) as clip:
        for name, is_kept in (("cold", False), ("depth kept", True)):
            found = [_command(clip, is_kept) for _ in range(TRIES)]
            rows.append(_row(f"command line, {name}", found))
        addon.register()
        try:
            check_gpu()
            for level, name in STEPS.items():
                found = [_seconds(partial(make_picture, _wanted(clip), level)) for _ in range(TRIES)]
                rows.append(_row(f"window, cold, {name}", found))
            wanted = _wanted(clip)
            make_picture(wanted, FINE)
            found = [_seconds(lambda: make_picture(wanted, FINE)) for _ in range(TRIES)]
            rows.append(_row("window, depth known, final quality", found))
        finally:
            addon.unregister()
    return "\n".join([*rows, ""])


def _command(clip: Clip, is_kept: bool) -> tuple[float, float]:
    if not is_kept:
        clip.forget()
    run = clip.run(clip.lens(focus=0.9 if is_kept else 1.0), 1)
    return run.wall_s, run.cpu_s


def _wanted(clip: Clip) -> Wanted:
    """A frame of a clip of which nothing is known but its solve."""
    _, radius, _, distance = clip.lens()
    options = FrameOptions(Focus(distance=float(str(distance))), radius=float(str(radius)))
    footage = open_footage(enlarged(clip.scene, clip.size).path)
    return Wanted(Shot(footage, clip.reconstruction), FRAME, options, clip.size)


def _seconds(call: Callable[[], object]) -> tuple[float, float]:
    wall, cpu = time.perf_counter(), time.process_time()
    call()
    return time.perf_counter() - wall, time.process_time() - cpu


def _row(name: str, found: list[tuple[float, float]]) -> str:
    wall, cpu = np.median(found, axis=0)
    return f"| {name} | {wall:.2f} | {cpu:.2f} |"
