"""CG objects in the clip, against Cycles drawing clip and objects through the lens together.

    python -m benchmarks.special cg [--scenes bars walk] [--width 640] [--blur 32]
        [--gloss] [--motion-blur]

The clip is a sample scene without the object, its depth is true (T1), and the object comes from the scene
that the product builds of it. PSNR after sRGB: of the object's surroundings, which are within the reach of
blur of where it is; of its silhouettes, and of the clip's own. Costs are CPU seconds, of Cycles with as many
samples for the object alone and for the whole through its own lens.

With `--gloss` the object has no lacquer, and lacquers of several roughnesses that mirror a lamp: a ball, and
a board, which mirrors the lamp at its own distance. With `--motion-blur` clip, object and truth are
filmed with a shutter, an object that stands, and one that goes across the picture; it is drawn with motion
blur and without.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import bpy
import cv2
import numpy as np
from numpy.typing import NDArray

import addon
from addon.core.focus.focus import Focus
from addon.core.frame.cg_layers import DrawCG
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.plan import FrameOptions
from addon.core.media.clip import open_footage
from addon.core.media.picture_file import Pixels
from addon.render.cg.cg_process import OVERSCAN, draw_cg, kept
from addon.render.cg.cycles_layers import CyclesScene, Wanted
from addon.render.views.average import render_frame
from addon.render.views.gpu_views import start_gpu
from addon.render.views.quiet import quiet

from . import metrics
from .cases import TrueDepth
from .cg_scenes import PLACES, SAMPLES, Sized, Thing, product_scene
from .scenes import Picture

Mask = NDArray[np.bool_]

BAND = 4
"""Pixels to either side of the object's outline that count as its silhouettes."""
ROUGHNESS = "0.2", "0.05"
"""Of lacquer: as of satin, and nearly a mirror."""
SHUTTER = 0.5
"""Frames: 180 degrees, as film cameras have it."""
LONG_SHUTTER = 4.0
"""For what stands: the scenes' cameras are slow, a frame moves it by 1 to 2 pixels."""


def bands(plain: Sized, both: Sized, frame: int, blur: int) -> dict[str, Mask]:
    """(H, W) what is judged, by name."""
    is_object = (both.geometry(frame).thing == len(both.stage.things) - 1).astype(np.uint8)
    near = cv2.dilate(is_object, np.ones((2 * blur + 1, 2 * blur + 1), np.uint8)) > 0
    line = np.ones((2 * BAND + 1, 2 * BAND + 1), np.uint8)
    rim = cv2.dilate(is_object, line) != cv2.erode(is_object, line)
    own = metrics.edge_band(1 / plain.depth(frame))
    return {
        "surroundings": near, "the object": cv2.erode(is_object, line) > 0, "its silhouettes": rim,
        "the clip's own": own & ~near, "rest": ~near,
    }  # fmt: skip


def costs(
    clip: Callable[[DrawCG | None], object], scene: bpy.types.Scene, both: Sized, frame: int, focus: float
) -> dict[str, float]:
    """CPU seconds of a frame by part; `clip` draws it with what draws the object."""
    seconds = {}

    def clock(name: str, work: Callable[[], object]) -> None:
        began = time.process_time()
        work()
        seconds[name] = time.process_time() - began

    clock("the clip", lambda: clip(None))
    camera = both.cameras.intrinsics(both.cameras.image_at(frame)[0])
    margin = int(np.ceil(OVERSCAN * camera.width))
    asked = Wanted(scene.view_layers[0].name, frame, camera, margin, np.zeros((0, 0), np.float32))
    with tempfile.TemporaryDirectory() as folder, quiet(1):
        cycles = CyclesScene(scene, Path(folder), is_preview=False)
        cycles.draw(asked)
        clock("its object by Cycles", lambda: cycles.draw(asked))
    whole = both.scene
    data, whole.cycles.samples = whole.camera.data, SAMPLES
    data.dof.use_dof, data.dof.focus_distance = True, focus
    data.dof.aperture_fstop = data.lens / 1000 / (2 * both.lens_radius)
    bpy.context.window.scene = whole
    whole.frame_set(frame)
    with quiet(1):
        bpy.ops.render.render(scene=whole.name)
        clock(f"all by Cycles with {SAMPLES} samples", lambda: bpy.ops.render.render(scene=whole.name))
    return seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=list(PLACES), choices=PLACES)
    parser.add_argument("--width", type=int, default=640)
    parser.add_argument("--blur", type=int, default=32)
    parser.add_argument("--gloss", action="store_true", help="objects with and without lacquer alone")
    parser.add_argument("--motion-blur", action="store_true", help="filmed with a shutter alone")
    parser.add_argument("--save", default="", help="folder for the pictures")
    options = parser.parse_args()
    addon.register()
    things = {"a ball": Thing()}
    if options.gloss:
        things = {
            f"{shape}, {words}{surface}": Thing(surface, is_board)
            for shape, is_board in (("a ball", False), ("a board", True))
            for words, surface in (("that ", "shines"), *(("roughness ", each) for each in ROUGHNESS))
        }
    elif options.motion_blur:
        things = {
            "a ball that stands": Thing(shutter=LONG_SHUTTER),
            "a ball that moves": Thing(moves=True, shutter=SHUTTER),
        }
    for name in options.scenes:
        for words, thing in things.items():
            print(f"{name}, {words}, {options.width} px wide, blur {options.blur} px", flush=True)
            judge(name, thing, options.width, options.blur, options.save)


def judge(name: str, thing: Thing, width: int, blur: int, save: str = "") -> None:
    """Print a scene's scores."""
    plain, both = Sized(name, width, None, thing.shutter), Sized(name, width, thing, thing.shutter)
    frame = plain.judged(blur)[1]
    radius, focus = plain.radius(blur), plain.focus_depth(frame, blur)
    # The object must not change the lens.
    both.lens_radius = radius
    truth, own_truth = both.truth(frame, blur).picture, plain.truth(frame, blur).picture
    masks = bands(plain, both, frame, blur)
    footage = open_footage(plain.clip())
    blurred = plain.blurred_frame(frame) if thing.shutter else None

    def read(number: int) -> Pixels:
        return footage.read(number) if blurred is None or number != frame else blurred

    context = ClipContext(plain.cameras, read, TrueDepth(plain))
    size = plain.stage.cameras.width, plain.stage.cameras.height
    lens = FrameOptions(Focus(distance=focus), radius)
    start_gpu()
    scene = product_scene(plain, thing)
    scene.frame_set(frame)

    def drawn(draw: DrawCG | None) -> Picture:
        return render_frame(context, frame, lens, size, lambda _: None, None, draw)[..., :3]

    def with_object() -> Picture:
        with kept():
            return drawn(draw_cg(scene, scene.view_layers[0].name))

    alone, picture = drawn(None), with_object()
    for part, mask in masks.items():
        with_it, without = metrics.psnr(picture, truth, mask), metrics.psnr(alone, own_truth, mask)
        print(f"  {part}: {with_it:.2f} dB; the clip alone there {without:.2f} dB")
    if thing.shutter:
        scene.render.use_motion_blur = False
        score = metrics.psnr(with_object(), truth, masks["surroundings"])
        print(f"  surroundings without its motion blur: {score:.2f} dB")
    elif thing == Thing():
        for part, seconds in costs(drawn, scene, both, frame, focus).items():
            print(f"  {part}: {seconds:.1f} CPU s")
    if save:
        stem = f"{save}/{name}-{thing.surface}{'-board' * thing.is_board}{'-moves' * thing.moves}"
        for key, shown in (("truth", truth), ("ours", picture)):
            cv2.imwrite(f"{stem}-{key}.png", 255 * np.clip(shown[..., ::-1], 0, 1) ** (1 / 2.2))


if __name__ == "__main__":
    main()
