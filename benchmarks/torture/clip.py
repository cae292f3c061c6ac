"""A tiny clip with sound that is solved without solving, so that a try takes seconds."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction, rotation_matrix
from addon.core.media.clip import open_footage
from addon.core.readers.matching import Imported
from addon.core.sfm.workspace import keep_import
from addon.render.views.quiet import quiet
from sample_scenes import clip as encoding

LENS = Intrinsics(96, 54, 84.0, 84.0, 48.0, 27.0)
RATE = 24
POINTS = 60
NEAR, FAR = 5.0, 12.0
WALLS = {10.0: (-30.0, 30.0), 6.0: (-2.6, -0.6), 4.0: (0.5, 1.6)}
"""Depth of the walls that a solve finds, far to near, and where they begin and end."""


def picture(frame: int, camera: Intrinsics = LENS) -> NDArray[np.uint8]:
    """(H, W, 3) of a frame: no two are alike, so that one in another's place is seen."""
    rng = np.random.default_rng(7)
    coarse, fine = (
        cv2.resize(
            rng.random((LENS.height // s, LENS.width // s, 3)),
            (LENS.width, LENS.height),
            interpolation=cv2.INTER_CUBIC,
        )
        for s in (3, 9)
    )
    mixed = np.roll(0.5 * coarse + 0.5 * fine, frame, axis=1)
    tile = np.asarray(np.clip(mixed * 255, 0, 255), np.uint8)
    # Large ones are many of it, so that making them takes no memory.
    across, down = -(-camera.width // LENS.width), -(-camera.height // LENS.height)
    return np.tile(tile, (down, across, 1))[: camera.height, : camera.width]


def truth(frames: range, camera: Intrinsics = LENS) -> Reconstruction:
    """Points on a plane that recedes to the right, seen by cameras that drift sideways."""
    rng = np.random.default_rng(3)
    rays = (
        rng.uniform([0, 0], [camera.width, camera.height], (POINTS, 2)) - camera.principal_point
    ) / camera.focal
    share = (rays[:, 0] - rays[:, 0].min()) / np.ptp(rays[:, 0])
    depth = 1 / ((1 - share) / NEAR + share / FAR)
    xyz = np.column_stack([rays, np.ones(POINTS)]) * depth[:, None]
    images = []
    for frame in frames:
        # To and fro, so that the points stay in view however long the clip is.
        along = 24 * np.sin(frame / 24)
        rotation = rotation_matrix(np.array([0.0002, -0.0003, 0.0001]) * along)
        centre = np.array([0.01, -0.002, 0.004]) * along
        seen = camera.project((xyz - centre) @ rotation.T)
        images.append(Image(frame, rotation, -rotation @ centre, seen, np.arange(POINTS, dtype=np.int32)))
    colours = np.full((POINTS, 3), 128, np.uint8)
    return Reconstruction((camera,), tuple(images), Points(xyz, colours, np.full(POINTS, 0.1)))


def write_video(folder: Path, count: int) -> Path:
    """The clip as H.264 with a tone, `clip.mp4` in the folder."""
    pictures = sorted(write_pictures(folder / "pictures", count).iterdir())
    tone, path = folder / "tone.wav", folder / "clip.mp4"
    encoding.write_sound(tone, encoding.ticking(count / RATE))
    with quiet(1):
        encoding.encode(pictures, path, RATE, tone)
    return path


def write_pictures(folder: Path, count: int, camera: Intrinsics = LENS) -> Path:
    """The clip as PNG, 0001.png and so on; the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for frame in range(1, count + 1):
        cv2.imwrite(str(folder / f"{frame:04d}.png"), picture(frame, camera))
    return folder


def write_masks(folder: Path, count: int) -> None:
    """A square that moves by itself, one picture a frame."""
    folder.mkdir(parents=True)
    for frame in range(1, count + 1):
        mask = np.zeros((LENS.height, LENS.width), np.uint8)
        mask[20:32, 30 + frame : 44 + frame] = 255
        cv2.imwrite(str(folder / f"{frame:04d}.png"), mask)


def write_depth(folder: Path, count: int) -> None:
    """The plane's inverse depth of every frame, 16 bits."""
    folder.mkdir(parents=True)
    share = np.linspace(0, 1, LENS.width)
    inverse = np.tile((1 - share) / NEAR + share / FAR, (LENS.height, 1))
    for frame in range(1, count + 1):
        cv2.imwrite(str(folder / f"{frame:04d}.png"), (inverse * 200_000).astype(np.uint16))


def write_floats(folder: Path, count: int) -> None:
    """The clip in scene linear floats."""
    folder.mkdir(parents=True)
    for frame in range(1, count + 1):
        cv2.imwrite(str(folder / f"{frame:04d}.tif"), (picture(frame) / np.float32(255)) ** np.float32(2.2))


def solve(clip: Path, work: Path, camera: Intrinsics = LENS) -> Path:
    """Put the truth into a working folder as if another program had solved the clip; the folder."""
    footage = open_footage(clip)
    model = truth(range(footage.frames[0], footage.frames[-1] + 1), camera)
    keep_import(Imported(model, "truth", ()), footage, work)
    return work


def write_walk(
    folder: Path,
    count: int = 12,
    path: float = 1.0,
    pan: float = 0.04,
    zoom: float = 0.0,
    distortion: float = 0.0,
    readout: float = 0.0,
) -> Path:
    """A clip that can be solved: three walls before a camera that goes to the side and turns a little.

    `path` is its length in the walls' unit, `pan` the angle in radians, `zoom` the relative change of the
    focal length; by `distortion` a corner's place is farther from the middle than it is seen, and `readout`
    is the time from the first row to the last, of the time from a frame to the next.
    """
    folder.mkdir(parents=True)
    width, height = 320, 240
    x, y = np.mgrid[:width, :height].T.reshape(-1, 2).T - [[(width - 1) / 2], [(height - 1) / 2]]
    bent = np.stack([x, y], axis=1) * (1 + distortion * (x * x + y * y) / (width**2 + height**2) * 4)[:, None]
    for frame, step in enumerate(np.linspace(-0.5, 0.5, count), 1):
        shown = np.zeros((height, width), np.float32)
        focal = 272.0 * (1 + zoom * step)
        lens = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])
        turned = cv2.Rodrigues(np.array([0.01 * step, pan * step, 0.0]))[0]
        centre = path * np.array([step, 0.2 * step * step, 0.1 * step])
        for depth, (left, right) in WALLS.items():
            rng = np.random.default_rng(int(depth))
            across, down = round((right - left) * 60), 1440
            wall = sum(
                cv2.resize(
                    rng.normal(0, 38, (down // s, across // s)), (across, down), interpolation=cv2.INTER_CUBIC
                )
                for s in (3, 8, 24)
            )
            from_texel = np.array([[1 / 60, 0, left], [0, 1 / 60, -12], [0, 0, 1]])
            plane = np.column_stack([np.eye(3)[:, :2], np.array([0, 0, depth]) - centre])
            seen = [
                cv2.warpPerspective(
                    each.astype(np.float32), lens @ turned @ plane @ from_texel, (width, height)
                )
                for each in (np.asarray(wall) + 128, np.ones((down, across)))
            ]
            shown += seen[1] * (seen[0] - shown)
        if distortion or readout:
            # The rows before and after the middle one are of a camera that has turned a little less, or more.
            late = pan / (count - 1) * readout * y / height
            rays = np.column_stack([bent / focal, np.ones(len(bent))])
            rays[:, 0], rays[:, 2] = rays[:, 0] - late, 1 + late * rays[:, 0]
            places = focal * rays[:, :2] / rays[:, 2:] + [(width - 1) / 2, (height - 1) / 2]
            grid = places.reshape(height, width, 2).astype(np.float32)
            shown = cv2.remap(shown, grid, None, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        cv2.imwrite(str(folder / f"{frame:04d}.png"), np.clip(shown, 0, 255).astype(np.uint8))
    return folder
