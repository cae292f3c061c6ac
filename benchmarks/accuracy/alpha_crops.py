"""Opacity of subjects against true mattes of fur, a plant and hair (real data).

`python -m benchmarks.special alpha_crops`: PSNR in the band of five crops of 320 pixels, each in the middle
of a frame that mirrors it on all sides. The probability that the product starts from is
simulated by `degraded`. *hard* is the opacity of layers without a matte: an outline found by colour, and
mixed pixels taken apart.

A second table is of composites: fur by each crop's opacity before what another crop shows, against the same
seen by a lens that has one of both in focus, sRGB, in the same band. Other frames saw the background: not at
all; beside its place and brighter (`OFF`); or wrongly.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.depth.matte import matte, outline_of
from addon.core.depth.source import FAINTEST
from addon.core.media.light import encode_srgb, to_linear
from addon.core.subjects.pictures import LONG_SIDE
from addon.core.warp.layered_depth_image import Fill, split

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
TILES = {0: ((4, 170, 0), (2, 0, 20)), 4: ((0, 120, 0), (0, 0, 180)), 5: ((5, 0, 170), (5, 100, 0))}
"""By crop with the opacity, those that fur and background are taken from: crop, first row, first column."""
TILE = 100
"""Pixels across a square of fur or background, which is mirrored."""
OFF = (2, 1.05)
"""Pixels, and exposure."""
WRONG = 25
"""Pixels by which a wrong background is beside its place."""


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
    print("\n| background | matte | fur in focus | background in focus |\n|---|---|---|---|")
    for row, each in composites().items():
        near, far = np.mean(each, axis=0)
        print(f"| {row} | {near:.2f} | {far:.2f} |", flush=True)
    print(store.provenance())


def composites() -> dict[str, list[tuple[float, float]]]:
    """PSNR of composites with fur and with their background in focus, by what is known of them."""
    found = dict[str, list[tuple[float, float]]]()
    for number, (fur, wall) in TILES.items():
        _, alpha, band = _frame(number)
        part = np.s_[SIZE[1] // 2 - 160 : SIZE[1] // 2 + 160, SIZE[0] // 2 - 160 : SIZE[0] // 2 + 160]
        share, true = alpha[..., None] / np.float32(255), alpha[part] / np.float32(255)
        near, far = (_mirrored(*place) for place in (fur, wall))
        picture = share * near + (1 - share) * far
        shown = np.rint(255 * encode_srgb(np.clip(picture, 0, 1))).astype(np.uint8)
        own, behind = near[part], far[part]
        mattes: dict[str, Map] = {
            "true": np.asarray(true, np.float32),
            "found": matte(shown, degraded(alpha))[part],
        }
        fills: dict[str, Fill | None] = {
            "not seen": None,
            "off": _seen(OFF[1] * np.roll(behind, OFF[0], axis=1)),
            "wrong": _seen(np.roll(behind, WRONG, axis=(0, 1))),
        }
        for fill, name in itertools.product(fills, mattes):
            seen = _through_lens(to_linear(shown[part]), mattes[name], fills[fill])
            lens = _lens(np.dstack([share[part] * own, true]), behind)
            scores = [_psnr(*pair, band[part]) for pair in zip(seen, lens, strict=True)]
            found.setdefault(f"{fill} | {name}", []).append((scores[0], scores[1]))
    return found


def _through_lens(picture: Map, opacity: Map, fill: Fill | None) -> tuple[Map, Map]:
    """A picture (H, W, 4) as its layers are seen with either in focus."""
    disparity = np.where(opacity > FAINTEST, NEARER, 0).astype(np.float32)
    layers = split(picture, disparity, JUMP, JUMP, fill, opacity=opacity)
    front = layers.front * (layers.mixed | (disparity > 0))[..., None]
    return _lens(front, layers.back[..., :3])


def _lens(front: Map, behind: Map) -> tuple[Map, Map]:
    """Something (H, W, 4), premultiplied, before a background (H, W, 3): in focus, and with that in focus."""
    reach = int(NEARER)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1)).astype(np.float32)
    soft, far = (
        cv2.filter2D(each, -1, disc / disc.sum(), borderType=cv2.BORDER_REFLECT) for each in (front, behind)
    )
    return front[..., :3] + (1 - front[..., 3:]) * far, soft[..., :3] + (1 - soft[..., 3:]) * behind


def _seen(behind: Map) -> Fill:
    return lambda _, wanted: (behind * wanted[..., None], wanted)


def _mirrored(number: int, row: int, column: int) -> Map:
    """A frame (H, W, 3), linear, of a square of a crop and its mirror images."""
    square = to_linear(_read(number, "image")[row : row + TILE, column : column + TILE, ::-1])[..., :3]
    both = np.block([[[square], [square[:, ::-1]]], [[square[::-1]], [square[::-1, ::-1]]]])
    return np.asarray(np.tile(both, (4, 7, 1))[: SIZE[1], : SIZE[0]], np.float32)


def _psnr(picture: Map, true: Map, band: NDArray[np.bool_]) -> float:
    error = encode_srgb(np.clip(picture, 0, 1)) - encode_srgb(np.clip(true, 0, 1))
    return float(-10 * np.log10(np.mean(error[band] ** 2)))


def degraded(alpha: Bytes) -> Bytes:
    """A subject's probability (h, w) in 255ths in the small picture, of its true opacity (H, W).

    Hair is lost, the outline is blurred.
    """
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (HAIR, HAIR))
    solid = cv2.morphologyEx((alpha > 127).astype(np.float32), cv2.MORPH_OPEN, kernel)
    times = LONG_SIDE / max(alpha.shape)
    small = cv2.resize(solid, None, fx=times, fy=times, interpolation=cv2.INTER_AREA)
    return np.asarray(np.rint(255 * cv2.GaussianBlur(small, (0, 0), BLUR)), np.uint8)


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
