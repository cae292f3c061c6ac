"""Opacity of subjects against true mattes of fur, a plant and hair (real data).

`python -m benchmarks.special alpha_crops`: PSNR in the band of five crops of 320 pixels, each in the middle
of a frame that mirrors it on all sides. The probability that the product starts from is
simulated by `degraded`. *hard* is the opacity of layers without a matte: an outline found by colour, and
mixed pixels taken apart.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.depth.matte import outline_of
from addon.core.media.clip import to_linear
from addon.core.subjects.matte import matte
from addon.core.subjects.pictures import LONG_SIDE
from addon.core.warp.layered_depth_image import split

from .. import store
from ..cost import cpu_seconds
from ..solving.real_clips import DATA

Bytes = NDArray[np.uint8]
Map = NDArray[np.float32]

CROPS = {0: "white fur", 2: "a plant", 4: "straw", 5: "a dog", 7: "straw, sky"}
SIZE = (1280, 720)
BLUR = 2.0
"""Pixels of the small picture: standard deviation of the simulated probability. Those of people and a cow in
three clips of DAVIS have 1.7 to 3.0 across their outlines."""
HAIR = 9
"""Pixels of the frame; what is thinner is missing in the simulated probability."""
NEARER = 10.0
"""Disparity of the subject, in pixels."""
JUMP = 3.0
"""Pixels by more than which disparity jumps at silhouettes."""


def main() -> None:
    """Print the table."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    ways: dict[str, Callable[[Bytes, Bytes], Map]] = {"start": _start, "hard": _hard, "matte": matte}
    columns = "PSNR in the band, dB", *CROPS.values(), "mean", "CPU s"
    print(f"| {' | '.join(columns)} |\n{'|---' * len(columns)}|")
    frames = [_frame(number) for number in CROPS]
    for name, find in ways.items():
        began = cpu_seconds()
        found = [find(picture, degraded(alpha)) for picture, alpha, _ in frames]
        cost = (cpu_seconds() - began) / len(frames)
        pairs = zip(found, frames, strict=True)
        errors = [(each - true / np.float32(255))[band] for each, (_, true, band) in pairs]
        scores = [float(-10 * np.log10(np.mean(each**2))) for each in errors]
        shown = " | ".join(f"{score:.2f}" for score in [*scores, np.mean(scores)])
        print(f"| {name} | {shown} | {cost:.2f} |", flush=True)
    print(store.provenance())


def degraded(alpha: Bytes) -> Bytes:
    """A subject's probability (h, w) in 255ths in the small picture, of its true opacity (H, W).

    Hair is lost, the outline is blurred.
    """
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (HAIR, HAIR))
    solid = cv2.morphologyEx((alpha > 127).astype(np.float32), cv2.MORPH_OPEN, kernel)
    times = LONG_SIDE / max(alpha.shape)
    small = cv2.resize(solid, None, fx=times, fy=times, interpolation=cv2.INTER_AREA)
    return np.rint(255 * cv2.GaussianBlur(small, (0, 0), BLUR)).astype(np.uint8)


def _frame(number: int) -> tuple[Bytes, Bytes, NDArray[np.bool_]]:
    """A frame's picture (H, W, 3), its true opacity (H, W) in 255ths, and the band (H, W) that is judged."""
    image, alpha, trimap = (_read(number, kind) for kind in ("image", "alpha", "trimap"))
    rows, columns = ((whole - part) // 2 for whole, part in zip(SIZE[::-1], alpha.shape[:2], strict=True))
    border = rows, SIZE[1] - rows - len(alpha), columns, SIZE[0] - columns - alpha.shape[1]
    band = cv2.copyMakeBorder((trimap[..., 0] == 128).astype(np.uint8), *border, cv2.BORDER_CONSTANT) > 0
    picture, opacity = (
        cv2.copyMakeBorder(each, *border, cv2.BORDER_REFLECT) for each in (image, alpha[..., 0])
    )
    return np.ascontiguousarray(picture[..., ::-1], np.uint8), np.asarray(opacity, np.uint8), band


def _read(number: int, kind: str) -> Bytes:
    file = DATA / "alpha" / f"dim_{number}_{kind}.png"
    picture = cv2.imread(str(file))
    if picture is None:
        raise SystemExit(f"{file} is missing: it is one of five crops with true opacity")
    return np.asarray(picture, np.uint8)


def _start(picture: Bytes, share: Bytes) -> Map:
    """The probability as it is, enlarged."""
    return np.asarray(cv2.resize(share / np.float32(255), picture.shape[1::-1]))


def _hard(picture: Bytes, share: Bytes) -> Map:
    linear = to_linear(picture)
    disparity = np.where(outline_of(share > 127, linear), NEARER, 0).astype(np.float32)
    layers = split(linear, disparity, JUMP, JUMP)
    return np.where(layers.mixed | (disparity > 0), layers.front[..., 3], 0)


if __name__ == "__main__":
    main()
