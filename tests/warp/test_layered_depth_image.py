"""Layers: a frame taken apart at its silhouettes, the mesh over it, and what views of it look like."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray

from addon.core.base.arrays import Floats, LinearRGB, Map, Mask
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Intrinsics
from addon.core.depth.stereo_depth import upsampled
from addon.core.frame.views import Views
from addon.core.optics.aperture import ApertureSamples
from addon.core.optics.aperture_sampling import vogel_disc
from addon.core.optics.thin_lens import ThinLens
from addon.core.warp import layered_mesh
from addon.core.warp.layer import Layer, joined
from addon.core.warp.layered_depth_image import LayeredDepthImage, depth_peel, split
from addon.core.warp.layered_mesh import FINER, FIRST_JUMP, WIDEST
from addon.core.warp.quadtree import SILHOUETTE_ERROR, Surfaces, triangulate
from addon.render.views import gpu_views
from sample_scenes import cycles_views

from ..disc_and_wall import (
    DISC,
    FAR,
    LENS,
    NEAR,
    SHIFT,
    SIZE,
    X,
    Y,
    cover,
    interpolated,
    make_mesh,
    one,
    scene,
    wall,
)


def through(canvas: Canvas, focus: float, offsets: Floats) -> Views:
    """Views at these places; `focus` is the focal plane's displacement in pixels at a radius of one."""
    return Views(canvas, ThinLens(LENS, 1.0, focus / 150)).placed(ApertureSamples(offsets))


def areas(triangles: NDArray[np.int32], width: int) -> Floats:
    row, column = np.divmod(triangles, width)
    (ax, bx, cx), (ay, by, cy) = column.T, row.T
    return np.asarray(((bx - ax) * (cy - ay) - (cx - ax) * (by - ay)) / 2, np.float64)


# The mesh


def of(found: LayeredDepthImage) -> Surfaces:
    return Surfaces(
        found.front_disparity,
        found.near_disparity,
        found.back_disparity,
        found.mixed,
        found.is_far,
        found.disoccluded,
    )


def test_a_silhouette_takes_few_triangles_of_each_surface() -> None:
    taken = split(scene(), SHIFT, 1.0, 1.0)
    found = triangulate(of(taken), 4.0, 0.2)
    assert len(found.far) + len(found.near) < 0.05 * 2 * SIZE[0] * SIZE[1]
    assert not len(found.cut)
    assert np.abs(areas(found.far, SIZE[1])).sum() == (SIZE[0] - 1) * (SIZE[1] - 1)
    far, near = interpolated(taken.back_disparity, found.far), interpolated(taken.near_disparity, found.near)
    np.testing.assert_allclose(far[cover() == 0], FAR, atol=0.4)
    np.testing.assert_allclose(far[taken.disoccluded], FAR, atol=1.6)
    assert np.median(np.abs(far[taken.disoccluded] - FAR)) < 0.2
    rim = (cover() > 0) & (np.hypot(X - 80, Y - 60) > DISC - 3)
    np.testing.assert_allclose(near[rim], NEAR, atol=0.4)
    assert found.before[rim].all()


def test_nothing_spans_a_jump_where_three_surfaces_meet() -> None:
    shift = np.where(X < 80, 1.0, 9.0) + np.where(Y < 60, 0.0, 20.0)
    shift[50:70, 70:90] = 50.0
    picture = np.ones((*SIZE, 4), np.float32)
    picture[..., :3] = (shift / 60)[..., None]
    taken = split(picture, shift, 1.0, 1.0)
    found = triangulate(of(taken), 2.0, 0.2)
    assert len(found.cut)
    assert np.ptp(taken.front_disparity.ravel()[found.cut], axis=1).max() <= 2
    cut, near, far = (
        np.nan_to_num(interpolated(*pair), nan=-1)
        for pair in (
            (taken.front_disparity, found.cut),
            (taken.near_disparity, found.near),
            (taken.back_disparity, found.far),
        )
    )  # fmt: skip
    # The near surface is transparent past its silhouettes.
    top = np.maximum(np.maximum(cut, np.where(taken.is_far, -1, near)), far)
    assert (np.abs(top - taken.front_disparity) < 1).mean() > 0.97


@pytest.mark.parametrize("error", [0.05, 0.3])
def test_the_error_is_bounded_and_there_are_no_cracks(error: float) -> None:
    depth = 4 * np.exp(-((X - 60) ** 2 + (Y - 50) ** 2) / 900) + 0.4 * np.sin(X / 9)
    triangles = triangulate(one(depth), 1.0, error).far
    found = interpolated(depth, triangles)
    assert np.isfinite(found).all()
    # A fan's triangles are smaller than the two that were measured, but not the same; what is steep may
    # be off by more.
    assert np.quantile(np.abs(found - depth), 0.9) < error
    assert np.abs(found - depth).max() < 1.5 * SILHOUETTE_ERROR * error
    total = np.abs(areas(triangles, SIZE[1])).sum()
    assert total == (SIZE[0] - 1) * (SIZE[1] - 1)


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (2, 2), (5, 3), (65, 64)])
def test_any_size(size: tuple[int, int]) -> None:
    triangles = triangulate(one(np.zeros(size)), 1.0, 0.1).far
    assert np.abs(areas(triangles, size[1])).sum() == (size[0] - 1) * (size[1] - 1)


# The layers


def test_both_layers_together_are_the_picture() -> None:
    picture = scene()
    found = split(picture, SHIFT, 1.0, 1.0)
    composed = found.front[..., :3] + (1 - found.front[..., 3:]) * found.back[..., :3]
    np.testing.assert_allclose(composed, picture[..., :3], atol=2e-3)
    assert found.front[..., 3].min() >= 0 and found.front[..., 3].max() <= 1


def test_what_is_behind_is_carried_on_as_far_as_the_aperture_sees() -> None:
    found = split(scene(), SHIFT, 1.0, 1.0)
    depth_within = DISC - np.hypot(X - 80, Y - 60)
    near_edge = (depth_within > 0) & (depth_within < NEAR - FAR)
    assert (found.disoccluded | found.mixed)[near_edge].all()
    assert not found.disoccluded[depth_within > NEAR - FAR + 4].any()
    assert not found.disoccluded[depth_within < -5].any()
    np.testing.assert_allclose(found.back_disparity[near_edge], FAR, atol=0.01)
    assert not (found.is_far & (cover() > 0)).any()
    np.testing.assert_allclose(found.near_disparity[found.is_far], NEAR, atol=0.01)
    # No yellow gets behind the disc: it has a third of the wall's blue.
    assert found.back[near_edge][:, 2].min() > 0.28
    assert np.abs(found.back[..., :3] - wall())[near_edge].mean() < 0.12


def test_what_is_behind_is_where_it_is_known_to_be() -> None:
    """Beside the disc stands a wall; behind the half of it that is known stands something farther."""
    farther = np.where(X < 80, FAR - 2, np.nan).astype(np.float32)
    found = split(scene(), SHIFT, 1.0, 1.0, far=farther)
    left = found.occluded & (X < 78)
    right = found.occluded & (X > 82)
    assert left.any() and right.any()
    rim = NEAR - FAR + 2
    deep = DISC - np.hypot(X - 80, Y - 60)
    np.testing.assert_allclose(found.back_disparity[left & (deep < rim)], FAR - 2, atol=0.01)
    np.testing.assert_allclose(found.back_disparity[right & (deep < rim)], FAR, atol=0.01)
    # What would lie before it is not believed.
    nearer = split(scene(), SHIFT, 1.0, 1.0, far=np.full_like(SHIFT, NEAR + 1, np.float32))
    np.testing.assert_array_equal(nearer.back_disparity, split(scene(), SHIFT, 1.0, 1.0).back_disparity)


def test_other_frames_colours_are_taken_where_there_are_any() -> None:
    def fill(shift: Floats, wanted: Mask) -> tuple[LinearRGB, Mask]:
        assert shift.shape == SIZE and wanted.any()
        return wall().astype(np.float32), X < 80

    found = split(scene(), SHIFT, 1.0, 1.0, fill)
    assert found.reprojected.any() and not found.reprojected[X >= 80].any()
    error = np.abs(found.back[..., :3] - wall())
    assert error[found.reprojected].max() < 1e-6


def test_what_other_frames_see_beside_a_silhouette_tells_its_pixels_shares() -> None:
    def fill(shift: Floats, wanted: Mask) -> tuple[LinearRGB, Mask]:
        return wall().astype(np.float32), np.ones(SIZE, bool)

    def misled(shift: Floats, wanted: Mask) -> tuple[LinearRGB, Mask]:
        return np.full((*SIZE, 3), 5, np.float32), np.ones(SIZE, bool)

    guessed, filled, wrong = (split(scene(), SHIFT, 1.0, 1.0, how) for how in (None, fill, misled))
    off = [np.abs(found.front[..., 3] - cover())[found.mixed] for found in (guessed, filled, wrong)]
    print("share of a silhouette's pixel, mean error", *(f"{part.mean():.3f}" for part in off))
    assert off[1].mean() < 0.5 * off[0].mean()
    np.testing.assert_allclose(filled.back[filled.mixed][:, :3], wall()[filled.mixed], atol=1e-3)
    # Colours that cannot be there are not believed, but where the pixel may be the disc's alone.
    assert off[2].mean() < 1.2 * off[0].mean()


def test_no_surface_no_split() -> None:
    """What is left behind the disc is a wall, without a silhouette where the guess about it ends."""
    for jumps in ((4.0, 1.0), (1.0,), (20.0, 1.0)):
        splits = depth_peel(scene(), SHIFT, jumps=jumps)
        assert len(splits) == 1 and splits[0].mixed.any()
    (nothing,) = depth_peel(scene(), 0.02 * X, jumps=(4.0, 1.0))
    assert not nothing.mixed.any()


MIDDLE = 3.5
"""Displacement of a house between the disc and the wall,"""
GABLE, GABLES = 52.0, (42.0, 47.0, 52.0, 57.0, 62.0)
"""and the row of its roof: it leaves the disc steeply or flat."""


def stones(x: Floats, y: Floats) -> Floats:
    return np.stack([0.3 + 0.2 * np.cos(x / 2), 0.1 + 0.0 * x, 0.6 + 0.1 * np.sin(y)], axis=2)


def house(
    shift_x: float = 0.0, shift_y: float = 0.0, focus: float = 0.0, gable: float = GABLE
) -> NDArray[np.float32]:
    """(H, W, 4) the disc before a house before the wall, in register at `focus`."""
    disc = cover((NEAR - focus) * shift_x, (NEAR - focus) * shift_y)[..., None]
    x, y = X - (MIDDLE - focus) * shift_x, Y - (MIDDLE - focus) * shift_y
    roof = np.clip(y - gable + 0.5, 0, 1)[..., None]
    colour = wall((FAR - focus) * shift_x, (FAR - focus) * shift_y)
    colour = roof * stones(x, y) + (1 - roof) * colour
    colour = disc * [0.9, 0.8, 0.1] + (1 - disc) * colour
    return np.concatenate([colour, np.ones((*SIZE, 1))], axis=2).astype(np.float32)


def before_house(gable: float = GABLE) -> Floats:
    """(H, W) displacement of what is seen."""
    return np.where(cover() > 0.5, NEAR, np.where(gable < Y, MIDDLE, FAR))


def test_where_silhouettes_cross_three_surfaces_are_kept_apart() -> None:
    first, second = depth_peel(house(), before_house(), jumps=(5.0, 1.0))
    # The disc is gone from what is left, and the roof goes on behind it.
    rim = (cover() > 0) & (np.hypot(X - 80, Y - 60) > DISC - 4)
    assert np.isin(np.round(first.back_disparity[rim], 1), [MIDDLE, FAR]).mean() > 0.9
    assert second.mixed[int(GABLE), 90 : 80 + int(DISC)].any()
    beside = (np.abs(Y - GABLE) < 2) & (cover() == 0)
    assert not first.mixed[beside & (np.abs(X - 80) > DISC + 3)].any()
    assert second.mixed[beside & (np.abs(Y - GABLE) < 1)].all()


def hidden_colours(focus: float, shift: Map, wanted: Mask) -> tuple[LinearRGB, Mask]:
    """The colours of what is behind the disc, by its depth."""
    margin = (shift.shape[0] - SIZE[0]) // 2
    inner = slice(margin, margin + SIZE[0]), slice(margin, margin + SIZE[1])
    colour, known = np.zeros((*shift.shape, 3), np.float32), np.zeros(shift.shape, bool)
    colour[inner] = np.where((shift[inner] + focus > (MIDDLE + FAR) / 2)[..., None], stones(X, Y), wall())
    known[inner] = True
    return colour, known & wanted


@pytest.mark.parametrize("focus", [NEAR, FAR])
def test_three_surfaces_make_better_views_than_two(focus: float, monkeypatch: pytest.MonkeyPatch) -> None:
    offsets, canvas = vogel_disc(24), Canvas(LENS)
    found: dict[float, list[float]] = {FIRST_JUMP: [], 0.0: []}
    for gable in GABLES:
        true = np.mean([house(x, y, focus, gable)[..., :3] for x, y in -offsets], axis=0)
        crossing = (np.abs(Y - gable) < 12) & (np.abs(np.abs(X - 80) - DISC) < 12)
        for large, scores in found.items():
            monkeypatch.setattr(layered_mesh, "FIRST_JUMP", large)
            layers = make_mesh(
                house(gable=gable),
                before_house(gable),
                focus,
                150.0,
                fill=partial(hidden_colours, focus),
            )
            view = drawn(through(canvas, focus, offsets), layers)
            scores.append(psnr(view[crossing][:, :3].astype(np.float64), true[crossing]))
    three, two = found.values()
    for gable, of_three, of_two in zip(GABLES, three, two, strict=True):
        print(f"roof at {gable:.0f}: three surfaces {of_three:.1f} dB, two {of_two:.1f} dB")
    assert min(three) > 38
    # With the wall in focus, and told what the silhouettes hide, two are as good.
    assert focus == FAR or np.min(np.subtract(three, two)) > 0.5


@pytest.mark.parametrize("is_known", [True, False])
def test_what_stands_past_the_border_is_blurred_into_the_picture(is_known: bool) -> None:
    """The disc ends two pixels left of the picture, and others tell its depth, and its colour or not."""
    left, focus = 80 + int(DISC) + 2, FAR
    camera = Intrinsics(SIZE[1] - left, SIZE[0], 150.0, 150.0, SIZE[1] / 2 - left, SIZE[0] / 2)
    past = np.full((SIZE[0] + 80, SIZE[1] - left + 80), np.nan)
    past[40:-40, :40] = SHIFT[:, left - 40 : left]

    def fill(shift: Map, wanted: Mask) -> tuple[LinearRGB, Mask]:
        margin = (shift.shape[0] - SIZE[0]) // 2
        own = slice(margin, margin + SIZE[0]), slice(0, margin)
        colour, known = np.zeros((*shift.shape, 3), np.float32), np.zeros(shift.shape, bool)
        near = shift[own] + focus > 5
        colour[own] = np.where(near[..., None], [0.9, 0.8, 0.1], wall()[:, left - margin : left])
        known[own] = ~near | is_known
        return colour, known & wanted

    offsets, canvas = vogel_disc(24), Canvas(camera)
    seen = [cover((NEAR - FAR) * x, (NEAR - FAR) * y)[..., None] for x, y in -offsets]
    true = np.mean([c * [0.9, 0.8, 0.1] + (1 - c) * wall() for c in seen], axis=0)[:, left:]
    scores = []
    for known_past in (past, None):
        layers = make_mesh(
            scene()[:, left:], SHIFT[:, left:], focus, 150.0, fill=fill, past_border=known_past
        )
        view = drawn(through(canvas, focus, offsets), layers)
        scores.append(psnr(view[:, :6, :3].astype(np.float64), true[:, :6]))
    print(f"with depth past the border {scores[0]:.1f} dB, without {scores[1]:.1f} dB")
    if is_known:
        assert scores[0] > 35 and scores[0] > scores[1] + 8
    else:
        assert scores[0] == pytest.approx(scores[1], abs=0.5)


def test_a_surface_does_not_tear_between_two_silhouettes(monkeypatch: pytest.MonkeyPatch) -> None:
    """The house is behind the disc, and before the wall: near the one it is the far surface, near the other
    the near one, and between them it goes on."""
    monkeypatch.setattr(layered_mesh, "FIRST_JUMP", 0.0)
    canvas = Canvas(LENS)
    for offset in np.array([[0.0, 0.95], [0.7, 0.7]]):
        layers = make_mesh(house(), before_house(), NEAR, 150.0, fill=partial(hidden_colours, NEAR))
        view = drawn(through(canvas, NEAR, offset[None]), layers)
        x, y = -offset
        error = np.abs(view[..., :3] - house(x, y, NEAR)[..., :3]).max(axis=2)
        below = (GABLE + (MIDDLE - NEAR) * y + 4 < Y) & (X > 8)
        torn = error[below & (np.hypot(X - 80, Y - 60) > DISC + 3)]
        print(f"seen from {offset}: {torn.max():.2f} off at worst, {np.mean(torn > 0.1):.5f} over 0.1")
        assert (torn > 0.1).mean() < 4e-3


# Views


def plan(
    focus: float, count: int, picture: NDArray[np.float32] | None = None
) -> tuple[Views, tuple[Layer, ...]]:
    """The disc and the wall through an aperture whose rim displaces by `NEAR` and `FAR` pixels."""
    layers = make_mesh(scene() if picture is None else picture, SHIFT, focus, 150.0)
    return through(Canvas(LENS), focus, vogel_disc(count)), layers


def truth(focus: float, offsets: Floats) -> Floats:
    """(H, W, 3) mean of the true views in register with the focal plane."""
    total = np.zeros((*SIZE, 3))
    for x, y in -offsets:
        share = cover((NEAR - focus) * x, (NEAR - focus) * y)[..., None]
        total += share * [0.9, 0.8, 0.1] + (1 - share) * wall((FAR - focus) * x, (FAR - focus) * y)
    return total / len(offsets)


def drawn(views: Views, layers: tuple[Layer, ...]) -> NDArray[np.float32]:
    """(H, W, 4) the mean of views of layers."""
    gpu_views.check_gpu()
    return gpu_views.mean_of_views(views, layers)


def psnr(a: Floats, b: Floats) -> float:
    return float(-10 * np.log10(np.mean((a - b) ** 2)))


@pytest.mark.parametrize("focus", [NEAR, FAR])
def test_views_are_the_scenes(focus: float) -> None:
    views, layers = plan(focus, 24)
    true = truth(focus, views.offsets)
    inside = (slice(10, -10), slice(10, -10))
    mean = drawn(views, layers)
    assert mean[..., 3].min() > 0.999
    found = psnr(mean[inside][..., :3].astype(np.float64), true[inside])
    sharp = psnr(scene()[inside][..., :3].astype(np.float64), true[inside])
    print(f"focus at {focus}: {found:.1f} dB, no blur {sharp:.1f} dB")
    assert found > 38 > sharp + 8


def test_what_is_in_focus_comes_through_untouched() -> None:
    grain = np.random.default_rng(0).uniform(0.5, 1.0, SIZE)
    picture = scene()
    picture[..., :3] *= np.where(np.hypot(X - 80, Y - 60) < DISC - 5, grain, 1.0)[..., None].astype(
        np.float32
    )
    views, layers = plan(NEAR, 16, picture)
    mean = drawn(views, layers)
    inner = np.hypot(X - 80, Y - 60) < DISC - 3
    np.testing.assert_allclose(mean[inner], picture[inner], atol=1e-3)


def test_cycles_draws_the_same() -> None:
    if gpu_views.gpu_problem():
        pytest.skip("only CI is sure to have a GPU driver, if a software one")
    views, layers = plan(NEAR, 6)
    ours = gpu_views.mean_of_views(views, layers)
    theirs = cycles_views.mean_of_views(views, layers)
    assert np.abs(ours - theirs).mean() < 2e-3
    assert np.quantile(np.abs(ours - theirs), 0.98) < 0.02


def test_what_is_displaced_out_of_the_picture_comes_back() -> None:
    layers = make_mesh(scene(), 3 * SHIFT * SIZE[1] / NEAR, FAR, 150.0)
    mesh = joined(layers)
    margin = WIDEST * SIZE[1] + 2
    assert mesh.xy.min() == 0.5 - margin
    assert np.abs(150 * mesh.inverse_depth - FAR).max() <= WIDEST * SIZE[1] + 1e-9
    assert layers[-1].picture.shape[1] == FINER * (SIZE[1] + 2 * margin)


# Depth in the large picture


def test_a_jump_lies_at_the_large_pictures_edge() -> None:
    height, width = 4 * SIZE[0], 4 * SIZE[1]
    x = np.arange(width) + 0.5
    edge = 4 * 81.3
    picture = np.zeros((height, width, 4), np.float32)
    picture[..., :3] = np.where(x < edge, 0.1, 0.8)[None, :, None]
    small = np.where(X < 81.3, 0.5, 2.0)
    found = upsampled(small, picture)
    assert set(np.unique(found)) == {0.5, 2.0}
    assert np.abs((found > 1).argmax(axis=1) + 0.5 - edge).max() <= 1
