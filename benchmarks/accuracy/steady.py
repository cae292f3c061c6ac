"""Clips carried by hand, drawn from a steadier path: `python -m benchmarks.special steady`.

A frame through the lens of the steadier camera, by the true cameras and by depth that is true or found from
the clip, against Cycles' thin lens on the same path; beside it the same frame through the lens on the
clip's own path, against Cycles' there. The path is told by how far accelerations of its positions and turns
fall, and by how much the picture is cropped.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from addon.core.camera.reconstruction import Reconstruction
from addon.core.camera.steady_path import SteadyPath
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.frame_path import Drawn
from addon.core.frame.plan import FrameOptions
from addon.core.media.clip import open_footage
from addon.render.views.average import render_frame
from addon.render.views.quiet import quiet
from sample_scenes import staging, truth

from .. import store
from . import metrics
from .cases import GroundTruth, TrueDepth
from .judge import save_picture
from .scenes import Floats, Picture, Staged

SCENES = ("walk", "blocks", "bars")
BLURS = (16, 32)
STRENGTHS = (0.3, 1.0)
VIEWS = 64
NOISE = 0.02


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="*", default=list(SCENES))
    parser.add_argument("--blurs", nargs="*", type=int, default=list(BLURS))
    parser.add_argument("--strengths", nargs="*", type=float, default=list(STRENGTHS))
    parser.add_argument("--fill", action="store_true", help="fill the border instead of cropping it")
    arguments = parser.parse_args()
    columns = (
        "scene | wished | used | crop | positions | turns | parallax px | blur | depth | steady dB | own dB"
        " | past the border | dB there"
    )
    print(f"| {columns} |\n" + "|---" * 13 + "|")
    for name in arguments.scenes:
        bench = Bench(Staged(name, NOISE))
        for strength in arguments.strengths:
            for blur in arguments.blurs:
                bench.say(strength, blur, arguments.fill)


def true_picture(scene: Staged, path: SteadyPath, frame: int, radius: float, focus: float) -> Picture:
    """(H, W, 3) a frame of a scene through the thin lens of a steadier camera, by Cycles."""
    cameras = scene.stage.cameras
    translations = -np.einsum("nij,nj->ni", path.rotations, path.centres)
    moved = replace(
        cameras, rotation=path.rotations, translation=translations, focal=cameras.focal * path.zoom
    )

    def make() -> Picture:
        with quiet(1):
            built = staging.build(replace(scene.stage, cameras=moved))
            return truth.lens(built, frame, radius, focus, NOISE, seed=1)

    return store.kept(scene.folder, f"steady-{store.digest(moved, frame, radius, focus, NOISE)}", make)


class Bench:
    """A scene, with features in all of its frames."""

    def __init__(self, scene: Staged) -> None:
        self.scene = scene
        given = GroundTruth(scene)
        self.reconstruction = given.reconstruction([int(frame) for frame in scene.cameras.frames])
        read = open_footage(scene.clip()).read
        self.clips = {
            "true": ClipContext(self.reconstruction, read, TrueDepth(scene)),
            "found": ClipContext(self.reconstruction, read),
        }

    def say(self, strength: float, blur: int, fills: bool) -> None:
        """Print the lines of a strength and a blur: one a depth."""
        frame, scene = self.scene.judged(blur)[0], self.scene
        for depth, clip in self.clips.items():
            path = clip.steady_path(strength, fills)
            lens = FrameOptions(
                Focus(distance=scene.focus_depth(frame, blur)),
                scene.radius(blur),
                views=VIEWS,
                stabilize=strength,
                fill_border=fills,
            )
            drawn: list[Drawn] = []
            size = scene.stage.cameras.width, scene.stage.cameras.height
            steady = render_frame(clip, frame, lens, size, lambda note: None, drawn.append)[..., :3]
            own = render_frame(clip, frame, replace(lens, stabilize=0.0), size, lambda note: None)[..., :3]
            there = drawn[0].warped.plan.lens
            wished = true_picture(scene, path, frame, lens.radius, 1 / (there.focus - there.lift))
            save_picture(scene.name, f"steady-{strength:g}", blur, depth, VIEWS, steady)
            save_picture(scene.name, f"steady-{strength:g}", blur, "truth", 0, wished)
            scores = metrics.psnr(steady, wished), metrics.psnr(own, scene.truth(frame, blur).picture)
            past = past_border(path, self.reconstruction, frame, scene.depth(frame))
            save_picture(scene.name, f"steady-{strength:g}-past", blur, depth, 0, np.dstack([past] * 3))
            cells = [
                scene.name, f"{strength:g}", f"{path.strength:.2f}", f"{100 * (1 - 1 / path.zoom):.1f} %",
                *(f"{share:.3f}" for share in jerks(path, self.reconstruction)),
                f"{parallax(path, self.reconstruction, frame, scene.depth(frame)):.1f}",
                str(blur), depth, *(f"{score:.2f}" for score in scores),
                f"{100 * past.mean():.1f} %",
                f"{metrics.psnr(steady, wished, past):.2f}" if past.any() else "-",
            ]  # fmt: skip
            print("| " + " | ".join(cells) + " |", flush=True)


def jerks(path: SteadyPath, reconstruction: Reconstruction) -> tuple[float, float]:
    """Root mean square accelerations of a path's positions, and of its viewing directions, over those of the
    clip's own."""
    images = [reconstruction.image_at(int(frame))[0] for frame in path.frames]
    own = np.array([image.centre for image in images]), np.array([image.rotation[2] for image in images])

    def size(values: Floats) -> float:
        return float(np.sqrt(np.mean(np.sum(np.diff(values, 2, axis=0) ** 2, axis=1))))

    return size(path.centres) / size(own[0]), size(path.rotations[:, 2]) / size(own[1])


def past_border(path: SteadyPath, reconstruction: Reconstruction, frame: int, depth: Floats) -> metrics.Mask:
    """(H, W) where the steadier camera sees past the border of a frame, at the median of its depths."""
    image, _ = reconstruction.image_at(frame)
    camera = reconstruction.intrinsics(image)
    rotation, move = path.seen_from(image)
    grid = np.stack(np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5), axis=-1)
    rays = (grid - camera.principal_point) / (camera.focal * path.zoom)
    ahead = np.concatenate([rays, np.ones_like(rays[..., :1])], axis=-1) - move * np.median(1 / depth)
    seen = camera.project(ahead @ rotation)
    return np.asarray(np.any((seen < 0) | (seen > [camera.width, camera.height]), axis=-1))


def parallax(path: SteadyPath, reconstruction: Reconstruction, frame: int, depth: Floats) -> float:
    """Pixels by which a frame's nearest and farthest things are seen apart from where the clip has them."""
    image, _ = reconstruction.image_at(frame)
    _, move = path.seen_from(image)
    spread = float(np.ptp(1 / depth))
    return float(np.linalg.norm(move[:2]) * reconstruction.intrinsics(image).fx * spread)


if __name__ == "__main__":
    main()
