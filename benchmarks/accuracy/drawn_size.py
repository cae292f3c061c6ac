"""Frames drawn small against the same at their own size: `python -m benchmarks.special drawn_size`.

The middle frame of real clips (real data), at the distance where it is clicked, and of the bench's scenes at
1920x1080, with their true depth and without other frames' colours. Depth is found once. Scores are PSNR in
dB against the frame drawn at its own size: of the whole picture, and of its worst tile of an eighth of the
width. The cost is CPU seconds of mesh and views, as a share of the own size's.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import cv2
import numpy as np

from addon.core.base.arrays import LinearRGBA
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.highlights import RESTORED
from addon.core.frame.plan import FrameOptions
from addon.core.frame.quality import NORMAL
from addon.core.frame.warped_frame import frame_geometry, sampled_disc
from addon.core.media.light import encode_srgb
from addon.core.sfm.workspace import load_solve
from addon.render.views.average import render_frame

from .. import store
from ..cost import measured
from ..gallery import clips
from ..gallery.clips import RealClip
from ..gallery.commands import HEADLESS
from ..gallery.stages import Program, Steps
from . import metrics
from .cases import GroundTruth
from .scenes import Resized, Staged

SHOWN = ("dog", "duck", "still_trees_1", "still_roof_hlg10_rot_1", "people_two_portrait_1")
"""Clips of 720 lines or more, with and without subjects."""
LARGE = 1920, 1080
NOISE = 0.02
"""The truth's, as the benchmark has it."""
TILES = 8
"""Tiles across the picture."""
SIDES = (640, 960, 1280)
"""Pixels of the long side."""


@dataclass(frozen=True)
class _MiddleOfScene:
    """The middle frame of a scene with its true depth."""

    name: str
    size = LARGE

    @cached_property
    def scene(self) -> Staged:
        return Resized(self.name, NOISE, LARGE[0])

    def drawn(self, blur: float, longest: int) -> LinearRGBA:
        case = GroundTruth(self.scene).case(self.scene.judged(0)[0], round(blur * self.size[0]))
        quality = replace(NORMAL, longest=longest)
        options = FrameOptions(case.focus, case.radius, borrow=False, quality=quality)
        return render_frame(case.clip, case.frame, options, self.size, lambda note: None)


@dataclass(frozen=True)
class _Middle:
    """The middle frame of a solved clip."""

    clip: RealClip
    work: Path

    @property
    def name(self) -> str:
        return self.clip.name

    @cached_property
    def context(self) -> ClipContext:
        solved = load_solve(self.work, self.clip.file)
        return ClipContext(solved.reconstruction, self.clip.footage.read)

    @cached_property
    def size(self) -> tuple[int, int]:
        return self.clip.footage.width, self.clip.footage.height

    @cached_property
    def distance(self) -> float:
        """Distance of the clicked pixel."""
        clip, frame = self.context, self.clip.middle
        canvas = clip.canvas(frame)
        depth = clip.depth(frame, canvas, canvas.from_source(clip.picture(frame, RESTORED)))
        rows, columns = depth.inverse_depth.shape
        x, y = self.clip.click
        return 1 / float(depth.inverse_depth[int(y * rows), int(x * columns)])

    def lens(self, blur: float) -> FrameOptions:
        """The lens whose largest disc is a share of the width."""
        options = FrameOptions(Focus(distance=self.distance), self.distance / 100)
        geometry = frame_geometry(self.context, self.clip.middle, options, self.size)
        return replace(options, radius=options.radius * blur * self.size[0] / sampled_disc(geometry))

    def drawn(self, blur: float, longest: int) -> LinearRGBA:
        quality = replace(NORMAL, longest=longest)
        options = replace(self.lens(blur), quality=quality)
        return render_frame(self.context, self.clip.middle, options, self.size, lambda note: None)


_Drawable = _Middle | _MiddleOfScene


def _worst(picture: LinearRGBA, own: LinearRGBA) -> float:
    """PSNR in dB of the worst tile."""
    side = own.shape[1] // TILES
    corners = [
        (y, x)
        for y in range(0, own.shape[0] - side + 1, side)
        for x in range(0, own.shape[1] - side + 1, side)
    ]
    cut = [(slice(y, y + side), slice(x, x + side)) for y, x in corners]
    return min(metrics.psnr(picture[each][..., :3], own[each][..., :3]) for each in cut)


def _rows(middle: _Drawable, blur: float, sides: Sequence[int], folder: Path) -> None:
    """Print the rows of a blur, and write the pictures."""
    middle.drawn(blur, max(sides))  # Depth is found.
    own, cost = measured(partial(middle.drawn, blur, max(middle.size)))
    name, size = middle.name, "x".join(map(str, middle.size))
    _write(folder / f"{name}-{blur:g}-own.png", own)
    for side in sides:
        picture, spent = measured(partial(middle.drawn, blur, side))
        _write(folder / f"{name}-{blur:g}-{side}.png", picture)
        print(
            f"| {name} | {size} | {blur:g} | {side} | {metrics.psnr(picture[..., :3], own[..., :3]):.1f}"
            f" | {_worst(picture, own):.1f} | {spent.cpu_s:.1f} | {spent.cpu_s / cost.cpu_s:.2f} |",
            flush=True,
        )


def _write(path: Path, picture: LinearRGBA) -> None:
    cv2.imwrite(str(path), (255 * encode_srgb(np.clip(picture[..., 2::-1], 0, 1)) + 0.5).astype(np.uint8))


def main() -> None:
    """Print the table; the pictures lie in build/drawn_size."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clips", nargs="*", default=SHOWN, metavar="NAME")
    parser.add_argument("--scenes", nargs="*", default=(), metavar="NAME")
    parser.add_argument("--blurs", nargs="+", type=float, default=(0.01, 0.03, 0.06), metavar="SHARE")
    parser.add_argument("--sides", nargs="+", type=int, default=SIDES, metavar="PIXELS")
    given = parser.parse_args()
    folder = store.ROOT / "build" / "drawn_size"
    folder.mkdir(parents=True, exist_ok=True)
    columns = "clip", "size", "blur", "long side", "dB", "worst tile", "CPU s", "of the own size's"
    print(f"| {' | '.join(columns)} |\n{'|---' * len(columns)}|")
    for middle in _chosen(given.clips, given.scenes):
        for blur in given.blurs:
            _rows(middle, blur, given.sides, folder)


def _chosen(names: Sequence[str], scenes: Sequence[str]) -> Iterator[_Drawable]:
    program = Program(HEADLESS.absolute())
    for clip in (each for each in clips.CLIPS if each.name in names):
        steps = Steps(clip, program)
        steps.solve()
        yield _Middle(clip, steps.solves / "work")
    yield from map(_MiddleOfScene, scenes)


if __name__ == "__main__":
    main()
