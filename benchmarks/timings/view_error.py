"""What few views miss of many, and what they cost: `python -m benchmarks.special view_error`.

A scene's first judged frame with its true depth, drawn through N views: plain, by Vogel's spiral, and with
the texture prefiltered for N, at positions of equal shares. Scores are PSNR and that of the edge band, in dB,
against 512 plain views, and against the truth where it has been filmed; the CPU seconds are those of the
prefilter and of drawing, the mesh is made once.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from addon.core.frame.frame import Frame
from addon.core.frame.frame_path import mesh_frame
from addon.core.frame.plan import FrameOptions
from addon.core.optics.aperture_sampling import exact_registration, vogel_disc
from addon.render.views.average import draw_mean

from .. import store
from ..accuracy import metrics
from ..accuracy.cases import GroundTruth
from ..accuracy.scenes import Picture, Staged
from ..cost import measured

REFERENCE = 512
"""Plain views of what stands for infinitely many."""
NOISE = 0.02
"""Of the truth, as the benchmark has it."""


@dataclass(frozen=True)
class Scored:
    """A scene at one size of the disc, with what pictures of it are compared to."""

    name: str
    blur: int

    @cached_property
    def scene(self) -> Staged:
        return Staged(self.name, NOISE)

    @property
    def frame(self) -> int:
        return self.scene.judged(self.blur)[0]

    @cached_property
    def meshed(self) -> Frame:
        case = GroundTruth(self.scene).case(self.frame, self.blur)
        size, lens = (case.picture.shape[1], case.picture.shape[0]), FrameOptions(case.focus, case.radius)
        picture = case.clip.picture(self.frame, lens.highlights)
        return mesh_frame(case.clip, self.frame, lens, size, picture)

    @cached_property
    def band(self) -> NDArray[np.bool_]:
        return metrics.edge_band(1 / self.scene.depth(self.frame))

    @cached_property
    def reference(self) -> Picture:
        return drawn(plain(self.meshed, REFERENCE))

    @cached_property
    def truth(self) -> Picture | None:
        """None where it would have to be rendered."""
        kept = store.FOLDER / self.scene.folder
        seeds = sorted(kept.glob(f"lens-{self.frame:04d}-{self.blur}px-{NOISE:g}-seed*.npy"))
        return self.scene.truth(self.frame, self.blur).picture if len(seeds) == 2 else None

    def scores(self, picture: Picture) -> str:
        """The cells of a row."""
        cells = []
        for other in (self.reference, self.truth):
            where = (None, self.band)
            cells += ["-"] * 2 if other is None else [f"{metrics.psnr(picture, other, m):.2f}" for m in where]
        return " | ".join(cells)


def plain(meshed: Frame, count: int) -> Frame:
    """A frame through views of Vogel's spiral, its texture as it is."""
    warped = meshed.through(count, prefiltered=False)
    views = warped.views
    offsets = views.lens.radius * vogel_disc(count)
    registration = exact_registration(views.canvas, offsets, views.lens.focus)
    return replace(warped, views=replace(views, offsets=offsets, registration=registration))


def drawn(warped: Frame) -> Picture:
    return warped.views.canvas.to_source(draw_mean(warped))[..., :3]


def compare(scored: Scored, counts: list[int]) -> None:
    """A row for each number of views, plain and prefiltered."""
    for count in counts:
        for name, make in (("plain", plain), ("prefiltered", Frame.through)):
            warped, making = measured(partial(make, scored.meshed, count))
            picture, drawing = measured(partial(drawn, warped))
            print(
                f"| {scored.name} | {scored.blur} | {count} | {name} | {scored.scores(picture)} |"
                f" {making.cpu_s:.2f} | {drawing.cpu_s:.2f} |",
                flush=True,
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=["bars", "fence", "walk", "blocks"])
    parser.add_argument("--blurs", nargs="+", type=int, default=[16, 32, 64], metavar="PX")
    parser.add_argument("--views", nargs="+", type=int, default=[8, 16, 24, 64, 256])
    options = parser.parse_args()
    print("| scene | disc, px | views | texture | PSNR | edges | truth | edges | prefilter, s | drawing, s |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for name in options.scenes:
        for blur in options.blurs:
            compare(Scored(name, blur), options.views)


if __name__ == "__main__":
    main()
