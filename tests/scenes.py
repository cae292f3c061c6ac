"""Small synthetic shots for tests: a textured slanted plane seen by known cameras."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from addon.core.base.arrays import LinearRGBA
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction, rotation_matrix
from addon.core.depth.source import SparseDepth
from addon.core.depth.user_depth import UserDepth
from addon.core.frame.clip_context import ClipContext, no_picture
from addon.core.frame.frame import Frame
from addon.core.frame.frame_path import mesh_frame
from addon.core.frame.plan import FrameOptions
from addon.core.frame.views import Views
from addon.core.media.clip import open_footage
from addon.core.warp.layer import Layer

if TYPE_CHECKING:
    from addon.scene.sources.shot import Shot

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
"""Of most small shots."""


def texture(width: int, height: int, seed: int = 0) -> np.ndarray:
    """(h, w, 3) uint8 smooth but detailed picture."""
    rng = np.random.default_rng(seed)
    layers = [cv2.resize(rng.random((max(2, height // s), max(2, width // s), 3)), (width, height),
                         interpolation=cv2.INTER_CUBIC) for s in (3, 8, 24)]  # fmt: skip
    mixed = 0.3 * layers[0] + 0.3 * layers[1] + 0.4 * layers[2]
    return np.clip(mixed * 255, 0, 255).astype(np.uint8)


def slanted_plane(
    camera: Intrinsics,
    frames: tuple[int, ...] = (1, 2, 3),
    near: float = 5.0,
    far: float = 12.0,
    count: int = 150,
) -> Reconstruction:
    """Points on a plane that recedes to the right, seen by cameras that drift sideways and turn a little."""
    rng = np.random.default_rng(3)
    seen = rng.uniform([0, 0], [camera.width, camera.height], (count, 2))
    rays = camera.undistort((seen - camera.principal_point) / camera.focal)
    # Inverse depth is affine in pinhole coordinates for a plane.
    low, high = rays[:, 0].min(), rays[:, 0].max()
    share = (rays[:, 0] - low) / (high - low)
    depth = 1 / ((1 - share) / near + share / far)
    xyz = np.column_stack([rays, np.ones(count)]) * depth[:, None]
    images = []
    for number, frame in enumerate(frames):
        rotation = rotation_matrix(np.array([0.004, -0.006, 0.01]) * number)
        centre = np.array([0.05 * number, -0.01 * number, 0.02 * number])
        local = (xyz - centre) @ rotation.T
        images.append(
            Image(
                frame, rotation, -rotation @ centre, camera.project(local), np.arange(count, dtype=np.int32)
            )
        )
    points = Points(xyz, np.full((count, 3), 128, np.uint8), np.full(count, 0.1))
    return Reconstruction((camera,), tuple(images), points)


def write_frames(folder: Path, camera: Intrinsics, frames: tuple[int, ...] = (1, 2, 3)) -> Path:
    """A PNG sequence with one picture for all frames; what is in it does not matter to most tests."""
    folder.mkdir(parents=True, exist_ok=True)
    for frame in frames:
        cv2.imwrite(str(folder / f"clip_{frame:04d}.png"), texture(camera.width, camera.height)[..., ::-1])
    return folder


def write_plane(folder: Path, plane: Reconstruction) -> Path:
    """A PNG sequence of what the cameras of `slanted_plane` see, for those who look at its depth."""
    folder.mkdir(parents=True, exist_ok=True)
    for image in plane.images:
        picture = plane_picture(plane, image)
        cv2.imwrite(str(folder / f"clip_{image.frame:04d}.png"), picture[..., ::-1])
    return folder


def plane_picture(plane: Reconstruction, image: Image) -> np.ndarray:
    """(h, w, 3) uint8 what a camera sees of `slanted_plane`, on which a picture repeats, mirrored."""
    (camera,), xyz = plane.cameras, plane.points.xyz
    size = camera.width, camera.height
    matrix = np.array([[camera.fx, 0, camera.cx - 0.5], [0, camera.fy, camera.cy - 0.5], [0, 0, 1]])
    # n X = 1 on the plane; the first camera is at the origin.
    normal = np.linalg.lstsq(xyz, np.ones(len(xyz)), rcond=None)[0]
    moved = matrix @ (image.rotation + np.outer(image.translation, normal)) @ np.linalg.inv(matrix)
    return np.asarray(cv2.warpPerspective(texture(*size), moved, size, borderMode=cv2.BORDER_REFLECT))


def slanted_shot(folder: Path, camera: Intrinsics, frames: tuple[int, ...] = (1, 2, 3)) -> Shot:
    """Footage and reconstruction of the slanted plane."""
    # Blender is loaded for it: other helpers here do without.
    from addon.scene.sources.shot import Shot

    return Shot(open_footage(write_frames(folder, camera, frames)), slanted_plane(camera, frames))


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    """Peak signal to noise ratio in dB of values in [0, 1]."""
    error = float(np.mean((np.clip(a, 0, 1) - np.clip(b, 0, 1)) ** 2))
    return float("inf") if error == 0 else -10 * np.log10(error)


def planned(
    reconstruction: Reconstruction,
    frame: int,
    settings: FrameOptions,
    size: tuple[int, int],
    depth: UserDepth | None = None,
    picture: LinearRGBA | None = None,
) -> Frame:
    """A frame with its views, whose depth is that of features or the user's maps; `picture` (H, W, 4)."""
    if settings.method == "layers":
        settings = replace(settings, method="features")
    blank = np.zeros((size[1], size[0], 4), np.float32)
    clip = ClipContext(reconstruction, no_picture, depth or SparseDepth(reconstruction))
    return mesh_frame(clip, frame, settings, size, blank if picture is None else picture).through()


def painted(frame: Frame, picture: LinearRGBA) -> tuple[Views, tuple[Layer, ...]]:
    """The views of a frame, and its mesh with another picture (h, w, 4), as they are drawn."""
    (layer,) = frame.layers
    return frame.views, (replace(layer, picture=picture),)
