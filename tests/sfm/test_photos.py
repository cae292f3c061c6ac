"""Photos in no order: which are near to each other, and cameras of their own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.camera.focal_length import Focal
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.media.clip import open_footage
from addon.core.readers import read_reconstruction
from addon.core.sfm.process import SolveProcess
from addon.core.sfm.workspace import load_solve
from tests import planes

CENTRES = np.array(
    [[-0.9, 0.1, 0], [0.9, -0.2, 0.1], [0, 0.5, 0], [0.3, -0.5, 0.2], [-0.4, -0.2, 0.1], [0.5, 0.3, 0]]
)
NAMES = ("quince", "apple", "medlar", "cherry", "sloe", "pear")


def photos(folder: Path, names: tuple[str, ...] = NAMES) -> dict[str, np.ndarray]:
    """Photos of the planes from all round, every second one reduced to three quarters; centres by name."""
    for index, (name, centre) in enumerate(zip(names, CENTRES, strict=True)):
        # Each looks at the same place.
        turn = np.array([-centre[1] / 7, centre[0] / 7, 0.02 * index])
        picture = planes.view(centre, turn)
        if index % 2:
            picture = cv2.resize(picture, None, fx=0.75, fy=0.75, interpolation=cv2.INTER_AREA)
            # Another exposure.
            picture = np.round(0.7 * picture).astype(np.uint8)
        cv2.imwrite(str(folder / f"{name}.png"), picture)
    return dict(zip(names, CENTRES, strict=True))


def distances(centres: np.ndarray) -> np.ndarray:
    """Between all pairs, in units of their mean."""
    apart = np.linalg.norm(centres[:, None] - centres[None], axis=2)[np.triu_indices(len(centres), 1)]
    return np.asarray(apart / apart.mean())


def solved(folder: Path, work: Path, focal: Focal | None = None, stills: bool = True) -> SolveProcess:
    process = SolveProcess(folder, work, focal=focal, stills=stills)
    try:
        process.wait()
    finally:
        process.cancel()
    return process


def test_photos_of_two_sizes_and_exposures_are_placed(tmp_path: Path) -> None:
    """The cameras stand where they stood, up to a similarity, each with its own size and focal length."""
    folder = tmp_path / "fruit"
    folder.mkdir()
    centres = photos(folder, tuple(f"IMG_7_{name}_7" for name in NAMES))
    solved(folder, tmp_path / "work", lambda width, _: width * planes.FOCAL / planes.SIZE[0])
    solve = load_solve(tmp_path / "work")
    reconstruction, footage = solve.reconstruction, solve.open_clip()
    assert solve.is_stills and footage.is_stills and not reconstruction.is_ordered
    assert len(reconstruction.images) == len(NAMES)
    names = [footage.file(image.frame).stem for image in reconstruction.images]
    found = np.array([image.centre for image in reconstruction.images])
    assert np.allclose(distances(found), distances(np.array([centres[n] for n in names])), atol=0.05)
    for image in reconstruction.images:
        camera, picture = reconstruction.intrinsics(image), footage.read(image.frame)
        assert (camera.height, camera.width) == picture.shape[:2]
        assert camera.fx / camera.width == pytest.approx(planes.FOCAL / planes.SIZE[0], rel=0.01)


@pytest.mark.long
def test_kermit_is_placed_as_bundler_placed_it(data: Path, tmp_path: Path) -> None:
    """Real flash photos: all 11 get a camera, and the 9 that Bundler knew stand where it put them."""
    folder = data / "kermit"
    with pytest.raises(UserError, match="solved as stills"):
        solved(folder, tmp_path / "clip", stills=False)
    solved(folder, tmp_path / "work")
    found = load_solve(tmp_path / "work").reconstruction
    assert len(found.images) == 11
    theirs = read_reconstruction(folder / "bundle.out", open_footage(folder)).reconstruction
    # Bundler's frames have the files' numbers, which begin at 0.
    own = np.array([found.image_at(image.frame + 1)[0].centre for image in theirs.images])
    centres = np.array([image.centre for image in theirs.images])
    assert np.allclose(distances(own), distances(centres), atol=0.05)
    assert found.cameras[0].fx == pytest.approx(theirs.cameras[0].fx, rel=0.02)


@pytest.mark.long
def test_photos_from_one_place_are_refused(tmp_path: Path) -> None:
    folder = tmp_path / "fruit"
    folder.mkdir()
    for index, name in enumerate(NAMES):
        turn = np.array([0.02 * index, -0.03 * index, 0.0])
        cv2.imwrite(str(folder / f"{name}.png"), planes.view(np.zeros(3), turn))
    with pytest.raises(UserError, match=r"different places|one place"):
        solved(folder, tmp_path / "work")


def reconstruction() -> Reconstruction:
    """Four photos in a row: the third by name is next to the first, the fourth sees other points."""
    camera = Intrinsics(320, 240, 272, 272, 160, 120)
    xyz = np.column_stack([np.linspace(-1, 1, 20), np.zeros(20), np.full(20, 8.0)])
    points = Points(np.concatenate([xyz, xyz + 50]), np.zeros((40, 3), np.uint8), np.zeros(40))
    images = tuple(
        Image(frame, np.eye(3), np.array([-x, 0.0, 0.0]), np.zeros((20, 2)), np.arange(start, start + 20))
        for frame, x, start in ((1, 0.0, 0), (2, 3.0, 0), (3, 0.5, 0), (4, 0.1, 20))
    )
    return Reconstruction((camera,), images, points, is_ordered=False)


def test_a_photo_without_a_camera_borrows_none() -> None:
    photos = reconstruction()
    lost = replace(photos, images=(photos.images[0], photos.images[2]))
    with pytest.raises(UserError, match=r"photo 2 .* has no camera"):
        lost.image_at(2)
    assert replace(lost, is_ordered=True).image_at(2)[1]
