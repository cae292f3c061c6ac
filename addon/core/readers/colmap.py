"""COLMAP models, binary or text.

The images hold their poses in every version, so rigs and frames (COLMAP 4) are not read. Formats:
https://colmap.github.io/format.html
"""

from pathlib import Path

from ..base.errors import UserError
from . import colmap_binary, colmap_text
from .colmap_tables import assemble
from .matching import Imported

FORMAT = "COLMAP"
KINDS = {".bin": ("COLMAP binary", colmap_binary), ".txt": ("COLMAP text", colmap_text)}
STEMS = ("cameras", "images", "points3D", "rigs", "frames")
SUBFOLDERS = (".", "0", "sparse", "sparse/0")
"""Possible places of a model in the selected folder; COLMAP numbers its models."""


def recognises(path: Path) -> bool:
    """Return whether a file belongs to a model, or a folder or COLMAP's folder within it holds one."""
    try:
        if path.is_file():
            return path.suffix in KINDS and path.stem in STEMS
        return _model_folder(path) is not None
    except (OSError, ValueError):
        return False


def read(path: Path, size: tuple[int, int]) -> Imported:
    """Read the model in a folder or of a file in it; see `Reader.read`.

    Images are in the order of their IMAGE_IDs. If both kinds exist, a named file decides, or else the kind
    with more files. The file has its own size.
    """
    folder = path.parent if path.is_file() else _model_folder(path)
    if folder is None or (path.is_file() and path.suffix not in KINDS):
        raise UserError(f"{path} has no COLMAP model: {', '.join(colmap_binary.FILES)}, or the same as .txt")
    kind = path.suffix if path.is_file() else _kind(folder)
    label, parser = KINDS[kind]
    reconstruction, names = assemble(parser.read(folder))
    return Imported(reconstruction, label, _other_models(folder), names)


def _model_folder(path: Path) -> Path | None:
    for name in SUBFOLDERS:
        if any((path / name / file).is_file() for _, parser in KINDS.values() for file in parser.FILES):
            return path / name
    return None


def _kind(folder: Path) -> str:
    def there(suffix: str) -> int:
        return sum((folder / file).is_file() for file in KINDS[suffix][1].FILES)

    return max(KINDS, key=there)


def _other_models(folder: Path) -> tuple[str, ...]:
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
