"""Readers of other programs' camera solves: each format is imported as a solve of the clip."""

import zipfile
from pathlib import Path
from typing import Protocol

from ..base.errors import Remedy, UserError
from ..base.npz import array_shapes
from ..base.regular_file import open_regular
from ..media.clip import Footage
from ..media.picture_file import ARRAY, ARRAYS, PICTURES
from ..media.sequence import clip_files, is_litter
from . import bundler, camera_arrays, colmap, nvm, record3d, stray, transforms, voodoo
from .matching import Imported, match
from .parsing import wrong


class Reader(Protocol):
    """A module that reads one format; `read_reconstruction` finds the module for a file.

    >>> imported = read_reconstruction(folder, footage)
    >>> imported.format, imported.reconstruction.frames.tolist()
    ('COLMAP text', [1, 2, 3])
    """

    FORMAT: str
    """The format's displayed name."""

    def recognises(self, path: Path) -> bool:
        """Return whether a file or folder looks like the format; False if it cannot be read."""

    def read(self, path: Path, size: tuple[int, int]) -> Imported:
        """Read the model of a file or folder; raises UserError that names the invalid place in it.

        `size` is the pictures' (width, height) in pixels, for formats without a size.
        """


class Recording(Reader, Protocol):
    """A reader of recordings, which include their clip."""

    def clip(self, path: Path) -> Path:
        """Return the clip of a recording, unpacked beside it if necessary; raises UserError."""


RECORDINGS: tuple[Recording, ...] = (stray, record3d)
READERS: tuple[Reader, ...] = (colmap, bundler, nvm, voodoo, transforms, camera_arrays, *RECORDINGS)
SUPPORTED = (
    "a COLMAP model (a folder with cameras, images and points3D as .bin or .txt), Bundler's bundle.out,"
    " a VisualSFM .nvm, a text export of the Voodoo camera tracker, a transforms.json, the .npz of MegaSaM,"
    " ViPE or Depth Anything 3, Record3D's .r3d, or a folder of Stray Scanner"
)
SUFFIXES = (".out", ".nvm", ".txt", ".json", ".npz", ".r3d")
"""Suffixes of the files examined in a folder without a COLMAP model."""
ENDINGS = (".bin", *SUFFIXES)
"""Suffixes of all files of models."""


def read_reconstruction(path: Path, footage: Footage) -> Imported:
    """Read another program's model, a file or a folder, and match it to the clip's frames.

    Raises UserError, which names the file, if the format is unknown, the file is damaged (the message names
    the place), or the model is not of this clip.
    """
    path = Path(path).expanduser().absolute()
    if not path.exists():
        raise UserError(f"{path} does not exist; choose {SUPPORTED}")
    reader, file = _recognised(path)
    try:
        return match(reader.read(file, (footage.width, footage.height)), footage)
    except UserError as error:
        if str(file.parent) in str(error):
            raise
        raise UserError(f"{file}: {error}", *error.remedies) from None


def recorded_clip(path: Path) -> Path | None:
    """Return the clip of a recording, or None for another file; raises UserError if it is unavailable."""
    path = Path(path).expanduser()
    return next((reader.clip(path) for reader in RECORDINGS if reader.recognises(path)), None)


def recorded_depth(path: Path, work_dir: Path) -> Path | None:
    """Return the depth maps of a recording, beside a working folder, or None; raises UserError."""
    path = Path(path).expanduser()
    folder = work_dir.with_name(f"{work_dir.stem}_lidar")
    return stray.write_depth(path, folder) if stray.recognises(path) else None


def _recognised(path: Path) -> tuple[Reader, Path]:
    for reader in READERS:
        if reader.recognises(path):
            return reader, path
    found = _models_in(path) if path.is_dir() else []
    if len(found) == 1:
        return found[0]
    if found:
        names = ", ".join(file.name for _, file in found)
        raise UserError(f"{path} has several models: {names}; name one of them")
    for file in [path] if path.is_file() else [*path.glob("*"), *path.glob("*/*")]:
        if file.suffix.lower() in SUFFIXES and file.is_file() and not file.stat().st_size:
            raise UserError(f"{file} is empty (0 bytes); export it again")
        if file.suffix.lower() in (ARRAY, ".r3d") and file.is_file() and not zipfile.is_zipfile(file):
            raise wrong(file, "a zip archive, but the file is cut off or damaged; copy or export it again")
    if held := _without_cameras(path):
        raise UserError(
            f"{path.name} holds {held}, but no cameras, so it is not a solve; solve the clip itself, or"
            " import its cameras, and give that as depth maps",
            Remedy.DEPTH_MAPS,
        )
    raise UserError(f"{path} is not a model in a known format; choose {SUPPORTED}")


def _without_cameras(path: Path) -> str:
    """Describe the pictures, depth maps or network in a file or folder; empty if there are none."""
    try:
        if path.suffix.lower() == ".onnx":
            return "a network"
        if path.suffix.lower() == ARRAY:
            return "depth maps" if not set(ARRAYS).isdisjoint(array_shapes(path)) else ""
        if path.is_dir():
            return "pictures" if clip_files(path) else ""
        with open_regular(path) as file, zipfile.ZipFile(file) as archive:
            names = archive.namelist()
        return "pictures" if any(Path(name).suffix.lower() in PICTURES for name in names) else ""
    except (OSError, ValueError, zipfile.BadZipFile):
        return ""


def _models_in(folder: Path) -> list[tuple[Reader, Path]]:
    """List the models in a folder, or otherwise in Bundler's folder within it."""
    for place in (folder, folder / "bundle"):
        files = sorted(
            f for f in place.glob("*")
            if f.suffix.lower() in SUFFIXES and not is_litter(f.name) and f.is_file()
        )  # fmt: skip
        found = [(reader, file) for file in files for reader in READERS if reader.recognises(file)]
        if found:
            return found
    return []
