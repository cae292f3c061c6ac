"""Record3D's .r3d: an archive of a phone's pictures with ARKit's poses in metres.

A zip with `metadata` (JSON) and rgbd/0.jpg, 0.depth, 0.conf and so on. The metadata has, for pictures of w x
h, K (3 x 3, column by column) and, in newer versions, perFrameIntrinsicCoeffs (fx, fy, cx, cy). Poses are qx,
qy, qz, qw, x, y, z, camera to world, of cameras that look along -z with y up (`record3d_utils.py` of
nerfstudio 1.1). Depth and confidence are packed as LZFSE, for which there is no decoder here, and are
ignored.
"""

import json
import re
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from ..base.atomic import staged_folder
from ..base.counting import counted
from ..base.errors import UserError
from ..base.regular_file import open_regular
from ..media.sequence import is_litter
from .matching import Imported
from .parsing import wrong
from .poses import DIGITS, OPENGL, cameras, finite, lens, to_world

FORMAT = "Record3D"
METADATA = "metadata"
PICTURE = re.compile(r"rgbd/(\d{1,9})\.(jpg|jpeg|png)")
MOST_METADATA, MOST_PICTURE = 2**28, 2**27
"""Bytes."""
NO_DEPTH = "the recording's depth is packed as LZFSE, which cannot be read here: poses and pictures are taken"
_DAMAGED = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, KeyError)


def recognises(path: Path) -> bool:
    """Return whether a file is a Record3D archive."""
    try:
        with open_regular(path) as file, zipfile.ZipFile(file) as archive:
            names = archive.namelist()
    except (OSError, ValueError, *_DAMAGED):
        return False
    return METADATA in names and any(PICTURE.fullmatch(name) for name in names)


def clip(path: Path) -> Path:
    """Return the folder of pictures, unpacked beside the recording; raises UserError if it is taken."""
    folder = path.with_name(f"{path.stem}_frames")
    try:
        with open_regular(path) as file, zipfile.ZipFile(file) as archive:
            wanted = _pictures(archive)
            if folder.exists():
                _check_unpacked(folder, wanted, path)
                return folder
            with staged_folder(folder) as part:
                for target, member in wanted.items():
                    (part / target).write_bytes(_unpacked(archive, member, MOST_PICTURE))
    except _DAMAGED as error:
        raise UserError(f"{path} is damaged: {error}; copy it from the phone again") from None
    except OSError as error:
        raise UserError(f"{path} cannot be unpacked into {folder}: {error.strerror}") from None
    return folder


def read(path: Path, size: tuple[int, int]) -> Imported:
    """Read the cameras of a recording; the file has its own size."""
    try:
        with open_regular(path) as file, zipfile.ZipFile(file) as archive:
            said = json.loads(_unpacked(archive, archive.getinfo(METADATA), MOST_METADATA))
    except (ValueError, RecursionError, *_DAMAGED) as error:
        raise UserError(f"{path} is damaged: {error}; copy it from the phone again") from None
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror}") from None
    if not isinstance(said, dict):
        raise wrong(f"{path}, {METADATA}", "an object")
    place = f"{path}, {METADATA}"
    table = finite(said.get("poses"), (-1, 7), f"{place}, poses", "seven numbers a frame")
    width, height = (float(finite(said.get(name), (), f"{place}, {name}", "one number")) for name in "wh")
    values = _lenses(said, len(table), place)
    lenses = [
        lens(f"{place}, lens {row}", "PINHOLE", (width, height), each) for row, each in enumerate(values)
    ]
    poses = to_world(table[:, :4], table[:, 4:], path)
    model = cameras(poses, OPENGL, lenses, f"{place}, pose {{}}")
    return Imported(model, FORMAT, (NO_DEPTH,), tuple(str(row) for row in range(len(table))))


def _lenses(said: dict[str, Any], count: int, place: str) -> np.ndarray:
    """Return (count, 4) focal lengths and principal points in pixels."""
    if said.get("perFrameIntrinsicCoeffs"):
        each = finite(
            said["perFrameIntrinsicCoeffs"], (-1, 4), f"{place}, perFrameIntrinsicCoeffs", "4 numbers"
        )
        if len(each) == count:
            return np.round(each, DIGITS)
    return np.tile(finite(said.get("K"), (9,), f"{place}, K", "9 numbers")[[0, 4, 6, 7]], (count, 1))


def _pictures(archive: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    """Return archive members by file name in the clip, sorted by frame."""
    found = {}
    for member in archive.infolist():
        if match := PICTURE.fullmatch(member.filename):
            found[f"{int(match[1]):06d}.{match[2]}"] = member
    return dict(sorted(found.items()))


def _unpacked(archive: zipfile.ZipFile, member: zipfile.ZipInfo, most: int) -> bytes:
    if member.file_size > most:
        raise UserError(f"{archive.filename}, {member.filename}: it unpacks to more than {most} bytes")
    return archive.read(member)


def _check_unpacked(folder: Path, wanted: dict[str, zipfile.ZipInfo], path: Path) -> None:
    files = [file for file in folder.iterdir() if not is_litter(file.name)] if folder.is_dir() else []
    there = {file.name: file.stat().st_size for file in files}
    if there != {name: member.file_size for name, member in wanted.items()}:
        raise UserError(
            f"{folder} exists and is not what {path.name} unpacks to ({counted(len(wanted), 'picture')});"
            " rename or remove it"
        )
