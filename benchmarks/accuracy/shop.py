"""The shop: a light field that others rendered, whose disc means are a lens's picture exactly.

17x17 views, 30.77 mm apart, with parallel axes; a path over them is the clip. Nobody gives its depth, so it
is measured by a plane sweep over more views than any method sees: track T1 here means true cameras and
this depth.
"""

from __future__ import annotations

import os
import re
from functools import cached_property, lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.media.light import to_linear
from sample_scenes.truth import Picture

from .. import store
from . import oracle
from .scenes import Floats, Motion, Truth

WIDTH, HEIGHT, FOCAL = 960, 640, 800.0
FOCUS = {"shop5": 5.0, "shop8": 8.12, "shop20": 20.0}
"""Depth in focus in metres: a skull, a stall, the back wall."""
RADII = (0.125, 0.24)
NAME = re.compile(r"_(\d\d)_(\d\d)_(-?[\d.]+)_(-?[\d.]+)_30_36\.jpg$")
NEAREST, FARTHEST, LEVELS = 2.0, 40.0, 160
MARGIN = 40
"""Pixels a side that some view of the widest lens does not see."""


def data_folder() -> Path:
    """Where the real test data lies, if it does."""
    return Path(os.environ.get("VA_DATA", store.ROOT.parent / "shared" / "data"))


class Shop:
    """One focal plane of the shop; as `scenes.Scene` asks."""

    def __init__(self, name: str, folder: Path) -> None:
        self.name, self.source = name, folder
        self.places: dict[tuple[int, int], Floats] = {}
        self.files: dict[tuple[int, int], Path] = {}
        for file in sorted(folder.glob("*.jpg")):
            if found := NAME.search(file.name):
                view = int(found[1]), int(found[2])
                self.files[view] = file
                # The camera stands at x = the second number, y = the first, in millimetres.
                self.places[view] = np.array([float(found[4]), float(found[3])]) / 1000

    @classmethod
    def open(cls, name: str) -> Shop | str:
        """The scene, or why it is not there."""
        folder = data_folder() / "shop"
        if not folder.is_dir():
            return f"{folder} is missing (set VA_DATA to the folder that holds it)"
        return cls(name, folder)

    @cached_property
    def key(self) -> str:
        return store.digest(
            [path.name for path in self.files.values()], store.sources("benchmarks/accuracy/shop.py")
        )

    @cached_property
    def blurs(self) -> tuple[int, ...]:
        return tuple(self._blur(radius) for radius in RADII)

    @cached_property
    def path(self) -> tuple[tuple[int, int], ...]:
        """Views (row, column) from right to left in a wave through the middle, and back below it."""
        there = [(13 + round(2 * np.sin((column - 13) / 8 * np.pi)), column) for column in range(5, 22)]
        back = [(16 + round(2 * np.sin((column - 13) / 8 * np.pi)), column) for column in range(20, 4, -1)]
        return (*there, (14, 21), *back)

    @cached_property
    def cameras(self) -> Reconstruction:
        camera = Intrinsics(WIDTH, HEIGHT, FOCAL, FOCAL, WIDTH / 2, HEIGHT / 2)
        nothing = np.zeros((0, 2)), np.zeros(0, np.int32)
        images = tuple(
            Image(frame, np.eye(3), -np.array([*self.places[view], 0.0]), *nothing)
            for frame, view in enumerate(self.path, start=1)
        )
        points = Points(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0))
        return Reconstruction((camera,), images, points)

    def judged(self, blur: int) -> tuple[int, ...]:
        """Around the middle of the grid, as far as whole discs reach."""
        middle = self.path.index((13, 13)) + 1
        return (middle - 1, middle, middle + 1) if blur == self.blurs[0] else (middle,)

    def clip(self) -> Path:
        folder = store.FOLDER / "shop-clip"
        folder.mkdir(parents=True, exist_ok=True)
        for frame, view in enumerate(self.path, start=1):
            link = folder / f"frame_{frame:04d}.jpg"
            if not link.exists():
                link.symlink_to(self.files[view].resolve())
        return folder

    def frame(self, frame: int) -> NDArray[np.uint8]:
        return _read(self.files[self.path[frame - 1]])

    def depth(self, frame: int) -> Floats:
        return store.kept("shop-depth", f"{self.key}-{frame:04d}", lambda: self._swept(frame))

    def subject(self, frame: int) -> None:
        """Nothing moves."""

    def matte(self, frame: int) -> None:
        """As `subject`."""

    def strokes(self, frame: int) -> dict[str, Floats]:
        """None: as `subject`."""
        return {}

    def past_border(self, frame: int) -> None:
        """None: what is judged ends before it."""

    def focus_depth(self, frame: int, blur: int) -> float:
        return FOCUS[self.name]

    def focus_xy(self, frame: int, blur: int) -> Floats:
        """The middle of the largest patch at the focal depth."""
        depth, focus = self.depth(frame), FOCUS[self.name]
        near = (np.abs(depth - focus) < 0.02 * focus).astype(np.uint8)
        inside = cv2.distanceTransform(near, cv2.DIST_L2, 5)
        row, column = np.unravel_index(int(inside.argmax()), inside.shape)
        return np.array([column + 0.5, row + 0.5])

    def radius(self, blur: int) -> float:
        return RADII[self.blurs.index(blur)]

    def margin(self, blur: int) -> int:
        return MARGIN

    def truth(self, frame: int, blur: int) -> Truth:
        """The disc's mean; as seeds, the black and the white squares of its chessboard."""
        views = self.disc(frame, self.radius(blur))

        def mean(parity: int | None) -> Picture:
            own = [view for view in views if parity is None or sum(view) % 2 == parity]
            return np.asarray(np.mean([self.registered(frame, v, FOCUS[self.name]) for v in own], axis=0))

        parts = [
            store.kept(f"{self.name}-truth", f"{self.key}-{frame:04d}-{blur}px-{p}", lambda p=p: mean(p))  # type: ignore[misc]
            for p in (None, 0, 1)
        ]
        return Truth(parts[0], (parts[1], parts[2]))

    def disc(self, frame: int, radius: float) -> list[tuple[int, int]]:
        """The views (row, column) on the lens of a frame."""
        here = self.places[self.path[frame - 1]]
        return [view for view, place in self.places.items() if np.linalg.norm(place - here) <= radius]

    def registered(self, frame: int, view: tuple[int, int], depth: float) -> Picture:
        """(H, W, 3) linear: the view shifted so that a depth lies where the frame has it."""
        shift = (self.places[view] - self.places[self.path[frame - 1]]) * FOCAL / depth
        return _shifted(to_linear(_read(self.files[view]))[..., :3], shift)

    def motion(self, frame: int) -> Motion | None:
        return None

    def layers(self, frame: int, margin: int) -> oracle.LayeredDepthImage | None:
        return None

    def _blur(self, radius: float) -> int:
        """Largest disc in pixels over all but a thousandth of the middle frame."""
        frame = self.path.index((13, 13)) + 1
        contrast = np.abs(1 / self.depth(frame) - 1 / FOCUS[self.name])
        return round(2 * radius * FOCAL * float(np.percentile(contrast, 99.9)))

    def _swept(self, frame: int) -> Floats:
        """(H, W) depth by a plane sweep; of the views at either side the ones that see a surface decide.

        Collins, "A space-sweep approach to true multi-image matching", 1996; one-sided minima as in Kang,
        Szeliski and Chai, "Handling occlusions in dense multi-view stereo", 2001.
        """
        row, column = self.path[frame - 1]
        sides = [[(row + down * k, column + across * k) for k in (2, 4, 7)]
                 for down, across in ((0, 1), (0, -1), (1, 0), (-1, 0))]  # fmt: skip
        sides = [[view for view in side if view in self.files] for side in sides]
        own = _read(self.files[self.path[frame - 1]]).astype(np.float32)
        levels = np.linspace(1 / FARTHEST, 1 / NEAREST, LEVELS)
        costs = np.empty((LEVELS, HEIGHT, WIDTH), np.float32)
        for level, inverse in enumerate(levels):
            lowest = np.full((HEIGHT, WIDTH), np.inf, np.float32)
            for side in (side for side in sides if side):
                cost = np.mean([self._mismatch(own, frame, view, inverse) for view in side], axis=0)
                lowest = np.minimum(lowest, cv2.GaussianBlur(cost, (0, 0), 2.0))
            costs[level] = lowest
        inner = np.clip(costs.argmin(axis=0), 1, LEVELS - 2)
        before, at, after = (np.take_along_axis(costs, (inner + k)[None], axis=0)[0] for k in (-1, 0, 1))
        curve = before - 2 * at + after
        # The parabola through the best level and its neighbours.
        step = np.divide(before - after, 2 * curve, out=np.zeros_like(curve), where=curve > 1e-6)
        found = levels[0] + (inner + np.clip(step, -1, 1)) * (levels[1] - levels[0])
        smooth = cv2.medianBlur(found.astype(np.float32), 5)
        return np.asarray(1 / smooth, dtype=np.float64)

    def _mismatch(self, own: Picture, frame: int, view: tuple[int, int], inverse: float) -> Picture:
        shift = (self.places[view] - self.places[self.path[frame - 1]]) * FOCAL * inverse
        moved = _shifted(_read(self.files[view]).astype(np.float32), shift, cv2.INTER_LINEAR)
        return np.asarray(np.minimum(np.abs(moved - own).mean(axis=-1), 40.0), dtype=np.float32)


@lru_cache(maxsize=300)
def _read(path: Path) -> NDArray[np.uint8]:
    bgr = cv2.imread(str(path))
    if bgr is None:
        raise FileNotFoundError(f"{path} cannot be read as a picture")
    return np.ascontiguousarray(bgr[..., ::-1], dtype=np.uint8)


def _shifted(picture: Picture, shift: Floats, how: int = cv2.INTER_LANCZOS4) -> Picture:
    """The picture moved right and down by `shift` (2,) pixels."""
    move = np.array([[1.0, 0.0, shift[0]], [0.0, 1.0, shift[1]]])
    size = (picture.shape[1], picture.shape[0])
    return np.asarray(cv2.warpAffine(picture, move, size, flags=how, borderMode=cv2.BORDER_REPLICATE))
