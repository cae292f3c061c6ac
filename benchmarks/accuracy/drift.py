"""Clips whose exposure and white balance drift, and whose lens darkens the corners:
`python -m benchmarks.special drift`.

The frames of a scene are filmed anew as such a camera writes them: linear light times a gain of the frame and
a share of the place, clipped, 8 bits. PSNR at 32 px of the frame in the middle, whose own gain is 1, where a
fifth of a pixel or more is borrowed from other frames and no clipped highlight reaches: against the real
lens, and against our frame of the clip without the drift, as the camera would write that. With `--depth`, how
far depth that is found is from the truth instead, and how much of the picture is held to move.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from unittest.mock import patch

import cv2
import numpy as np

from addon.core.frame.clip_context import ClipContext
from addon.core.frame.frame_path import Drawn, mesh_frame
from addon.core.frame.highlights import HighlightSettings
from addon.core.frame.inspection import SOURCES
from addon.core.frame.plan import FrameOptions
from addon.core.media.light import encode_srgb, to_linear
from addon.core.warp import disocclusion_fill
from addon.core.warp.source_view import Places, SourceView
from addon.render.views.average import draw_mean, draw_shares

from . import metrics
from .cases import GroundTruth
from .scenes import Picture, Staged

SCENES = ("bars", "walk", "blocks", "fence")
BLUR, VIEWS, NOISE = 32, 64, 0.02
BORROWED = 0.2
"""Share of a pixel's light that is borrowed, at least, where borrowed colours are judged."""
WRONG = 0.05
"""Of the inverse depth, by which one that is found is wrong."""


@dataclass(frozen=True)
class Drift:
    """How a camera's pictures differ from the scene's light."""

    name: str
    stops: float = 0.0
    """Of exposure over the clip."""
    balance: float = 0.0
    """By which red rises and blue falls over the clip, each from less half of it to half of it."""
    corner: float = 0.0
    """Share of the light that the lens loses in the corners; less inwards by the square of the radius."""

    def gain(self, frame: int, middle: int, frames: int) -> Picture:
        """(3,) of a frame, 1 in the middle one."""
        at = (frame - middle) / frames
        colour = np.array([1 + self.balance, 1, 1 / (1 + self.balance)])
        return np.asarray(2 ** (self.stops * at) * colour ** (2 * at), np.float32)

    def falloff(self, width: int, height: int) -> Picture:
        """(height, width, 1) share of the light that is left."""
        x, y = ((np.arange(n) + 0.5) / n * 2 - 1 for n in (width, height))
        squared = ((x * width) ** 2 + (y[:, None] * height) ** 2) / (width**2 + height**2)
        return np.asarray(1 - self.corner * squared, np.float32)[..., None]


DRIFTS = (
    Drift("none"),
    Drift("exposure, 1 stop", stops=1.0),
    Drift("white balance, 15 %", balance=0.15),
    Drift("both", stops=1.0, balance=0.15),
    Drift("corners, 30 %", corner=0.3),
    Drift("all", stops=1.0, balance=0.15, corner=0.3),
)


@dataclass(frozen=True)
class Filmed:
    """A scene as a camera with a drift writes it."""

    scene: Staged
    drift: Drift

    @property
    def middle(self) -> int:
        """The frame that is judged."""
        return self.scene.judged(BLUR)[0]

    def read(self, frame: int) -> np.ndarray:
        """(H, W, 3) uint8 of the clip."""
        linear = to_linear(self.scene.frame(frame))[..., :3]
        height, width = linear.shape[:2]
        linear = linear * self.drift.falloff(width, height)
        linear *= self.drift.gain(frame, self.middle, len(self.scene.cameras.frames))
        return np.rint(255 * encode_srgb(np.clip(linear, 0, 1))).astype(np.uint8)

    def truth(self) -> Picture:
        """(H, W, 3) the judged frame through the real lens, as this camera would film it."""
        picture = self.scene.truth(self.middle, BLUR).picture
        return np.asarray(picture * self.drift.falloff(picture.shape[1], picture.shape[0]), np.float32)


class TrueGeometry(GroundTruth):
    """True cameras and depth, and pictures with a drift."""

    def __init__(self, filmed: Filmed) -> None:
        super().__init__(filmed.scene)
        self.__dict__["whole"] = ClipContext(filmed.scene.cameras, filmed.read)


def by_falloff(share: Picture, colours: Callable[..., Picture]) -> Callable[..., Picture]:
    """`SourceView.colours` times the share (H, W) of the light that the lens leaves at a place over what it
    leaves where the source frame sees it: what knowing the fall-off exactly would give."""
    height, width = share.shape

    def left(x: Picture, y: Picture) -> Picture:
        column, row = (np.clip(np.nan_to_num(v), 0, n - 1).astype(int) for v, n in ((x, width), (y, height)))
        return np.asarray(share[row, column])

    def corrected(self: SourceView, places: Places) -> Picture:
        x, y, _ = self.reprojection(places)
        return colours(self, places) * (left(places.x, places.y) / left(x, y))

    return corrected


def rendered(
    filmed: Filmed, gains: tuple[float, float] | None = None, knows_falloff: bool = False
) -> tuple[Picture, Picture]:
    """(H, W, 3) the judged frame, and (H, W) the share of each pixel that is borrowed.

    `gains` are the bounds of the ratio of exposures, None for the product's. Highlights are off: the
    films are clipped already, and light that was lost does not drift.
    """
    case = TrueGeometry(filmed).case(filmed.middle, BLUR)
    options = FrameOptions(case.focus, case.radius, VIEWS, highlights=HighlightSettings(gain=0.0))
    picture = case.clip.picture(case.frame, options.highlights)
    height, width = picture.shape[:2]
    with ExitStack() as stack:
        if gains is not None:
            stack.enter_context(patch.object(disocclusion_fill, "GAINS", gains))
        if knows_falloff:
            share = filmed.drift.falloff(width, height)[..., 0]
            stack.enter_context(patch.object(SourceView, "colours", by_falloff(share, SourceView.colours)))
        warped = mesh_frame(case.clip, case.frame, options, (width, height), picture).warped
        mean = warped.plan.canvas.to_source(draw_mean(warped))[..., :3]
        shares = draw_shares(Drawn(warped, picture, 0.0))
    return mean, shares[..., SOURCES.index("borrowed")]


def lens_rows(scene: Staged, numbers: Sequence[int]) -> None:
    """Lines of the first table, printed."""
    steady = Filmed(scene, DRIFTS[0])
    plain, borrowed = rendered(steady)
    disc = TrueGeometry(steady).case(steady.middle, BLUR).disc
    band = metrics.unclipped(steady.read(steady.middle), disc) & (borrowed >= BORROWED)
    for drift in (DRIFTS[number] for number in numbers):
        filmed, cells = Filmed(scene, drift), [f"{100 * band.mean():.1f} %"]
        corners = drift.falloff(band.shape[1], band.shape[0])
        for gains, knows in (((1.0, 1.0), False), (None, False), *([(None, True)] if drift.corner else [])):
            picture, _ = rendered(filmed, gains, knows)
            cells += [
                f"{metrics.psnr(picture, each, band):.2f}" for each in (filmed.truth(), plain * corners)
            ]
        print(f"| {scene.name} | {drift.name} | " + " | ".join(cells) + " |", flush=True)


def depth_row(filmed: Filmed) -> str:
    """A line of the second table."""
    scene, frame = filmed.scene, filmed.middle
    clip = ClipContext(
        TrueGeometry(filmed).reconstruction([int(n) for n in scene.cameras.frames]), filmed.read
    )
    found, said = clip.stereo.at(frame).inverse_depth, clip.parts.mask(frame)
    said = np.zeros(found.shape, bool) if said is None else said
    true = cv2.resize(1 / scene.depth(frame), found.shape[1::-1], interpolation=cv2.INTER_NEAREST)
    off = np.abs(found - true) / np.maximum(true, 1e-9)
    shown = scene.moves(frame).astype(np.uint8)
    moves = cv2.resize(shown, said.shape[1::-1], interpolation=cv2.INTER_NEAREST) > 0
    overlap = np.sum(said & moves) / np.sum(said | moves) if moves.any() else np.nan
    figures = np.median(off), np.mean(off > WRONG), np.mean(said & ~moves), overlap
    cells = [f"{100 * each:.2f} %" for each in figures]
    return f"| {scene.name} | {filmed.drift.name} | " + " | ".join(cells) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="*", default=list(SCENES))
    parser.add_argument("--drifts", nargs="*", type=int, default=list(range(1, len(DRIFTS))), help="numbers")
    parser.add_argument("--depth", action="store_true", help="judge depth and motion instead of colours")
    arguments = parser.parse_args()
    figures = ("error", "wrong", "held to move", "overlap") if arguments.depth else (
        "borrowed", "as is", "to steady", "matched", "to steady", "fall-off known", "to steady"
    )  # fmt: skip
    print("| scene | drift | " + " | ".join(figures) + " |\n" + "|---" * (len(figures) + 2) + "|")
    for name in arguments.scenes:
        scene = Staged(name, NOISE)
        if not arguments.depth:
            lens_rows(scene, arguments.drifts)
            continue
        for number in arguments.drifts:
            print(depth_row(Filmed(scene, DRIFTS[number])), flush=True)


if __name__ == "__main__":
    main()
