"""Highlights drawn as discs: their energy, their shape, what hides them, and when pictures stay as they
are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest

from addon.core.base.arrays import Floats, LinearRGBA, Map
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Intrinsics, rotation_matrix
from addon.core.depth.source import PixelDepth
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.frame import Frame
from addon.core.frame.frame_path import mesh_frame
from addon.core.frame.highlight_discs import BRIGHT, TrackedDepth, without_small_highlights
from addon.core.frame.highlights import HighlightSettings
from addon.core.frame.plan import FrameOptions
from addon.core.media.light import to_linear
from addon.core.optics.aperture import Aperture
from addon.core.warp.cg_layer import CGLayer

from .. import planes
from ..scenes import slanted_plane, texture

SIZE = (240, 160)
LENS = Intrinsics(*SIZE, 200.0, 200.0, 120.0, 80.0)
FOCUS, FAR = 4.0, 8.0
RADIUS = 12.0 / (200.0 * (1 / FOCUS - 1 / FAR))
"""Of an aperture through which what is at FAR has a disc of 24 pixels."""


class Given:
    """A depth source: inverse depth (H, W) is told."""

    def __init__(self, inverse: Floats) -> None:
        self._inverse = inverse

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth:
        return PixelDepth(self._inverse)

    def samples(self, frame: int, canvas: Canvas) -> None:
        return None


def dark(light: float = 0.05) -> LinearRGBA:
    """(H, W, 4) of one grey."""
    picture = np.full((SIZE[1], SIZE[0], 4), light, np.float32)
    picture[..., 3] = 1
    return picture


def with_highlight(picture: LinearRGBA, x: int, y: int, light: float = 40.0) -> LinearRGBA:
    """A picture with a highlight two pixels wide."""
    picture = picture.copy()
    picture[y : y + 2, x : x + 2, :3] += light * np.array([1.0, 0.8, 0.5], np.float32)
    return picture


def drawn(picture: LinearRGBA, inverse: Floats, views: int = 16, gain: float = 1.0, **shape: float) -> Frame:
    lens = FrameOptions(
        Focus(distance=FOCUS), RADIUS, borrow=False, aperture=Aperture(**shape),  # type: ignore[arg-type]
        highlights=HighlightSettings(gain),
    )  # fmt: skip
    clip = ClipContext(slanted_plane(LENS), lambda frame: texture(*SIZE), Given(inverse))
    return mesh_frame(clip, 2, lens, SIZE, picture).through(views)


def discs(frame: Frame) -> Map:
    assert frame.highlight_discs is not None
    return frame.highlight_discs.light(frame.views, frame.layers, steadied=frame.steadied)


def flat(distance: float = FAR) -> Floats:
    return np.full(SIZE[::-1], 1 / distance)


@pytest.mark.parametrize("shape", [{}, {"blades": 5}, {"obstruction": 0.5}, {"ratio": 1.6}], ids=str)
@pytest.mark.parametrize("distance", [FAR, 8 / 3], ids=["behind", "before"])
def test_a_highlight_in_the_open_keeps_its_energy_and_its_place(
    shape: dict[str, float], distance: float
) -> None:
    frame = drawn(with_highlight(dark(), 101, 71), flat(distance), **shape)
    light = discs(frame)
    # Four pixels over a ground that stays.
    np.testing.assert_allclose(light.sum(axis=(0, 1)), 4 * 40 * np.array([1, 0.8, 0.5]), rtol=1e-3)
    row, column = np.mgrid[: SIZE[1], : SIZE[0]] + 0.5
    if shape != {"blades": 5}:
        middle = [(axis * light[..., 0]).sum() / light[..., 0].sum() for axis in (column, row)]
        np.testing.assert_allclose(middle, [102, 72], atol=0.02)
    brightest = max(each.picture[..., :3].max() for each in frame.layers)
    np.testing.assert_allclose(brightest, 0.05, rtol=1e-3)


def test_a_disc_is_round_and_even() -> None:
    light = discs(drawn(with_highlight(dark(), 119, 79), flat()))[..., 0]
    row, column = np.mgrid[: SIZE[1], : SIZE[0]] + 0.5
    away = np.hypot(row - 80, column - 120)
    inner = light[away < 12 - 3]
    np.testing.assert_allclose(inner, 160 / (np.pi * 12**2), rtol=2e-2)
    assert light[away > 12 + 3].max() < 1e-5


def straight(near: float, edge: int) -> Floats:
    """(H, W) inverse depth of a wall at FAR behind a half plane right of a column."""
    inverse = flat()
    inverse[:, edge:] = 1 / near
    return inverse


@pytest.mark.parametrize("near", [FOCUS, 3.0])
def test_a_highlight_is_clipped_by_what_is_nearer(near: float) -> None:
    """From p the edge is beside the highlight at (s_edge - s_highlight) p, whatever is in focus."""
    edge, middle = 110, 102.0
    picture = with_highlight(dark(), 101, 71)
    picture[:, edge:, :3] = 0.4
    inverse = straight(near, edge)
    lit, whole = (
        discs(drawn(picture, inverse))[..., 0],
        discs(drawn(with_highlight(dark(), 101, 71), flat()))[..., 0],
    )
    apart = RADIUS * 200 * (1 / near - 1 / FAR)
    # Places of the aperture from which the edge hides it, and where its light would be seen from there.
    least = (edge - middle) / apart
    first = middle + 12 * least
    column = np.broadcast_to(np.arange(SIZE[0]) + 0.5, lit.shape)
    # A highlight two pixels wide: shadows of near edges are soft by as much.
    np.testing.assert_allclose(lit[column < first - 2.5], whole[column < first - 2.5], atol=3e-4)
    assert lit[column > first + 2.5].max(initial=0) < 0.02 * whole.max()
    share = lit.sum() / whole.sum()
    seen = np.clip(least, -1, 1)
    covered = 1 - (np.arccos(seen) - seen * np.sqrt(1 - seen**2)) / np.pi
    assert share == pytest.approx(covered, abs=0.03)


def test_nothing_that_is_farther_or_as_far_hides_a_highlight() -> None:
    rng = np.random.default_rng(3)
    inverse = flat() * (1 + 0.004 * rng.standard_normal(SIZE[::-1]))
    inverse[:, 110:] = 1 / 20.0
    inverse[70:76, 98:106] = 1 / FAR
    light = discs(drawn(with_highlight(dark(), 101, 71), inverse))
    assert light[..., 0].sum() == pytest.approx(160, rel=5e-3)


@pytest.mark.parametrize("away", [3.0, 20.0], ids=["before", "behind"])
def test_a_title_that_stays_sharp_hides_discs_where_it_stands(away: float) -> None:
    frame = drawn(with_highlight(dark(), 119, 79), flat())
    title = np.zeros((SIZE[1], SIZE[0], 4), np.float32)
    title[:, 124:] = 1
    layer = CGLayer.of(title, np.full(SIZE[::-1], 1 / away, np.float32), 0, 0.0, is_sharp=True)
    whole, held = discs(frame), frame.highlight_discs
    assert layer is not None and held is not None and whole[:, 124:].any()
    found = held.light(frame.views, frame.layers, [layer])
    # A hard edge through the disc, or none of it.
    assert np.array_equal(found[:, :124], whole[:, :124])
    assert np.array_equal(found[:, 124:], whole[:, 124:] * (away > FAR))


@pytest.mark.parametrize(
    "change",
    [
        lambda: (with_highlight(dark(), 101, 71), flat(), 0.0),
        lambda: (with_highlight(dark(), 101, 71), flat(FOCUS), 1.0),
        lambda: (with_highlight(dark(), 101, 71, 0.9), flat(), 1.0),
        lambda: (cv2.rectangle(dark(), (60, 40), (100, 100), (9.0, 9.0, 9.0, 1.0), -1), flat(), 1.0),
    ],
    ids=["highlights off", "in focus", "not over white", "wider than its disc"],
)  # fmt: skip
def test_everything_else_stays_in_the_texture(change: Callable[[], tuple[LinearRGBA, Floats, float]]) -> None:
    picture, inverse, gain = change()
    frame = drawn(picture, inverse, gain=gain)
    assert frame.highlight_discs is None


def test_light_is_moved_not_lost() -> None:
    rng = np.random.default_rng(1)
    picture = dark()
    picture[..., :3] += 0.3 * rng.random((SIZE[1], SIZE[0], 3), np.float32)
    for x, y in rng.integers(5, 150, (30, 2)):
        picture = with_highlight(picture, x, y, 2 * BRIGHT)
    rest, highlights = without_small_highlights(picture, np.full(SIZE[::-1], -12, np.float32), Aperture())
    assert highlights is not None
    total = rest.copy()
    for highlight in highlights.found:
        row, column = highlight.corner
        total[row:, column:, :3][: highlight.light.shape[0], : highlight.light.shape[1]] += highlight.light
    np.testing.assert_allclose(total, picture, atol=1e-5)
    assert rest.min() >= 0
    assert rest[..., :3].max() < BRIGHT


def test_a_disc_is_as_large_as_its_feature_points_say_where_stereo_sees_the_background() -> None:
    lamp = np.array([0.0, -0.6, 8.0])
    corners = lamp + 0.06 * np.array([[-1, -1, 0], [1, -1, 0], [-1, 1, 0], [1, 1, 0]])
    solve = planes.poses(planes.CENTRES, np.concatenate([planes.features(), corners]))
    pictures = planes.clip(planes.CENTRES)
    for picture, centre in zip(pictures, planes.CENTRES, strict=True):
        x, y = planes.LENS.project((lamp - centre)[None])[0].round().astype(int)
        picture[y - 2 : y + 2, x - 2 : x + 2] = 255
    frame, radius = planes.MIDDLE, 0.35
    source = to_linear(pictures[frame - 1])
    source[98:102, 158:162, :3] = 40
    clip = ClipContext(solve, lambda frame: pictures[frame - 1])
    lens = FrameOptions(Focus(distance=4.0), radius, borrow=False)
    found = mesh_frame(clip, frame, lens, planes.SIZE, source).highlight_discs
    assert found is not None
    (highlight,) = found.found
    assert highlight.displacement == pytest.approx(radius * planes.FOCAL * (1 / 8 - 1 / 4), abs=0.2)


@pytest.mark.parametrize(
    ("place", "displacement", "expected"),
    [((105, 72), -8.0, -8.0), ((105, 72), -15.0, -12.0), ((110, 72), -8.0, -12.0), ((98, 72), 0.0, -12.0)],
    ids=["nearer", "farther", "beside it", "of another surface"],
)
def test_feature_points_of_a_highlight_alone_bring_it_nearer(
    place: tuple[int, int], displacement: float, expected: float
) -> None:
    surfaces = np.full(SIZE[::-1], -12, np.float32)
    surfaces[:, :100] = 0
    tracked = TrackedDepth(np.array([place], np.float64), np.array([displacement], np.float32))
    _, highlights = without_small_highlights(with_highlight(dark(), 101, 71), surfaces, Aperture(), tracked)
    assert highlights is not None
    assert highlights.found[0].displacement == pytest.approx(expected)


def test_from_a_steadier_path_a_disc_stands_where_its_highlight_is_seen() -> None:
    picture = with_highlight(dark(), 60, 50)
    plane = slanted_plane(LENS, (1, 2, 3, 4))
    first, second, *others = plane.images
    shaken = replace(second, rotation=rotation_matrix(np.array([0.01, -0.01, 0.005])) @ second.rotation)
    plane = replace(plane, images=(first, shaken, *others))
    clip = ClipContext(plane, lambda frame: texture(*SIZE), Given(flat()))
    lens = FrameOptions(Focus(distance=FOCUS), RADIUS, borrow=False, stabilize=1.0)
    made = mesh_frame(clip, 2, lens, SIZE, picture).through(16)
    path, (image, _), pinhole = (
        clip.steady_path(1.0),
        clip.reconstruction.image_at(2),
        made.views.canvas.pinhole,
    )
    ray = np.array([(61 - LENS.cx) / LENS.fx, (51 - LENS.cy) / LENS.fy, 1.0])
    world = image.centre + FAR * ray @ image.rotation
    seen = pinhole.project((world - path.centres[1]) @ path.rotations[1].T)
    light = discs(made).sum(axis=2)
    y, x = np.nonzero(light > 0)
    weights = light[y, x] / light.sum()
    assert np.hypot(*(seen - [61, 51])) > 0.5
    assert weights @ (x + 0.5) == pytest.approx(seen[0], abs=0.05)
    assert weights @ (y + 0.5) == pytest.approx(seen[1], abs=0.05)
    # Enlarged as the picture is, as bright as it was.
    own = discs(mesh_frame(clip, 2, replace(lens, stabilize=0.0), SIZE, picture).through(16)).sum()
    assert light.sum() / own == pytest.approx(path.zoom**2, rel=0.01)
