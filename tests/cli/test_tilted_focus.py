"""A tilted focal plane as it is told on the command line, and what is said to be sharp."""

from __future__ import annotations

import math
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.core.focus.focus import Focus
from addon.core.optics.thin_lens import ACCEPTABLE
from addon.scene.lens.lens import focus_of

from ..scenes import LENS
from .solved_clips import FRAMES, run, work

__all__ = ["work"]
PLANE = (1, 20, 300, 700)


def test_a_plane_through_points_of_the_scene_leaves_it_sharp(
    work: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lens = ("--method", "features", "--aperture-radius", 0.3, "--frames", 3)
    out = tmp_path / "o" / "####.png"
    assert run("render", work, "--focus-plane", *PLANE, *lens, "--out", out) == 0
    assert "sharp at frame 3 on the optical axis: from " in capsys.readouterr().out
    assert run("render", work, "--focus-distance", 8, *lens, "--out", tmp_path / "p" / "####.png") == 0
    source, tilted, straight = (
        cv2.imread(str(path)).astype(float)
        for path in (work.parent / "clip" / "clip_0003.png", tmp_path / "o/0003.png", tmp_path / "p/0003.png")
    )
    # All points lie on one plane.
    assert np.abs(tilted - source).max() <= 2
    assert np.abs(straight - source).max() > 20


def test_the_blend_has_plane_tilt_and_swing(work: Path, tmp_path: Path) -> None:
    blend = ("--blend", tmp_path / "a.blend", "--overwrite", "--aperture-radius", 0.02)
    assert run("save", work, *blend, "--focus-plane", *PLANE) == 0
    assert focus_of(bpy.context.scene.virtual_aperture) == Focus(
        PLANE, pytest.approx(7.5, rel=0.3), through_points=True
    )
    pulled = ("--focus-at", "0.2,0.5@2", "--focus-at", "0.8,0.5@5")
    assert run("save", work, *blend, *pulled, "--tilt", -20, "--swing", 30) == 0
    scene = bpy.context.scene
    foci = []
    for frame in FRAMES:
        scene.frame_set(frame)
        foci.append(focus_of(scene.virtual_aperture))
    assert {(each.points, each.through_points) for each in foci} == {((), False)}
    assert foci[0].tilt == pytest.approx(math.radians(-20)) and foci[5].swing == pytest.approx(math.pi / 6)
    assert foci[1].distance < foci[4].distance


@pytest.mark.parametrize(
    ("focus", "said"),
    [
        (("--focus-plane", 1, 20, 20), "takes 3 or more"),
        (("--focus-plane", *PLANE, "--tilt", 5), "leave out --tilt"),
        (("--focus-distance", 8, "--swing", 90), "between -90 and 90"),
        (("--focus-distance", 0.2, "--swing", 80, "--aperture-radius", 0.1), "comes within 2 radii"),
        (
            ("--focus-point", *PLANE, "--swing", 10, "--method", "thesis"),
            "thesis does not support a tilted focal plane",
        ),
    ],
)
def test_planes_that_are_none_are_refused(
    work: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], focus: tuple[object, ...], said: str
) -> None:
    method = () if "thesis" in focus else ("--method", "features")
    assert run("render", work, *focus, *method, "--out", tmp_path / "o" / "####.png") == 1
    assert said in capsys.readouterr().err


def test_what_is_sharp_is_said(work: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    blend = ("--blend", tmp_path / "a.blend", "--overwrite")
    assert run("save", work, *blend, "--focus-distance", 8, "--aperture-radius", 0.05) == 0
    contrast = math.hypot(LENS.width, LENS.height) / ACCEPTABLE / (2 * 0.05 * LENS.fx)
    near, far = (1 / (1 / 8 + side * contrast) for side in (1, -1))
    assert f"sharp at frame 1: from {near:.4g} to {far:.4g} away" in capsys.readouterr().out
    assert run("save", work, *blend, "--focus-distance", 8, "--aperture-radius", 0.001) == 0
    near = 1 / (1 / 8 + 50 * contrast)
    assert f"sharp at frame 1: from {near:.4g} and farther" in capsys.readouterr().out
