"""Photos in no order on the command line: solved, one of them rendered, and that again from a .blend."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.cli.main import run_command
from tests import planes

PLACES = {"apple": (0.0, 0.0), "cherry": (0.6, 0.1), "medlar": (-0.6, 0.2), "pear": (0.1, -0.6)}


@pytest.mark.long
def test_one_photo_is_rendered_by_its_name_as_large_as_it_is(registered: None, tmp_path: Path) -> None:
    folder, work, blend = tmp_path / "fruit", tmp_path / "work", tmp_path / "scene" / "scene.blend"
    folder.mkdir()
    for name, (x, y) in PLACES.items():
        picture = planes.view(np.array([x, y, 0.0]), np.array([-y / 7, x / 7, 0.0]))
        size = (240, 180) if name == "pear" else planes.SIZE
        cv2.imwrite(str(folder / f"{name}.png"), cv2.resize(picture, size, interpolation=cv2.INTER_AREA))
    lens = ("--focus-at", "0.5,0.5", "--method", "features", "--views", "2")

    def command(*words: object) -> int:
        return run_command([str(word) for word in words])

    assert command("solve", folder, "--work", work, "--fov", 61) == 0
    assert command("render", work, "--still", "plum", *lens, "--out", tmp_path / "plum.png") == 1
    for name in ("apple", "pear.png"):
        out = tmp_path / f"{name}-out.png"
        assert command("render", work, "--still", name, *lens, "--out", out) == 0
        own = cv2.imread(str(folder / f"{Path(name).stem}.png"))
        assert cv2.imread(str(out)).shape == own.shape
    assert command("save", work, "--blend", blend, *lens) == 0
    again = tmp_path / "again.png"
    assert command("render", blend, "--still", "pear", "--out", again) == 0
    assert cv2.imread(str(again)).shape == (180, 240, 3)
    assert command("render", work, *lens, "--out", tmp_path / "all" / "####.png") == 0
    assert {cv2.imread(str(file)).shape for file in (tmp_path / "all").iterdir()} == {(240, 320, 3)}
