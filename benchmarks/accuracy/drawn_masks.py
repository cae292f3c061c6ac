"""Subjects of real clips against hand-drawn masks (real data).

`python -m benchmarks.special drawn_masks [--clips NAME ...] [--ways WAY ...] [--pictures FOLDER]
[--segmenter FILE.onnx]`. *Stroke*: a line down the middle of the true mask in the middle frame that has one,
carried through the clip. *Click*: its innermost pixel alone. *Anywhere*: clicks at random places on it in
four frames, each measured in its own frame. *Automatic*: the people and other moving objects of the solved
clip, all of them.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np

from addon.core.frame.clip_context import ClipContext
from addon.core.media.clip import Footage, open_footage
from addon.core.sfm.process import SolveProcess
from addon.core.sfm.workspace import load_solve
from addon.core.subjects.carried import CarriedSubject
from addon.core.subjects.clip_subjects import ClipSubjects
from addon.core.subjects.networks import Networks
from addon.core.subjects.pictures import ClipPictures
from addon.core.subjects.strokes import Stroke, down

from .. import store
from ..cost import cpu_seconds
from ..gallery.clips import DATA
from .mask_metrics import Mask, boundary_f, iou

CORNERS = {"stroke": 5, "click": 1}
"""Of the line that marks the subject."""
WAYS = (*CORNERS, "anywhere", "automatic")
FRAMES, PLACES, WITHIN = 4, 10, 1 / 90
"""Frames with random clicks, clicks in each, and their least distance from the outline over the long side."""


def main() -> None:
    """Print the table."""
    folder = DATA / "masks"
    if not folder.is_dir():
        raise SystemExit(f"{folder} is missing: it has hand-drawn masks of real clips")
    parser = argparse.ArgumentParser(description=__doc__)
    names = sorted(path.name for path in folder.iterdir() if path.is_dir())
    parser.add_argument("--clips", nargs="+", default=names, choices=names, metavar="NAME")
    parser.add_argument("--ways", nargs="+", default=WAYS, choices=WAYS, metavar="WAY")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="every tenth frame with its mask")
    parser.add_argument("--segmenter", type=Path, metavar="FILE.onnx", help="as of the command line")
    options = parser.parse_args()
    columns = "clip", "how", "mean IoU", "least", "over 0.85", "boundary F", "CPU s a frame"
    print(f"| {' | '.join(columns)} |\n{'|---' * len(columns)}|")
    for name in options.clips:
        _judge(name, options.ways, options.pictures, Networks(segmenter=options.segmenter))


def _judge(name: str, ways: Sequence[str], pictures: Path | None, networks: Networks) -> None:
    footage = open_footage(DATA / "clips" / f"{name}.mp4")
    truths = {frame: truth for frame in footage.frames if (truth := _truth(name, frame)) is not None}
    small = ClipPictures(footage.frames, footage.read)
    middle = sorted(truths)[len(truths) // 2]
    finds: dict[str, Callable[[int], Mask]] = {
        way: CarriedSubject(small, networks, (Stroke(middle, down(_solid(truths[middle]), corners)),)).mask
        for way, corners in CORNERS.items()
    }
    if "automatic" in ways:
        finds["automatic"] = _automatic(footage, name, networks)
    for way in ways:
        began = cpu_seconds()
        if way == "anywhere":
            pairs = list(_anywhere(small, networks, truths))
        else:
            pairs = [(_sized(finds[way](frame), truth.shape), truth) for frame, truth in truths.items()]
        cost = (cpu_seconds() - began) / len(pairs)
        values = np.array([iou(*pair) for pair in pairs])
        outline = np.mean([boundary_f(*pair) for pair in pairs])
        print(f"| {name} | {way} | {values.mean():.2f} | {values.min():.2f} | {(values > 0.85).mean():.2f}"
              f" | {outline:.2f} | {cost:.2f} |", flush=True)  # fmt: skip
        if pictures is not None and way != "anywhere":
            pictures.mkdir(parents=True, exist_ok=True)
            found = zip(truths, pairs, strict=False)
            rows = [_shown(footage.read(frame)[..., 2::-1], mask) for frame, (mask, _) in [*found][::10]]
            cv2.imwrite(str(pictures / f"{name}_{way}.jpg"), np.vstack(rows))
    footage.close()


def _anywhere(
    small: ClipPictures, networks: Networks, truths: dict[int, Mask]
) -> Iterator[tuple[Mask, Mask]]:
    """Subjects of clicks at random places, each with the truth of its frame."""
    random, frames = np.random.default_rng(0), sorted(truths)
    for frame in (frames[round(at)] for at in np.linspace(0, len(frames) - 1, FRAMES + 2)[1:-1]):
        truth = truths[frame]
        away = cv2.distanceTransform(_solid(truth).astype(np.uint8), cv2.DIST_L2, 5)
        places = np.argwhere(away > WITHIN * max(truth.shape))
        for row, column in random.choice(places, PLACES):
            at = (column + 0.5) / truth.shape[1], (row + 0.5) / truth.shape[0]
            subject = CarriedSubject(small, networks, (Stroke(frame, (at,)),))
            yield _sized(subject.mask(frame), truth.shape), truth


def _automatic(footage: Footage, name: str, networks: Networks) -> Callable[[int], Mask]:
    """All subjects of a clip that are found without the user, (h, w) by frame."""
    work = store.FOLDER / "solves" / f"{name}-{store.digest(store.sources(*store.SOLVER))}.aperture"
    SolveProcess(footage.path, work).wait()
    solved = load_solve(work).reconstruction
    clip = ClipContext(
        solved, footage.read, known_subjects=ClipSubjects(solved, footage.read, networks=networks)
    )

    def mask(frame: int) -> Mask:
        found = clip.parts.mask(frame)
        return np.zeros((1, 1), bool) if found is None else found

    return mask


def _truth(name: str, frame: int) -> Mask | None:
    file = DATA / "masks" / name / f"{frame - 1:05d}.png"
    if not file.is_file():
        return None
    drawn = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
    assert drawn is not None, file
    return np.asarray(drawn > 127)


def _solid(mask: Mask) -> Mask:
    """A mask (h, w) without its parts that are thinner than a hundredth of the width: nobody draws there."""
    side = max(round(mask.shape[1] / 100), 1)
    return np.asarray(cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, np.ones((side, side))) > 0)


def _sized(mask: Mask, shape: tuple[int, ...]) -> Mask:
    return np.asarray(cv2.resize(mask.astype(np.uint8), shape[1::-1], interpolation=cv2.INTER_LINEAR) > 0)


def _shown(picture: np.ndarray, mask: Mask) -> np.ndarray:
    """A picture (h, w, 3), darker outside a mask."""
    return np.where(_sized(mask, picture.shape)[..., None], picture, picture // 3).astype(np.uint8)


if __name__ == "__main__":
    main()
