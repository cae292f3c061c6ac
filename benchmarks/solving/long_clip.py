"""A clip of thousands of frames, solved, against its truth.

`python -m benchmarks.special long_clip [--frames 2000]`.
The camera walks along a wall with boards before it and looks about a little. All of it is textured planes, so
a frame is drawn in milliseconds and its camera is known. Nothing that the first frame shows is to be seen in
the last, nor in most of those between: keyframes, their matches and the drift are what is asked here.
"""

from __future__ import annotations

import argparse
import resource
import time
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.base.arrays import Floats
from addon.core.base.errors import UserError
from addon.core.camera.reconstruction import Reconstruction
from addon.core.sfm.process import SolveProcess
from addon.core.sfm.workspace import load_solve

from ..store import FOLDER

SIZE = (320, 240)
FOCAL = 0.85 * SIZE[0]
STEP = 0.03
"""Scene units that the camera walks from a frame to the next."""
TEXELS = 50
"""A scene unit of texture."""
TALL = 12.0
"""Scene units from the lower to the upper end of the wall."""
WALL, BOARDS = 8.0, (3.5, 5.5)
"""Depths of the wall, and of the nearest and the farthest board."""


def texture(width: int, height: int, seed: int) -> NDArray[np.uint8]:
    """(height, width) blotches of many sizes, grey."""
    random = np.random.default_rng(seed)
    total = np.zeros((height, width), np.float32)
    for size in (3, 8, 24):
        small = random.standard_normal((height // size + 2, width // size + 2)).astype(np.float32)
        total += cv2.resize(small, (width, height), interpolation=cv2.INTER_CUBIC)
    return np.clip(128 + 38 * total, 0, 255).astype(np.uint8)


def path(count: int) -> tuple[Floats, Floats]:
    """(F, 3) camera centres and (F, 3) world-to-camera rotation vectors."""
    at = np.arange(count)
    centres = np.column_stack([STEP * at, 0.15 * np.sin(at / 31), 0.3 * np.sin(at / 170)])
    turns = np.column_stack([0.02 * np.sin(at / 23), 0.08 * np.sin(at / 90), 0.01 * np.sin(at / 41)])
    return centres, turns


class Street:
    """The wall and its boards, drawn a piece at a time: no texture is wider than OpenCV can warp."""

    PIECE = 20.0

    def __init__(self, length: float) -> None:
        self._pieces: dict[tuple[int, int], NDArray[np.uint8]] = {}
        random = np.random.default_rng(3)
        lefts = np.arange(-4.0, length + 6.0, 2.1)
        self._boards = [
            (depth, left, left + width, top)
            for left, (depth, width, top) in zip(
                lefts.tolist(),
                random.uniform((BOARDS[0], 0.6, -1.5), (BOARDS[1], 1.4, 0.3), (len(lefts), 3)).tolist(),
                strict=True,
            )
        ]

    def view(self, centre: Floats, turn: Floats) -> NDArray[np.uint8]:
        """(240, 320) picture."""
        picture = np.zeros((SIZE[1], SIZE[0]), np.float32)
        reach = 2.0 * WALL
        first, last = (int((centre[0] + side) // self.PIECE) for side in (-reach, reach))
        for number in range(first, last + 1):
            self._paint(
                picture, centre, turn, WALL, number * self.PIECE, -TALL / 2, self.PIECE, TALL, (0, number)
            )
        near = [(b, i) for i, b in enumerate(self._boards) if abs(b[1] - centre[0]) < reach]
        for (depth, left, right, top), number in sorted(near, reverse=True):
            self._paint(picture, centre, turn, depth, left, top, right - left, 1.6, (1, number))
        noise = np.random.default_rng(round(1000 * centre[0]) + 1).normal(0, 1.0, picture.shape)
        return np.clip(picture + noise, 0, 255).astype(np.uint8)

    def _paint(
        self, picture: NDArray[np.float32], centre: Floats, turn: Floats, depth: float, left: float,
        top: float, width: float, height: float, key: tuple[int, int],
    ) -> None:  # fmt: skip
        if key not in self._pieces:
            self._pieces[key] = texture(
                round(width * TEXELS), round(height * TEXELS), 1000 + 10 * key[1] + key[0]
            )
        pattern = self._pieces[key]
        lens = np.array([[FOCAL, 0, SIZE[0] / 2 - 0.5], [0, FOCAL, SIZE[1] / 2 - 0.5], [0, 0, 1]])
        from_texel = np.array([[1 / TEXELS, 0, left], [0, 1 / TEXELS, top], [0, 0, 1]])
        plane = np.column_stack([np.eye(3)[:, :2], [0, 0, depth] - centre])
        matrix = lens @ cv2.Rodrigues(turn)[0] @ plane @ from_texel
        warped = cv2.warpPerspective(pattern, matrix, SIZE, flags=cv2.INTER_LINEAR)
        cover = cv2.warpPerspective(np.full_like(pattern, 255), matrix, SIZE) / np.float32(255)
        picture += cover * (warped - picture)


def film(folder: Path, count: int) -> Path:
    """A folder of PNGs, drawn unless it is there."""
    if len(list(folder.glob("*.png"))) == count:
        return folder
    folder.mkdir(parents=True, exist_ok=True)
    street = Street(STEP * count)
    for number, (centre, turn) in enumerate(zip(*path(count), strict=True), 1):
        cv2.imwrite(str(folder / f"walk_{number:05d}.png"), street.view(centre, turn))
    return folder


def drift(reconstruction: Reconstruction, count: int) -> tuple[float, float]:
    """After the best similarity, in shares of the path's length: the RMS error of the camera centres; and the
    largest ratio of how long ten pieces of the path came out, less one."""
    frames = np.array([image.frame - 1 for image in reconstruction.images])
    found = np.array([image.centre for image in reconstruction.images])
    true = path(count)[0][frames]
    a, b = found - found.mean(axis=0), true - true.mean(axis=0)
    u, size, vt = np.linalg.svd(b.T @ a)
    sign = np.diag([1.0, 1.0, np.linalg.det(u @ vt)])
    scale = (size * np.diag(sign)).sum() / (a**2).sum()
    placed = scale * a @ (u @ sign @ vt).T
    error = np.sqrt(((placed - b) ** 2).sum(axis=1).mean()) / (STEP * count)
    cuts = np.linspace(0, len(frames) - 1, 11).round().astype(int)
    pieces = [np.linalg.norm(np.diff(p[cuts], axis=0), axis=1) for p in (placed, b)]
    ratio = pieces[0] / pieces[1]
    return float(error), float(ratio.max() / ratio.min() - 1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--frames", type=int, default=2000)
    parser.add_argument("--focal", action="store_true", help="tell the focal length")
    options = parser.parse_args()
    folder = FOLDER / "long" / str(options.frames)
    clip = film(folder / "clip", options.frames)
    began, spent = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    process = SolveProcess(clip, folder / "solve", focal=FOCAL if options.focal else None, again=True)
    try:
        process.wait(lambda step: print(f"{time.perf_counter() - began:6.0f} s {step.text}", flush=True))
    except UserError as refusal:
        print(refusal)
        return
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    solved = load_solve(folder / "solve")
    error, uneven = drift(solved.reconstruction, options.frames)
    print(solved.quality.text({}))
    print(
        f"{options.frames} frames of {SIZE[0]}x{SIZE[1]}, focal length {FOCAL:.0f} px:"
        f" {len(solved.reconstruction.images)} registered, centres off by {100 * error:.3f} % of the path,"
        f" pieces of the path by up to {100 * uneven:.2f} % of each other;"
        f" {time.perf_counter() - began:.0f} s, {usage.ru_utime - spent.ru_utime:.0f} s of processor time,"
        f" {usage.ru_maxrss / 1024:.0f} MiB"
    )


if __name__ == "__main__":
    main()
