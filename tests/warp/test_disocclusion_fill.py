"""Other frames' colours: cameras that walk along a wall, each picture a part of one wide one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.depth.view_selection import source_frames
from addon.core.media.light import decode_srgb, to_linear
from addon.core.warp.disocclusion_fill import DisocclusionFill, ReprojectedColours
from addon.core.warp.source_view import Places, SourceView

from .. import planes

WIDTH, HEIGHT, FOCAL, DEPTH = 96, 64, 100.0, 10.0
STEP = 12
"""Pixels of the wall from a frame to the next."""
LENS = Intrinsics(WIDTH, HEIGHT, FOCAL, FOCAL, WIDTH / 2, HEIGHT / 2)
WALL = np.repeat(planes.texture(WIDTH + 20 * STEP, HEIGHT, 4)[..., None] // 2 + 60, 3, axis=2).astype(
    np.uint8
)
FRAMES = 9
MIDDLE = 5


def shot() -> Reconstruction:
    images = tuple(
        Image(
            n, np.eye(3), np.array([-n * STEP * DEPTH / FOCAL, 0, 0]), np.zeros((0, 2)), np.zeros(0, np.int32)
        )
        for n in range(1, FRAMES + 1)
    )
    return Reconstruction((LENS,), images, Points(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0)))


def view(frame: int) -> NDArray[np.uint8]:
    return WALL[:, frame * STEP : frame * STEP + WIDTH].copy()


def colours_at(
    read: object, places: NDArray[np.float64], inverse: float, shown: NDArray[np.float64]
) -> tuple:  # type: ignore[type-arg]
    disocclusion = DisocclusionFill(shot(), read)  # type: ignore[arg-type]
    picture = to_linear(view(MIDDLE))
    reprojected = disocclusion.reprojected(MIDDLE, Canvas(LENS), picture, shown)
    return reprojected.colours(places, np.full(len(places), inverse))


BESIDE = np.stack(
    np.meshgrid(np.arange(WIDTH, WIDTH + 20) + 0.5, np.arange(4, HEIGHT - 4) + 0.5), axis=-1
).reshape(-1, 2)
FLAT = np.full((HEIGHT, WIDTH), 1 / DEPTH)


def truth(places: NDArray[np.float64]) -> NDArray[np.float64]:
    column, row = np.floor(places).astype(int).T
    return decode_srgb(WALL[row, MIDDLE * STEP + column] / 255)


def test_what_lies_past_the_border_is_taken_from_the_next_frames() -> None:
    colour, known = colours_at(view, BESIDE, 1 / DEPTH, FLAT)
    assert known.mean() > 0.98
    np.testing.assert_allclose(colour[known], truth(BESIDE)[known], atol=2e-3)


def test_what_something_nearer_hides_in_them_is_not_taken() -> None:
    # A board as wide as the frame stands so near that every other frame sees it before these places, too.
    near = np.full((HEIGHT, WIDTH), 1.05 / DEPTH)
    inside = np.array([[WIDTH / 2, HEIGHT / 2], [WIDTH / 2 + 5, HEIGHT / 2]])
    _, known = colours_at(view, inside, 0.9 / DEPTH, near)
    assert not known.any()
    _, known = colours_at(view, inside, 1 / DEPTH, FLAT)
    assert known.all()


def test_what_frames_disagree_on_is_not_taken() -> None:
    noise = {
        n: np.random.default_rng(n).integers(30, 220, (HEIGHT, WIDTH, 3), np.uint8) for n in range(FRAMES + 1)
    }
    _, known = colours_at(lambda frame: noise[frame], BESIDE, 1 / DEPTH, FLAT)
    # Only what a single frame sees has nobody to disagree.
    assert known.mean() < 0.5


def crossing(frame: int) -> NDArray[np.bool_]:
    """(H, W) where something large and bright stands in a frame, which sways before a camera that follows."""
    mask = np.zeros((HEIGHT, WIDTH), bool)
    left = 20 + 9 * (frame % 3)
    mask[10:54, left : left + 32] = True
    return mask


def crossed(frame: int) -> NDArray[np.uint8]:
    picture = view(frame)
    picture[crossing(frame)] = 240
    return picture


def behind(moving: object) -> tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.float64]]:
    """What is known of the wall behind what crosses the middle frame, and the truth."""
    places: NDArray[np.float64] = np.argwhere(crossing(MIDDLE))[:, ::-1] + 0.5
    shown = np.where(crossing(MIDDLE), 2 / DEPTH, FLAT)
    disocclusion = DisocclusionFill(shot(), crossed, moving)  # type: ignore[arg-type]
    reprojected = disocclusion.reprojected(MIDDLE, Canvas(LENS), to_linear(crossed(MIDDLE)), shown)
    reprojections = reprojected.colours(places, np.full(len(places), 1 / DEPTH))
    return *reprojections, truth(places)


def test_what_moves_is_not_taken() -> None:
    colour, known, true = behind(crossing)
    assert known.mean() > 0.8
    np.testing.assert_allclose(colour[known], true[known], atol=2e-3)
    # Unsaid, it hides the wall where it is not: less is known.
    assert behind(None)[1].mean() < known.mean()


def test_what_stands_before_a_place_in_most_frames_is_no_ghost() -> None:
    """Of the four frames that see past the border, two show something else there."""

    def mask(frame: int) -> NDArray[np.bool_]:
        there = np.zeros((HEIGHT, WIDTH), bool)
        start = MIDDLE * STEP + WIDTH - frame * STEP
        if frame in (7, 8):
            there[:, start : start + 20] = True
        return there

    def read(frame: int) -> NDArray[np.uint8]:
        picture = view(frame)
        picture[mask(frame)] = 240
        return picture

    picture, inverse = to_linear(view(MIDDLE)), np.full(len(BESIDE), 1 / DEPTH)
    reprojections = [
        DisocclusionFill(shot(), read, moving)
        .reprojected(MIDDLE, Canvas(LENS), picture, FLAT)
        .colours(BESIDE, inverse)
        for moving in (None, mask)
    ]
    off = [np.abs(colour[known] - truth(BESIDE)[known]).max() for colour, known in reprojections]
    assert off[0] > 0.1 and off[1] < 2e-3
    assert reprojections[1][1].mean() > 0.98


def test_nothing_is_taken_where_others_do_not_see_what_the_frame_shows() -> None:
    """A poster that is there in this frame only, towards the border: it may go on past it."""
    picture = to_linear(view(MIDDLE))
    picture[:32, -24:, :3] = 0.6
    # Before the wall, as far as its own depth goes, it is no reason not to take the wall's colours.
    for inverse, shown, above in ((1 / DEPTH, FLAT, False), (1 / DEPTH, with_poster(3 / DEPTH), True)):
        reprojected = DisocclusionFill(shot(), view).reprojected(MIDDLE, Canvas(LENS), picture, shown)
        _, known = reprojected.colours(BESIDE, np.full(len(BESIDE), inverse))
        assert known[BESIDE[:, 1] > 40].mean() > 0.95
        assert (known[BESIDE[:, 1] < 24].mean() > 0.5) == above


def with_poster(inverse: float) -> NDArray[np.float64]:
    shown = FLAT.copy()
    shown[:32, -24:] = inverse
    return shown


def source_of(reprojected: ReprojectedColours, frame: int) -> SourceView:
    frames = [image.frame for image in source_frames(shot(), MIDDLE)]
    return dict(zip(frames, reprojected.sources, strict=True))[frame]


def seen_by(source: SourceView, places: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(n,) which places (n, 2) of the wall another frame sees."""
    return np.isfinite(source.colours(Places.of(places, np.full(len(places), 1 / DEPTH)))).all(axis=0)


def test_what_goes_on_past_the_border_hides_what_is_behind() -> None:
    """The frame before sees beside a board that the frame shows up to its border: it may be wider."""
    board = np.zeros((HEIGHT, WIDTH), bool)
    board[:, :20] = True
    shown = np.where(board, 2 / DEPTH, FLAT)
    reprojected = DisocclusionFill(shot(), view).reprojected(
        MIDDLE, Canvas(LENS), to_linear(view(MIDDLE)), shown
    )
    places = np.argwhere(board)[:, ::-1] + 0.5
    source = source_of(reprojected, MIDDLE - 1)
    assert not seen_by(source, places).any()
    assert seen_by(source, places + np.array([38, 0])).all()


def test_what_another_frame_sees_from_close_by_hides_all_of_what_is_behind() -> None:
    """A board fills the frames that are nearer to it; none of them sees through it, between its pixels."""
    ahead = tuple(
        Image(n, np.eye(3), np.array([0, 0, -z]), np.zeros((0, 2)), np.zeros(0, np.int32))
        for n, z in enumerate((0.0, 1.2, 1.5, 1.8), start=1)
    )
    shot_ahead = Reconstruction((LENS,), ahead, shot().points)
    board = np.zeros((HEIGHT, WIDTH), bool)
    board[20:44, 32:64] = True
    shown = np.where(board, 4 / DEPTH, FLAT)
    places: NDArray[np.float64] = np.argwhere(board)[:, ::-1] + 0.5
    reprojected = DisocclusionFill(shot_ahead, lambda frame: view(MIDDLE)).reprojected(
        1, Canvas(LENS), to_linear(view(MIDDLE)), shown
    )
    assert len(reprojected.sources) == 3
    assert not any(seen_by(source, places).any() for source in reprojected.sources)


def test_no_colour_of_a_silhouette_is_taken() -> None:
    """Beside a board the wall's colours are taken, not the board's nor any that are both's."""
    board = np.zeros((HEIGHT, WIDTH), bool)
    board[:, 40:52] = True
    shown = np.where(board, 2 / DEPTH, FLAT)

    def before(frame: int) -> NDArray[np.uint8]:
        """The board, and beside it a pixel that it covers in part."""
        picture = view(frame)
        left = 40 + 2 * STEP * (MIDDLE - frame)
        picture[:, max(left, 0) : max(left + 12, 0)] = (250, 30, 30)
        for column in (left - 1, left + 12):
            if 0 <= column < WIDTH:
                picture[:, column] = picture[:, column] // 2 + np.array([125, 15, 15], np.uint8)
        return picture

    near: NDArray[np.float64] = np.argwhere(board)[:, ::-1] + 0.5
    picture = to_linear(before(MIDDLE))
    colour, known = (
        DisocclusionFill(shot(), before)
        .reprojected(MIDDLE, Canvas(LENS), picture, shown)
        .colours(near, np.full(len(near), 1 / DEPTH))
    )
    assert known.mean() > 0.6
    np.testing.assert_allclose(colour[known], truth(near)[known], atol=2e-3)


def test_a_single_frame_gives_only_colours_like_those_around() -> None:
    """Something red stood in the only frame that sees behind a board; nobody says that it moves."""
    board = np.zeros((HEIGHT, WIDTH), bool)
    board[:, 40:60] = True
    shown = np.where(board, 2 / DEPTH, FLAT)
    places = np.argwhere(board)[:, ::-1] + 0.5
    # Farther in, there is nothing around that could be unlike it.
    places = places[np.abs(places[:, 0] - 50) > 9]

    def with_other(colour: tuple[int, int, int]) -> Callable[[int], NDArray[np.uint8]]:
        other = np.full((HEIGHT, WIDTH, 3), colour, np.uint8)
        return lambda frame: view(frame) if frame != MIDDLE - 2 else other

    shares = []
    # A lamp is like nothing around it.
    for read in (view, with_other((250, 250, 240)), with_other((250, 20, 20)), with_other((5, 5, 5))):
        reprojected = DisocclusionFill(shot(), read).reprojected(
            MIDDLE, Canvas(LENS), to_linear(view(MIDDLE)), shown
        )
        alone = replace(reprojected, sources=(source_of(reprojected, MIDDLE - 2),))
        _, known = alone.colours(places, np.full(len(places), 1 / DEPTH))
        shares.append(known.mean())
    assert min(shares[:2]) > 0.3 and max(shares[2:]) < 0.05
