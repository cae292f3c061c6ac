"""A camera that stays in its place: turns from tracks, points from depth maps, pictures from both."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.base.errors import Remedy, UserError
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.depth.placed_points import placed
from addon.core.depth.source import NO_PICTURE
from addon.core.depth.user_depth import UserDepth
from addon.core.depth.user_maps import DepthMaps, open_depth
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.frame_path import mesh_frame
from addon.core.frame.highlights import HighlightSettings
from addon.core.frame.plan import FrameOptions
from addon.core.media.clip import Footage, open_footage
from addon.core.media.light import to_linear
from addon.core.sfm.adjustment import solution
from addon.core.sfm.calibration.rotation import turned
from addon.core.sfm.process import SolveProcess
from addon.core.sfm.tracking.tracks import Tracks
from addon.core.sfm.workspace import load_solve
from addon.render.views.average import draw_mean
from benchmarks.accuracy import metrics
from benchmarks.accuracy.defocus import defocus

from .. import planes
from ..staying_clips import WALKER, staying_clip

WIDTH, HEIGHT = 640, 360
FRAMES = 40
RADIUS = 0.15
"""Of the lens, in metres: who walks has discs of 19 pixels."""


def turns(pan: float) -> np.ndarray:
    """(40, 3, 3) a pan of so many radians that also tilts."""
    angle = pan * np.linspace(-0.5, 0.5, FRAMES)
    return np.array([cv2.Rodrigues(np.array([0.2 * np.sin(9 * a), a, 0.1 * a]))[0] for a in angle])


def tracks_of(rotation: np.ndarray, focal: float, noise: float = 0.2, moving: float = 0.2) -> Tracks:
    """What such a camera tracks of 800 directions, a share of which go their own way."""
    rng = np.random.default_rng(1)
    towards = rng.normal(size=(800, 3)) * [1.0, 0.4, 0.3] + [0, 0, 1.0]
    drift = np.where(rng.random(800) < moving, 0.01, 0.0)[:, None] * [1.0, 0.2, 0.0]
    local = np.einsum("fij,fpj->fpi", rotation, towards + drift * np.arange(FRAMES)[:, None, None])
    xy = focal * local[..., :2] / local[..., 2:] + [WIDTH / 2, HEIGHT / 2]
    xy += noise * rng.standard_normal(xy.shape)
    seen = (local[..., 2] > 0) & np.all((xy > 0) & (xy < [WIDTH, HEIGHT]), axis=-1)
    frame, track = np.nonzero(seen)
    return Tracks(
        tuple(range(1, FRAMES + 1)), WIDTH, HEIGHT, frame.astype(np.int32), track.astype(np.int32), xy[seen],
        np.zeros((800, 3), np.uint8),
    )  # fmt: skip


@pytest.mark.parametrize("focal", [450.0, pytest.param(800.0, marks=pytest.mark.long)])
def test_turns_and_focal_length_of_a_pan(focal: float) -> None:
    """From a lens that is taken to be 544 px long, with a fifth of the tracks moving by themselves."""
    rotation = turns(0.5)
    made, sigma = turned(tracks_of(rotation, focal), 544.0, 0.2)
    assert made.focal[0] == pytest.approx(focal, rel=0.02)
    assert sigma < 0.02
    between = made.rotation @ made.rotation[0].T
    true = rotation @ rotation[0].T
    off = [np.linalg.norm(cv2.Rodrigues(a @ b.T)[0]) for a, b in zip(between, true, strict=True)]
    # A third of a pixel, and what the focal length is off by over half of the pan.
    assert max(off) < 0.33 / focal + 0.25 * abs(made.focal[0] / focal - 1) + 1e-3
    lasting = np.bincount(made.tracks.track, minlength=made.tracks.count) >= solution.MIN_VIEWS
    assert np.isnan(made.xyz[lasting, 0]).mean() == pytest.approx(0.2, abs=0.07)
    np.testing.assert_array_equal(made.translation, 0)


def panned(count: int = 12) -> Reconstruction:
    """Cameras at the origin that pan past 300 points at 10, whatever is there."""
    camera = Intrinsics(160, 90, 150.0, 150.0, 80.0, 45.0)
    rng = np.random.default_rng(2)
    towards = np.column_stack([rng.uniform(-0.7, 0.7, 300), rng.uniform(-0.3, 0.3, 300), np.ones(300)])
    xyz = 10 * towards / np.linalg.norm(towards, axis=1, keepdims=True)
    images = []
    for frame, angle in enumerate(np.linspace(-0.15, 0.15, count), 1):
        rotation = cv2.Rodrigues(np.array([0.0, angle, 0.0]))[0]
        local = xyz @ rotation.T
        xy = camera.project(local)
        inside = np.flatnonzero(np.all((xy > 0) & (xy < [160, 90]), axis=1)).astype(np.int32)
        images.append(Image(frame, rotation, np.zeros(3), xy[inside], inside))
    return Reconstruction((camera,), tuple(images), Points(xyz, np.zeros((300, 3), np.uint8), np.zeros(300)))


FLOOR, WALL = 1.2, 8.0
"""Metres below the camera and before it."""


def room(reconstruction: Reconstruction, frame: int) -> np.ndarray:
    """(90, 160) depth in metres of a floor and a wall."""
    image, camera = reconstruction.images[frame - 1], reconstruction.cameras[0]
    x, y = np.meshgrid(np.arange(160) + 0.5, np.arange(90) + 0.5)
    rays = np.stack([(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, np.ones_like(x)], axis=-1)
    world = rays @ image.rotation
    with np.errstate(divide="ignore"):
        floor = np.where(world[..., 1] > 0, FLOOR / world[..., 1], np.inf)
    return np.asarray(np.minimum(floor, WALL / world[..., 2]))


def true_distance(reconstruction: Reconstruction) -> np.ndarray:
    """(300,) metres to the floor or the wall in each point's direction."""
    towards = reconstruction.points.xyz / 10
    with np.errstate(divide="ignore"):
        floor = np.where(towards[:, 1] > 0, FLOOR / towards[:, 1], np.inf)
    return np.asarray(np.minimum(floor, WALL / towards[:, 2]))


def maps_of(folder: Path, values: np.ndarray) -> DepthMaps:
    """(n, 90, 160) as an .npz of a clip of that size."""
    clip = folder / "clip"
    clip.mkdir()
    for frame in range(1, len(values) + 1):
        cv2.imwrite(str(clip / f"{frame:03d}.png"), np.zeros((90, 160, 3), np.uint8))
    np.savez(folder / "maps.npz", depths=values)
    footage: Footage = open_footage(clip)
    return open_depth(folder / "maps.npz", footage)


def test_points_are_as_far_away_as_maps_in_metres_say(tmp_path: Path) -> None:
    cameras = panned()
    maps = maps_of(tmp_path, np.stack([room(cameras, frame) for frame in range(1, 13)]))
    found = placed(cameras, maps)
    distance = np.linalg.norm(found.points.xyz, axis=1)
    seen = cameras.views_per_point > 0
    off = np.abs(distance / true_distance(cameras) - 1)[seen]
    # A map tells the depth of a pixel's centre.
    assert np.median(off) < 0.005
    assert np.percentile(off, 95) < 0.05
    depth = UserDepth.of(maps, found)
    assert depth.fit.kind == "depth"


def test_inverse_depth_that_drifts_gives_distances_up_to_one_affine_change(tmp_path: Path) -> None:
    """Scale and shift of every frame are others; the points that frames share tie them to each other."""
    cameras, rng = panned(), np.random.default_rng(6)
    values = [
        rng.uniform(0.8, 1.25) * (1 / room(cameras, frame) + rng.uniform(0.1, 0.15))
        for frame in range(1, 13)
    ]  # fmt: skip
    found = placed(cameras, maps_of(tmp_path, np.stack(values)))
    image = cameras.images[5]
    ids = image.points
    found_depth, depth = (
        image.to_camera(xyz[ids])[:, 2]
        for xyz in (found.points.xyz, cameras.points.xyz / 10 * true_distance(cameras)[:, None])
    )
    line = np.polynomial.Polynomial.fit(1 / depth, 1 / found_depth, 1)
    off = np.abs(1 / found_depth - line(1 / depth))
    assert np.median(off) < 0.02 * np.ptp(1 / found_depth)
    distance = np.linalg.norm(found.points.xyz, axis=1)[cameras.views_per_point > 0]
    assert np.median(distance) == pytest.approx(10, rel=0.01)


def test_what_is_behind_who_walks_is_where_other_frames_have_it(tmp_path: Path) -> None:
    """A post wanders through the room, past which a camera pans. It moves, so it has no points."""
    cameras, column = panned(), np.arange(160)
    true = np.stack([room(cameras, frame) for frame in range(1, 13)])
    seen = true.copy()
    posts = [(column > 12 * frame - 12) & (column < 12 * frame + 8) for frame in range(1, 13)]
    for depth, post in zip(seen, posts, strict=True):
        depth[:, post] = 0.7
    (tmp_path / "empty").mkdir()
    points = placed(cameras, maps_of(tmp_path / "empty", true))
    maps = maps_of(tmp_path, seen)
    depth = UserDepth.of(maps, points)
    context = ClipContext(depth.reconstruction, maps.footage.read, maps=depth)
    found = context.depth(6, context.canvas(6), np.zeros((90, 160, 4), np.float32))
    assert found.behind is not None
    known = np.isfinite(found.behind)
    assert known[:, posts[5]].mean() > 0.9
    np.testing.assert_allclose(1 / found.inverse_depth[:, posts[5]], 0.7, rtol=0.02)
    off = np.abs(found.behind * true[5] - 1)[known]
    # A map tells the depth of the pixel that a ray falls into.
    assert np.median(off) < 0.005
    assert np.percentile(off, 95) < 0.05
    # Who only picks does not wait for it.
    assert depth.at(6, context.canvas(6), NO_PICTURE).behind is None


@pytest.mark.long
@pytest.mark.parametrize("pan", [0.0, 0.25])
def test_behind_who_walks_is_what_other_frames_saw(tmp_path: Path, pan: float) -> None:
    """From clip and maps to the colours that a wide aperture sees behind somebody, a frame's own size."""
    made = staying_clip(24, pan)
    clip, maps = made.write(tmp_path)
    if pan == 0:
        with pytest.raises(UserError, match=r"camera does not move in this clip.*depth maps") as refused:
            SolveProcess(clip, tmp_path / "refused").wait()
        assert refused.value.remedies == (Remedy.DEPTH_MAPS,)
    SolveProcess(clip, tmp_path / "work", depth_maps=maps).wait()
    solve = load_solve(tmp_path / "work")
    assert solve.reconstruction.stays
    assert len(solve.reconstruction.images) == 24
    footage = open_footage(clip)
    depth = UserDepth.of(open_depth(maps, footage), solve.reconstruction)
    context = ClipContext(solve.reconstruction, footage.read, maps=depth)
    frame = 12
    canvas = context.canvas(frame)
    picture = to_linear(footage.read(frame))
    own = context.depth(frame, canvas, picture)
    # Edges are made steps, and a step has two sides: where three surfaces meet, one loses a few pixels.
    wrong = np.abs(1 / own.inverse_depth / made.depth[frame - 1] - 1) > 0.02
    assert wrong.sum() < 10 * 4
    fill = context.hidden_colours(frame, canvas, picture, own, HighlightSettings(gain=0))
    # Well inside of the card, where only other frames see the wall.
    inner = cv2.erode(made.walker[frame - 1].astype(np.uint8), np.ones((7, 7))) > 0
    row, column = np.nonzero(inner)
    behind = np.full(len(row), 1 / 10)
    colour, known = fill(np.column_stack([column, row]) + 0.5, behind)
    assert known.mean() > 0.8
    true = to_linear(made.without[frame - 1])[row, column, :3]
    off = np.abs(np.sqrt(colour) - np.sqrt(true)).max(axis=1)[known]
    # A pan resamples a texture that is as fine as pixels.
    assert np.median(off) < (0.01 if pan == 0 else 0.08)
    lens = FrameOptions(Focus(distance=10.0), RADIUS, 64, highlights=HighlightSettings(gain=0))
    ours = canvas.to_source(draw_mean(mesh_frame(context, frame, lens, planes.SIZE, picture).through()))[
        ..., :3
    ]
    real = made.through_lens(frame, RADIUS, 10.0)
    largest = RADIUS * planes.FOCAL * (1 / WALKER - 1 / 10)
    node = defocus(picture[..., :3], made.depth[frame - 1], planes.FOCAL, RADIUS, 10.0, largest)
    ours_psnr, node_psnr, sharp_psnr = (metrics.psnr(each, real) for each in (ours, node, picture[..., :3]))
    print(f"against the real lens: {ours_psnr:.2f} dB, Defocus {node_psnr:.2f}, no blur {sharp_psnr:.2f}")
    assert ours_psnr > node_psnr + 1
