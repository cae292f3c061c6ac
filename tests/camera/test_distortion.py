"""Every camera model of COLMAP against COLMAP itself, limit cases by hand, the canvas and the .blend."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.camera.canvas import MAX_PADDING, Canvas
from addon.core.camera.distortion import PARAMETERS
from addon.core.camera.reconstruction import Intrinsics, Reconstruction
from tests.lenses import HEIGHT, TERMS, WIDTH, lens_of, values_of
from tests.scenes import slanted_plane, texture

# pycolmap must not be loaded into the same process as bpy.
COLMAP = """
import json, sys, numpy, pycolmap
job = json.load(sys.stdin)
out = {"ids": {n: pycolmap.CameraModelId.__members__[n].value for n in job["models"]}, "counts": {}}
for name in job["models"]:
    camera = pycolmap.Camera.create_from_model_name(
        camera_id=1, model_name=name, focal_length=1, width=640, height=480)
    out["counts"][name] = len(camera.params)
def camera(name):
    params = job["params"][name]
    return pycolmap.Camera(model=name, width=640, height=480, params=params)
out["seen"] = {n: camera(n).img_from_cam(numpy.array(r)).tolist() for n, r in job["rays"].items()}
out["rays"] = {n: camera(n).cam_from_img(numpy.array(job["pixels"])).tolist() for n in job["rays"]}
print(json.dumps(out))
"""


def grid() -> np.ndarray:
    """(n, 2) places over the whole picture, its border included."""
    x, y = np.meshgrid(np.linspace(0, WIDTH, 41), np.linspace(0, HEIGHT, 31))
    return np.stack([x, y], axis=-1).reshape(-1, 2)


def rays_of(camera: Intrinsics) -> np.ndarray:
    return camera.undistort((grid() - camera.principal_point) / camera.focal)


@dataclass(frozen=True)
class Reference:
    """What COLMAP says of the same lenses."""

    ids: dict[str, int]
    counts: dict[str, int]
    seen: dict[str, np.ndarray]
    """(n, 2) pixels of the rays that we found for `grid`."""
    rays: dict[str, np.ndarray]
    """(n, 2) rays of `grid`."""


@pytest.fixture(scope="module")
def colmap() -> Reference:
    job = {
        "models": list(PARAMETERS),
        "params": {model: values_of(model) for model in TERMS},
        "rays": {m: np.column_stack([rays_of(lens_of(m)), np.ones(len(grid()))]).tolist() for m in TERMS},
        "pixels": grid().tolist(),
    }
    child = subprocess.run(
        [sys.executable, "-c", COLMAP], input=json.dumps(job), capture_output=True, text=True, check=True
    )
    out = json.loads(child.stdout)
    tables = ({model: np.array(rows) for model, rows in out[name].items()} for name in ("seen", "rays"))
    return Reference(out["ids"], out["counts"], *tables)


@pytest.mark.parametrize("model", TERMS)
def test_colmap_sees_the_same(colmap: Reference, model: str) -> None:
    """To 1e-9 px over the whole picture; COLMAP's own inverse stops a little earlier."""
    lens, rays = lens_of(model), rays_of(lens_of(model))
    np.testing.assert_allclose(colmap.seen[model], grid(), rtol=0, atol=1e-9)
    points = np.column_stack([rays, np.ones(len(rays))]) * np.linspace(0.1, 50, len(rays))[:, None]
    np.testing.assert_allclose(lens.project(points), colmap.seen[model], rtol=0, atol=1e-9)
    np.testing.assert_allclose(colmap.rays[model], rays, rtol=0, atol=1e-9)


@pytest.mark.parametrize("model", TERMS)
def test_the_jacobian_is_the_derivative(model: str) -> None:
    lens, step = lens_of(model), 1e-6
    rays = rays_of(lens)
    moved = [(lens.distort(rays + d) - lens.distort(rays - d)) / (2 * step) for d in step * np.eye(2)]
    np.testing.assert_allclose(lens.distort_jacobian(rays), np.stack(moved, axis=-1), rtol=0, atol=1e-8)


def test_worked_by_hand() -> None:
    def radius(model: str, tangent: float, *terms: float) -> float:
        camera = Intrinsics(2, 2, 1.0, 1.0, 0.0, 0.0, model=model, terms=terms)
        return float(camera.project(np.array([tangent, 0.0, 1.0]))[0])

    still = (0.0,) * 4
    assert radius("OPENCV_FISHEYE", 1.0, *still) == pytest.approx(np.pi / 4, abs=1e-15)
    assert radius("OPENCV_FISHEYE", 1e-9, *still) == pytest.approx(1e-9, rel=1e-15)
    # k1 = 1: theta + theta^3.
    assert radius("OPENCV_FISHEYE", 1.0, 1.0, 0.0, 0.0, 0.0) == pytest.approx(np.pi / 4 + (np.pi / 4) ** 3)


@pytest.mark.parametrize("model", ["FISHEYE", "OPENCV_FISHEYE"])
def test_what_is_not_ahead_is_lost(model: str) -> None:
    """With a short focal length the corners are 90 degrees from the axis or farther, the centre is not."""
    lens = replace(lens_of(model), fx=120.0, fy=120.0)
    found = lens.undistort((grid() - lens.principal_point) / lens.focal)
    lost = np.isnan(found).any(axis=1)
    assert lost[[0, 40, -41, -1]].all()
    assert not lost[np.linalg.norm(grid() - lens.principal_point, axis=1) < 60].any()
    np.testing.assert_allclose(
        (lens.distort(found) * lens.focal + lens.principal_point)[~lost], grid()[~lost], rtol=0, atol=1e-6
    )
    with pytest.raises(UserError, match=f"{lens.model}.*90 degrees"):
        Canvas(lens).pinhole  # noqa: B018


@pytest.mark.parametrize("model", TERMS)
def test_the_canvas_holds_the_whole_picture(model: str) -> None:
    size = (160, 120)
    camera = lens_of(model).scaled(*size)
    canvas = Canvas(camera)
    places = canvas.features_from_source(grid() / (WIDTH, HEIGHT) * size)
    pinhole = canvas.pinhole
    assert np.all(places >= -1e-6) and np.all(places <= [pinhole.width + 1e-6, pinhole.height + 1e-6])
    assert not pinhole.is_distorted
    assert max(pinhole.width / size[0], pinhole.height / size[1]) <= 1 + 2 * MAX_PADDING
    picture = np.ones((size[1], size[0], 4), np.float32)
    small = texture(size[0] // 8, size[1] // 8).astype(np.float32) / 255
    picture[..., :3] = np.repeat(np.repeat(small, 8, axis=0), 8, axis=1)
    for _ in range(12):
        picture[1:-1, 1:-1] = (
            picture[:-2, 1:-1] + picture[2:, 1:-1] + picture[1:-1, :-2] + picture[1:-1, 2:]
        ) / 4
    back = canvas.to_source(canvas.from_source(picture))
    assert np.abs(back - picture)[4:-4, 4:-4].max() < 0.02


@pytest.mark.parametrize(
    ("model", "values", "message"),
    [
        ("EQUIRECTANGULAR", (640.0, 480.0), "not EQUIRECTANGULAR; undistort"),
        ("EUCM", (400.0, 400.0, 320.0, 240.0, 0.5, 1.0), "not EUCM; undistort"),
        ("FISHEYE_3", (1.0,), "one of SIMPLE_PINHOLE"),
        ("PINHOLE", (400.0, 320.0, 240.0), "4 parameters of PINHOLE, not 3"),
        ("PINHOLE", (400.0, np.nan, 320.0, 240.0), "finite"),
        ("PINHOLE", (400.0, -1.0, 320.0, 240.0), "greater than zero"),
    ],
)
def test_no_lens_is_refused(model: str, values: tuple[float, ...], message: str) -> None:
    with pytest.raises(UserError, match=f"^expected.*{message}"):
        Intrinsics.from_parameters(model, WIDTH, HEIGHT, values)
    with pytest.raises(UserError, match="size"):
        Intrinsics.from_parameters("PINHOLE", 0, HEIGHT, (1.0, 1.0, 0.0, 0.0))


def test_every_lens_is_kept_in_the_blend(scene: object, tmp_path: Path) -> None:
    import bpy

    from addon.scene.solve import point_cloud

    lenses = tuple(lens_of(model) for model in TERMS)
    before = Reconstruction(lenses, slanted_plane(lenses[0]).images, slanted_plane(lenses[0]).points)
    mesh = bpy.data.meshes.new("points")
    mesh.use_fake_user = True
    point_cloud.write(mesh, before)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "lenses.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "lenses.blend"))
    assert point_cloud.read(bpy.data.meshes["points"]).cameras == lenses
