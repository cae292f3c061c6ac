"""Lines and numbers of text files, with their places for errors.

A count is rejected if its bytes are missing, and a number if it is not finite or its powers may overflow.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import UserError
from ..base.numbers import LARGEST, reals
from ..base.regular_file import open_regular, read_regular

SPACE = np.isin(np.arange(256), list(b" \t\n\r\v\f"))
"""(256,) bytes that separate words."""
LONGEST = 2**32
"""Most bytes of a file."""
START = 1000
"""Bytes by which a format is recognised."""
CHUNK = 2**22
"""Bytes split into words at a time: words take ten times the memory of their text."""


def wrong(place: Path | str, expected: str) -> UserError:
    """Make the error for an unexpected value at a place in a file; a solution may follow a semicolon."""
    return UserError(f"{place}: expected {expected}{'' if ';' in expected else '; export it again'}")


def contents(
    path: Path, missing: str = "is not a file; give the file that the other program exported"
) -> bytes:
    """Read a file; raises UserError with the words `missing` for a file that is not there."""
    try:
        if not path.is_file():
            raise UserError(f"{path} {missing}")
        if path.stat().st_size > LONGEST:
            raise UserError(f"{path} is larger than {LONGEST >> 30} GiB; export fewer points")
        return read_regular(path)
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror}") from None


def plain(data: bytes) -> bytes:
    """Return a text without a byte order mark, whose lines end with LF."""
    return data.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n")


def beginning(path: Path) -> bytes | None:
    """Return the first `START` bytes of a text without a byte order mark and blanks; None if unreadable."""
    try:
        with open_regular(path) as file:
            return file.read(START).removeprefix(b"\xef\xbb\xbf").lstrip()
    except OSError:
        return None


class Text:
    """A text file, read line by line; LF, CRLF and CR end a line."""

    def __init__(self, path: Path, data: bytes | None = None) -> None:
        """Raise UserError for a file that is missing, empty, too large or not text, without its `data`."""
        self.path = path
        self.line = 0
        """Number of the last line read."""
        if data is None:
            data = contents(path)
            if not plain(data).strip():
                raise UserError(f"{path} is empty; export it again")
            if (nothing := data.find(b"\0")) >= 0:
                raise wrong(f"{path}, byte {nothing}", "text, this is a binary file or UTF-16")
        self._data = plain(data)
        self._at = 0

    def next(self) -> str | None:
        """Return the next line that is not blank, stripped; None at the end."""
        while self._at < len(self._data):
            if row := self.following():
                return row
        return None

    def following(self) -> str:
        """Return the next line, stripped; empty for a blank one and at the end."""
        end = self._data.find(b"\n", self._at)
        end = len(self._data) if end < 0 else end
        row = self._data[self._at : end].strip()
        self._at = end + 1
        self.line += 1
        return decoded(row)

    def demand(self, expected: str) -> str:
        """Return the next line that is not blank; raises UserError with `expected` at the end."""
        row = self.next()
        if row is None:
            raise self.ends(expected)
        return row

    def back(self) -> None:
        self._at = self._data.rfind(b"\n", 0, self._at - 1) + 1
        self.line -= 1

    def numbers(self, lines: int | None = None) -> Numbers:
        """Read the numbers on the next `lines` lines that are not blank, or on all."""
        first, wanted = self.line + 1, lines
        values: list[Floats] = [np.zeros(0)]
        per_line: list[NDArray[np.int64]] = [np.zeros(0, dtype=np.int64)]
        while self._at < len(self._data) and wanted != 0:
            end = self._data.find(b"\n", self._at + CHUNK)
            piece = self._data[self._at : len(self._data) if end < 0 else end + 1]
            stops, counts = _words_per_line(piece)
            if wanted is not None:
                filled = np.flatnonzero(counts)[:wanted]
                wanted -= len(filled)
                if wanted == 0:
                    stops, counts = stops[: filled[-1] + 1], counts[: filled[-1] + 1]
                    piece = piece[: stops[-1]]
            values.append(self._values(piece))
            per_line.append(counts)
            self._at += len(piece)
            self.line += len(counts)
        if wanted:
            raise self.ends(f"{wanted} more lines of {lines}")
        ends = np.cumsum(np.concatenate(per_line))
        return Numbers(self, np.concatenate(values), ends, np.arange(first, first + len(ends)))

    def row(self, words: list[str], count: int | None = None, what: str = "") -> Floats:
        """Parse (count,) numbers from words of the last line read, by default all."""
        if count is not None and len(words) != count:
            raise self.wrong(f"{what}, not {len(words)}")
        try:
            self.line -= 1
            return self._values(" ".join(words).encode())
        finally:
            self.line += 1

    def count(self, word: str, what: str, bytes_each: int) -> int:
        """Parse a count on the last line read, of items that take at least `bytes_each` bytes."""
        if not re.fullmatch(r"\d{1,18}", word, re.ASCII):
            raise self.wrong(f"the number of {what}, not {word[:40]!r}")
        left = max(len(self._data) - self._at, 0)
        if int(word) * bytes_each > left + 1:
            missing = f"{int(word)} do not fit into the {left} bytes left, export it again"
            raise self.wrong(f"the number of {what}; {missing}")
        return int(word)

    def wrong(self, expected: str, line: int | None = None) -> UserError:
        """Make the error for a line that is not as expected, by default the last one read."""
        return wrong(f"{self.path}, line {self.line if line is None else line}", expected)

    def ends(self, expected: str) -> UserError:
        """Make the error for a text that ends too early."""
        solution = "" if ";" in expected else "; it may be truncated, export it again"
        return UserError(f"{self.path} ends at line {self.line}: expected {expected}{solution}")

    def _values(self, piece: bytes) -> Floats:
        """Parse the numbers that follow the last line read."""
        words = piece.split()
        try:
            values = reals(words)
        except ValueError:
            values = np.full(len(words), np.nan)
        # NaN compares false, too.
        if np.all(np.abs(values) <= LARGEST):
            return values
        for number, line in enumerate(piece.split(b"\n"), self.line + 1):
            for word in line.split():
                if not _is_number(word):
                    shown = decoded(word[:40])
                    hint = " (with a point, not a comma)" if b"," in word else ""
                    raise self.wrong(f"a number of at most {LARGEST:g}{hint}, not {shown!r}", number)
        raise AssertionError("one of the words is not a number")


def decoded(row: bytes) -> str:
    """Decode a text, which programs on Windows may write in a code page."""
    try:
        return row.decode("utf-8")
    except UnicodeDecodeError:
        return row.decode("latin-1")


def _words_per_line(piece: bytes) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the end of each line in bytes and its number of words; both (lines,)."""
    space = SPACE[np.frombuffer(piece, dtype=np.uint8)]
    begins = ~space
    begins[1:] &= space[:-1]
    stops = np.flatnonzero(np.frombuffer(piece, dtype=np.uint8) == ord("\n")) + 1
    if not piece.endswith(b"\n"):
        stops = np.append(stops, len(piece))
    return stops, np.diff(np.searchsorted(np.flatnonzero(begins), stops), prepend=0)


def _is_number(word: bytes) -> bool:
    try:
        return bool(abs(reals([word])[0]) <= LARGEST)
    except ValueError:
        return False


@dataclass(frozen=True)
class Numbers:
    """Numbers of a text, and their lines."""

    text: Text
    values: Floats
    """(n,)"""
    ends: NDArray[np.int64]
    """(lines,) cumulative count of numbers."""
    lines: NDArray[np.int64]
    """(lines,) line numbers in the text."""

    def line(self, index: int) -> int:
        """Return the line of a number."""
        return int(self.lines[np.searchsorted(self.ends, index, side="right")])

    def wrong(self, index: int, expected: str) -> UserError:
        if index >= len(self.values):
            return self.text.ends(expected)
        return self.text.wrong(f"{expected}, not {self.values[index]:g}", self.line(index))

    def whole(self, where: NDArray[np.int64], below: int, what: str) -> NDArray[np.int64]:
        """Return whole numbers from 0 to `below` - 1 at indices (k,); raises UserError."""
        found = self.values[where]
        bad = np.flatnonzero((found < 0) | (found >= below) | (found != np.floor(found)))
        if len(bad):
            raise self.wrong(int(where[bad[0]]), f"{what} from 0 to {below - 1}")
        return found.astype(np.int64)
