"""Stray Scanner's folder: a phone's video with ARKit's poses, in metres, and the depth of its LiDAR.

rgb.mp4; odometry.csv with a line of names (timestamp, frame, x, y, z, qx, qy, qz, qw, and of newer versions
fx, fy, cx, cy); camera_matrix.csv (3 x 3), of the video's pixels; depth/000000.png, millimetres of 256 x 192;
confidence/000000.png, 0 to 2. The app turns ARKit's cameras so that they look along +z with y down
(`OdometryEncoder.swift` of strayrobots/scanner: q_WA * q_AC). Older versions write no line of names and
neither timestamp nor frame.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np

from ..base.arrays import Floats
from ..base.atomic import PART, collect_orphans, owned
from ..base.errors import UserError
from ..base.numbers import LARGEST, reals
from ..base.regular_file import is_regular, read_regular
from .imported_model import ImportedModel
from .poses import OPENCV, cameras, finite, lens, to_world

FORMAT = "Stray Scanner"
ODOMETRY, MATRIX, VIDEO = "odometry.csv", "camera_matrix.csv", "rgb.mp4"
OLD = ("x", "y", "z", "qx", "qy", "qz", "qw")
MOST = 2**28
"""Bytes of a table."""
SURE = 2
"""The highest of the phone's levels of confidence."""
ENOUGH = 0.5
"""Confidence of depth that is taken for depth: the phone's "medium". As StrayVisualizer has it."""
DIGITS = 3
"""Digits of a pixel in lenses of frames: the phone's focus changes them all the time."""


def recognises(path: Path) -> bool:
    """Return whether a folder is such a recording."""
    return is_regular(path / ODOMETRY) and is_regular(path / MATRIX)


def clip(path: Path) -> Path:
    """The recording's own clip; UserError where it is gone."""
    if not is_regular(path / VIDEO):
        raise UserError(f"{path / VIDEO} is missing; a recording of Stray Scanner has its video beside it")
    return path / VIDEO


def read(path: Path, size: tuple[int, int]) -> ImportedModel:
    """The cameras of a recording whose video has a size (width, height) in pixels.

    UserError naming the line that is not what was expected.
    """
    columns, table = _table(path / ODOMETRY)
    at = {name: table[:, column] for column, name in enumerate(columns)}
    if missing := [name for name in OLD if name not in at]:
        raise UserError(f"{path / ODOMETRY}, line 1: expected a column {missing[0]}")
    place = f"{path / ODOMETRY}, pose {{}}"
    poses = to_world(
        np.stack([at[name] for name in OLD[3:]], axis=1), np.stack([at[name] for name in OLD[:3]], axis=1),
        path / ODOMETRY,
    )  # fmt: skip
    numbers = at.get("frame", np.arange(len(table))).astype(int)
    own = [name for name in ("fx", "fy", "cx", "cy") if name in at and np.isfinite(at[name]).all()]
    if len(own) == 4:
        values = np.round(np.stack([at[name] for name in own], axis=1), DIGITS)
    else:
        _, rows = _table(path / MATRIX)
        matrix = finite(rows, (3, 3), str(path / MATRIX), "3 x 3 numbers")
        values = np.tile(matrix[[0, 1, 0, 1], [0, 1, 2, 2]], (len(table), 1))
    lenses = [lens(place.format(row), "PINHOLE", size, each) for row, each in enumerate(values)]
    model = cameras(poses, OPENCV, lenses, place)
    return ImportedModel(FORMAT, model, tuple(str(number) for number in numbers.tolist()))


def depth(path: Path, frame: int) -> tuple[Floats, Floats] | None:
    """Return the LiDAR's depth of a frame, counted from 0; None without a file.

    Returns:
        Metres (h, w), NaN in unknown pixels, and confidence (h, w) from 0 to 1.

    Raises:
        UserError: The file is damaged.
    """
    file, sure = (path / folder / f"{frame:06d}.png" for folder in ("depth", "confidence"))
    if not is_regular(file):
        return None
    millimetres = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
    if millimetres is None or millimetres.ndim != 2 or millimetres.dtype != np.uint16:
        raise UserError(f"{file}: expected a gray picture of 16 bits, millimetres")
    metres = np.where(millimetres > 0, millimetres / 1000.0, np.nan)
    level = cv2.imread(str(sure), cv2.IMREAD_UNCHANGED) if is_regular(sure) else np.full(metres.shape, SURE)
    if level is None or level.shape != metres.shape:
        raise UserError(f"{sure}: expected a gray picture of {metres.shape[1]}x{metres.shape[0]}")
    return metres, np.where(np.isfinite(metres), np.clip(level / SURE, 0, 1), 0.0)


def write_depth(path: Path, folder: Path) -> Path | None:
    """Write the LiDAR's depth as maps of the recording's clip, unless they are there.

    They are 16-bit PNG in millimetres, 0 where confidence is below the middle.

    Returns:
        The folder; None without depth.

    Raises:
        UserError: It cannot be written.
    """
    measured = sorted(int(file.stem) for file in (path / "depth").glob("*.png") if file.stem.isdecimal())
    if folder.exists() or not measured:
        return folder if folder.exists() else None
    collect_orphans(folder.parent)
    try:
        with owned(folder.parent, PART) as name:
            part = folder.with_name(f"{name}-{folder.name}")
            try:
                part.mkdir()
                for frame in measured:
                    metres, confidence = depth(path, frame) or (np.zeros((1, 1)), np.zeros((1, 1)))
                    sure = np.where(confidence >= ENOUGH, metres * 1000, 0).round().astype(np.uint16)
                    # Maps are numbered as the video's frames are, from 1.
                    (part / f"{frame + 1:06d}.png").write_bytes(cv2.imencode(".png", sure)[1].tobytes())
                part.rename(folder)
            finally:
                shutil.rmtree(part, ignore_errors=True)
    except OSError as error:
        raise UserError(f"{folder} cannot be written: {error.strerror}") from None
    return folder


def _table(path: Path) -> tuple[list[str], Floats]:
    """The names of a table's columns and its numbers (rows, columns), NaN where a cell is empty."""
    try:
        text = read_regular(path, MOST)
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror}") from None
    lines = [line for line in enumerate(text.splitlines(), 1) if line[1].strip()]
    names = list(OLD)
    if lines and b"x" in lines[0][1]:
        names = [name.strip().decode(errors="replace") for name in lines.pop(0)[1].split(b",")]
    rows = []
    for number, line in lines:
        try:
            rows.append(reals([word.strip() or b"nan" for word in line.split(b",")]))
        except ValueError:
            raise UserError(f"{path}, line {number}: expected numbers with commas between") from None
        if len(rows[-1]) != len(rows[0]):
            raise UserError(f"{path}, line {number}: expected {len(rows[0])} numbers, not {len(rows[-1])}")
    if not rows:
        raise UserError(f"{path} has no numbers; record again")
    table = np.array(rows)
    if np.any(np.abs(table) > LARGEST):
        raise UserError(f"{path}: expected numbers up to {LARGEST:g}")
    return names[: table.shape[1]], table
