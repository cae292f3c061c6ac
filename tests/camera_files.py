"""A clip of planes whose cameras are known, and these as other programs write them, without points."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from addon.core.camera.reconstruction import (
    Image,
    Intrinsics,
    Points,
    Reconstruction,
    quaternion_from_matrix,
    rotation_matrix,
)
from addon.core.readers.colmap_export import write_model

from . import planes

OPENGL = np.diag([1.0, -1.0, -1.0])
"""From a camera that looks along -z with y up to one that looks along +z with y down."""
SHIFT = (14.0, -9.0)
"""Pixels of the principal point from the middle of the picture: a mirrored one is not the same."""
COUNT = 12
NAMES = tuple(f"shot_{frame:04d}.png" for frame in range(1, COUNT + 1))


def camera() -> Intrinsics:
    """The lens of the clip."""
    cx, cy = planes.WIDTH / 2 + SHIFT[0], planes.HEIGHT / 2 + SHIFT[1]
    return Intrinsics(*planes.SIZE, planes.FOCAL, planes.FOCAL, cx, cy)


def model(world: np.ndarray | None = None, scale: float = 1.0) -> Reconstruction:
    """The true cameras: they go to the side, up and ahead, turning about all axes; frames from 1.

    `world` (3, 3) turns the world, `scale` is its unit: the pictures are the same.
    """
    turned = np.eye(3) if world is None else world
    images = []
    for number, step in enumerate(np.linspace(-0.5, 0.5, COUNT), 1):
        centre = np.array([step, 0.2 * step * step, 0.5 * step])
        rotation = rotation_matrix(np.array([0.05 * step, 0.08 * step, 0.1 * step]))
        images.append(
            Image(
                number, rotation @ turned.T, -scale * rotation @ centre, np.zeros((0, 2)),
                np.zeros(0, np.int32),
            )
        )  # fmt: skip
    points = Points(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0))
    return Reconstruction((camera(),), tuple(images), points)


def write_clip(folder: Path) -> Path:
    """What these cameras see of the planes, as PNGs from frame 1 on."""
    pictures = [
        planes.view(image.centre, cv2.Rodrigues(image.rotation)[0].ravel(), shift=SHIFT)
        for image in model().images
    ]
    return planes.write_clip(folder, pictures)


def to_world(known: Reconstruction, axes: np.ndarray | None = None) -> np.ndarray:
    """(n, 4, 4) camera-to-world matrices of cameras with other `axes`."""
    matrices = np.tile(np.eye(4), (len(known.images), 1, 1))
    for matrix, image in zip(matrices, known.images, strict=True):
        matrix[:3, :3], matrix[:3, 3] = image.rotation.T, image.centre
        matrix[:3, :3] @= np.eye(3) if axes is None else axes
    return matrices


def transforms(path: Path, known: Reconstruction, names: tuple[str, ...] = NAMES, **said: object) -> Path:
    """nerfstudio's transforms.json."""
    lens = known.cameras[0]
    frames = [
        {"file_path": f"images/{name}", "transform_matrix": matrix.tolist()}
        for name, matrix in zip(names, to_world(known, OPENGL), strict=True)
    ]
    top = {
        "w": lens.width, "h": lens.height, "fl_x": lens.fx, "fl_y": lens.fy, "cx": lens.cx, "cy": lens.cy,
        "k1": lens.k1, "k2": lens.k2, "p1": lens.p1, "p2": lens.p2, "camera_model": "OPENCV",
        "applied_transform": np.eye(4)[:3].tolist(),
    }  # fmt: skip
    path.write_text(json.dumps({**top, **said, "frames": frames}, indent=4))
    return path


def colmap(folder: Path, known: Reconstruction) -> Path:
    """A text model as ViPE's converter writes it: no image has features, and there are no points."""
    folder.mkdir()
    write_model(folder, known, {image.frame: NAMES[image.frame - 1] for image in known.images})
    return folder


def bundler(folder: Path, known: Reconstruction) -> Path:
    """bundle.out without a point, and its list of pictures."""
    folder.mkdir()
    lines = ["# Bundle file v0.3", f"{len(known.images)} 0"]
    for image in known.images:
        rows = [*(OPENGL @ image.rotation), OPENGL @ image.translation]
        lines += [f"{known.cameras[0].fx!r} 0 0", *(" ".join(map(repr, row.tolist())) for row in rows)]
    (folder / "bundle.out").write_text("\n".join(lines) + "\n")
    (folder / "list.txt").write_text("\n".join(NAMES) + "\n")
    return folder / "bundle.out"


def _matrix(lens: Intrinsics) -> np.ndarray:
    """(3, 3), pixels from the centre of the first one."""
    return np.array([[lens.fx, 0, lens.cx - 0.5], [0, lens.fy, lens.cy - 0.5], [0, 0, 1]])


def megasam(path: Path, known: Reconstruction) -> Path:
    """NAME_sgd_cvd_hr.npz: pictures scaled to the area of 512 x 384 and cut to multiples of 8."""
    lens = known.cameras[0]
    scale = np.sqrt(384 * 512 / (lens.width * lens.height))
    width, height = int(lens.width * scale), int(lens.height * scale)
    shape = (len(known.images), height - height % 8, width - width % 8)
    scaled = lens.scaled(width, height)
    np.savez(
        path, images=np.zeros((*shape, 3), np.uint8), depths=np.ones(shape, np.float16),
        intrinsic=_matrix(scaled).astype(np.float32), cam_c2w=to_world(known).astype(np.float32),
    )  # fmt: skip
    return path


def vipe(folder: Path, known: Reconstruction, name: str = "shot") -> Path:
    """The folder of ViPE's results, without the pictures."""
    frames = np.arange(len(known.images))
    lens = known.cameras[0]
    row = [lens.fx, lens.fy, lens.cx - 0.5, lens.cy - 0.5]
    for kind in ("pose", "intrinsics"):
        (folder / kind).mkdir(parents=True)
    np.savez(folder / "pose" / f"{name}.npz", data=to_world(known).astype(np.float32), inds=frames)
    np.savez(
        folder / "intrinsics" / f"{name}.npz", data=np.tile(row, (len(frames), 1)).astype(np.float32),
        inds=frames,
    )  # fmt: skip
    lines = "".join(f"{frame}: PINHOLE\n" for frame in frames)
    (folder / "intrinsics" / f"{name}_camera.txt").write_text(lines)
    return folder


def depth_anything(path: Path, known: Reconstruction) -> Path:
    """results.npz, whose poses are world to camera."""
    lens, count = known.cameras[0].scaled(504, 378), len(known.images)
    np.savez(
        path, depth=np.ones((count, 378, 504), np.float32), conf=np.ones((count, 378, 504), np.float32),
        extrinsics=np.linalg.inv(to_world(known))[:, :3].astype(np.float32),
        intrinsics=np.tile(_matrix(lens), (count, 1, 1)).astype(np.float32),
    )  # fmt: skip
    return path


def _quaternion(matrix: np.ndarray) -> list[float]:
    """x, y, z, w"""
    w, x, y, z = quaternion_from_matrix(matrix).tolist()
    return [x, y, z, w]


def record3d(path: Path, known: Reconstruction, clip: Path) -> Path:
    """An .r3d of a clip's pictures; depth is bytes that nobody can read."""
    lens, matrices = known.cameras[0], to_world(known, OPENGL)
    poses = [[*_quaternion(each[:3, :3]), *each[:3, 3].tolist()] for each in matrices]
    said = {
        "w": lens.width, "h": lens.height, "dw": 192, "dh": 256, "fps": 60,
        "K": [lens.fx, 0, 0, 0, lens.fy, 0, lens.cx, lens.cy, 1], "poses": poses, "initPose": poses[0],
        "perFrameIntrinsicCoeffs": [[lens.fx, lens.fy, lens.cx, lens.cy]] * len(poses),
        "frameTimestamps": [number / 60 for number in range(len(poses))], "cameraType": 1,
    }  # fmt: skip
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("metadata", json.dumps(said))
        for number, file in enumerate(sorted(clip.iterdir())):
            done, packed = cv2.imencode(".jpg", cv2.imread(str(file)), [cv2.IMWRITE_JPEG_QUALITY, 98])
            assert done
            archive.writestr(f"rgbd/{number}.jpg", packed.tobytes())
            archive.writestr(f"rgbd/{number}.depth", b"bvx2")
            archive.writestr(f"rgbd/{number}.conf", b"bvx2")
    return path


def stray(folder: Path, known: Reconstruction, clip: Path) -> Path:
    """Stray Scanner's folder, its video of a clip's pictures without loss, its depth the planes'."""
    import av

    folder.mkdir()
    lens = known.cameras[0]
    rows = ["timestamp, frame, x, y, z, qx, qy, qz, qw"]
    for number, matrix in enumerate(to_world(known)):
        values = [number / 30, *matrix[:3, 3].tolist(), *_quaternion(matrix[:3, :3])]
        rows.append(f"{values[0]!r}, {number:06d}, " + ", ".join(map(repr, values[1:])))
    (folder / "odometry.csv").write_text("\n".join(rows) + "\n")
    table = [[lens.fx, 0.0, lens.cx], [0.0, lens.fy, lens.cy], [0.0, 0.0, 1.0]]
    (folder / "camera_matrix.csv").write_text("\n".join(", ".join(map(repr, row)) for row in table))
    with av.open(str(folder / "rgb.mp4"), "w") as movie:
        stream = movie.add_stream("libx264rgb", rate=30, options={"crf": "0"})
        stream.width, stream.height, stream.pix_fmt = lens.width, lens.height, "rgb24"
        for file in sorted(clip.iterdir()):
            picture = cv2.cvtColor(cv2.imread(str(file)), cv2.COLOR_BGR2RGB)
            movie.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        movie.mux(stream.encode())
    for kind in ("depth", "confidence"):
        (folder / kind).mkdir()
    for number in range(len(known.images)):
        metres = np.full((192, 256), 4000, np.uint16)
        metres[:20] = 0
        sure = np.full((192, 256), 2, np.uint8)
        sure[:, :64], sure[:, 64:128] = 0, 1
        cv2.imwrite(str(folder / "depth" / f"{number:06d}.png"), metres)
        cv2.imwrite(str(folder / "confidence" / f"{number:06d}.png"), sure)
    return folder


def packed(arrays: dict[str, np.ndarray]) -> bytes:
    """An .npz of arrays."""
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


def middled(known: Reconstruction) -> Reconstruction:
    """The cameras with the principal point in the middle, which is all that some formats can say."""
    lens = known.cameras[0]
    return replace(known, cameras=(replace(lens, cx=lens.width / 2, cy=lens.height / 2),))
