"""What the interface waits for: python -m benchmarks.special interface [BLEND ...]

Times of a preview's pictures by level, of frames that follow each other, with depth kept; of an import by its
number of points, and of a move of the eyedropper among them; and of one view on this machine's GPU, from the
difference between N and 2 N views. Of each the median and the least, because the machine's other work is in
it. Without a .blend that holds a solved clip, whose working folder keeps depth
(`headless.py solve CLIP --work DIR --depth`, then `save`), only points and views are timed.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path

import bpy
import cv2
import numpy as np

import addon
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext, no_picture
from addon.core.media.clip import open_footage
from addon.render.viewport.pictures import COARSE, FAIR, FINE, FIRST, ROUGH, Wanted, make_picture
from addon.render.views import gpu_views
from addon.scene.build import build
from addon.scene.lens.lens import frame_options
from addon.scene.sources.shot import shot_of
from addon.ui.picking.points_overlay import places_and_colours

from ..stability.runs import planned

COUNTS = (10_000, 100_000, 1_000_000)
FRAMES = 6
"""Of a clip, that are shown one after the other."""
MOVES = 200
SIZES = ((640, 360), (884, 1080), (1920, 1080), (3840, 2160))
FEATURES, VIEWS = 1500, 64
LEVELS = {
    ROUGH: "from the feature points", FIRST: "first look", COARSE: "coarse", FAIR: "draft", FINE: "best",
}  # fmt: skip


def timed(call: Callable[..., object], arguments: Iterable[tuple[object, ...]]) -> str:
    """Median and least time of calls with each of the arguments, in milliseconds."""
    seconds = []
    for each in arguments:
        began = time.perf_counter()
        call(*each)
        seconds.append(time.perf_counter() - began)
    return f"{1000 * float(np.median(seconds)):.0f} ({1000 * min(seconds):.0f})"


def preview_table(file: Path) -> None:
    """Print what a preview of a .blend takes, full size and at half of it."""
    bpy.ops.wm.open_mainfile(filepath=str(file.resolve()))
    scene = bpy.context.scene
    shot = shot_of(scene)
    lens = frame_options(scene.virtual_aperture, shot.reconstruction)
    first = shot.footage.frames[0]
    print(f"\n{file.name}: {shot.footage.width}x{shot.footage.height}, ms, median (least)\n")
    print("| preview | " + " | ".join(LEVELS.values()) + " |\n|---|" + len(LEVELS) * "---|")
    for smaller in (1, 2):
        size = -(-shot.footage.width // smaller), -(-shot.footage.height // smaller)
        wanted = [Wanted(shot, frame, lens, size) for frame in range(first, first + FRAMES)]
        # What the frames around tell is found once.
        timed(make_picture, ((each, FINE) for each in wanted))
        cells = [timed(make_picture, [(each, level) for each in wanted]) for level in LEVELS]
        print(f"| {size[0]}x{size[1]} | " + " | ".join(cells) + " |")


def cloud(count: int, width: int = 640, height: int = 360) -> Reconstruction:
    """Random points of a plane that recedes to the right from 5 to 12, which two cameras see."""
    camera = Intrinsics(width, height, 0.85 * width, 0.85 * width, width / 2, height / 2)
    rng = np.random.default_rng(0)
    xy = rng.uniform([0, 0], [camera.width, camera.height], (count, 2))
    depth = 5 + 7 * xy[:, 0] / width
    xyz = np.column_stack([(xy - camera.principal_point) / camera.focal, np.ones(count)]) * depth[:, None]
    numbers = np.arange(count, dtype=np.int32)
    images = []
    for frame in (1, 2):
        move = np.array([-0.05 * (frame - 1), 0, 0])
        images.append(Image(frame, np.eye(3), move, camera.project(xyz + move), numbers))
    points = Points(xyz, np.full((count, 3), 128, np.uint8), np.full(count, 0.1))
    return Reconstruction((camera,), tuple(images), points)


def points_table() -> None:
    """Print what a solve of so many points takes."""
    print("\n| points | into the scene, s | colours of the overlay, ms | a move of the eyedropper, ms |")
    print("|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        for frame in (1, 2):
            cv2.imwrite(str(Path(name) / f"clip_{frame:04d}.png"), np.full((360, 640, 3), 128, np.uint8))
        for count in COUNTS:
            bpy.ops.wm.read_homefile(app_template="", use_factory_startup=True)
            reconstruction = cloud(count)
            began = time.perf_counter()
            settings = build(bpy.context.scene, open_footage(Path(name)), reconstruction)
            built = time.perf_counter() - began
            colours = timed(places_and_colours, 3 * [(settings.points.data,)])
            finder = ClipContext(reconstruction, no_picture).places(1)
            places = np.random.default_rng(1).random((MOVES, 2))
            moves = timed(finder.glance, map(tuple, places))
            print(f"| {count:,} | {built:.2f} | {colours} | {moves} |")


def views_table() -> None:
    """Print what a frame takes (upload, views, sum, download) and what one more view takes."""
    if problem := gpu_views.gpu_problem():
        raise SystemExit(f"no GPU context: {problem}")
    import gpu

    print(f"\n{gpu.platform.renderer_get()}, {gpu.platform.backend_type_get()}, {FEATURES} points\n")
    print(f"| picture | {VIEWS} views, ms | one more, ms |\n|---|---|---|")
    # A largest disc of 0.02 of the width.
    radius = 0.02 / (2 * 0.85 * (1 / 5 - 1 / 8))
    for width, height in SIZES:
        picture = np.random.default_rng(1).random((height, width, 4), dtype=np.float32)
        reconstruction = cloud(FEATURES, width, height)
        seconds = []
        for count in (VIEWS, 2 * VIEWS):
            plan = planned(reconstruction, Focus(distance=8.0), radius=radius, views=count)
            runs = []
            for _ in range(3):
                began = time.perf_counter()
                gpu_views.mean_of_views(plan, picture)
                runs.append(time.perf_counter() - began)
            seconds.append(min(runs))
        more = (seconds[1] - seconds[0]) / VIEWS
        print(f"| {width}x{height} | {1e3 * seconds[0]:.1f} | {1e3 * more:.3f} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("blends", nargs="*", type=Path, metavar="BLEND")
    options = parser.parse_args()
    addon.register()
    for file in options.blends:
        preview_table(file)
    points_table()
    views_table()


if __name__ == "__main__":
    main()
