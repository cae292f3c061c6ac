"""The real phone clip through the command line: the subject sharp, the wall blurred, the border whole."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.media.clip import open_footage

from ..command_line import headless

# The duck inside its silhouette in frame 1 (left, top, right, bottom), and a larger box to find it again by.
DUCK = (395, 725, 495, 815)
TEMPLATE = (355, 640, 525, 865)
WALL = (30, 30, 550, 300)


def sharpness(picture: np.ndarray, box: tuple[int, int, int, int], dx: int = 0, dy: int = 0) -> float:
    """Variance of the Laplacian of the luma in a box."""
    left, top, right, bottom = box
    part = cv2.cvtColor(picture[top + dy : bottom + dy, left + dx : right + dx], cv2.COLOR_RGB2GRAY)
    return float(cv2.Laplacian(part.astype(float), cv2.CV_64F).var())


@pytest.mark.parametrize("name", ["####.png", "duck.mp4"])
def test_the_duck_is_sharp_and_the_wall_is_not(duck: Path, data: Path, tmp_path: Path, name: str) -> None:
    # The first, the last, and three in the middle: each that stands alone has its neighbours' depth to find.
    frames = "1-118:117" if name.endswith("png") else "58-60"
    out = tmp_path / "out" / name
    done = headless(
        "render", duck, "--focus-at", "0.52,0.72@1", "--blur", 0.03, "--frames", frames, "--out", out
    )
    assert done.returncode == 0, done.stderr
    source = open_footage(data / "duck" / "demo.mp4")
    result = open_footage(out)
    assert (result.width, result.height) == (884, 1080)
    left, top, right, bottom = TEMPLATE
    template = source.read(1)[top:bottom, left:right].copy()
    for shown in result.frames:
        # A movie counts from its own first picture.
        frame = shown + 57 if result.is_video else shown
        before, after = source.read(frame), result.read(shown)
        found = cv2.minMaxLoc(cv2.matchTemplate(before, template, cv2.TM_CCOEFF_NORMED))[3]
        at = found[0] - left, found[1] - top
        duckling = sharpness(after, DUCK, *at) / sharpness(before, DUCK, *at)
        wall = sharpness(after, WALL) / sharpness(before, WALL)
        print(f"{name}, frame {frame}: sharpness kept: duck {duckling:.2f}, wall {wall:.2f}")
        assert duckling >= 0.9
        assert wall < 0.6
        for edge in (np.s_[:3], np.s_[-3:], np.s_[:, :3], np.s_[:, -3:]):
            assert after[edge].mean() > 0.95 * before[edge].mean()
    assert len(result.frames) == (2 if not result.is_video else 3)
