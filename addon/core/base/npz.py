"""Reading arrays from NumPy's .npz files of strangers: what they claim is compared with what they may be.

A compressed file of a few megabytes can unpack to terabytes, and an array of objects to any program.
"""

from __future__ import annotations

import math
import re
import zipfile
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .regular_file import open_regular

PACKED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
HEADER = 4096
"""Bytes that an array's header takes at most."""

_HEADER = re.compile(
    rb"\x93NUMPY\x01\x00(?s:..)\{'descr': '(?P<dtype>[<>|](b1|[iu][1248]|f[248]))',"
    rb" 'fortran_order': (?P<fortran>True|False),"
    rb" 'shape': \((?P<shape>(\d{1,18}(, \d{1,18}){0,7})?,?)\), \} *\n"
)
"""As NumPy writes it, version 1.0: its own reader takes other Python, too."""
_DAMAGED = KeyError, EOFError, RuntimeError, NotImplementedError, zipfile.BadZipFile, zlib.error


def read_arrays(path: Path, names: tuple[str, ...], most: int) -> dict[str, NDArray[np.generic]]:
    """The arrays of these names, which together have `most` bytes at most, before any is unpacked.

    OSError where there is no such file (`open_regular`), ValueError where it is damaged, lacks one, has
    larger ones or objects.
    """
    with open_regular(path) as file:
        try:
            with zipfile.ZipFile(file) as archive:
                members = {name: archive.getinfo(f"{name}.npy") for name in names}
                if sum(member.file_size for member in members.values()) > most + len(names) * HEADER:
                    raise ValueError(f"{path.name} unpacks to more than {most} bytes")
                if any(member.compress_type not in PACKED for member in members.values()):
                    raise ValueError(f"{path.name} is packed in another way than NumPy does")
                # No more than that is unpacked, whatever follows in the file.
                return {name: _array(archive.read(member)) for name, member in members.items()}
        except _DAMAGED as error:
            raise ValueError(f"{path.name} is no file of {', '.join(names)}: {error}") from None


def array_shapes(path: Path) -> dict[str, tuple[int, ...]]:
    """The shapes of all arrays of numbers in a file by their names; nothing but their headers is unpacked.

    OSError where there is no such file (`open_regular`), ValueError where it is no archive.
    """
    shapes = {}
    with open_regular(path) as file:
        try:
            with zipfile.ZipFile(file) as archive:
                for member in archive.infolist():
                    name = member.filename.removesuffix(".npy")
                    if name == member.filename or member.compress_type not in PACKED:
                        continue
                    with archive.open(member) as data:
                        header = _HEADER.match(data.read(HEADER))
                    if header is not None:
                        shapes[name] = _shape(header)
        except _DAMAGED as error:
            raise ValueError(f"{path.name} is no file of arrays: {error}") from None
    return shapes


def _shape(header: re.Match[bytes]) -> tuple[int, ...]:
    return tuple(int(side) for side in re.findall(rb"\d+", header["shape"]))


def _array(data: bytes) -> NDArray[np.generic]:
    """An array of numbers of an .npy file's bytes; ValueError where it claims another size than it has."""
    header = _HEADER.match(data)
    if header is None:
        raise ValueError("it does not begin as an array of numbers does")
    dtype, is_fortran = np.dtype(header["dtype"].decode()), header["fortran"] == b"True"
    shape = _shape(header)
    left = data[header.end() :]
    # In Python's own numbers, which do not overflow.
    if math.prod(shape) * dtype.itemsize != len(left):
        raise ValueError("it has another size than it says")
    return np.frombuffer(left, dtype).reshape(shape, order="F" if is_fortran else "C")
