"""Clips whose cameras are known, as solves that commands take, and commands over them."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.cli.main import run_command
from addon.core.media.light import decode_srgb
from addon.core.readers.colmap_export import write_model

from .. import planes
from ..command_line import done
from ..media.colour_curves import Array
from ..scenes import LENS, slanted_plane, write_plane

FRAMES = tuple(range(1, 7))
PLANE = slanted_plane(LENS, FRAMES, count=1500)
PLANES_LENS = planes.LENS.scaled(160, 120)
"""Of three planes at half their size."""
BRIGHT, SHOWN = ("--focus-point", 3, "--blur", 0.03), 3
"""How frames that are brighter than white are rendered, and which one is looked at."""


@pytest.fixture
def work(registered: None, tmp_path: Path) -> Path:
    """The working folder of a clip of the slanted plane."""
    return imported(tmp_path, write_plane(tmp_path / "clip", PLANE))


def imported(tmp_path: Path, footage: Path) -> Path:
    """The working folder of the clip with a plane's model."""
    (tmp_path / "model").mkdir()
    write_model(tmp_path / "model", PLANE)
    words = ("import", tmp_path / "model", "--footage", footage, "--work", tmp_path / "work")
    assert run_command([str(each) for each in words]) == 0
    return tmp_path / "work"


def run(command: str, work: Path, *options: object) -> int:
    """The exit status of a command about a working folder, in this process, with two views."""
    return run_command([command, str(work), *map(str, options), "--views", "2"])


def filmed(folder: Path) -> list[Array]:
    """(90, 160, 3) linear light of the slanted plane's frames, up to six times white."""
    write_plane(folder, PLANE)
    pictures = [cv2.imread(str(file))[..., ::-1] / 255 for file in sorted(folder.iterdir())]
    return [decode_srgb(picture) * (1 + 5 * np.clip(4 * picture - 3, 0, 1)) for picture in pictures]


def import_planes(folder: Path) -> Path:
    """Write a clip of three planes into a folder and import its cameras; the working folder."""
    planes.write_clip(folder / "clip", planes.halved(planes.clip(planes.CENTRES)))
    names = {n: f"shot_{n:04d}.png" for n in range(1, len(planes.CENTRES) + 1)}
    (folder / "model").mkdir()
    write_model(folder / "model", planes.poses(planes.CENTRES, planes.features(), PLANES_LENS), names)
    done("import", folder / "model", "--footage", folder / "clip", "--work", folder / "work")
    return folder / "work"
