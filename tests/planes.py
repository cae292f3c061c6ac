"""Small synthetic clips with known depth: three textured planes before a moving camera."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.base.arrays import Floats
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction

SIZE = (320, 240)
FOCAL = 0.85 * SIZE[0]
PLANES = {10.0: (-30.0, 30.0), 6.0: (-2.6, -0.6), 4.0: (0.5, 1.6)}
"""Depth of each plane, far to near, and its left and right edge, in scene units."""
TEXELS = 60
"""A scene unit of texture."""


def texture(width: int, height: int, seed: int) -> NDArray[np.uint8]:
    """Blotches of many sizes, grey."""
    random = np.random.default_rng(seed)
    total = np.zeros((height, width), np.float32)
    for size in (3, 8, 24):
        small = random.standard_normal((height // size + 2, width // size + 2)).astype(np.float32)
        total += cv2.resize(small, (width, height), interpolation=cv2.INTER_CUBIC)
    return np.clip(128 + 38 * total, 0, 255).astype(np.uint8)


pattern = cache(texture)
"""Not to be written to: the planes of all views."""


def camera_matrix(focal: float = FOCAL) -> NDArray[np.float64]:
    """OpenCV's pixel centres."""
    return np.array([[focal, 0, SIZE[0] / 2 - 0.5], [0, focal, SIZE[1] / 2 - 0.5], [0, 0, 1]])


def view(
    centre: NDArray[np.float64],
    turn: NDArray[np.float64],
    focal: float = FOCAL,
    shift: tuple[float, float] = (0.0, 0.0),
) -> NDArray[np.uint8]:
    """(240, 320, 3) picture from a camera at `centre` with world-to-camera rotation vector `turn`, what it
    shows shifted by so many pixels."""
    picture = np.zeros((SIZE[1], SIZE[0]), np.float32)
    rotation = cv2.Rodrigues(turn)[0]
    moved = np.array([[1, 0, shift[0]], [0, 1, shift[1]], [0, 0, 1.0]])
    for seed, (depth, (left, right)) in enumerate(PLANES.items()):
        texels = pattern(round((right - left) * TEXELS), 24 * TEXELS, seed)
        from_texel = np.array([[1 / TEXELS, 0, left], [0, 1 / TEXELS, -12], [0, 0, 1]])
        plane = np.column_stack([np.eye(3)[:, :2], [0, 0, depth] - centre])
        matrix = moved @ camera_matrix(focal) @ rotation @ plane @ from_texel
        warped = cv2.warpPerspective(texels, matrix, SIZE, flags=cv2.INTER_LINEAR)
        cover = cv2.warpPerspective(np.full_like(texels, 255), matrix, SIZE) / np.float32(255)
        picture += cover * (warped - picture)
    noise = np.random.default_rng(int(1000 * abs(centre).sum())).normal(0, 1.0, picture.shape)
    return np.repeat(np.clip(picture + noise, 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def write_clip(folder: Path, pictures: list[NDArray[np.uint8]], first: int = 1) -> Path:
    """A folder of PNGs from a first frame on."""
    folder.mkdir()
    for frame, picture in enumerate(pictures, first):
        cv2.imwrite(str(folder / f"shot_{frame:04d}.png"), picture)
    return folder


def write_video(path: Path, count: int, size: tuple[int, int] = (192, 144)) -> Path:
    """A small MPEG-4 of the camera that walks to the side: a command on it takes seconds."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 24, size)
    for picture in sideways(count):
        writer.write(cv2.resize(picture, size, interpolation=cv2.INTER_AREA))
    writer.release()
    return path


def halved(pictures: Sequence[NDArray[np.uint8]]) -> list[NDArray[np.uint8]]:
    """The same at half the size, and of half the focal length: depth takes a quarter of the time."""
    size = SIZE[0] // 2, SIZE[1] // 2
    return [cv2.resize(each, size, interpolation=cv2.INTER_AREA) for each in pictures]


def sideways(count: int, focal: float = FOCAL) -> list[NDArray[np.uint8]]:
    """A camera that walks one unit to the side, a little up, and turns a little."""
    steps = np.linspace(-0.5, 0.5, count)
    return [
        view(np.array([s, 0.2 * s * s, 0.1 * s]), np.array([0.01 * s, 0.04 * s, 0.0]), focal) for s in steps
    ]


def stabilised(count: int, depth: float, path: float = 1.0) -> list[NDArray[np.uint8]]:
    """A camera that slides `path` units to the side without turning, its pictures shifted so that what is at
    `depth` stays in place, as in rectified light fields."""
    steps = path * np.linspace(-0.5, 0.5, count)
    return [view(np.array([s, 0, 0]), np.zeros(3), shift=(FOCAL * s / depth, 0.0)) for s in steps]


def turning(count: int) -> list[NDArray[np.uint8]]:
    """A camera on a tripod that pans."""
    return [view(np.zeros(3), np.array([0.0, a, 0.0])) for a in np.linspace(-0.12, 0.12, count)]


# Cameras that look straight ahead

WIDTH, HEIGHT = SIZE
LENS = Intrinsics(WIDTH, HEIGHT, FOCAL, FOCAL, WIDTH / 2, HEIGHT / 2)
STEPS = np.linspace(-0.4, 0.4, 9)
CENTRES = np.column_stack([STEPS, 0.1 * STEPS**2, np.zeros(9)])
MIDDLE = 5
"""The middle one's frame."""
RANGE = 1 / 4 - 1 / 10
"""Of the planes' inverse depths."""


def clip(centres: Floats) -> list[NDArray[np.uint8]]:
    """A picture from each centre."""
    return [view(centre, np.zeros(3)) for centre in centres]


def poses(centres: Floats, points: Floats | None = None, camera: Intrinsics = LENS) -> Reconstruction:
    """Cameras that look straight ahead, and points that all of them observe."""
    xyz = np.zeros((0, 3)) if points is None else points
    images = []
    for frame, centre in enumerate(centres, start=1):
        xy = camera.project(xyz - centre)
        images.append(Image(frame, np.eye(3), -centre, xy, np.arange(len(xyz), dtype=np.int32)))
    found = Points(xyz, np.zeros((len(xyz), 3), np.uint8), np.zeros(len(xyz)))
    return Reconstruction((camera,), tuple(images), found)


def features() -> Floats:
    """Some points on each plane."""
    rng = np.random.default_rng(1)
    made = []
    for depth, (left, right) in PLANES.items():
        left, right = max(left, -4.0), min(right, 4.0)
        x, y = rng.uniform(left, right, 30), rng.uniform(-0.3 * depth, 0.3 * depth, 30)
        made.append(np.column_stack([x, y, np.full(30, depth)]))
    return np.concatenate(made)


def truth(centre: Floats, camera: Intrinsics = LENS) -> Floats:
    """(h, w) inverse depth that a camera looking straight ahead from a centre sees."""
    x = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
    inverse = np.zeros(camera.width)
    for depth, (left, right) in PLANES.items():
        there = centre[0] + x * (depth - centre[2])
        inverse[(there > left) & (there < right)] = 1 / (depth - centre[2])
    return np.tile(inverse, (camera.height, 1))
