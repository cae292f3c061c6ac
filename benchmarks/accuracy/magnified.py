"""Clips that have depth of field already: `python -m benchmarks.accuracy.magnified`.

A clip filmed by Cycles through a lens of some stops less than the wished one, both focused on the subject;
from the video alone, against the real lens that was wished. Beside it the same clip filmed through a pinhole,
and the one through the lens drawn as if it were that.
"""

from __future__ import annotations

import argparse
from functools import cached_property
from pathlib import Path

import cv2

from addon.render.quiet import quiet
from sample_scenes import truth

from . import metrics
from .cases import FromVideo
from .judge import save_picture
from .methods import METHODS
from .scenes import Staged

SCENES = ("walk", "blocks")
STOPS = (4.0, 2.0)
"""By which the clip's aperture is smaller than the wished one: f/8 and f/4 for f/2."""
BLUR = 32
VIEWS = 64
NOISE = 0.02
FILMED = 0.1
"""Error of a pixel to which Cycles samples a clip filmed through a lens."""


class ThroughALens(Staged):
    """A scene whose clip is filmed through a lens of fewer stops than is wished."""

    def __init__(self, name: str, noise: float, stops: float) -> None:
        super().__init__(name, noise)
        self.stops = stops

    @cached_property
    def own_radius(self) -> float:
        """Of the aperture that the clip is filmed through, in metres."""
        return float(self.radius(BLUR) / 2 ** (self.stops / 2))

    @cached_property
    def key(self) -> str:
        return f"{Staged(self.name, self.noise).key}-{self.stops:g}-stops-{BLUR}px"

    def _film(self, frame: int) -> Path:
        path = self._clip_folder / f"frame_{frame:04d}.png"
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            focus = self.focus_depth(frame, BLUR)
            with quiet(1):
                picture = truth.lens(self.scene, frame, self.own_radius, focus, FILMED, frame)
            part = path.with_suffix(".part")
            part.write_bytes(cv2.imencode(".png", truth.recorded(picture, frame)[..., ::-1])[1].tobytes())
            part.rename(path)
        return path


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="*", default=list(SCENES))
    parser.add_argument("--stops", nargs="*", type=float, default=list(STOPS))
    parser.add_argument("--frames", type=int, default=1, help="of those judged")
    arguments = parser.parse_args()
    print("| scene | clip | whole | edges | in focus |\n|---|---|---|---|---|")
    for name in arguments.scenes:
        print(row(FromVideo(Staged(name, NOISE)), "pinhole", arguments.frames), flush=True)
        for stops in arguments.stops:
            given = FromVideo(ThroughALens(name, NOISE, stops))
            print(row(given, f"{stops:g} stops less", arguments.frames), flush=True)
            if given.clip.own_lens is not None:
                given.clip.__dict__["own_lens"] = None
                print(row(given, f"{stops:g} stops less as if sharp", arguments.frames), flush=True)


def row(given: FromVideo, kind: str, count: int) -> str:
    """A line of the table: means over the judged frames."""
    scene, scores = given.scene, []
    assert isinstance(scene, Staged)
    for frame in scene.judged(BLUR)[:count]:
        case, wished = given.case(frame, BLUR), scene.truth(frame, BLUR).picture
        picture = METHODS["layers"].run(case, VIEWS).picture
        save_picture(scene.name, f"magnified-{kind.replace(' ', '-')}", BLUR, "layers", VIEWS, picture)
        inverse, scale = 1 / scene.depth(frame), 2 * scene.radius(BLUR) * scene.stage.cameras.focal
        disc = scale * (inverse - 1 / scene.focus_depth(frame, BLUR))
        where = None, metrics.edge_band(inverse), metrics.in_focus(disc)
        scores.append([metrics.psnr(picture, wished, each) for each in where])
    means = [sum(column) / len(column) for column in zip(*scores, strict=True)]
    return f"| {scene.name} | {kind} | " + " | ".join(f"{x:.2f}" for x in means) + " |"


if __name__ == "__main__":
    main()
