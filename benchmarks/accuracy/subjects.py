"""Masks and depth of subjects that move, against the truth, as the product finds them from the video alone.

`python -m benchmarks.accuracy.subjects [--scenes ...] [--methods ...] [--frames A-B] [--depth-every N]
[--pictures FOLDER]`.
A method is a line in `METHODS`. What its scores are, `mask_metrics` and `Score` define.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.camera.canvas import Canvas
from addon.core.depth.source import PixelDepth
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.highlights import RESTORED
from addon.core.subjects.strokes import MarkedSubject, Stroke
from sample_scenes import filming

from .. import store
from ..cost import cpu_seconds
from . import mask_metrics
from .cases import FromVideo, robust_line
from .mask_metrics import Mask
from .scenes import Floats, Staged

OTHER_DEPTH = 0.15
"""Share of its true inverse depth by which a pixel of a subject is on another depth: more than a person's own
relief at 4 m, 0.05, and than half of what tells them from a hedge at 7 m, 0.2."""
PART = 0.01
"""Share of a subject's pixels that are a part of it, if they hang together: a hand."""
INNER = 2
"""Pixels within the outline in which depth is not judged: they show two surfaces."""
GOOD, FAIR = 0.95, 0.85
"""IoU that a subject marked by a stroke, and one found by itself, is to have."""


@dataclass(frozen=True, eq=False)
class Given:
    """What a method may know: the solved clip, and of the truth only where a user would put a stroke."""

    scene: Staged
    clip: ClipContext
    subject: str
    """The one that is wanted; empty for all of them."""

    @lru_cache(maxsize=4)  # noqa: B019 - it lives as long as the scene is judged
    def depth(self, frame: int) -> PixelDepth:
        """The depth that the product draws with, normal quality."""
        picture = self.canvas(frame).from_source(self.clip.picture(frame, RESTORED))
        return self.clip.depth(frame, self.canvas(frame), picture)

    def canvas(self, frame: int) -> Canvas:
        return self.clip.canvas(frame)

    def pixels(self, frame: int) -> Floats:
        """(H * W, 2) where the canvas shows the centres of the source frame's pixels."""
        camera = self.canvas(frame).camera
        grid = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
        return self.canvas(frame).features_from_source(np.stack(grid, axis=-1).reshape(-1, 2))

    def truth(self, frame: int) -> Mask:
        """(H, W) the subject, as most of the 3 x 3 pixels around have it.

        A single hair covers less than a pixel: it is a matter of the matte, and no part of an outline.
        """
        mask = self.scene.subject(frame, self.subject)
        assert mask is not None
        return np.asarray(cv2.medianBlur(mask.astype(np.uint8), 3) > 0)

    def marked(self) -> Given:
        """The same with one stroke on the subject, in the middle of the clip, as a user would draw it."""
        frames = self.clip.reconstruction.frames
        middle = int(frames[len(frames) // 2])
        places = tuple((float(x), float(y)) for x, y in self.stroke(middle))
        mark = MarkedSubject(self.subject, (Stroke(middle, places),))
        return replace(self, clip=replace(self.clip, marked=(mark,)))

    def with_mattes(self) -> Given:
        """The same with the true mattes of all that moves."""
        return replace(self, clip=replace(self.clip, masks=self.scene.matte))

    def stroke(self, frame: int, places: int = 5) -> Floats:
        """(n, 2) places of a stroke from head to foot, in shares of the picture."""
        return mask_metrics.stroke(self.truth(frame), places)


@dataclass(frozen=True)
class Method:
    """A way to find subjects."""

    masks: Callable[[Given], Callable[[int], Mask]]
    """What gives the mask of a frame, (h, w) at any size over the canvas."""
    each: bool = False
    """Whether it knows one subject from another."""
    marks: bool = False
    """Whether the user marks the subject, which depth then knows too."""
    mattes: bool = False
    """Whether the user gives its true mattes."""


@dataclass(frozen=True)
class Score:
    """Shares are of frames; means are over them."""

    scene: str
    subject: str
    method: str
    frames: int
    iou: float
    """Mean intersection over union."""
    least_iou: float
    good: float
    """Share with an IoU of at least `GOOD`."""
    fair: float
    """Share with an IoU of at least `FAIR`."""
    boundary_f: float
    least_boundary_f: float
    boiling: float
    """Pixels a frame."""
    torn: float
    """Share in which a part of the subject (`PART`) lies on another depth (`OTHER_DEPTH`) than it has, in the
    depth that the product draws with."""
    off_depth: float
    """Mean share of the subject's pixels that do."""
    nearer: float
    """Mean share by which the subject's inverse depth, its median, is more than the true one."""
    unsteady: float
    """Standard deviation of how that changes from one frame that is judged to the next."""
    cpu_s: float
    """Processor seconds a frame of the masks, with the depth that they need."""


def moving(given: Given) -> Callable[[int], Mask]:
    """The pixels that depth takes for moving: `PixelDepth.moving`."""

    def mask(frame: int) -> Mask:
        found = given.depth(frame).moving
        return np.zeros((1, 1), bool) if found is None else found

    return mask


def automatic(given: Given) -> Callable[[int], Mask]:
    """Subjects that are found without the user, before depth: `ClipContext.moving`."""

    def mask(frame: int) -> Mask:
        found = given.clip.parts.mask(frame)
        return np.zeros((1, 1), bool) if found is None else found

    return mask


def true_mattes(given: Given) -> Callable[[int], Mask]:
    """What there is in truth, by which depth is found: as a user's masks are taken."""
    return given.truth


def by_stroke(given: Given) -> Callable[[int], Mask]:
    """What one stroke marks, carried both ways: `MovingParts.named` of `Given.marked`."""
    return given.clip.parts.named(given.subject).mask


METHODS = {
    "moving": Method(moving),
    "automatic": Method(automatic),
    "stroke": Method(by_stroke, each=True, marks=True),
    "mattes": Method(true_mattes, mattes=True),
}


def in_frame(mask: Mask, given: Given, frame: int) -> Mask:
    """A mask over the canvas, (h, w) at any size, as (H, W) in the source frame."""
    camera, pinhole = given.canvas(frame).camera, given.canvas(frame).pinhole
    shape = np.array(mask.shape[::-1])
    places = given.pixels(frame) * (shape / [pinhole.width, pinhole.height])
    column, row = np.clip(np.floor(places), 0, shape - 1).astype(int).T
    return np.asarray(mask[row, column].reshape(camera.height, camera.width))


class DepthScore(NamedTuple):
    """How the depth of a subject in one frame is."""

    torn: bool
    """Whether a part of it lies on another depth than it has."""
    off: float
    """Share of its pixels that do."""
    nearer: float
    """Share by which its inverse depth, the median, is more than the true one."""


def other_depth(inverse: Floats, true_depth: Floats, subject: Mask, moves: Mask) -> DepthScore:
    """The score of a subject's depth.

    `inverse` (H, W) is found, in its own unit; what stands still tells how that goes with the true depth
    (H, W). Judged are the subject's pixels further than `INNER` from its outline; a part is `PART` of them
    that touch each other and are off by more than `OTHER_DEPTH`.
    """
    inner = subject & ~mask_metrics.outline_band(subject, INNER)
    count = np.count_nonzero(inner)
    if not count:
        return DepthScore(False, 0.0, 0.0)
    still = ~moves & np.isfinite(true_depth)
    slope, offset = robust_line(1 / true_depth[still][::7], inverse[still][::7])
    with np.errstate(divide="ignore", invalid="ignore"):
        nearer = (inverse - offset) / slope * true_depth - 1
        off = inner & (np.abs(nearer) > OTHER_DEPTH)
    _, _, stats, _ = cv2.connectedComponentsWithStats(off.astype(np.uint8), connectivity=4)
    largest = stats[1:, cv2.CC_STAT_AREA].max(initial=0)
    share = np.count_nonzero(off) / count
    return DepthScore(bool(largest >= PART * count), share, float(np.median(nearer[inner])))


def judge(
    given: Given, name: str, frames: Sequence[int], pictures: Path | None = None, depth_every: int = 1
) -> Score:
    """One method on one subject over consecutive frames; its depth, which takes most of the time, in every so
    many of them."""
    method = METHODS[name]
    given = given.marked() if method.marks else given.with_mattes() if method.mattes else given
    of_frame = method.masks(given)
    truths = [given.truth(frame) for frame in frames]
    masks, depths, seconds = [], [], 0.0
    for frame in frames:
        start = cpu_seconds()
        found = of_frame(frame)
        seconds += (cpu_seconds() - start) / len(frames)
        masks.append(in_frame(found, given, frame))
        if (frame - frames[0]) % depth_every == 0:
            depths.append(_other_depth(given, frame))
    overlap = np.array([mask_metrics.iou(*each) for each in zip(masks, truths, strict=True)])
    boundary = [mask_metrics.boundary_f(*each) for each in zip(masks, truths, strict=True)]
    motions = [given.scene.motion(frame)[0] for frame in frames[:-1]]
    if pictures:
        for frame, mask, truth in zip(frames, masks, truths, strict=True):
            _draw(pictures, given, name, frame, mask, truth)
    return Score(
        given.scene.name, given.subject or "all", name, len(frames),
        float(overlap.mean()), float(overlap.min()),
        float(np.mean(overlap >= GOOD)), float(np.mean(overlap >= FAIR)),
        float(np.mean(boundary)), min(boundary), mask_metrics.boiling(masks, truths, motions),
        float(np.mean([depth.torn for depth in depths])), float(np.mean([depth.off for depth in depths])),
        float(np.mean([depth.nearer for depth in depths])),
        float(np.std(np.diff([depth.nearer for depth in depths]))) if len(depths) > 1 else 0.0, seconds,
    )  # fmt: skip


def _other_depth(given: Given, frame: int) -> DepthScore:
    true = given.scene.depth(frame)
    found, _, _ = given.depth(frame).at_places(given.pixels(frame), given.canvas(frame))
    return other_depth(found.reshape(true.shape), true, given.truth(frame), given.scene.moves(frame))


def _draw(folder: Path, given: Given, name: str, frame: int, mask: Mask, truth: Mask) -> None:
    """The frame, dimmed where the mask is not; the true outline is green, the mask's red."""
    picture: NDArray[np.uint8] = given.scene.frame(frame)[..., ::-1].copy()
    picture[~mask] //= 3
    picture[mask_metrics.outline(mask)] = (0, 0, 255)
    picture[mask_metrics.outline(truth)] = (0, 255, 0)
    folder.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(folder / f"{given.scene.name}-{given.subject or 'all'}-{name}-{frame:04d}.png"), picture)


def table(scores: Sequence[Score]) -> str:
    """The scores as Markdown."""
    names = [field.name for field in fields(Score)]
    lines = ["| " + " | ".join(name.replace("_", " ") for name in names) + " |", "|" + "---|" * len(names)]
    for score in scores:
        cells = [getattr(score, name) for name in names]
        lines.append("| " + " | ".join(f"{c:.3f}" if isinstance(c, float) else str(c) for c in cells) + " |")
    return "\n".join([*lines, ""])


def run(
    scene: Staged, methods: Sequence[str], frames: Sequence[int], pictures: Path | None, depth_every: int
) -> list[Score]:
    """Every method on a scene, on each of its subjects where it knows them apart."""
    clip = FromVideo(scene).clip
    return [
        judge(Given(scene, clip, subject), name, frames, pictures, depth_every)
        for name in methods
        for subject in (scene.stage.subjects if METHODS[name].each else ("",))
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="*", default=filming.SUBJECTS, choices=filming.SUBJECTS)
    parser.add_argument("--methods", nargs="*", default=list(METHODS), choices=METHODS)
    parser.add_argument("--frames", default="", help="only these, as in 20-39")
    parser.add_argument("--depth-every", type=int, default=1, help="judge depth in every so many frames only")
    parser.add_argument("--pictures", type=Path, help="folder for the masks over the frames")
    arguments = parser.parse_args()
    scores = []
    for name in arguments.scenes:
        scene = Staged(name, 0.02)
        first, last = map(int, (arguments.frames or f"1-{len(scene.stage.cameras)}").split("-"))
        frames = range(first, last + 1)
        scores += run(scene, arguments.methods, frames, arguments.pictures, arguments.depth_every)
        print(table(scores), flush=True)
    print(store.provenance())


if __name__ == "__main__":
    main()
