"""Clips whose camera stays in its place, with depth maps: `python -m benchmarks.special turning`.

From the video and the maps alone, as the product solves and draws them, against the real lens; beside it
Blender's Defocus with the same maps. They are exact, or as a network has them (`network_depth`). Scored are
the whole picture, a band around depth jumps, and one around who walks, behind whom other frames have seen.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np

from addon.core.depth.user_depth import UserDepth
from addon.core.depth.user_maps import open_depth
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext
from addon.core.media.clip import open_footage
from addon.core.media.light import to_linear
from addon.core.sfm.process import SolveProcess
from addon.core.sfm.workspace import load_solve

from . import metrics
from .cases import BenchmarkCase, FromVideo
from .judge import save_picture
from .mask_metrics import outline_band
from .methods import METHODS
from .network_depth import as_seen
from .scenes import Floats, Picture, Staged

SCENES = ("tripod", "pan")
"""Not of `filming.STAGES`, since the video alone is refused."""
BLURS = (16, 32)
VIEWS = 64
NOISE = 0.02
FARTHEST = 1000.0
"""Metres that an exact map has where there is only air."""
MAPS = ("exact", "network")
DRAWN = {"ours": "layers", "Defocus": "Defocus", "no blur": "no blur"}


class FromMaps(FromVideo):
    """Turns of the camera from the video, distances from maps: what is `FromVideo` of a camera that stays."""

    def __init__(self, scene: Staged, kind: str, folder: Path) -> None:
        """`kind` is one of `MAPS`; the folder, which is empty, takes maps and solve."""
        self.scene = scene
        footage, maps, work = scene.clip(), folder / "maps", folder / "solve"
        write_maps(scene, kind, maps)
        SolveProcess(footage, work, depth_maps=maps).wait()
        solve = load_solve(work)
        self.reconstruction, self.report = solve.reconstruction, solve.report
        clip = open_footage(footage)
        given = UserDepth.of(open_depth(maps, clip), self.reconstruction)
        self.clip = ClipContext(self.reconstruction, clip.read, maps=given)

    def case(self, frame: int, blur: int) -> BenchmarkCase:
        """What is `FromVideo.case`, the depth being that of the maps as the product draws with it."""
        picture = to_linear(self.scene.frame(frame))
        with np.errstate(divide="ignore"):
            depth = 1 / self._inverse(frame)
        lens = self._focus(frame, blur), self._radius(blur)
        return BenchmarkCase(frame, picture, self.clip, *lens, depth, lambda margin: None)

    def _focus(self, frame: int, blur: int) -> Focus:
        """Picked in the frame, where the subject is seen, at the depth that the maps have there."""
        column, row = self.scene.focus_xy(frame, blur).astype(int)
        return Focus(distance=float(1 / self._inverse(frame)[row, column]))

    def _inverse(self, frame: int) -> Floats:
        picture = to_linear(self.scene.frame(frame))
        return self.clip.depth(frame, self.clip.canvas(frame), picture).inverse_depth


def write_maps(scene: Staged, kind: str, folder: Path) -> None:
    """A map of every frame: depth in metres, or inverse depth as a network has it."""
    folder.mkdir()
    for frame in (int(each) for each in scene.cameras.frames):
        depth = scene.depth(frame)
        seen = np.minimum(depth, FARTHEST) if kind == "exact" else as_seen(1 / depth, frame)
        np.savez(folder / f"depth_{frame:04d}.npz", depth=seen.astype(np.float32))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="*", default=list(SCENES), choices=SCENES)
    parser.add_argument("--frames", type=int, default=1, help="of those judged")
    arguments = parser.parse_args()
    print("| scene | maps | blur | " + " | ".join(f"{name}: whole | edges | walker" for name in DRAWN) + " |")
    print("|---" * (3 + 3 * len(DRAWN)) + "|")
    for name in arguments.scenes:
        for kind in MAPS:
            with tempfile.TemporaryDirectory() as folder:
                given = FromMaps(Staged(name, NOISE), kind, Path(folder))
                for blur in BLURS:
                    print(row(given, kind, blur, arguments.frames), flush=True)


def row(given: FromMaps, kind: str, blur: int, count: int) -> str:
    """A line of the table: means over the judged frames."""
    scene, scores = given.scene, []
    for frame in scene.judged(blur)[:count]:
        case, truth = given.case(frame, blur), scene.truth(frame, blur).picture
        for name, method in DRAWN.items():
            picture = METHODS[method].run(case, VIEWS).picture
            save_picture(scene.name, kind, blur, name, VIEWS, picture)
            scores.append(scored(given, frame, picture, truth))
        save_picture(scene.name, kind, blur, "truth", 0, truth)
    means = np.mean(np.reshape(scores, (-1, 3 * len(DRAWN))), axis=0)
    return f"| {scene.name} | {kind} | {blur} | " + " | ".join(f"{x:.2f}" for x in means) + " |"


def scored(given: FromMaps, frame: int, picture: Picture, truth: Picture) -> tuple[float, ...]:
    """PSNR in dB of the whole picture, around depth jumps, and around who walks."""
    subject = given.scene.subject(frame)
    assert subject is not None
    edges, walker = metrics.edge_band(1 / given.scene.depth(frame)), outline_band(subject)
    return tuple(metrics.psnr(picture, truth, where) for where in (None, edges, walker))


if __name__ == "__main__":
    main()
