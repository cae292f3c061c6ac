"""What automatic subjects cost in still scenes, and gain in scenes with moving objects.

`python -m benchmarks.special automatic_subjects [--scenes ...] [--clips ...]`: for scenes PSNR against the
real lens at 32 px, in the whole picture, near depth jumps and around subjects, with automatic subjects off
and as the product decides (`addon/core/subjects/gate.py`); for real clips the decision alone. *tracks* is
the number of moving tracks that two sampled frames in a row both have, the best two of the clip.

Scenes in `MIRRORING` have true cameras, the others are solved.
"""

from __future__ import annotations

import argparse
import itertools
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from pathlib import Path

import bpy
import numpy as np

from addon.core.base.errors import UserError
from addon.core.frame.clip_context import ClipContext
from addon.core.media.clip import open_footage
from addon.core.sfm.process import SolveProcess
from addon.core.sfm.workspace import load_solve
from addon.core.subjects import gate
from addon.core.subjects.clip_subjects import ClipSubject, ClipSubjects
from sample_scenes import filming

from .. import store
from ..cost import cpu_seconds
from ..solving.real_clips import DATA
from . import metrics
from .cases import BenchmarkCase, FromVideo, GroundTruth
from .mask_metrics import outline_band
from .methods import METHODS
from .scenes import Staged

BLUR, VIEWS, NOISE = 32, 64, 0.02
MIRRORING = {"verge": (3, 14), "pond": (3, 14), "gloss": (12,), "surfaces": (12,)}
"""Scenes with a `build` of their own, and the frames that they are judged in."""
STILL = (*MIRRORING, "porch", "bars", "blocks", "walk", "slope", "foreground")
MOVING = ("fence", *filming.SUBJECTS)
HEADER = "| scene | tracks | moves | place | off | decided |\n|---|---|---|---|---|---|"


class Mirroring(Staged):
    """A scene of `MIRRORING`."""

    @cached_property
    def scene(self) -> bpy.types.Scene:
        scene = import_module(f"sample_scenes.{self.name}").build(self.stage)
        assert isinstance(scene, bpy.types.Scene)
        return scene

    @cached_property
    def folder(self) -> str:
        code = store.sources("sample_scenes/gloss.py", f"sample_scenes/{self.name}.py")
        return f"{super().folder}-{store.digest(code)}"

    def judged(self, blur: int) -> tuple[int, ...]:
        return MIRRORING[self.name]


@dataclass(frozen=True)
class Nothing(ClipSubjects):
    """No subject is found."""

    @property
    def people(self) -> list[ClipSubject]:  # type: ignore[override]
        return []

    @property
    def objects(self) -> list[ClipSubject]:  # type: ignore[override]
        return []


def cases(scene: Staged) -> Iterator[BenchmarkCase]:
    """The judged frames of a scene; the first one where cameras are solved."""
    if not isinstance(scene, Mirroring):
        yield FromVideo(scene).case(scene.judged(BLUR)[0], BLUR)
        return
    true = GroundTruth(scene)
    clip = ClipContext(true.reconstruction([int(n) for n in scene.cameras.frames]), true.whole.read)
    for frame in scene.judged(BLUR):
        yield replace(true.case(frame, BLUR), clip=clip)


def rows(scene: Staged) -> Iterator[str]:
    """The scene's lines of the table."""
    scores = dict[str, list[list[float]]]()
    for case in cases(scene):
        clip, truth = case.clip, scene.truth(case.frame, BLUR).picture
        off = replace(clip, known_subjects=Nothing(clip.reconstruction, clip.read))
        pictures = [METHODS["layers"].run(replace(case, clip=each), VIEWS).picture for each in (off, clip)]
        places = {"all": np.ones(truth.shape[:2], bool),
                  "edges": metrics.edge_band(1 / scene.depth(case.frame))}  # fmt: skip
        subject = scene.subject(case.frame)
        if subject is not None:
            places["subject"] = outline_band(subject)
        for name, where in places.items():
            scores.setdefault(name, []).append([metrics.psnr(each, truth, where) for each in pictures])
    tracks = moving_tracks(clip)
    decision = tracks >= gate.TRACKS
    for name, each in scores.items():
        off, on = np.mean(each, axis=0)
        yield f"| {scene.name} | {tracks} | {decision} | {name} | {off:.2f} | {on:.2f} |"


def moving_tracks(clip: ClipContext) -> int:
    """Count the moving tracks of the best two sampled frames in a row."""
    counts = [len(each.tracks) for each in gate.moving_tracks(clip.reconstruction, clip.read)]
    return max((min(pair) for pair in itertools.pairwise(counts)), default=0)


def clip_row(path: Path) -> str:
    """A real clip's line: solved, or why not."""
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder) / "work"
        try:
            SolveProcess(path, work).wait()
        except UserError as error:
            return f"| {path.stem} | refused: {error} | | |"
        reconstruction = load_solve(work).reconstruction
    start = cpu_seconds()
    tracks = moving_tracks(ClipContext(reconstruction, open_footage(path).read))
    return f"| {path.stem} | {tracks} | {tracks >= gate.TRACKS} | {cpu_seconds() - start:.1f} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="*", default=[*STILL, *MOVING])
    parser.add_argument("--clips", nargs="*", default=[], help="files in the folder of real footage")
    arguments = parser.parse_args()
    print(HEADER)
    for name in arguments.scenes:
        scene = (Mirroring if name in MIRRORING else Staged)(name, NOISE)
        for row in rows(scene):
            print(row, flush=True)
    print("\n| clip | tracks | moves | CPU s |\n|---|---|---|---|")
    for name in arguments.clips:
        print(clip_row(DATA / name), flush=True)
    print(store.provenance())


if __name__ == "__main__":
    main()
