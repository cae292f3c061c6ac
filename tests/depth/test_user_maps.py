"""The user's depth maps come back as true inverse depth, whatever their kind, scale, shift and size."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.depth.map_fit import fit_clip
from addon.core.depth.user_depth import grid_features
from addon.core.depth.user_maps import DepthMaps, open_depth
from addon.core.media import picture_file as footage_module
from addon.core.media.clip import Footage, FrameRange, open_footage
from addon.scene.base import exr
from sample_scenes import filming, staging, truth

from ..map_fits import fitted
from ..variants import combined

WIDTH, HEIGHT = 160, 90
FRAMES = (1, 8, 15, 22, 29, 36)
KINDS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "depth": lambda z: z,
    "depth, white near": lambda z: -z,
    "inverse": lambda z: 1 / z,
    "inverse, white far": lambda z: -1 / z,
}


@pytest.fixture(scope="module")
def depths() -> dict[int, np.ndarray]:
    """True depth (90, 160) of a few frames of a scene with thin bars, a wall and a sky, in metres."""
    stage = filming.load("bars")
    before = bpy.context.window.scene
    scene = staging.build(stage)
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    try:
        return {frame: truth.geometry(scene, frame).depth for frame in FRAMES}
    finally:
        bpy.context.window.scene = before
        bpy.data.scenes.remove(scene)


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Footage:
    """A clip of as many frames, with gaps in their numbers."""
    folder = tmp_path_factory.mktemp("clip")
    for frame in FRAMES:
        cv2.imwrite(str(folder / f"clip_{frame:04d}.png"), np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    return open_footage(folder)


@pytest.fixture(autouse=True)
def decoder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(footage_module, "exr_decoder", exr.read)


def write_exr(path: Path, values: np.ndarray) -> None:
    """(h, w) as 32-bit EXR, by Blender."""
    height, width = values.shape
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = values[::-1, :, None]
    scene = bpy.data.scenes.new("writer")
    scene.view_settings.view_transform = "Standard"
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"
    image = bpy.data.images.new("depth", width, height, float_buffer=True)
    image.pixels.foreach_set(pixels.ravel())
    image.save_render(str(path), scene=scene)
    bpy.data.images.remove(image)
    bpy.data.scenes.remove(scene)


def write_png(path: Path, values: np.ndarray, dtype: type = np.uint16) -> None:
    """(h, w) over the whole range of the type but 0, which stands for what is not finite."""
    known = np.isfinite(values)
    low, high = values[known].min(), values[known].max()
    top = np.iinfo(dtype).max
    steps = 1 + np.round((top - 1) * (np.where(known, values, low) - low) / (high - low))
    cv2.imwrite(str(path), np.where(known, steps, 0).astype(dtype))


def features(depth: np.ndarray, frame: int, noise: float, outliers: float) -> tuple[np.ndarray, np.ndarray]:
    """Places (300, 2) and inverse depths, a share of which are wrong and the others a little off."""
    rng = np.random.default_rng(frame)
    rows, columns = np.nonzero(np.isfinite(depth))
    chosen = rng.choice(len(rows), 300, replace=False)
    inverse = 1 / depth[rows[chosen], columns[chosen]]
    inverse += noise * np.median(inverse) * rng.standard_normal(300)
    wrong = rng.random(300) < outliers
    inverse[wrong] = rng.uniform(0.02, 1.0, wrong.sum())
    return np.stack([columns[chosen] + 0.5, rows[chosen] + 0.5], axis=1), inverse


def fit_all(
    maps: DepthMaps, depths: dict[int, np.ndarray], noise: float, outliers: float
) -> dict[int, np.ndarray]:
    """(90, 160) inverse depths by frame."""
    seen = {frame: features(depths[frame], frame, noise, outliers) for frame in maps.frames}
    prior = fit_clip(maps, lambda frame: seen[frame])
    return {frame: fitted(maps.read(frame), *seen[frame], prior) for frame in maps.frames}


@pytest.mark.parametrize(
    ("kind", "suffix", "each"),
    combined(list(KINDS), ["exr", "png"], {"one scale": False, "each its own": True}),
)
def test_every_kind_comes_back_as_true_inverse_depth(
    depths: dict[int, np.ndarray], clip: Footage, tmp_path: Path, kind: str, suffix: str, each: bool
) -> None:
    rng = np.random.default_rng(7)
    scale, shift = rng.uniform(0.01, 100), rng.uniform(-5, 5)
    for frame, depth in depths.items():
        if each:
            scale, shift = scale * rng.uniform(0.7, 1.4), shift + rng.uniform(-1, 1)
        with np.errstate(invalid="ignore"):
            stored = scale * (KINDS[kind](np.where(np.isfinite(depth), depth, np.nan)) + shift)
        path = tmp_path / f"depth_{frame:03d}.{suffix}"
        (write_exr if suffix == "exr" else write_png)(path, stored)
    maps = open_depth(tmp_path, clip)
    assert maps.frames == FRAMES
    assert not maps.notes
    noise = 0.005
    found = fit_all(maps, depths, noise, outliers=0.1)
    exact = fit_all(maps, depths, noise=0.0, outliers=0.1)
    worst = np.zeros(2)
    for frame, depth in depths.items():
        known = np.isfinite(depth)
        true = 1 / depth[known]
        result = exact[frame]
        np.testing.assert_array_equal(np.isfinite(result), known)
        # Half a step of 16 bits, in depth or in inverse depth; float32's own steps are finer still.
        step = np.ptp(depth[known]) * true**2 if kind.startswith("depth") else np.ptp(true)
        quantum = step / 65534 if suffix == "png" else 0.0
        assert np.all(np.abs(result[known] - true) < quantum + 2e-5 * true)
        off = np.abs(found[frame][known] - true)
        xy, seen = features(depth, frame, noise, outliers=0.1)
        assert np.all(off < quantum + 4 * noise * np.median(seen) * line_error(kind, true, depth, xy))
        worst = np.maximum(worst, [np.median(off / true), (off / true).max()])
    print(f"{kind}, {suffix}: median error {worst[0]:.2e}, largest {worst[1]:.2e}")


def line_error(kind: str, true: np.ndarray, depth: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """(n,) standard error at inverse depths (n,) of a line through points whose inverse depth is off by 1."""

    def rows(inverse: np.ndarray) -> np.ndarray:
        # Depth is off by the inverse square of inverse depth.
        return np.stack([inverse, inverse**2 if kind.startswith("depth") else np.ones_like(inverse)], axis=1)

    at = np.floor(xy).astype(int)
    # Nine tenths of the points are right.
    information = 0.9 * rows(1 / depth[at[:, 1], at[:, 0]]).T @ rows(1 / depth[at[:, 1], at[:, 0]])
    one = rows(true)
    return np.sqrt(np.einsum("ni,ij,nj->n", one, np.linalg.inv(information), one))


def write_all(folder: Path, depths: dict[int, np.ndarray], dtype: type = np.uint16) -> Path:
    """Inverse depth as PNG, the same scale in all frames."""
    nearest = max(1 / depth.min() for depth in depths.values())
    folder.mkdir(exist_ok=True)
    for frame, depth in depths.items():
        top = np.iinfo(dtype).max
        cv2.imwrite(str(folder / f"d{frame:04d}.png"), np.round(top / (depth * nearest)).astype(dtype))
    return folder


def test_a_frame_that_knows_little_stays_near_the_clip(
    depths: dict[int, np.ndarray], clip: Footage, tmp_path: Path
) -> None:
    """Points at one depth say nothing of the scale, and three points next to nothing at all."""
    maps = open_depth(write_all(tmp_path / "maps", depths), clip)
    noise = 0.01
    seen = {frame: features(depths[frame], frame, noise, 0.1) for frame in FRAMES}
    frame, depth = 15, depths[15]
    xy, inverse = features(depth, 99, noise, 0.1)
    at = np.floor(xy).astype(int)
    wall = np.abs(depth[at[:, 1], at[:, 0]] - 12) < 0.5
    assert 40 < wall.sum() < 150
    few = xy[:3], inverse[:3]
    seen[frame] = xy[wall], inverse[wall]
    prior = fit_clip(maps, lambda frame: seen[frame])
    known = np.isfinite(depth)
    errors = {}
    for name, (places, values) in {"wall": seen[frame], "three": few, "none": (xy[:0], inverse[:0])}.items():
        found = fitted(maps.read(frame), places, values, prior)
        errors[name] = np.abs(found[known] * depth[known] - 1)
        assert errors[name].max() < 0.02
    print({name: f"median {np.median(e):.1e}, largest {e.max():.1e}" for name, e in errors.items()})


@pytest.mark.parametrize(("columns", "rows"), [(80, 45), (480, 270), (100, 100)])
def test_a_map_of_any_size_covers_the_picture(
    depths: dict[int, np.ndarray], clip: Footage, tmp_path: Path, columns: int, rows: int
) -> None:
    """A plane is linear in inverse depth and comes back exactly; nothing is made up between two of them."""
    x, y = (np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows
    plane = 0.2 + 0.1 * x[None, :] + 0.05 * y[:, None]
    # The place of the step lies between pixels of all sizes.
    near = np.broadcast_to(x > 0.501, (rows, columns))
    for frame in FRAMES:
        write_exr(tmp_path / f"{frame}.exr", plane + near)
    maps = open_depth(tmp_path, clip)
    assert any("stretched" in note for note in maps.notes) == (columns == rows)
    xy = np.random.default_rng(0).uniform([0, 0], [WIDTH, HEIGHT], (200, 2))
    true = 0.2 + 0.1 * xy[:, 0] / WIDTH + 0.05 * xy[:, 1] / HEIGHT + (xy[:, 0] > 0.501 * WIDTH)
    result = fitted(maps.read(1), xy, true, fit_clip(maps, lambda frame: (xy, true)))
    assert result.shape == (HEIGHT, WIDTH)
    u, v = (np.arange(WIDTH) + 0.5) / WIDTH, (np.arange(HEIGHT) + 0.5) / HEIGHT
    smooth = 0.2 + 0.1 * u[None, :] + 0.05 * v[:, None]
    off = np.minimum(np.abs(result - smooth), np.abs(result - smooth - 1))
    # Away from the border and the step, where a neighbour is missing, it is exact but for the fit.
    inner = (np.abs(u - 0.501) > 1.5 / columns) & (np.abs(u - 0.5) < 0.5 - 1 / columns)
    assert off[2:-2, inner].max() < 0.004
    assert off.max() < 0.004 + 0.1 / columns + 0.05 / rows


def test_holes_stay_holes_and_leave_the_grid(
    depths: dict[int, np.ndarray], clip: Footage, tmp_path: Path
) -> None:
    """0, what is not finite, what is nearer than all the rest by far; and past the horizon is far away."""
    for frame, depth in depths.items():
        stored = np.where(np.isfinite(depth), 3 / depth - 0.4, -0.401)
        stored[10:20, 10:20], stored[30:40, 10:20], stored[50:60, 10:20] = 0, np.nan, np.inf
        stored[10:20, 60:70] = 65504
        write_exr(tmp_path / f"{frame}.exr", stored)
    maps = open_depth(tmp_path, clip)
    seen = {frame: features(depths[frame], frame, 0.0, 0.1) for frame in FRAMES}
    result = fitted(maps.read(8), *seen[8], fit_clip(maps, lambda frame: seen[frame]))
    sky = np.isinf(depths[8])
    holes = np.zeros((HEIGHT, WIDTH), bool)
    for rows, columns in ((10, 10), (30, 10), (50, 10), (10, 60)):
        holes[rows : rows + 10, columns : columns + 10] = True
    np.testing.assert_array_equal(np.isnan(result), holes)
    assert np.all(result[sky & ~holes] == 0)
    seen_there = np.isfinite(depths[8]) & ~holes
    np.testing.assert_allclose(result[seen_there], 1 / depths[8][seen_there], rtol=1e-4)
    for step in (1.0, 7.3, 40.0):
        xy, inverse = grid_features(result, step)
        across, down = np.unique(xy[:, 0]), np.unique(xy[:, 1])
        assert (across[0], across[-1], down[0], down[-1]) == (0.5, WIDTH - 0.5, 0.5, HEIGHT - 0.5)
        assert np.ptp(np.diff(across)) <= 1
        assert np.diff(across).mean() == pytest.approx(step, rel=0.15)
        at = np.floor(xy).astype(int)
        assert not holes[at[:, 1], at[:, 0]].any()
        np.testing.assert_array_equal(inverse, result[at[:, 1], at[:, 0]])
        grid = holes[np.ix_(np.floor(down).astype(int), np.floor(across).astype(int))]
        assert len(xy) == (~grid).sum()


def test_maps_find_their_frames(depths: dict[int, np.ndarray], clip: Footage, tmp_path: Path) -> None:
    folder = write_all(tmp_path / "maps", depths)
    assert open_depth(folder, clip).numbers == dict(zip(FRAMES, FRAMES, strict=True))
    assert open_depth(folder / "d####.png", clip).numbers == dict(zip(FRAMES, FRAMES, strict=True))
    # A part of the clip takes its own maps.
    part = open_footage(clip.path, FrameRange(8, 22))
    assert open_depth(folder, part).frames == (8, 15, 22)
    # Other numbers, equal counts: in order.
    for place, frame in enumerate(FRAMES):
        (folder / f"d{frame:04d}.png").rename(folder / f"e{place:02d}.png")
    ordered = open_depth(folder, clip)
    assert ordered.numbers == {frame: place for place, frame in enumerate(FRAMES)}
    assert "in order" in ordered.notes[0]
    # A part of the clip takes those of its places, too.
    assert open_depth(folder, part).numbers == {8: 1, 15: 2, 22: 3}
    # One map too few: nothing tells which one.
    (folder / "e05.png").unlink()
    with pytest.raises(UserError, match="maps has 5 depth maps, numbered 0 to 4, and the clip 6 frames"):
        open_depth(folder, clip)
    # Numbers that do more than count are those of frames.
    (folder / "e00.png").rename(folder / "e08.png")
    fewer = open_depth(folder, clip)
    assert fewer.numbers == {1: 1, 8: 8}
    assert fewer.notes == (
        "3 of 5 depth maps belong to no frame of the clip", "4 of 6 frames without a depth map",
    )  # fmt: skip
    with pytest.raises(UserError, match=r"frame 15 has no depth map in maps; .* for frames 1 to 8"):
        fewer.read(15)
    with pytest.raises(UserError, match="no depth map in maps belongs to the clip"):
        open_depth(folder, open_footage(clip.path, FrameRange(15, 29)))


def test_maps_of_a_video_may_count_from_zero(depths: dict[int, np.ndarray], tmp_path: Path) -> None:
    path = tmp_path / "clip.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 24, (WIDTH, HEIGHT))
    for _ in FRAMES:
        writer.write(np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    writer.release()
    folder = write_all(tmp_path / "maps", dict(enumerate(depths.values())))
    video = open_footage(path, FrameRange(2, 4))
    assert open_depth(folder, video).numbers == {2: 1, 3: 2, 4: 3}


def test_eight_bits_are_called_coarse_and_still_fit(
    depths: dict[int, np.ndarray], clip: Footage, tmp_path: Path
) -> None:
    maps = open_depth(write_all(tmp_path / "maps", depths, np.uint8), clip)
    assert any("8 bits" in note for note in maps.notes)
    found = fit_all(maps, depths, noise=0.005, outliers=0.1)
    nearest = max(1 / depth.min() for depth in depths.values())
    for frame, inverse in found.items():
        known = np.isfinite(depths[frame])
        off = np.abs(inverse[known] - 1 / depths[frame][known])
        # Half a step of 256, and what 300 points say of the line.
        assert off.max() < 0.5 * nearest / 255 + 0.005 / depths[frame][known].min()


@pytest.mark.parametrize("wrong", ["noise", "mirrored", "another frame"])
def test_maps_that_explain_nothing_are_refused(
    depths: dict[int, np.ndarray], clip: Footage, tmp_path: Path, wrong: str
) -> None:
    folder = write_all(tmp_path / "maps", depths)
    bad = {
        "noise": np.random.default_rng(0).integers(1, 65536, (HEIGHT, WIDTH)).astype(np.uint16),
        "mirrored": cv2.imread(str(folder / "d0015.png"), cv2.IMREAD_UNCHANGED)[:, ::-1],
        "another frame": np.roll(cv2.imread(str(folder / "d0015.png"), cv2.IMREAD_UNCHANGED), 40, axis=0),
    }[wrong]
    seen = {frame: features(depths[frame], frame, 0.005, 0.1) for frame in FRAMES}
    cv2.imwrite(str(folder / "d0015.png"), bad)
    # One bad frame does not spoil the clip, and is named.
    prior = fit_clip(open_depth(folder, clip), lambda frame: seen[frame])
    good, known = fitted(open_depth(folder, clip).read(8), *seen[8], prior), np.isfinite(depths[8])
    assert np.median(np.abs(good[known] * depths[8][known] - 1)) < 0.01
    with pytest.raises(UserError, match=r"of frame 15 \(d0015\.png\) does not fit .*by \d+\.\d%, one depth"):
        fitted(open_depth(folder, clip).read(15), *seen[15], prior)
    for frame in FRAMES:
        cv2.imwrite(str(folder / f"d{frame:04d}.png"), bad)
    if wrong == "noise":
        with pytest.raises(UserError, match="does not fit the clip"):
            fit_clip(open_depth(folder, clip), lambda frame: seen[frame])


def test_what_is_no_depth_map_is_refused(
    depths: dict[int, np.ndarray], clip: Footage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(UserError, match=r"depth maps: .* does not exist"):
        open_depth(tmp_path / "nowhere", clip)
    with pytest.raises(UserError, match=r"depth maps: .* has no images"):
        open_depth(tmp_path, clip)
    colour = tmp_path / "colour"
    colour.mkdir()
    for frame in FRAMES:
        cv2.imwrite(str(colour / f"{frame}.png"), rng.integers(0, 255, (HEIGHT, WIDTH, 3), np.uint8))
    with pytest.raises(UserError, match=r"1\.png is a color picture, not a depth map"):
        open_depth(colour, clip).read(1)
    empty = tmp_path / "empty"
    empty.mkdir()
    for frame in FRAMES:
        cv2.imwrite(str(empty / f"{frame}.png"), np.zeros((HEIGHT, WIDTH), np.uint16))
    with pytest.raises(UserError, match=r"8\.png has no depth: every pixel is 0"):
        open_depth(empty, clip).read(8)
    sparse = tmp_path / "sparse"
    sparse.mkdir()
    for frame in FRAMES:
        picture = np.zeros((HEIGHT, WIDTH), np.uint16)
        picture[0, 0] = 7
        cv2.imwrite(str(sparse / f"{frame}.png"), picture)
    with pytest.raises(UserError, match="know fewer than 8 feature points"):
        fit_clip(open_depth(sparse, clip), lambda frame: features(depths[frame], frame, 0.0, 0.0))
    write_exr(tmp_path / "one.exr", depths[1])
    write_exr(tmp_path / "two.exr", depths[1])
    monkeypatch.setattr(footage_module, "exr_decoder", None)
    with pytest.raises(UserError, match="can only be read inside Blender"):
        open_depth(tmp_path, clip)
