"""Three planes, whose cameras are known, as a solve that commands take."""

from __future__ import annotations

from pathlib import Path

from addon.core.readers.colmap_export import write_model

from .. import planes
from ..command_line import done
from ..planes import CENTRES, clip, features, poses

LENS = planes.LENS.scaled(160, 120)
"""Of the three planes at half their size."""


def import_planes(folder: Path) -> Path:
    """Write the clip into a folder and import its cameras; the working folder."""
    planes.write_clip(folder / "clip", planes.halved(clip(CENTRES)))
    names = {n: f"shot_{n:04d}.png" for n in range(1, len(CENTRES) + 1)}
    (folder / "model").mkdir()
    write_model(folder / "model", poses(CENTRES, features(), LENS), names)
    done("import", folder / "model", "--footage", folder / "clip", "--work", folder / "work")
    return folder / "work"
