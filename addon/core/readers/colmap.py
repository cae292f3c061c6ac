"""Reader of COLMAP models, binary or text, with or without rigs and frames.

Rigs and frames (COLMAP 4) are not read: the images have their poses in every version. Formats:
https://colmap.github.io/format.html
"""

from __future__ import annotations

from pathlib import Path

from ..base.errors import UserError
from . import colmap_binary, colmap_text
from .colmap_tables import assemble
from .imported_model import ImportedModel

FORMAT = "COLMAP"
KINDS = {".bin": ("COLMAP binary", colmap_binary), ".txt": ("COLMAP text", colmap_text)}
STEMS = ("cameras", "images", "points3D", "rigs", "frames")
SUBFOLDERS = (".", "0", "sparse", "sparse/0")
"""Folders of a model within the named folder; COLMAP numbers its models."""


def recognises(path: Path) -> bool:
    """Whether a file is part of a model, or a folder or one that COLMAP makes in it holds one."""
    try:
        if path.is_file():
            return path.suffix in KINDS and path.stem in STEMS
        return _model_folder(path) is not None
    except (OSError, ValueError):
        return False


def read(path: Path, size: tuple[int, int]) -> ImportedModel:
    """Read the model in a folder or beside one of its files, images in the order of their IMAGE_IDs.

    If both text and binary are there, the named file decides, or else the binary one is read.

    Raises:
        UserError: Something unexpected, with file, line or byte, and the expected content.
    """
    folder = path.parent if path.is_file() else _model_folder(path)
    if folder is None or (path.is_file() and path.suffix not in KINDS):
        raise UserError(f"{path} has no COLMAP model: {', '.join(colmap_binary.FILES)}, or the same as .txt")
    kind = path.suffix if path.is_file() else _kind(folder)
    label, parser = KINDS[kind]
    reconstruction, names = assemble(folder, parser.read(folder))
    return ImportedModel(label, reconstruction, names, _other_models(folder))


def _model_folder(path: Path) -> Path | None:
    """The first of the places where a model may be that has any of its files."""
    for name in SUBFOLDERS:
        if any((path / name / file).is_file() for _, parser in KINDS.values() for file in parser.FILES):
            return path / name
    return None


def _kind(folder: Path) -> str:
    """Suffix of the files of which most are there."""

    def there(suffix: str) -> int:
        return sum((folder / file).is_file() for file in KINDS[suffix][1].FILES)

    return max(KINDS, key=there)


def _other_models(folder: Path) -> tuple[str, ...]:
    """A note on the pieces in which a clip was solved beside this one."""
    if not folder.name.isdecimal():
        return ()
    others = [
        other.name for other in folder.parent.iterdir()
        if other.name.isdecimal() and other.name != folder.name and _model_folder(other) == other
    ]  # fmt: skip
    if not others:
        return ()
    listed = ", ".join(sorted(others, key=int))
    return (
        f"the solve has several models: {folder.name} was read, not {listed}; name one's folder to get it",
    )
