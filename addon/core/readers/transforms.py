"""transforms.json of nerfstudio, instant-ngp and many converters: cameras without points.

Matrices are camera-to-world, of cameras that look along -z with y up; the first pixel's centre is (0.5, 0.5).
Size, focal lengths, principal point and distortion are at the top for all frames, or in a single frame;
instant-ngp may give the angle of view instead, and no camera model. Layout: nerfstudio 1.1 (docs.nerf.studio,
"Data conventions", and its cameras.py), instant-ngp's docs/nerf_dataset_tips.md.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import UserError
from ..base.regular_file import open_regular, read_regular
from ..camera.reconstruction import Intrinsics
from .matching import Imported
from .parsing import wrong
from .poses import OPENGL, cameras, finite, lens

FORMAT = "transforms.json"
LONGEST = 2**30
"""Most bytes of a file."""
START = 2**16
"""Bytes read to recognise a file."""
FISHEYE, PERSPECTIVE = "OPENCV_FISHEYE", "OPENCV"
MODELS = {
    "": PERSPECTIVE, "SIMPLE_PINHOLE": PERSPECTIVE, "PINHOLE": PERSPECTIVE, "SIMPLE_RADIAL": PERSPECTIVE,
    "RADIAL": PERSPECTIVE, "OPENCV": PERSPECTIVE, "PERSPECTIVE": PERSPECTIVE,
    "OPENCV_FISHEYE": FISHEYE, "FISHEYE": FISHEYE,
}  # fmt: skip
"""Values of `camera_model` in COLMAP, nerfstudio and its converters."""


def recognises(path: Path) -> bool:
    """Return whether a file is JSON with frames and their matrices."""
    if path.suffix.lower() != ".json":
        return False
    try:
        with open_regular(path) as file:
            start = file.read(START)
    except OSError:
        return False
    return b'"frames"' in start or b'"transform_matrix"' in start


def read(path: Path, size: tuple[int, int]) -> Imported:
    """Read the cameras of a file; `size` is for files without one. See `Reader.read`."""
    whole = _contents(path)
    frames = whole.get("frames")
    if not isinstance(frames, list) or not frames or not all(isinstance(frame, dict) for frame in frames):
        raise wrong(path, "a list of frames")
    matrices, lenses, names = [], [], []
    for number, frame in enumerate(frames):
        place = f"{path}, frame {number}"
        rows = finite(frame.get("transform_matrix"), (-1, 4), place, "a transform_matrix of 4 x 4 numbers")
        if len(rows) not in (3, 4):
            raise wrong(place, f"a transform_matrix of 4 x 4 numbers, not of {len(rows)} rows")
        matrices.append(rows[:3])
        lenses.append(_lens(place, {**whole, **frame}, size))
        name = frame.get("file_path")
        if not isinstance(name, str):
            raise wrong(place, "a file_path")
        names.append(name)
    model = cameras(np.array(matrices), OPENGL, lenses, f"{path}, frame {{}}")
    return Imported(model, FORMAT, names=tuple(names))


def _contents(path: Path) -> dict[str, Any]:
    try:
        whole = json.loads(read_regular(path, LONGEST))
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise UserError(f"{path} is not JSON: {error}; export it again") from None
    if not isinstance(whole, dict):
        raise wrong(path, f"an object with frames, not {type(whole).__name__}")
    return whole


def _lens(place: str, said: Mapping[str, Any], size: tuple[int, int]) -> Intrinsics:
    def number(name: str, otherwise: float) -> float:
        value = said.get(name)
        return otherwise if value is None else float(finite(value, (), place, f"one number as {name}"))

    width, height = number("w", size[0]), number("h", size[1])
    across, down = number("camera_angle_x", 0), number("camera_angle_y", 0)
    fx = number("fl_x", width / 2 / np.tan(across / 2) if 0 < across < np.pi else 0)
    fy = number("fl_y", height / 2 / np.tan(down / 2) if 0 < down < np.pi else fx)
    if not fx > 0:
        raise wrong(place, "a focal length as fl_x, or camera_angle_x in radians")
    where = (fx, fy, number("cx", width / 2), number("cy", height / 2))
    k1, k2, k3, k4 = (number(name, 0) for name in ("k1", "k2", "k3", "k4"))
    p1, p2 = number("p1", 0), number("p2", 0)
    name = said.get("camera_model") or ""
    model = MODELS.get(name) if isinstance(name, str) else None
    if model is None:
        raise wrong(place, f"a camera_model that is one of {', '.join(filter(None, MODELS))}")
    if model == FISHEYE or said.get("is_fisheye") is True:
        return lens(place, FISHEYE, (width, height), (*where, k1, k2, k3, k4))
    if k4:
        raise wrong(place, "no k4 for a lens that is not a fisheye; undistort the pictures")
    if k3:
        return lens(place, "FULL_OPENCV", (width, height), (*where, k1, k2, p1, p2, k3, 0.0, 0.0, 0.0))
    return lens(place, PERSPECTIVE, (width, height), (*where, k1, k2, p1, p2))
