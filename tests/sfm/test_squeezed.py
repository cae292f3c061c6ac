"""Clips of anamorphic lenses: refused with their way out, and solved in their true shape."""

from __future__ import annotations

import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.base.errors import Remedy, UserError
from addon.core.sfm.process import SolveProcess
from addon.core.sfm.workspace import load_solve

from .. import planes
from ..pictures import with_chunks


def rolling(folder: Path, tagged: bool) -> Path:
    """A camera that walks, pans and rolls, in pictures of half their width, with or without their ratio."""
    folder.mkdir()
    for number, s in enumerate(np.linspace(-0.5, 0.5, 16), 1):
        turn = np.array([0.05 * np.sin(6 * s), 0.2 * s, 0.6 * s])
        picture = planes.view(np.array([1.5 * s, 0.3 * s * s, 0.3 * s]), turn)
        width, height = planes.SIZE
        half = cv2.resize(picture, (width // 2, height), interpolation=cv2.INTER_AREA)
        png = cv2.imencode(".png", half)[1].tobytes()
        png = with_chunks(png, pHYs=struct.pack(">IIB", 1, 2, 0)) if tagged else png
        (folder / f"s_{number:04d}.png").write_bytes(png)
    return folder


@pytest.mark.parametrize("tagged", [pytest.param(True, marks=pytest.mark.long), False])
def test_a_squeezed_clip_is_solved_in_its_true_shape(tmp_path: Path, tagged: bool) -> None:
    clip, work = rolling(tmp_path / "clip", tagged), tmp_path / "work"
    SolveProcess(clip, work, pixel_aspect=0.0 if tagged else 2.0).wait()
    solved = load_solve(work)
    camera = solved.reconstruction.cameras[0]
    assert (camera.width, camera.height) == planes.SIZE
    assert camera.fx == pytest.approx(planes.FOCAL, rel=0.03) and camera.fx == pytest.approx(camera.fy)
    opened = solved.open_clip()
    assert (opened.width, opened.height) == planes.SIZE and opened.read(3).shape[:2] == planes.SIZE[::-1]
    # What is not asked for is taken from the kept solve, and another ratio is another solve.
    assert SolveProcess(clip, work).finished
    other = SolveProcess(clip, work, pixel_aspect=1.5)
    assert not other.finished
    other.cancel()


@pytest.mark.long
def test_a_refused_clip_that_looks_squeezed_says_so(tmp_path: Path) -> None:
    process = SolveProcess(rolling(tmp_path / "clip", False), tmp_path / "work")
    with pytest.raises(UserError, match="with a pixel aspect of 2 the clip fits a static scene") as e:
        process.wait()
    assert Remedy.PIXEL_ASPECT in e.value.remedies
