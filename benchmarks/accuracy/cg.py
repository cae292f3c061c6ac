"""CG objects in the clip, against Cycles drawing clip and objects through the lens together.

    python -m benchmarks.accuracy.cg [--scenes bars walk] [--width 640] [--blur 32]

The clip is a sample scene without the object, its depth is true (T1), and the object comes from the scene
that the product builds of it. PSNR after sRGB: of the object's surroundings, which are within the reach of
blur of where it is; of its silhouettes, and of the clip's own. Costs are CPU seconds, of Cycles with as many
samples for the object alone and for the whole through its own lens.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import bpy
import cv2
import numpy as np
from numpy.typing import NDArray

import addon
from addon.core.camera.reconstruction import Points, Reconstruction
from addon.core.focus.focus import Focus
from addon.core.frame.cg_layers import DrawCG
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.plan import FrameOptions
from addon.core.media.clip import open_footage
from addon.render.average import render_frame
from addon.render.cg_process import OVERSCAN, draw_cg, kept
from addon.render.cycles_layers import CyclesScene, Wanted
from addon.render.gpu_views import start_gpu
from addon.render.quiet import quiet
from addon.scene.build import build
from sample_scenes import filming, staging, textures
from sample_scenes.shapes import sphere
from sample_scenes.stage import Prop, Stage

from . import metrics
from .cases import TrueDepth
from .scenes import Picture, Staged

Mask = NDArray[np.bool_]

OBJECTS = {
    # Half behind the vase, before the street.
    "bars": ((0.36, 5.0, 1.2), 0.36),
    # Half behind the chair's back, before desks and wall.
    "walk": ((0.55, 4.6, 0.5), 0.3),
}
"""Middle and radius of the ball in the world, by scene: between what is in focus and what is behind it."""
GLOW = 0.7
"""Radiance of the ball's white: it shines, so that what hides the sky from it has no part."""
BAND = 4
"""Pixels to either side of the ball's outline that count as its silhouettes."""
SAMPLES = 64


def ball(scene: str) -> Prop:
    """The object: a ball that shines, its print as fine as the clip's."""
    middle, radius = OBJECTS[scene]
    shape = sphere(radius, 48).moved(*middle)
    print_ = textures.speckled(np.random.default_rng(5), (512, 512), (0.5, 0.1, 0.05), (0.9, 0.6, 0.3))
    return Prop("ball", shape, print_, smooth=True, glow=GLOW, layer=9)


class Sized(Staged):
    """A staged scene at another size, and with more things in it."""

    def __init__(self, name: str, width: int, *more: Prop) -> None:
        super().__init__(name, 0.02)
        self._width, self._more = width, more
        self.lens_radius = 0.0
        """That of another scene, where it is not 0."""

    def radius(self, blur: int) -> float:
        return self.lens_radius or super().radius(blur)

    @cached_property
    def stage(self) -> Stage:
        plain = filming.load(self.name)
        height = self._width * plain.cameras.height // plain.cameras.width
        cameras = plain.cameras.resized(self._width, height)
        return replace(plain, cameras=cameras, things=(*plain.things, *self._more))

    @cached_property
    def scene(self) -> bpy.types.Scene:
        scene = super().scene
        if self._more:
            _unshadowed(scene, len(self.stage.things))
        return scene


def _unshadowed(scene: bpy.types.Scene, number: int) -> None:
    """Have a thing of a scene, counted from 1, throw no shadow: what it does to light is judged by itself."""
    for thing in scene.objects:
        if thing.pass_index == number:
            thing.visible_shadow = False


def with_points(plain: Sized, frame: int) -> Reconstruction:
    """The true cameras, and points where every eighth pixel of a frame has its surface."""
    cameras, depth = plain.cameras, plain.depth(frame)[4::8, 4::8]
    image, _ = cameras.image_at(frame)
    lens = cameras.intrinsics(image)
    row, column = np.nonzero(np.isfinite(depth))
    place = 8.0 * np.stack([column, row], axis=1) + 4.5
    rays = np.column_stack([(place - lens.principal_point) / lens.focal, np.ones(len(row))])
    world = (rays * depth[row, column, None] - image.translation) @ image.rotation
    points = Points(world, np.full((len(row), 3), 128, np.uint8), np.full(len(row), 0.1))
    return replace(cameras, points=points)


def product_scene(plain: Sized, thing: Prop) -> bpy.types.Scene:
    """The clip as the product builds it, with the object in the light that the clip was shot in."""
    scene = staging.build(replace(plain.stage, things=(thing,)), SAMPLES)
    _unshadowed(scene, 1)
    build(scene, open_footage(plain.clip()), with_points(plain, plain.judged(0)[1]))
    return scene


def bands(plain: Sized, both: Sized, frame: int, blur: int) -> dict[str, Mask]:
    """(H, W) what is judged, by name."""
    is_ball = both.geometry(frame).thing == len(both.stage.things) - 1
    around = np.ones((2 * blur + 1, 2 * blur + 1), np.uint8)
    near = cv2.dilate(is_ball.astype(np.uint8), around) > 0
    line = np.ones((2 * BAND + 1, 2 * BAND + 1), np.uint8)
    rim = cv2.dilate(is_ball.astype(np.uint8), line) != cv2.erode(is_ball.astype(np.uint8), line)
    own = metrics.edge_band(1 / plain.depth(frame))
    return {"surroundings": near, "its silhouettes": rim, "the clip's own": own & ~near, "rest": ~near}


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
    parser.add_argument("--scenes", nargs="+", default=list(OBJECTS), choices=OBJECTS)
    parser.add_argument("--width", type=int, default=640)
    parser.add_argument("--blur", type=int, default=32)
    parser.add_argument("--save", default="", help="folder for the pictures")
    options = parser.parse_args()
    addon.register()
    for name in options.scenes:
        judge(name, options.width, options.blur, options.save)


def judge(name: str, width: int, blur: int, save: str = "") -> None:
    """Print a scene's scores."""
    thing = ball(name)
    plain, both = Sized(name, width), Sized(name, width, thing)
    frame = plain.judged(blur)[1]
    radius, focus = plain.radius(blur), plain.focus_depth(frame, blur)
    # The object must not change the lens.
    both.lens_radius = radius
    truth, own_truth = both.truth(frame, blur).picture, plain.truth(frame, blur).picture
    masks = bands(plain, both, frame, blur)
    footage = open_footage(plain.clip())
    context = ClipContext(plain.cameras, footage.read, TrueDepth(plain))
    size = plain.stage.cameras.width, plain.stage.cameras.height
    lens = FrameOptions(Focus(distance=focus), radius)
    start_gpu(size)
    scene = product_scene(plain, thing)
    scene.frame_set(frame)

    def drawn(draw: DrawCG | None) -> Picture:
        return render_frame(context, frame, lens, size, lambda _: None, None, draw)[..., :3]

    alone = drawn(None)
    with kept():
        picture = drawn(draw_cg(scene, scene.view_layers[0].name))
    print(f"{name}, {size[0]}x{size[1]}, blur {blur} px")
    for part, mask in masks.items():
        with_it, without = metrics.psnr(picture, truth, mask), metrics.psnr(alone, own_truth, mask)
        print(f"  {part}: {with_it:.2f} dB; the clip alone there {without:.2f} dB")
    for part, seconds in costs(drawn, scene, both, frame, focus).items():
        print(f"  {part}: {seconds:.1f} CPU s")
    if save:
        for key, shown in (("truth", truth), ("ours", picture)):
            cv2.imwrite(f"{save}/{name}-{key}.png", 255 * np.clip(shown[..., ::-1], 0, 1) ** (1 / 2.2))


if __name__ == "__main__":
    main()
