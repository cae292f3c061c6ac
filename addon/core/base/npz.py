"""Safe reading of NumPy's .npz files from other people.

A small file can unpack to terabytes, and an array of objects can run any program: headers are checked first.
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
from .side_by_side import Lock

PACKED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
HEADER = 4096
"""Most bytes of an array's header."""
_HEADER = re.compile(
    rb"\x93NUMPY\x01\x00(?s:..)\{'descr': '(?P<dtype>[<>|](b1|[iu][1248]|f[248]))',"
    rb" 'fortran_order': (?P<fortran>True|False),"
    rb" 'shape': \((?P<shape>(\d{1,18}(, \d{1,18}){0,7})?,?)\), \} *\n"
)
"""NumPy's format, version 1.0; NumPy's own reader evaluates other Python, too."""
_DAMAGED = KeyError, EOFError, RuntimeError, NotImplementedError, zipfile.BadZipFile, zlib.error


def read_arrays(path: Path, names: tuple[str, ...], most: int) -> dict[str, NDArray[np.generic]]:
    """Read named arrays.

    Args:
        path: An .npz file.
        names: Names of the arrays.
        most: Most bytes of all arrays together, checked before any is unpacked.

    Raises:
        OSError: There is no such file (`open_regular`).
        ValueError: The file is damaged, or an array is missing, too large or holds objects.
    """
    with open_regular(path) as file:
        try:
            with zipfile.ZipFile(file) as archive:
                members = {name: archive.getinfo(f"{name}.npy") for name in names}
                if sum(member.file_size for member in members.values()) > most + len(names) * HEADER:
                    raise ValueError(f"{path.name} unpacks to more than {most} bytes")
                if any(member.compress_type not in PACKED for member in members.values()):
                    raise ValueError(f"{path.name} is not packed the way NumPy does")
                # No more is unpacked, whatever follows in the file.
                return {name: _array(archive.read(member)) for name, member in members.items()}
        except _DAMAGED as error:
            raise ValueError(f"{path.name} is not a file of {', '.join(names)}: {error}") from None


def array_shapes(path: Path) -> dict[str, tuple[int, ...]]:
    """Return the shapes of all arrays of numbers, from their headers; raises OSError or ValueError."""
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
            raise ValueError(f"{path.name} is not a file of arrays: {error}") from None
    return shapes


def _shape(header: re.Match[bytes]) -> tuple[int, ...]:
    return tuple(int(side) for side in re.findall(rb"\d+", header["shape"]))


class ArrayFile:
    """Reads the maps (h, w) of an .npz array (h, w) or (n, h, w) one by one; axes of length 1 are dropped."""

    def __init__(self, path: Path, names: tuple[str, ...]) -> None:
        """Open the first array of `names` that the file has; raises OSError or ValueError."""
        self._path, self._lock = path, Lock()
        try:
            self._archive = zipfile.ZipFile(open_regular(path))
            there = [name.removesuffix(".npy") for name in self._archive.namelist()]
            self.name = next((name for name in names if name in there), "")
            """Name of the array."""
            if not self.name:
                raise ValueError(f"it has no array {' or '.join(names)}, but {', '.join(there) or 'nothing'}")
            member = self._archive.getinfo(f"{self.name}.npy")
            if member.compress_type not in PACKED:
                raise ValueError("it is not packed the way NumPy does")
            self._stream = self._archive.open(member)
            header = _HEADER.match(self._stream.read(HEADER))
        except _DAMAGED as error:
            raise ValueError(f"it is not a complete .npz: {error}") from None
        if header is None or header["fortran"] == b"True":
            raise ValueError(f"its array {self.name} does not begin as an array of numbers, row by row, does")
        self._dtype, self._begin = np.dtype(header["dtype"].decode()), header.end()
        shape = _shape(header)
        sides = [side for side in shape if side != 1]
        if len(sides) not in (2, 3) or 0 in sides:
            raise ValueError(f"its array {self.name} has the shape {tuple(shape)}, not (n, h, w)")
        if member.file_size != self._begin + math.prod(shape) * self._dtype.itemsize:
            raise ValueError(f"its array {self.name} has another size than it says")
        self.count = sides[0] if len(sides) == 3 else 1
        """Number of maps."""
        self.shape = sides[-2], sides[-1]
        """Rows and columns of a map."""

    def read(self, index: int) -> NDArray[np.generic]:
        """Read a map (h, w) by its index; quick in the file's order. Raises ValueError if it is damaged."""
        size = self.shape[0] * self.shape[1] * self._dtype.itemsize
        with self._lock:
            try:
                self._stream.seek(self._begin + index * size)
                data = self._stream.read(size)
            except _DAMAGED as error:
                raise ValueError(f"its array {self.name} is damaged: {error}") from None
        if len(data) != size:
            raise ValueError(f"its array {self.name} is damaged: it ends too soon")
        return np.frombuffer(data, self._dtype).reshape(self.shape)


def _array(data: bytes) -> NDArray[np.generic]:
    """Parse an .npy file of numbers; raises ValueError if its size differs from its header's."""
    header = _HEADER.match(data)
    if header is None:
        raise ValueError("it does not begin as an array of numbers does")
    dtype, is_fortran = np.dtype(header["dtype"].decode()), header["fortran"] == b"True"
    shape = _shape(header)
    left = data[header.end() :]
    # Python's integers do not overflow.
    if math.prod(shape) * dtype.itemsize != len(left):
        raise ValueError("it has another size than it says")
    return np.frombuffer(left, dtype).reshape(shape, order="F" if is_fortran else "C")
