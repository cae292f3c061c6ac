"""A tilted focal plane, against pinhole pictures of the scene itself that are brought into register by the
homography of the plane, found from its points."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from addon.core.base.arrays import Floats, LinearRGBA, Map
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.depth.source import PixelDepth
from addon.core.depth.sparse import FrameFeatures, frame_features
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.frame import Frame
from addon.core.frame.frame_path import mesh_frame
from addon.core.frame.plan import FrameOptions
from addon.core.media.light import encode_srgb
from addon.core.optics.aperture_sampling import vogel_disc
from addon.render.views.average import draw_mean
from addon.render.views.gpu_views import gpu_problem
from benchmarks.displaced import displaced

from ..scenes import psnr, texture

needs_gpu = pytest.mark.skipif(bool(gpu_problem()), reason="only CI is sure to have a GPU driver")
SIZE = (192, 108)
LENS = Intrinsics(*SIZE, 180.0, 176.0, 99.0, 51.0)
RADIUS = 0.5
PINHOLES = 128
FINER = 3
"""Pixels of the reference across one of the picture."""
TEXELS = 40
"""A scene unit of the scene's textures, which reach as far in every direction from the axis."""
WALL, CARD = (8.0, -0.5), (4.5, 0.3)
"""Distance on the axis and its slope to the right: Z = Z0 + slope X."""
EDGES = (-0.9, 0.9, -0.5, 0.7)
"""Of the card: left, right, top and bottom, in scene units."""
UNTILTED = Focus(distance=6.0)
TILTED = Focus(distance=6.0, tilt=0.35, swing=-0.6)
POINTS = np.array([[-1.0, -0.6, 8.0], [1.2, -0.5, 5.0], [0.1, 0.9, 5.5], [0.1, 0.5, 5.9]])
THROUGH = Focus(points=(0, 1, 2), through_points=True)


def camera(finer: int = FINER) -> Floats:
    """Intrinsic matrix in OpenCV's pixels, of a picture so many times as fine."""
    scaled = LENS.scaled(finer * SIZE[0], finer * SIZE[1])
    return np.array([[scaled.fx, 0, scaled.cx - 0.5], [0, scaled.fy, scaled.cy - 0.5], [0, 0, 1]])


@cache
def painted(seed: int) -> Map:
    """(n, n, 3) linear; not to be written to."""
    size = 16 * TEXELS
    return 0.8 * (texture(size, size, seed).astype(np.float32) / 255) ** 2.2


def seen(surface: tuple[float, float], seed: int, at: Floats) -> Map:
    """(h, w, 3) finely what a pinhole at (x, y) of the lens sees of a whole surface, linear."""
    texels = painted(seed)
    # From texels to the surface's (X, Y, Z), as the camera sees it.
    place = np.array([[1 / TEXELS, 0, -8.0], [0, 1 / TEXELS, -8.0], [0, 0, 1]])
    plane = np.array([[1, 0, -at[0]], [0, 1, -at[1]], [surface[1], 0, surface[0]]])
    fine = (FINER * SIZE[0], FINER * SIZE[1])
    return cv2.warpPerspective(texels, camera() @ plane @ place, fine, flags=cv2.INTER_LINEAR)


def pinhole(at: Floats, has_card: bool) -> Map:
    """(h, w, 3) finely the scene as a pinhole at (x, y) of the lens sees it."""
    wall = seen(WALL, 1, at)
    if not has_card:
        return wall
    left, right, top, bottom = EDGES
    corners = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
    depth = CARD[0] + CARD[1] * corners[:, 0]
    local = np.column_stack([corners - at, depth]) @ camera().T
    cover = np.zeros((FINER * SIZE[1], FINER * SIZE[0]), np.uint8)
    outline = np.round(16 * local[:, :2] / local[:, 2:]).astype(np.int32)
    cv2.fillConvexPoly(cover, outline, 255, cv2.LINE_AA, 4)
    share = cover[..., None] / np.float32(255)
    return (1 - share) * wall + share * seen(CARD, 2, at)


def plane_points(focus: Focus) -> Floats:
    """(4, 3) points of the focal plane."""
    if focus.points:
        one, other, third = POINTS[list(focus.points)]
        return np.array([one, other, third, one + 0.7 * (other - one) + 0.4 * (third - one)])
    assert focus.distance
    across = np.array([[-2.0, -1.0], [2.0, -1.0], [2.0, 1.0], [-2.0, 1.0]])
    # To the right and up, by so many units a unit.
    deep = focus.distance + across @ [np.tan(focus.swing), -np.tan(focus.tilt)]
    return np.column_stack([across, deep])


def homography(focus: Focus, at: Floats, finer: int) -> Floats:
    """From pixels of a pinhole's picture at (x, y) of the lens to those of the middle one's, on the plane, to
    a ten-thousandth: OpenCV takes single precision."""
    points = plane_points(focus)
    theirs, own = ((points - [*place, 0]) @ camera(finer).T for place in (at, (0.0, 0.0)))
    return cv2.findHomography(theirs[:, :2] / theirs[:, 2:], own[:, :2] / own[:, 2:])[0]


def reference(focus: Focus, has_card: bool) -> Map:
    """(H, W, 3) the mean of many pinholes' pictures, the focal plane in register."""
    total = np.zeros((FINER * SIZE[1], FINER * SIZE[0], 3), np.float32)
    for at in RADIUS * vogel_disc(PINHOLES):
        matrix = homography(focus, at, FINER)
        total += cv2.warpPerspective(
            pinhole(at, has_card), matrix, total.shape[1::-1], flags=cv2.INTER_LINEAR
        )
    return cv2.resize(total / PINHOLES, SIZE, interpolation=cv2.INTER_AREA)


@cache
def source(has_card: bool = True) -> LinearRGBA:
    """(H, W, 4) what the pinhole in the middle sees."""
    picture = cv2.resize(pinhole(np.zeros(2), has_card), SIZE, interpolation=cv2.INTER_AREA)
    return np.dstack([picture, np.ones(SIZE[::-1], np.float32)])


class Truth:
    """A depth source: what the scene is."""

    def __init__(self, has_card: bool = True) -> None:
        self._has_card = has_card

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth:
        rows, columns = np.mgrid[: SIZE[1], : SIZE[0]] + 0.5
        x, y = (columns - LENS.cx) / LENS.fx, (rows - LENS.cy) / LENS.fy
        wall, card = ((1 - slope * x) / distance for distance, slope in (WALL, CARD))
        left, right, top, bottom = EDGES
        is_card = (
            (left * card < x) & (x < right * card) & (top * card < y) & (y < bottom * card) & self._has_card
        )
        shape = picture.shape[:2]
        return PixelDepth(
            np.where(is_card, card, wall).astype(np.float32),
            np.ones(shape, np.float32),
            np.zeros(shape, bool),
        )

    def samples(self, frame: int, canvas: Canvas) -> FrameFeatures:
        return frame_features(reconstruction(), frame, canvas)


def reconstruction() -> Reconstruction:
    """One camera, with the points of a focal plane and others on the wall."""
    x, y = np.meshgrid(np.linspace(-4, 4, 9), np.linspace(-2, 2, 5))
    wall = np.column_stack([x.ravel(), y.ravel(), WALL[0] + WALL[1] * x.ravel()])
    xyz = np.concatenate([POINTS, wall])
    # The focal plane's own points would be spikes of a coarse mesh: they are not seen.
    ids = np.arange(len(POINTS), len(xyz), dtype=np.int32)
    image = Image(1, np.eye(3), np.zeros(3), LENS.project(wall), ids)
    return Reconstruction(
        (LENS,), (image,), Points(xyz, np.zeros((len(xyz), 3), np.uint8), np.zeros(len(xyz)))
    )


def meshed(focus: Focus, method: str = "layers", has_card: bool = True) -> Frame:
    clip = ClipContext(reconstruction(), lambda frame: np.zeros((*SIZE[::-1], 3), np.uint8), Truth(has_card))
    return mesh_frame(clip, 1, FrameOptions(focus, RADIUS, 0, method, borrow=False), SIZE, source(has_card))


def error(mean: Map, true: Map) -> float:
    """PSNR in dB as displayed, as far from the border as any view misses of it."""
    inner = (slice(20, -20), slice(24, -24), slice(3))
    return psnr(*(encode_srgb(np.clip(part[inner].astype(np.float64), 0, 1)) for part in (mean, true)))


@pytest.mark.parametrize("focus", [TILTED, THROUGH], ids=["angles", "points"])
@pytest.mark.parametrize("method", ["layers", "features"])
def test_views_are_where_the_planes_homography_takes_them(focus: Focus, method: str) -> None:
    plan = meshed(focus, method).through(12).views
    rng = np.random.default_rng(0)
    pixels = rng.uniform([0, 0], SIZE, (50, 2))
    inverse = rng.uniform(0, 0.3, 50)
    moved = displaced(plan, pixels, plan.lens.rectified(inverse, pixels))
    rays = np.column_stack([(pixels - LENS.principal_point) / LENS.focal, np.ones(50)])
    for place, shown in zip(plan.lens.aperture_positions(plan.offsets), moved, strict=True):
        assert np.linalg.norm(place) < RADIUS
        # A point at inverse depth 0 only turns with the camera.
        local = (rays - np.append(place, 0) * inverse[:, None]) @ camera(1).T
        registered = local @ homography(focus, place, 1).T
        np.testing.assert_allclose(shown, registered[:, :2] / registered[:, 2:] + 0.5, atol=1e-3)
    np.testing.assert_allclose(
        plan.lens.unrectified(plan.lens.rectified(inverse, pixels), pixels), inverse, atol=1e-12
    )


@needs_gpu
@pytest.mark.parametrize("has_card", [False, True], ids=["wall", "card before a wall"])
def test_a_tilted_plane_is_as_good_as_those_that_are_not(has_card: bool) -> None:
    found = {}
    for focus in (UNTILTED, Focus(distance=WALL[0]), TILTED, THROUGH):
        mean = draw_mean(meshed(focus, has_card=has_card).through(96))
        true = reference(focus, has_card)
        found[focus] = error(mean, true)
        print(f"{found[focus]:.2f} dB, as it was {error(source(has_card), true):.2f}: {focus}")
    # How much of what the card hides is in focus, and so guessed sharply, is not the same.
    rectified = min(found[UNTILTED], found[Focus(distance=WALL[0])])
    assert rectified > (37 if has_card else 45)
    assert min(found[TILTED], found[THROUGH]) > rectified - 0.5


@needs_gpu
def test_what_is_in_the_tilted_plane_stays_sharp() -> None:
    # The wall itself: nothing is out of focus but the card, which features know nothing of.
    on_wall = Focus(points=(4, 12, 48), through_points=True)
    mean = draw_mean(meshed(on_wall, "features").through(16))
    assert error(mean, source()) > 45
    assert error(draw_mean(meshed(UNTILTED, "features").through(16)), source()) < 35


@needs_gpu
def test_angles_of_nothing_change_nothing() -> None:
    plain = draw_mean(meshed(UNTILTED).through(8))
    level = replace(UNTILTED, tilt=0.0, swing=0.0, through_points=True)
    np.testing.assert_array_equal(draw_mean(meshed(level).through(8)), plain)
