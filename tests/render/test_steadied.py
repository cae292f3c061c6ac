"""A frame from a steadier path, against rays traced through a lens there onto a plane that the clip shows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.base.arrays import Floats, LinearRGBA
from addon.core.camera.reconstruction import Image, Intrinsics, Reconstruction, rotation_matrix
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.frame import Frame
from addon.core.frame.highlights import HighlightSettings
from addon.core.frame.plan import FrameOptions
from addon.core.frame.steadied import Steadied
from addon.core.media.clip import open_footage
from addon.core.media.light import to_linear
from addon.core.optics.zone import NO_ZONE, InFocusZone
from addon.render.views.average import render_frame

from ..scenes import plane_picture, psnr, slanted_plane, write_plane

SIZE = (240, 136)
LENS = Intrinsics(*SIZE, 210.0, 210.0, 120.0, 68.0)
FRAMES = tuple(range(1, 12))
FRAME = 6


def shaken(plane: Reconstruction, strength: float = 1.0) -> Reconstruction:
    """The plane's cameras in a hand that trembles."""
    rng = np.random.default_rng(2)
    images = []
    for image in plane.images:
        rotation = rotation_matrix(strength * rng.normal(0, 0.004, 3)) @ image.rotation
        centre = image.centre + strength * rng.normal(0, 0.02, 3)
        local = (plane.points.xyz - centre) @ rotation.T
        images.append(Image(image.frame, rotation, -rotation @ centre, LENS.project(local), image.points))
    return replace(plane, images=tuple(images))


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> ClipContext:
    plane = shaken(slanted_plane(LENS, FRAMES))
    folder: Path = write_plane(tmp_path_factory.mktemp("steadied") / "clip", plane)
    return ClipContext(plane, open_footage(folder).read)


def drawn(clip: ClipContext, radius: float) -> tuple[LinearRGBA, Frame]:
    options = FrameOptions(
        Focus(distance=7.0), radius, views=32, method="features", stabilize=1.0,
        highlights=HighlightSettings(0.0),
    )  # fmt: skip
    found: list[Frame] = []
    picture = render_frame(clip, FRAME, options, SIZE, lambda note: None, found.append)
    return picture, found[0]


def traced(clip: ClipContext, warped: Frame) -> LinearRGBA:
    """The mean over the views' places on the aperture of what rays through the focal plane meet."""
    steady = warped.steadied
    assert steady is not None
    image, _ = clip.reconstruction.image_at(FRAME)
    picture, path = to_linear(clip.read(FRAME)), clip.steady_path(1.0)
    rotation, centre = path.rotations[FRAME - 1], path.centres[FRAME - 1]
    own = np.linalg.lstsq(clip.reconstruction.points.xyz, np.ones(150), rcond=None)[0]
    camera = warped.views.canvas.pinhole
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    ray = np.dstack([(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, np.ones_like(x)]) @ rotation
    # In focus is the plane that the frame's own camera has 7 units ahead.
    at = (7.0 - image.translation[2] - image.rotation[2] @ centre) / (ray @ image.rotation[2])
    in_focus = centre + at[..., None] * ray
    total = np.zeros((SIZE[1], SIZE[0], 4), np.float32)
    places = warped.views.lens.aperture_positions(warped.views.offsets)
    for place in places:
        begin = centre + place @ rotation[:2]
        way = in_focus - begin
        met = begin + ((1 - begin @ own) / (way @ own))[..., None] * way
        seen: Floats = LENS.project(image.to_camera(met)) - 0.5
        total += cv2.remap(
            picture, seen.astype(np.float32), None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT
        )
    return total / np.float32(len(places))


@pytest.mark.parametrize("radius", [0.001, 0.4])
def test_it_is_what_a_lens_on_the_steadier_path_sees(clip: ClipContext, radius: float) -> None:
    picture, warped = drawn(clip, radius)
    inside = slice(4, -4), slice(4, -4)
    assert psnr(picture[inside], traced(clip, warped)[inside]) > 45
    # The frame as it is would not do.
    assert psnr(picture[inside], to_linear(clip.read(FRAME))[inside]) < 30


@pytest.fixture(scope="module")
def shaky(tmp_path_factory: pytest.TempPathFactory) -> ClipContext:
    """A clip whose frames miss 3 to 8 pixels of what a steadier camera sees."""
    plane = shaken(slanted_plane(LENS, FRAMES), 5.0)
    folder: Path = write_plane(tmp_path_factory.mktemp("shaky") / "clip", plane)
    return ClipContext(plane, open_footage(folder).read)


@pytest.mark.parametrize("borrow", [True, False])
def test_past_the_border_is_what_other_frames_saw(shaky: ClipContext, borrow: bool) -> None:
    options = FrameOptions(
        Focus(distance=7.0), 0.001, views=8, stabilize=1.0, fill_border=True, borrow=borrow, grain=0.0,
        highlights=HighlightSettings(0.0),
    )  # fmt: skip
    path = shaky.steady_path(1.0, True)
    assert path.zoom == 1.0 < shaky.steady_path(1.0).zoom
    found: list[Frame] = []
    picture = render_frame(shaky, FRAME, options, SIZE, lambda note: None, found.append)[..., :3]
    steady = found[0].steadied
    assert steady is not None
    missing = steady.beyond(np.array([1 / 12, 1 / 5]))
    assert 3 < missing < 20
    rotation, centre = path.rotations[FRAME - 1], path.centres[FRAME - 1]
    there = Image(FRAME, rotation, -rotation @ centre, np.zeros((0, 2)), np.zeros(0, np.int32))
    wished = to_linear(plane_picture(shaky.reconstruction, there))[..., :3]
    border = np.ones(picture.shape[:2], bool)
    border[int(missing) : -int(missing), int(missing) : -int(missing)] = False
    score = psnr(picture[border], wished[border])
    assert (score > 36) if borrow else (score < 30)


@pytest.mark.parametrize("zone", [NO_ZONE, InFocusZone(0.3, 0.5, 0.5)], ids=["plain", "zone"])
def test_places_move_as_the_cameras_do(clip: ClipContext, zone: InFocusZone) -> None:
    _, warped = drawn(clip, 0.1)
    steady, path = warped.steadied, clip.steady_path(1.0)
    assert isinstance(steady, Steadied)
    lenses = (replace(each, zone=zone) for each in (steady.lens, steady.own_lens))
    steady = replace(steady, **dict(zip(("lens", "own_lens"), lenses, strict=True)))
    image, _ = clip.reconstruction.image_at(FRAME)
    world = clip.reconstruction.points.xyz
    local = image.to_camera(world)
    inverse = steady.own_lens.rectified(1 / local[:, 2], LENS.project(local))
    place, there = steady.moved(LENS.project(local), inverse)
    seen = (world - path.centres[FRAME - 1]) @ path.rotations[FRAME - 1].T
    assert np.allclose(place, warped.views.canvas.pinhole.project(seen), atol=1e-9)
    assert np.allclose(steady.lens.unrectified(there, place), 1 / seen[:, 2], atol=1e-10)
