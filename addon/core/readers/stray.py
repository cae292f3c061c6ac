"""Stray Scanner's folder: a phone's video with ARKit's poses in metres and the depth of its LiDAR.

rgb.mp4; odometry.csv with a header (timestamp, frame, x, y, z, qx, qy, qz, qw, in newer versions also fx, fy,
cx, cy); camera_matrix.csv (3 x 3) in the video's pixels; depth/000000.png, millimetres at 256 x 192;
confidence/000000.png, 0 to 2. The app turns ARKit's cameras to look along +z with y down
(`OdometryEncoder.swift` of strayrobots/scanner: q_WA * q_AC). Older versions write no header, timestamp and
frame.
"""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.atomic import staged_folder
from ..base.errors import UserError
from ..base.numbers import LARGEST, reals
from ..base.regular_file import is_regular, read_regular
from .matching import Imported
from .parsing import wrong
from .poses import DIGITS, OPENCV, cameras, finite, lens, to_world

FORMAT = "Stray Scanner"
ODOMETRY, MATRIX, VIDEO = "odometry.csv", "camera_matrix.csv", "rgb.mp4"
OLD = ("x", "y", "z", "qx", "qy", "qz", "qw")
MOST = 2**28
"""Most bytes of a table."""
MEDIUM = 1
"""Least level of confidence of valid depth, of 0 to 2, as in StrayVisualizer."""


def recognises(path: Path) -> bool:
    """Return whether a folder is a Stray Scanner recording."""
    return is_regular(path / ODOMETRY) and is_regular(path / MATRIX)


def clip(path: Path) -> Path:
    """Return the recording's video; raises UserError if it is missing."""
    if not is_regular(path / VIDEO):
        raise UserError(f"{path / VIDEO} is missing; a recording of Stray Scanner has its video beside it")
    return path / VIDEO


def read(path: Path, size: tuple[int, int]) -> Imported:
    """Read the cameras of a recording with a video of `size`; see `Reader.read`."""
    columns, table = _table(path / ODOMETRY)
    at = {name: table[:, column] for column, name in enumerate(columns)}
    if missing := [name for name in OLD if name not in at]:
        raise wrong(f"{path / ODOMETRY}, line 1", f"a column {missing[0]}")
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
    return Imported(model, FORMAT, names=tuple(str(number) for number in numbers.tolist()))


def write_depth(path: Path, folder: Path) -> Path | None:
    """Write the LiDAR's depth as maps of the clip, 16-bit PNG in mm, 0 for low confidence.

    Returns the folder, unchanged if it exists, or None without measurements. Raises UserError if it cannot be
    written, or a measurement is damaged.
    """
    measured = [file for file in (path / "depth").glob("*.png") if file.stem.isdecimal() and is_regular(file)]
    if folder.exists() or not measured:
        return folder if folder.exists() else None
    try:
        with staged_folder(folder) as part:
            for file in measured:
                data = cv2.imencode(".png", _millimetres(file))[1].tobytes()
                # Maps are numbered from 1, as the video's frames are.
                (part / f"{int(file.stem) + 1:06d}.png").write_bytes(data)
    except OSError as error:
        raise UserError(f"{folder} cannot be written: {error.strerror}") from None
    return folder


def _millimetres(file: Path) -> NDArray[np.uint16]:
    """(h, w) of a picture of depth, 0 where it is unmeasured or the phone was not sure."""
    sure = file.parents[1] / "confidence" / file.name
    depth = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
    if depth is None or depth.ndim != 2 or depth.dtype != np.uint16:
        raise wrong(file, "a gray picture of 16 bits, in millimeters")
    level = cv2.imread(str(sure), cv2.IMREAD_UNCHANGED) if is_regular(sure) else np.full(depth.shape, MEDIUM)
    if level is None or level.shape != depth.shape:
        raise wrong(sure, f"a gray picture of {depth.shape[1]}x{depth.shape[0]}")
    return np.where(level >= MEDIUM, depth, np.uint16(0))


def _table(path: Path) -> tuple[list[str], Floats]:
    """Read a table's column names and numbers (rows, columns), NaN for empty cells."""
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
            raise wrong(f"{path}, line {number}", "numbers with commas between") from None
        if len(rows[-1]) != len(rows[0]):
            raise wrong(f"{path}, line {number}", f"{len(rows[0])} numbers, not {len(rows[-1])}")
    if not rows:
        raise UserError(f"{path} has no numbers; record again")
    table = np.array(rows)
    if np.any(np.abs(table) > LARGEST):
        raise wrong(path, f"numbers up to {LARGEST:g}")
    return names[: table.shape[1]], table
