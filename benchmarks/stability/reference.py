"""What the stability cases are held against: shots with known depth, closed forms, a float64 renderer.

Nothing here uses the add-on's own drawing. Pictures are read as a map: red and green are the place, so that
a rendered pixel tells which place of the source it shows, in pixels.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from addon.core.base.arrays import Floats, LinearRGBA
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction, rotation_matrix
from addon.core.frame.views import Views
from addon.core.optics.aperture_sampling import exact_registration
from addon.core.optics.thin_lens import ThinLens
from addon.core.warp.layer import Layer
from addon.core.warp.mesh import WarpMesh

from ..displaced import displaced

type Ints = NDArray[np.int64]

LENS = Intrinsics(96, 54, 80.0, 80.0, 48.0, 27.0)
NEAR, FAR = 5.0, 12.0
SCENE_SIZE = 12.0


def places(camera: Intrinsics, count: int = 150) -> Floats:
    """(count, 2) feature places in pixels, spread evenly but not regularly (the R2 sequence)."""
    plastic = 1.32471795724474602596
    share = (0.5 + np.outer(np.arange(count), [1 / plastic, 1 / plastic**2])) % 1.0
    return share * [camera.width, camera.height]


def shot(
    camera: Intrinsics = LENS,
    depth: Floats | float | None = None,
    xy: Floats | None = None,
    frames: tuple[int, ...] = (1, 2, 3),
) -> Reconstruction:
    """Features at `xy` (n, 2) and `depth` (n,) of the first frame, which drifts and turns in the others.

    Without a depth they lie on a plane from NEAR at the left border to FAR at the right one.
    """
    xy = places(camera) if xy is None else xy
    if depth is None:
        share = xy[:, 0] / camera.width
        depth = 1 / ((1 - share) / NEAR + share / FAR)
    depth = np.broadcast_to(np.asarray(depth, dtype=np.float64), len(xy))
    rays = np.column_stack([camera.undistort((xy - camera.principal_point) / camera.focal), np.ones(len(xy))])
    with np.errstate(invalid="ignore"):
        xyz = rays * depth[:, None]
    images = []
    for number, frame in enumerate(frames):
        rotation = rotation_matrix(np.array([0.004, -0.006, 0.01]) * number)
        centre = np.array([0.05, -0.01, 0.02]) * number
        seen = camera.project((xyz - centre) @ rotation.T) if number else xy
        images.append(Image(frame, rotation, -rotation @ centre, seen, np.arange(len(xy), dtype=np.int32)))
    points = Points(xyz, np.full((len(xy), 3), 128, np.uint8), np.full(len(xy), 0.1))
    return Reconstruction((camera,), tuple(images), points)


def moved(rec: Reconstruction, scale: float, offset: float) -> Reconstruction:
    """The same shot in other units and, `offset` units away along all axes, another origin."""
    shift = np.full(3, offset)
    points = Points(rec.points.xyz * scale + shift, rec.points.rgb, rec.points.error)
    images = tuple(
        Image(i.frame, i.rotation, i.translation * scale - i.rotation @ shift, i.xy, i.points, i.camera)
        for i in rec.images
    )
    return Reconstruction(rec.cameras, images, points)


def map_picture(width: int, height: int) -> LinearRGBA:
    """(height, width, 4): x and y as shares of the size, waves of 8 to 20 pixels, opaque."""
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    waves = 0.5 + 0.2 * np.cos(x * 0.31 + y * 0.22) + 0.2 * np.cos(y * 0.7 - x * 0.11)
    return np.stack([x / width, y / height, waves, np.ones_like(x)], axis=-1).astype(np.float32)


def bilinear(picture: LinearRGBA, xy: Floats) -> Floats:
    """(..., 4) in float64 at pixels (..., 2), mirrored past the border."""
    height, width = picture.shape[:2]
    at = np.asarray(xy - 0.5)
    low = np.floor(at)
    share = at - low

    def mirrored(index: Floats, size: int) -> Ints:
        place = np.mod(index, 2 * size).astype(np.int64)
        return np.minimum(place, 2 * size - 1 - place)

    total = np.zeros((*xy.shape[:-1], 4))
    for right in (0, 1):
        for down in (0, 1):
            column, row = mirrored(low[..., 0] + right, width), mirrored(low[..., 1] + down, height)
            weight = (share[..., 0] if right else 1 - share[..., 0]) * (
                share[..., 1] if down else 1 - share[..., 1]
            )
            total += weight[..., None] * picture[row, column].astype(np.float64)
    return total


class Plan(NamedTuple):
    """A mesh, and the views that draw it."""

    views: Views
    mesh: WarpMesh

    def painted(self, picture: LinearRGBA) -> tuple[Views, tuple[Layer, ...]]:
        """The views, and the mesh with a picture (h, w, 4), as they are drawn."""
        return self.views, (Layer(self.mesh, picture),)


def rendered(plan: Plan, picture: LinearRGBA) -> Floats:
    """(h, w, 4) float64 mean of a plan's views; a pixel's centre sees the nearest triangle over it."""
    height, width = picture.shape[:2]
    mesh = plan.mesh
    total = np.zeros((height * width, 4))
    for seen in displaced(plan.views, mesh.xy, mesh.inverse_depth):
        corners = seen[mesh.triangles]
        triangle, x, y = _candidates(corners, width, height)
        a, ab, ac = (corners[triangle, i] - (corners[triangle, 0] if i else 0) for i in range(3))
        ap = np.stack([x, y], axis=1) + 0.5 - a
        with np.errstate(divide="ignore", invalid="ignore"):
            v, w = _cross(ap, ac) / _cross(ab, ac), _cross(ab, ap) / _cross(ab, ac)
        inside = (v >= 0) & (w >= 0) & (v + w <= 1)
        triangle, pixel = triangle[inside], (y * width + x)[inside]
        shares = np.stack([1 - v - w, v, w], axis=1)[inside]
        rows = mesh.triangles[triangle]
        nearness = (shares * mesh.inverse_depth[rows]).sum(axis=1)
        # Of equally near ones the last is drawn over the others.
        order = np.lexsort((triangle, nearness, pixel))
        last = order[np.append(np.diff(pixel[order]) > 0, True)]
        place = np.einsum("pc,pci->pi", shares[last], mesh.texture_xy[rows[last]])
        total[pixel[last]] += bilinear(picture, place)
    return total.reshape(height, width, 4) / len(plan.views.offsets)


def _candidates(corners: Floats, width: int, height: int) -> tuple[Ints, Ints, Ints]:
    """Triangle, column and row of every pixel in the bounding boxes of triangles (T, 3, 2)."""
    size = np.array([width, height])
    low = np.clip(np.ceil(corners.min(axis=1) - 0.5), 0, size).astype(np.int64)
    high = np.clip(np.floor(corners.max(axis=1) - 0.5), -1, size - 1).astype(np.int64)
    across, down = np.maximum(high - low + 1, 0).T
    count = across * down
    triangle = np.repeat(np.arange(len(corners)), count)
    row, column = np.divmod(np.arange(len(triangle)) - (np.cumsum(count) - count)[triangle], across[triangle])
    return triangle, low[triangle, 0] + column, low[triangle, 1] + row


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def one_triangle(
    camera: Intrinsics, inverse: float, slope: tuple[float, float], focus: float, offsets: Floats
) -> Plan:
    """A plan whose only triangle covers every view of a plane.

    Its inverse depth is `inverse` at the principal point and grows by `slope` a pixel, in 1 / scene units.
    """
    canvas = Canvas(camera)
    size = float(max(camera.width, camera.height))
    corners = np.array([[-1.0, -1.0], [3.5, -1.0], [-1.0, 3.5]]) * size
    mesh = WarpMesh(
        corners, corners, inverse + (corners - camera.principal_point) @ np.array(slope),
        np.array([[0, 1, 2]], dtype=np.int32),
    )  # fmt: skip
    thin = ThinLens(camera, float(np.linalg.norm(offsets, axis=1).max(initial=0.0)), focus)
    return Plan(Views(canvas, thin, offsets, exact_registration(canvas, offsets, focus)), mesh)


def plane_places(
    camera: Intrinsics,
    inverse: float,
    slope: tuple[float, float],
    focus: float,
    offsets: Floats,
    rows: Ints | None = None,
) -> Floats:
    """(N, h, w, 2) places of the source that views of a plane show, in closed form; of some rows only.

    A place p is seen at q = p - s (c + g.p) with s = f offset, c and g the plane's inverse depth relative to
    the focal plane; so p = (1 - s g^T)^-1 (q + s c).
    """
    rows = np.arange(camera.height) if rows is None else rows
    q = np.stack(np.meshgrid(np.arange(camera.width) + 0.5, rows + 0.5), axis=-1)
    s = camera.focal * offsets
    gradient = np.array(slope)
    c = inverse - focus - gradient @ camera.principal_point
    matrices = np.linalg.inv(np.eye(2) - s[:, :, None] * gradient)
    return np.asarray(
        np.einsum("nij,hwj->nhwi", matrices, q) + np.einsum("nij,nj->ni", matrices, s * c)[:, None, None]
    )


def plane_picture(places_shown: Floats, picture: LinearRGBA) -> Floats:
    """(h, w, 4) mean of the views that show places (N, h, w, 2) of a picture."""
    total = np.zeros((*places_shown.shape[1:3], picture.shape[2]))
    for place in places_shown:
        total += bilinear(picture, place)
    return total / len(places_shown)


def displacement_error(a: NDArray[np.floating], b: NDArray[np.floating], size: tuple[int, int]) -> float:
    """Largest difference in pixels between the mean places that two renders of `map_picture(*size)` show."""
    return float((np.abs(np.asarray(a, dtype=np.float64)[..., :2] - b[..., :2]) * size).max())


def psnr(a: NDArray[np.floating], b: NDArray[np.floating]) -> float:
    """Peak signal to noise ratio of all four channels in dB; 200 where they are equal."""
    error = float(np.mean((np.asarray(a, dtype=np.float64) - b) ** 2))
    return 200.0 if error < 1e-20 else -10 * float(np.log10(error))
