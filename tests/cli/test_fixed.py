"""What is burnt into a clip, from command to pictures, against the same clip without it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.camera.reconstruction import Intrinsics, Reconstruction
from addon.core.media.clip import open_footage
from addon.core.readers.matching import Imported
from addon.core.sfm.workspace import keep_import

from ..command_line import done
from ..scenes import plane_picture, psnr, slanted_plane

pytestmark = pytest.mark.usefixtures("registered")

FRAMES = tuple(range(1, 13))
FRAME = 6
BARS = {
    "pillarbox": (0, 0, 24, 30),
    "window": (12, 12, 20, 20),
    "one": (0, 21, 0, 0),
}
"""Rows at the top and the bottom, columns at the left and the right."""
LENS = Intrinsics(240, 136, 210.0, 210.0, 120.0, 68.0)


def plane() -> Reconstruction:
    """A slanted plane that goes by 6 pixels a frame."""
    still = slanted_plane(LENS, FRAMES)
    images = []
    for number, image in enumerate(still.images):
        centre = np.array([0.2 * number, -0.02 * number, 0.0])
        local = (still.points.xyz - centre) @ image.rotation.T
        images.append(replace(image, translation=-image.rotation @ centre, xy=LENS.project(local)))
    return replace(still, images=tuple(images))


def write(folder: Path, pictures: dict[int, np.ndarray]) -> Path:
    folder.mkdir()
    for frame, picture in pictures.items():
        cv2.imwrite(str(folder / f"clip_{frame:04d}.png"), picture[..., ::-1])
    return folder


def rendered(clip: Path, solve: Reconstruction, *options: object) -> np.ndarray:
    """(h, w, 3) in [0, 1] a frame of a clip through a lens, and what was said."""
    work = clip.with_name(f"{clip.name}.work")
    keep_import(Imported(solve, "COLMAP text", ()), open_footage(clip), work)
    out = clip.with_name(f"{clip.name}.out") / "####.png"
    done(
        "render", work, "--out", out, "--frames", FRAME, "--focus-distance", 20, "--aperture-radius", 0.35,
        "--views", 24, "--grain", 0, "--borrow", "off", *options,
    )  # fmt: skip
    return np.asarray(cv2.imread(str(next(out.parent.iterdir())))[..., ::-1] / 255)


@pytest.fixture(scope="module")
def scene() -> tuple[Reconstruction, dict[int, np.ndarray]]:
    solve = plane()
    return solve, {image.frame: plane_picture(solve, image) for image in solve.images}


@pytest.fixture(scope="module")
def alone(
    registered: None,
    scene: tuple[Reconstruction, dict[int, np.ndarray]],
    tmp_path_factory: pytest.TempPathFactory,
) -> np.ndarray:
    """The frame of the clip without anything burnt in."""
    return rendered(write(tmp_path_factory.mktemp("alone") / "clip", scene[1]), scene[0])


@pytest.mark.parametrize(
    ("name", "colour"), [pytest.param("pillarbox", 16, marks=pytest.mark.long), ("window", 235), ("one", 0)]
)
def test_the_picture_ends_at_bars_as_at_its_border(
    name: str,
    colour: int,
    scene: tuple[Reconstruction, dict[int, np.ndarray]],
    alone: np.ndarray,
    tmp_path: Path,
) -> None:
    top, bottom, left, right = BARS[name]
    width, height = LENS.width + left + right, LENS.height + top + bottom
    camera = replace(LENS, width=width, height=height, cx=LENS.cx + left, cy=LENS.cy + top)
    images = tuple(replace(image, xy=image.xy + np.array([left, top])) for image in scene[0].images)
    sides = (top, bottom), (left, right), (0, 0)
    barred = {frame: np.pad(picture, sides, constant_values=colour) for frame, picture in scene[1].items()}
    clip = write(tmp_path / "clip", barred)
    picture = rendered(clip, replace(scene[0], cameras=(camera,), images=images))
    inside = np.s_[top : top + LENS.height, left : left + LENS.width]
    bars = np.ones(picture.shape[:2], bool)
    bars[inside] = False
    assert np.abs(255 * picture[bars] - colour).max() <= 1.01  # Of rounding.
    # All of it, and within 6 pixels of the border.
    border = np.ones(alone.shape[:2], bool)
    border[6:-6, 6:-6] = False
    whole = write(tmp_path / "whole", barred)
    off = rendered(whole, replace(scene[0], cameras=(camera,), images=images), "--fixed", "off")
    found, before = (psnr(each[inside][border], alone[border]) for each in (picture, off))
    print(
        f"{name}: {psnr(picture[inside], alone):.1f} dB, at the border {found:.1f}; --fixed off {before:.1f}"
    )
    assert psnr(picture[inside], alone) > 34
    assert found > before + 6
