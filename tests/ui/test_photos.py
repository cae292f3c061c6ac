"""Photos in no order in the panel: solved as such, and one of them shown."""

from __future__ import annotations

from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.ui.footage import photos
from tests import planes

PLACES = {"DSC_0009": (0.0, 0.0), "DSC_0003": (0.6, 0.1), "DSC_0007": (-0.6, 0.2), "DSC_0001": (0.1, -0.6)}


@pytest.mark.long
@pytest.mark.parametrize("clip", ["", "DSC_####.png"])
def test_photos_are_solved_and_shown_by_name(scene: bpy.types.Scene, tmp_path: Path, clip: str) -> None:
    """Numbered as cameras number them, in no order: a clip unless the user says otherwise."""
    folder = tmp_path / "fruit"
    folder.mkdir()
    for name, (x, y) in PLACES.items():
        picture = planes.view(np.array([x, y, 0.0]), np.array([-y / 7, x / 7, 0.0]))
        cv2.imwrite(str(folder / f"{name}.png"), picture)
    settings = scene.virtual_aperture
    settings.footage, settings.work_dir = str(folder / clip), str(tmp_path / "work")
    settings.stills = True
    assert bpy.ops.virtual_aperture.solve() == {"FINISHED"}
    assert photos.are_photos(settings)
    names = {name: frame for frame, name, _ in photos._photos(None, bpy.context)}
    assert list(names) == sorted(f"{name}.png" for name in PLACES)
    assert bpy.ops.virtual_aperture.show_photo(photo=names["DSC_0007.png"]) == {"FINISHED"}
    assert scene.frame_current == 3
