"""Clips of a hand that shakes, whose rows are read in turn: `python -m benchmarks.special rolling`.

Cycles films a scene with its own rolling shutter. One frame is drawn through the lens on the clip's own path,
against Cycles' thin lens with the same shutter, and through the lens on a steadier path, against a thin lens
there that sees all rows at once; depth is found from the clip. Cameras are true, or solved from the video
alone; the readout is left out, as it is, or found.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np

from addon.core.camera.reconstruction import Reconstruction, rotation_matrix
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.frame_path import Drawn
from addon.core.frame.plan import FrameOptions
from addon.core.media.clip import open_footage
from addon.render.views.average import render_frame
from addon.render.views.quiet import quiet
from sample_scenes import truth
from sample_scenes.stage import Stage, tremor

from .. import store
from . import metrics
from .cases import FromVideo, GroundTruth
from .judge import save_picture
from .scenes import FILM_SAMPLES, Picture, Staged
from .steady import NOISE, VIEWS, true_picture

SCENES = ("walk", "blocks", "bars")
READOUT = 0.5
"""Of the time from a frame to the next: 20 milliseconds, as phones have."""
SHAKE = 1.5
"""Degrees by which the hand turns beside the path of the scene: up to 0.9 from a frame to the next."""
BLUR = 32


class Shaken(Staged):
    """A scene filmed by a hand that shakes, through a rolling shutter."""

    @cached_property
    def stage(self) -> Stage:
        stage = super().stage
        cameras = stage.cameras
        sway = np.radians(SHAKE) * tremor(len(cameras), np.random.default_rng(1))[:, 3:]
        turns = np.array([rotation_matrix(each) for each in sway])
        moved = replace(
            cameras, rotation=turns @ cameras.rotation,
            translation=np.einsum("nij,nj->ni", turns, cameras.translation),
        )  # fmt: skip
        return replace(stage, cameras=moved)

    @cached_property
    def key(self) -> str:
        return f"{super().key}-readout-{READOUT:g}"

    @cached_property
    def cameras(self) -> Reconstruction:
        return replace(super().cameras, readout=(0.0, READOUT))

    def _film(self, frame: int) -> Path:
        path = self._clip_folder / f"frame_{frame:04d}.png"
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            with quiet(1), truth.rolling_shutter(self.scene, READOUT):
                picture = truth.pinhole(self.scene, frame, FILM_SAMPLES, seed=frame)
            part = path.with_suffix(".part")
            part.write_bytes(cv2.imencode(".png", truth.recorded(picture, frame)[..., ::-1])[1].tobytes())
            part.rename(path)
        return path

    def rolled(self, frame: int, radius: float, focus: float) -> Picture:
        """(H, W, 3) the frame through a thin lens, its rows read as the clip's are."""

        def make() -> Picture:
            with quiet(1), truth.rolling_shutter(self.scene, READOUT):
                return truth.lens(self.scene, frame, radius, focus, NOISE, seed=1)

        return store.kept(self.folder, f"rolled-{store.digest(frame, radius, focus, READOUT)}", make)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="*", default=list(SCENES))
    parser.add_argument("--strength", type=float, default=0.5, help="of Stabilize")
    arguments = parser.parse_args()
    print("| scene | cameras | readout | used | crop | steady dB | own dB |\n|---|---|---|---|---|---|---|")
    for name in arguments.scenes:
        scene = Shaken(name, NOISE)
        given, found = GroundTruth(scene), FromVideo(scene)
        true = given.reconstruction([int(frame) for frame in scene.cameras.frames])
        frame, blur = scene.judged(BLUR)[0], BLUR
        lens = Focus(distance=scene.focus_depth(frame, blur)), scene.radius(blur)
        case = found.case(frame, blur)
        for cameras, reconstruction, (focus, radius) in (
            ("true", replace(true, readout=(0.0, 0.0)), lens),
            ("true", true, lens),
            ("solved", replace(found.reconstruction, readout=(0.0, 0.0)), (case.focus, case.radius)),
            ("solved", found.reconstruction, (case.focus, case.radius)),
        ):
            cells = row(scene, reconstruction, focus, radius, arguments.strength, cameras)
            print(f"| {name} | {cameras} | " + " | ".join(cells) + " |", flush=True)


def row(
    scene: Shaken, reconstruction: Reconstruction, focus: Focus, radius: float, strength: float, cameras: str
) -> list[str]:
    """Cells of a line of the table."""
    frame = scene.judged(BLUR)[0]
    clip = ClipContext(reconstruction, open_footage(scene.clip()).read)
    path = clip.steady_path(strength)
    options = FrameOptions(focus, radius, views=VIEWS, stabilize=strength)
    size = scene.stage.cameras.width, scene.stage.cameras.height
    drawn: list[Drawn] = []
    steady = render_frame(clip, frame, options, size, lambda note: None, drawn.append)[..., :3]
    own = render_frame(clip, frame, replace(options, stabilize=0.0), size, lambda note: None)[..., :3]
    rolled = scene.rolled(frame, scene.radius(BLUR), scene.focus_depth(frame, BLUR))
    readout = reconstruction.readout[1]
    kind = f"rolling-{cameras}-{readout:.2f}"
    save_picture(scene.name, f"{kind}-steady", BLUR, "found", VIEWS, steady)
    save_picture(scene.name, f"{kind}-own", BLUR, "found", VIEWS, own)
    save_picture(scene.name, "rolling-own", BLUR, "truth", 0, rolled)
    score = "-"
    if cameras == "true":
        there = drawn[0].warped.plan.lens
        wished = true_picture(scene, path, frame, radius, 1 / (there.focus - there.lift))
        save_picture(scene.name, f"{kind}-steady", BLUR, "truth", 0, wished)
        score = f"{metrics.psnr(steady, wished):.2f}"
    return [
        f"{readout:.3f}", f"{path.strength:.2f}", f"{100 * (1 - 1 / path.zoom):.1f} %", score,
        f"{metrics.psnr(own, rolled):.2f}",
    ]  # fmt: skip


if __name__ == "__main__":
    main()
