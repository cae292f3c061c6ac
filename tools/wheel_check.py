"""Checks of the wheels in an extension's zip, for `store_check.py`."""

from __future__ import annotations

import base64
import csv
import email
import hashlib
import io
import re
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from email.message import Message
from functools import cached_property

PYTHON = (3, 13)
"""Version of Python in Blender's own builds."""
OF_BLENDER = {
    "attrs", "cattrs", "certifi", "charset_normalizer", "idna", "numpy", "requests", "urllib3", "zstandard",
}  # fmt: skip
"""Packages that Blender comes with: a bundled copy would replace Blender's for every extension."""
COMPATIBLE = re.compile(r"apache|bsd|mit\b|isc\b|zlib|psf|python software|mpl|mozilla|gpl", re.IGNORECASE)
"""Names of licences that the GNU GPL 3 is compatible with."""
PROGRAMS = (".app", ".bat", ".cmd", ".com", ".exe", ".msi", ".ps1", ".scr", ".sh")
LIBRARIES = {
    "linux-x64": ("manylinux", b"\x7fELF\x02\x01", 18, b"\x3e\x00"),
    "windows-x64": ("win_amd64", b"MZ", 0, b"MZ"),
    "macos-arm64": ("macosx", b"\xcf\xfa\xed\xfe", 4, b"\x0c\x00\x00\x01"),
}
"""Platform tag, first bytes, and place and bytes of the machine in native files of each platform."""
FORMATS = (b"\x7fELF", b"MZ", b"\xcf\xfa\xed\xfe", b"\xca\xfe\xba\xbe")
"""First bytes of native files: ELF, PE, Mach-O, Mach-O for several machines."""


@dataclass(frozen=True)
class Wheel:
    """A wheel: its file name and its bytes."""

    name: str
    data: bytes

    @cached_property
    def archive(self) -> zipfile.ZipFile:
        return zipfile.ZipFile(io.BytesIO(self.data))

    @cached_property
    def files(self) -> list[str]:
        return [each.filename for each in self.archive.infolist() if not each.is_dir()]

    @cached_property
    def metadata(self) -> Message:
        return email.message_from_bytes(self.archive.read(self._information("METADATA")))

    @property
    def package(self) -> str:
        return self.name.split("-")[0].lower()

    def _information(self, name: str) -> str:
        return next(each for each in self.files if each.endswith(f".dist-info/{name}"))

    def recorded(self) -> dict[str, str]:
        """Return the digest of each file by `RECORD`."""
        rows = csv.reader(io.StringIO(self.archive.read(self._information("RECORD")).decode()))
        return {row[0]: row[1] for row in rows if row}


def modified(wheels: Sequence[Wheel]) -> Iterator[str]:
    """Wheels are whole, every file as its publisher recorded it"""
    for wheel in wheels:
        recorded = wheel.recorded()
        for name in sorted({*wheel.files, *recorded}):
            if name.endswith((".dist-info/RECORD", ".jws", ".p7s")):
                continue
            if name not in recorded or name not in wheel.files:
                yield f"{wheel.name}: {name} is {'not recorded' if name not in recorded else 'missing'}"
                continue
            kind, _, digest = recorded[name].partition("=")
            found = base64.urlsafe_b64encode(hashlib.new(kind, wheel.archive.read(name)).digest())
            if found.decode().rstrip("=") != digest:
                yield f"{wheel.name}: {name} differs from its record"


def bundled(wheels: Sequence[Wheel]) -> Iterator[str]:
    """No wheel is a package that Blender has, and each has its dependencies beside it"""
    there = {wheel.package for wheel in wheels}
    for wheel in wheels:
        if inside := OF_BLENDER & {wheel.package, *(name.split("/")[0].lower() for name in wheel.files)}:
            yield f"{wheel.name}: has Blender's own {', '.join(sorted(inside))}"
        for wanted in wheel.metadata.get_all("Requires-Dist", ()):
            name = re.split(r"[^\w.-]", wanted)[0].replace("-", "_").lower()
            if "extra ==" not in wanted and name not in there | OF_BLENDER:
                yield f"{wheel.name}: needs {name}"


def licensed(wheels: Sequence[Wheel]) -> Iterator[str]:
    """Each wheel names a GPL-compatible licence and holds its text"""
    for wheel in wheels:
        keys = ("License-Expression", "License", "Classifier")
        named = [text for key in keys for text in wheel.metadata.get_all(key, ())]
        licences = [text for text in named if not text.startswith(("Programming", "Operating", "Topic"))]
        if not any(COMPATIBLE.search(text) for text in licences):
            yield f"{wheel.name}: has no licence that is compatible with the GPL"
        if not any(re.search(r"(licen[sc]e|copying)[^/]*$", name, re.IGNORECASE) for name in wheel.files):
            yield f"{wheel.name}: lacks the text of its licence"


def fitting(wheels: Sequence[Wheel], platform: str) -> Iterator[str]:
    """Each wheel is for Blender's Python, and its native files are for the zip's platform"""
    tag, first, place, machine = LIBRARIES[platform]
    for wheel in wheels:
        python, abi, *_, system = wheel.name.removesuffix(".whl").split("-")[-3:]
        number = tuple(int(part) for part in re.findall(r"^cp(\d)(\d+)$", python)[0:1] for part in part)
        if number != PYTHON and not (abi == "abi3" and number <= PYTHON) and python != "py3":
            yield f"{wheel.name}: is for {python}, which Blender does not run"
        if tag not in system and system != "any":
            yield f"{wheel.name}: is for {system}, not for {platform}"
        for name in wheel.files:
            with wheel.archive.open(name) as file:
                start = file.read(32)
            if start.startswith(FORMATS) and not (
                start.startswith(first) and start[place : place + len(machine)] == machine
            ):
                yield f"{wheel.name}: {name} is for another platform"


def programs(wheels: Sequence[Wheel]) -> Iterator[str]:
    """No wheel holds a program or a script for the system's shell"""
    for wheel in wheels:
        for name in wheel.files:
            if name.lower().endswith(PROGRAMS) or ".data/scripts/" in name or _runs(wheel.archive, name):
                yield f"{wheel.name}: {name} is a program"


def _runs(archive: zipfile.ZipFile, name: str) -> bool:
    """Whether a file is an ELF or Mach-O program, or begins with a line for a shell."""
    with archive.open(name) as file:
        start = file.read(4096)
    if start.startswith(b"\x7fELF"):
        # A program header of type PT_INTERP (3) names the loader that starts a program.
        fields = (start[32:40], start[54:56], start[56:58])
        offset, size, count = (int.from_bytes(field, "little") for field in fields)
        return any(start[at : at + 4] == b"\x03\0\0\0" for at in range(offset, offset + size * count, size))
    return start.startswith(b"#!") or (start[:4] == b"\xcf\xfa\xed\xfe" and start[12:16] == b"\x02\0\0\0")
