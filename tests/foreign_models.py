"""A small solve whose every number is known, written by hand in the formats of other programs."""

from __future__ import annotations

import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from addon.core.camera.reconstruction import (
    Image,
    Intrinsics,
    Points,
    Reconstruction,
    quaternion_from_matrix,
    rotation_matrix,
)
from addon.core.media.clip import Footage

from .scenes import write_frames

SIZE = (96, 64)
LENS = Intrinsics(*SIZE, 80.0, 80.0, 48.0, 32.0)
FLIP = np.diag([1.0, -1.0, -1.0])
NAMES = ("shot_0001.png", "shot_0002.png", "shot_0003.png", "shot_0004.png")


def world(camera: Intrinsics = LENS, images: int = 4, points: int = 12) -> Reconstruction:
    """Cameras side by side, somewhat turned, each of which sees all points but one; `Image.frame` from 0."""
    random = np.random.default_rng(11)
    rays = random.uniform([-0.4, -0.28, 1], [0.4, 0.28, 1], (points, 3))
    xyz = rays * random.uniform(4, 8, (points, 1)) + [0.3, 0.1, 0.0]
    made = []
    for index in range(images):
        rotation = rotation_matrix(random.normal(0, 0.02, 3))
        centre = np.array([0.2 * index, 0.05 * index**2, 0.1])
        bare = Image(index, rotation, -rotation @ centre, np.zeros((0, 2)), np.zeros(0, dtype=np.int32))
        seen = np.delete(np.arange(points, dtype=np.int32), index)
        made.append(replace(bare, xy=camera.project(bare.to_camera(xyz[seen])), points=seen))
    rgb = random.integers(0, 256, (points, 3)).astype(np.uint8)
    return Reconstruction((camera,), tuple(made), Points(xyz, rgb, np.zeros(points)))


def footage(
    names: tuple[str, ...] = NAMES, folder: str = "/clips/shot", size: tuple[int, int] = SIZE
) -> Footage:
    """A clip of files that nobody opens, numbered from 1."""
    files = tuple(Path(folder) / name for name in names)
    return Footage(Path(folder), tuple(range(1, len(names) + 1)), *size, 24.0, files)


def video(frames: int = 4, size: tuple[int, int] = SIZE) -> Footage:
    return Footage(Path("/clips/shot.mp4"), tuple(range(1, frames + 1)), *size, 24.0)


def views(model: Reconstruction) -> list[list[tuple[int, float, float]]]:
    """For each point the image, x and y of its views."""
    seen: list[list[tuple[int, float, float]]] = [[] for _ in range(len(model.points))]
    for image in model.images:
        for point, (x, y) in zip(image.points.tolist(), image.xy.tolist(), strict=True):
            seen[point].append((image.frame, x, y))
    return seen


def row(values: NDArray[np.float64] | list[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def bundler(
    model: Reconstruction, header: str = "# Bundle file v0.3\n", missing: tuple[int, ...] = ()
) -> str:
    """Version 0.3; `missing` cameras are written as Bundler writes those that it did not register."""
    lines = [f"{len(model.images)} {len(model.points)}"]
    for image in model.images:
        camera = model.cameras[image.camera]
        if image.frame in missing:
            lines += ["0 0 0"] * 5
            continue
        rotation, translation = FLIP @ image.rotation, FLIP @ image.translation
        lines += [row([camera.fx, camera.k1, camera.k2]), *map(row, rotation), row(translation)]
    for xyz, rgb, seen in zip(model.points.xyz, model.points.rgb, views(model), strict=True):
        observations = [
            f"{image} 7 {row([x - camera.width / 2, camera.height / 2 - y])}"
            for image, x, y in seen if image not in missing
        ]  # fmt: skip
        lines += [row(xyz), " ".join(map(str, rgb)), " ".join([str(len(observations)), *observations])]
    return header + "\n".join(lines) + "\n"


def nvm(
    model: Reconstruction,
    names: tuple[str, ...] = NAMES,
    radial: float = 0.0,
    origin: tuple[float, float] = (0.0, 0.0),
    header: str = "NVM_V3\n\n",
    tail: str = "\n0\n",
) -> str:
    """Features are written relative to `origin`; `radial` as it is."""
    lines = [str(len(model.images))]
    for image, name in zip(model.images, names, strict=True):
        camera = model.cameras[image.camera]
        pose = [*quaternion_from_matrix(image.rotation) * 2, *image.centre]
        lines.append(f"{name}\t{row([camera.fx, *pose, radial])} 0")
    lines += ["", str(len(model.points))]
    for xyz, rgb, seen in zip(model.points.xyz, model.points.rgb, views(model), strict=True):
        observations = [f"{image} 7 {row([x - origin[0], y - origin[1]])}" for image, x, y in seen]
        lines.append(" ".join([row(xyz), *map(str, rgb), str(len(observations)), *observations]))
    return header + "\n".join(lines) + tail


def voodoo(model: Reconstruction, k3: float = 0.0, k5: float = 0.0, first: int = 0, sx: float = 0.01) -> str:
    """With CRLF, a blank line first and tabs at the ends, as the program writes it."""
    lines = ["", "# Text export ", "# The camera (one line per frame) ", "#"]
    for image in model.images:
        camera = model.cameras[image.camera]
        focal = camera.fx * sx
        offset = camera.principal_point - [camera.width / 2, camera.height / 2]
        across, down, axis = image.rotation
        values = [
            *image.centre, *axis, *(camera.fx * across + offset[0] * axis),
            *(camera.fy * down + offset[1] * axis), k3, k5, sx, focal / camera.fy,
            camera.width, camera.height,
            *offset, focal, np.degrees(2 * np.arctan(camera.width / 2 / camera.fx)), *across, *down,
        ]  # fmt: skip
        lines += [f"#timeindex {image.frame + first}", row(values).replace(" ", "\t") + "\t"]
    lines += ["#", "# 3D Feature Points", "# X\t\tY\t\tZ"]
    lines += [row(xyz).replace(" ", "\t\t") for xyz in model.points.xyz]
    return "\r\n".join([*lines, "", "", ""])


def colmap_text(model: Reconstruction, names: tuple[str, ...] = NAMES) -> dict[str, str]:
    """The three files of a text model."""
    camera = model.cameras[0]
    images = []
    for image, name in zip(model.images, names, strict=True):
        images.append(
            f"{image.frame + 1} {row([*quaternion_from_matrix(image.rotation), *image.translation])} 1 {name}"
        )
        places = zip(image.xy, image.points, strict=True)
        images.append(" ".join(f"{row(xy)} {point + 1}" for xy, point in places))
    points = []
    for index, (xyz, rgb) in enumerate(zip(model.points.xyz, model.points.rgb, strict=True)):
        track = " ".join(f"{image + 1} {at}" for image, at in _track(model, index))
        points.append(f"{index + 1} {row(xyz)} {' '.join(map(str, rgb))} 0.5 {track}")
    parameters = row([*camera.focal, camera.cx, camera.cy])
    return {
        "cameras.txt": f"# cameras\n1 PINHOLE {camera.width} {camera.height} {parameters}\n",
        "images.txt": "# images\n" + "\n".join(images) + "\n",
        "points3D.txt": "# points\n" + "\n".join(points) + "\n",
    }


def colmap_binary(model: Reconstruction, names: tuple[str, ...] = NAMES) -> dict[str, bytes]:
    """The three files of a binary model."""
    camera = model.cameras[0]
    cameras = struct.pack(
        "<QIiQQ4d", 1, 1, 1, camera.width, camera.height, *camera.focal, camera.cx, camera.cy
    )
    images = struct.pack("<Q", len(model.images))
    for image, name in zip(model.images, names, strict=True):
        pose = [*quaternion_from_matrix(image.rotation), *image.translation]
        images += struct.pack("<I7dI", image.frame + 1, *pose, 1) + name.encode() + b"\0"
        images += struct.pack("<Q", len(image.points))
        for (x, y), point in zip(image.xy, image.points, strict=True):
            images += struct.pack("<ddQ", x, y, point + 1)
    points = struct.pack("<Q", len(model.points))
    for index, (xyz, rgb) in enumerate(zip(model.points.xyz, model.points.rgb, strict=True)):
        track = _track(model, index)
        points += struct.pack("<Q3d3BdQ", index + 1, *xyz, *rgb.tolist(), 0.5, len(track))
        for image_index, at in track:
            points += struct.pack("<II", image_index + 1, at)
    return {"cameras.bin": cameras, "images.bin": images, "points3D.bin": points}


def _track(model: Reconstruction, point: int) -> list[tuple[int, int]]:
    return [
        (image.frame, int(np.flatnonzero(image.points == point)[0]))
        for image in model.images if point in image.points
    ]  # fmt: skip


def write_clip(folder: Path) -> Path:
    """PNGs of the size and with the names of `world`."""
    write_frames(folder, LENS, (1, 2, 3, 4))
    for path in sorted(folder.iterdir()):
        path.rename(path.with_name(path.name.replace("clip", "shot")))
    return folder


def write_model(folder: Path, points: int = 12) -> Path:
    """`world` as COLMAP text."""
    folder.mkdir(parents=True)
    for name, text in colmap_text(world(points=points)).items():
        (folder / name).write_text(text)
    return folder


def assert_same(after: Reconstruction, before: Reconstruction) -> None:
    """Equal to the bit but for rotations, which go through quaternions."""
    assert after.cameras == before.cameras
    for name in ("xyz", "rgb", "error"):
        np.testing.assert_array_equal(getattr(after.points, name), getattr(before.points, name))
    for old, new in zip(before.images, after.images, strict=True):
        assert (new.frame, new.camera) == (old.frame, old.camera)
        np.testing.assert_array_equal(new.xy, old.xy)
        np.testing.assert_array_equal(new.points, old.points)
        assert new.points.dtype == np.int32
        np.testing.assert_array_equal(new.translation, old.translation)
        np.testing.assert_allclose(new.rotation, old.rotation, atol=1e-15)
