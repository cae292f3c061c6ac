"""What is in focus, how large the aperture is, and how each view is brought into register."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ..base.errors import UserError
from ..camera.canvas import Canvas
from ..camera.reconstruction import Floats, Intrinsics, Ints, Reconstruction, seen_by
from ..depth.sparse import FrameFeatures, frame_features, point_inverse_depths
from .thin_lens import ThinLens

FEWEST_IN_PLANE = 3
"""Points in focus that make a plane."""
COLLINEAR = 1e-3
"""Of the extent of points in focus: a plane through points that lie closer to a line is none. By eye."""
IN_PLANE = 1e-6
"""Of the distance of points in focus: a camera that is closer to their plane sees it as a line. By eye."""


@dataclass(frozen=True)
class PickOptions:
    """How feature points are chosen for a click."""

    points: int = 4
    """Points that are chosen: the thesis averages four."""
    range_weight: float = 0.1
    """Cost of the chosen points' range of inverse depths, against a cost of 1 for what their mean misses the
    surface under the click by: by eye, at silhouettes of the sample clip."""
    softening: float = 2.0
    """Pixels from the click within which features count alike: about their accuracy."""
    frontal: float = 0.1
    """Weight of a surface that faces the camera against what features around the click tell of its tilt: by
    eye, where features lie in a row."""


@dataclass(frozen=True)
class Focus:
    """What is in focus: 3D points that are followed through the clip, or a constant distance."""

    points: tuple[int, ...] = ()
    distance: float | None = None
    """Depth along the optical axis, in scene units, or infinity; used where there are no points."""
    through_points: bool = False
    """Whether the focal plane is tilted to go through the points, three or more, and stays with them."""
    tilt: float = 0.0
    """Radians by which the focal plane's upper part leans away from the camera, about its place on the
    optical axis; not of a plane through points."""
    swing: float = 0.0
    """The same of its right part."""

    @property
    def is_tilted(self) -> bool:
        """Whether the focal plane need not be parallel to the picture."""
        return bool(self.through_points and self.points) or self.tilt != 0 or self.swing != 0

    def lens(
        self, reconstruction: Reconstruction, frame: int, pinhole: Intrinsics, radius: float
    ) -> ThinLens:
        """The thin lens of an aperture radius in scene units at a frame that is seen through a pinhole.

        UserError as `inverse_depth`, and where the points in focus make no plane.
        """
        inverse = self.inverse_depth(reconstruction, frame)
        slope = (0.0, 0.0)
        if self.through_points and self.points:
            inverse, slope = self._plane_through_points(reconstruction, frame, pinhole)
        elif self.tilt or self.swing:
            # Z = Z0 + X tan(swing) - Y tan(tilt), divided by Z Z0; y points down.
            slope = (
                -inverse * float(np.tan(self.swing)) / pinhole.fx,
                inverse * float(np.tan(self.tilt)) / pinhole.fy,
            )
        return ThinLens.on_plane(pinhole, radius, inverse, slope)

    def _plane_through_points(
        self, reconstruction: Reconstruction, frame: int, pinhole: Intrinsics
    ) -> tuple[float, tuple[float, float]]:
        """Inverse depth on the optical axis and its slope a pixel, of the plane with the least sum of squared
        distances to the points: the same one in all frames."""
        if len(self.points) < FEWEST_IN_PLANE:
            raise UserError(
                f"a focal plane through points takes {FEWEST_IN_PLANE} or more; {len(self.points)} are picked"
            )
        xyz = reconstruction.points.xyz[check_points(reconstruction, self.points)]
        centre = xyz.mean(axis=0)
        _, extent, axes = np.linalg.svd(xyz - centre, full_matrices=False)
        if not extent[1] > COLLINEAR * extent[0]:
            raise UserError("the points in focus lie in a line; pick points that span a plane")
        image, _ = reconstruction.image_at(frame)
        normal, middle = image.rotation @ axes[2], image.to_camera(centre)
        away = float(normal @ middle)
        if not abs(away) > IN_PLANE * float(np.linalg.norm(middle)):
            raise UserError(
                f"frame {frame}: the camera lies in the plane of the points in focus; pick other points"
            )
        # normal . (x, y, 1) Z = away on the plane, for rays (x, y, 1).
        across, down = normal[:2] / away / pinhole.focal
        return float(normal[2] / away), (float(across), float(down))

    def inverse_depth(self, reconstruction: Reconstruction, frame: int) -> float:
        """Inverse depth of the focal plane at a frame.

        Points are carried as 3D points: they need not be seen in the frame.
        Raises UserError where nothing is picked or the picked points lie behind the camera.
        """
        if not self.points:
            if self.distance is None:
                raise UserError("nothing is in focus; pick two or more points or give a focus distance")
            # The smallest normal number is the last whose inverse is one.
            if not self.distance >= np.finfo(float).tiny:
                raise UserError(f"the focus distance is {self.distance:g}; it must be greater than zero")
            return 1.0 / float(self.distance)
        ids = check_points(reconstruction, self.points)
        inverse = point_inverse_depths(reconstruction, frame, ids)
        ahead = inverse[inverse > 0]
        if not len(ahead):
            raise UserError(
                f"frame {frame}: no focus point lies ahead of the camera; pick points that lie ahead there"
            )
        return float(ahead.mean())


def check_points(reconstruction: Reconstruction, points: tuple[int, ...]) -> Ints:
    """Point IDs as an array; UserError naming the first one that does not exist."""
    ids = np.array(points, dtype=np.int64)
    wrong = ids[(ids < 0) | (ids >= len(reconstruction.points))]
    if len(wrong) and not len(reconstruction.points):
        raise UserError("the reconstruction has no points to focus on; solve the clip again")
    if len(wrong):
        raise UserError(
            f"there is no focus point {wrong[0]}; the points are 0 to {len(reconstruction.points) - 1}"
        )
    return ids.astype(np.int32)


def pick(
    reconstruction: Reconstruction, frame: int, x: float, y: float, options: PickOptions = PickOptions()
) -> Focus:
    """The focus points for a click at fractions x, y of the picture (0, 0 = top left) of a frame.

    Of the features nearest to the click the four are taken whose mean depth is that of the surface under the
    click, and which differ little: so a click beside a silhouette does not focus between subject and
    background, nor one on a slope before or behind the place.
    """
    check_place(reconstruction, frame, x, y)
    image, _ = reconstruction.image_at(frame)
    canvas = Canvas(reconstruction.intrinsics(image))
    return pick_features(frame_features(reconstruction, frame, canvas), canvas, x, y, options)


def check_place(reconstruction: Reconstruction, frame: int, x: float, y: float) -> None:
    """UserError for fractions x, y outside of the picture, and for a frame without a camera of its own."""
    if not (0 <= x <= 1 and 0 <= y <= 1):
        raise UserError(f"focus at {x:g},{y:g} is outside the picture; both must be between 0 and 1")
    if frame not in reconstruction.frames:
        if not reconstruction.images:
            raise UserError("the reconstruction has no registered frames; solve the clip again")
        first, last = reconstruction.frames[[0, -1]]
        raise UserError(
            f"frame {frame} has no camera to pick a focus in; registered frames are {first} to {last}"
        )


def pick_features(
    features: FrameFeatures, canvas: Canvas, x: float, y: float, options: PickOptions = PickOptions()
) -> Focus:
    """What is `pick`, of a frame's features on its canvas; UserError where they are fewer than two."""
    if len(features.points) < 2:
        raise UserError(
            f"frame {features.frame} has fewer than two feature points; pick the focus in another frame"
        )
    click = canvas.features_from_source(np.array([[x * canvas.lens.width, y * canvas.lens.height]]))
    near = _nearest(features.observed, click[0], 3 * options.points)
    distance = np.linalg.norm(features.observed[near] - click, axis=1)
    # A neighbour at twice the distance of the fourth says little about the clicked place.
    near = near[distance <= 2 * distance[min(options.points, len(near)) - 1]]
    inverse = features.inverse_depth[near]
    under = _surface(features.observed[near] - click, inverse, options)
    agree = np.argsort(np.abs(inverse - under), kind="stable")[: 2 * options.points]
    fours = np.array(list(combinations(agree, min(options.points, len(agree)))))
    chosen = inverse[fours]
    cost = np.abs(chosen.mean(axis=1) - under) + options.range_weight * np.ptp(chosen, axis=1)
    return Focus(points=tuple(int(p) for p in features.points[near[fours[np.argmin(cost)]]]))


def _nearest(places: Floats, place: Floats, count: int) -> Ints:
    """(count,) or fewer indices of the places (n, 2) that are nearest to one (2,), the nearest first.

    Without sorting all of them, which takes a quarter of a second of a million.
    """
    away = np.square(places[:, 0] - place[0])
    away += np.square(places[:, 1] - place[1])
    near = np.argpartition(away, count - 1)[:count] if count < len(away) else np.arange(len(away))
    near.sort()
    return np.asarray(near[np.argsort(away[near], kind="stable")])


def _surface(offsets: Floats, inverse: Floats, options: PickOptions) -> float:
    """Inverse depth at a click of the surface that most of the features (n, 2) pixels beside it are on.

    A plane's inverse depth (n,) is linear over the picture: weighted least squares with Cauchy's weights from
    the weighted median on (Holland and Welsch, "Robust regression using iteratively reweighted
    least-squares", 1977). Close features count more; few that lie in a row tell little of the tilt.
    """
    distance = np.linalg.norm(offsets, axis=1)
    closeness = 1 / (distance + options.softening)
    order = np.argsort(inverse, kind="stable")
    half = np.searchsorted(np.cumsum(closeness[order]), closeness.sum() / 2)
    across = np.column_stack([np.ones(len(inverse)), offsets / (distance.max() + options.softening)])
    plane = np.array([inverse[order[half]], 0.0, 0.0])
    for _ in range(5):
        miss = np.abs(inverse - across @ plane)
        weight = closeness / (1 + (miss / (2 * max(float(np.median(miss)), 1e-9 * inverse.max()))) ** 2)
        flat = np.diag([0.0, 1.0, 1.0]) * options.frontal * weight.sum()
        plane = np.linalg.solve(across.T @ (across * weight[:, None]) + flat, across.T @ (weight * inverse))
    return float(plane[0])


def radius_for_blur(reconstruction: Reconstruction, focus: Focus, frame: int, blur: float) -> float:
    """Aperture radius in scene units that blurs the farthest background into a disc of `blur` image widths.

    D = 2 R f |1/Z - 1/Zf|. The farthest background is the 2nd percentile of the frame's inverse depths
    (single points farther away are mostly wrong). With the background itself in focus, the nearest
    foreground takes its place. UserError where there is nothing to blur.
    """
    if not (np.isfinite(blur) and blur > 0):
        raise UserError(
            f"the blur is {blur:g}; it must be greater than zero (0.03 is 3 % of the image width)"
        )
    return blur / _blur_of_unit_radius(reconstruction, focus, frame)


def blur_for_radius(reconstruction: Reconstruction, focus: Focus, frame: int, radius: float) -> float:
    """Inverse of `radius_for_blur`: the blur disc, in image widths, of an aperture radius in scene units.

    UserError where there is nothing to blur.
    """
    return radius * _blur_of_unit_radius(reconstruction, focus, frame)


def largest_discs(
    reconstruction: Reconstruction, focus: Focus, frame: int, radius: float
) -> tuple[float, float]:
    """Diameters of a frame's largest blur discs before and beyond the focal plane, in image widths.

    Of all but the nearest and farthest 2 % of its points; 0 where none is on that side.
    """
    image, _ = reconstruction.image_at(frame)
    canvas = Canvas(reconstruction.intrinsics(image))
    features = frame_features(reconstruction, frame, canvas)
    if not len(features.points):
        return 0.0, 0.0
    lens = focus.lens(reconstruction, frame, canvas.pinhole, radius)
    plane = lens.focus
    far, near = np.percentile(lens.untilted(features.inverse_depth, features.observed), [2, 98])
    of_contrast = 2 * radius * canvas.lens.fx / canvas.lens.width
    return float(of_contrast * max(near - plane, 0.0)), float(of_contrast * max(plane - far, 0.0))


def sharp_distances(
    reconstruction: Reconstruction, focus: Focus, frame: int, radius: float
) -> tuple[float, float]:
    """`ThinLens.sharp_distances` at a frame, of an aperture radius in scene units."""
    image, _ = reconstruction.image_at(frame)
    plain = reconstruction.intrinsics(image).without_distortion()
    return focus.lens(reconstruction, frame, plain, radius).sharp_distances


def _blur_of_unit_radius(reconstruction: Reconstruction, focus: Focus, frame: int) -> float:
    image, _ = reconstruction.image_at(frame)
    canvas = Canvas(reconstruction.intrinsics(image))
    # First: where nothing is in focus a million points need not be looked at.
    lens = focus.lens(reconstruction, frame, canvas.pinhole, 1.0)
    features = frame_features(reconstruction, frame, canvas)
    if not len(features.points):
        raise UserError(
            f"frame {frame} has no usable feature points to measure a blur by; pick the focus in another"
            " frame, give the aperture's radius, or solve the clip again"
        )
    inverse = lens.focus
    far, near = np.percentile(lens.untilted(features.inverse_depth, features.observed), [2, 98])
    contrast = inverse - far
    if contrast < 0.25 * (near - inverse):
        contrast = near - inverse
    if contrast <= 1e-6 * inverse:
        raise UserError(
            "everything in the picture lies in the focal plane, so there is nothing to blur;"
            " focus elsewhere or give the aperture's radius"
        )
    return float(2 * canvas.lens.fx * contrast / canvas.lens.width)


def exact_registration(canvas: Canvas, offsets: Floats, inverse_depth: float) -> Floats:
    """(N, 2, 3) shears that bring the plane 1/inverse_depth into register, for offsets (N, 2) in scene units.

    A point moves by -f (dx, dy) / z when the camera moves by (dx, dy); the shear adds the focal plane's
    share back, which in Blender is `shift_x`, `shift_y`.
    """
    registration = np.zeros((len(offsets), 2, 3))
    registration[:, 0, 0] = registration[:, 1, 1] = 1.0
    registration[:, :, 2] = canvas.pinhole.focal * offsets * inverse_depth
    return registration


def fitted_registration(
    reconstruction: Reconstruction, features: FrameFeatures, canvas: Canvas, offsets: Floats, focus: Focus
) -> Floats:
    """(N, 2, 3) scalings and translations that map the focus points back by least squares.

    The thesis's section 3.8. Features of the frame are used where at least two focus points are seen in
    it; otherwise the 3D focus points are carried into the frame by projection.
    """
    if len(focus.points) < 2:
        raise UserError("the thesis's method needs at least two focus points; pick four on the subject")
    ids = check_points(reconstruction, focus.points)
    seen = np.isin(features.points, ids)
    if seen.sum() >= 2:
        start, projected = features.observed[seen], features.projected[seen]
        inverse = features.inverse_depth[seen]
    else:
        image, _ = reconstruction.image_at(features.frame)
        local, ahead = seen_by(image, reconstruction, ids)
        local = local[ahead]
        if len(local) < 2:
            raise UserError(
                f"frame {features.frame} has fewer than two focus points in front of the camera;"
                " pick more points that lie ahead there"
            )
        start = projected = canvas.pinhole.project(local)
        inverse = 1.0 / local[:, 2]
    moved = projected - (canvas.pinhole.focal * offsets)[:, None, :] * inverse[:, None]
    centre, target = moved.mean(axis=1, keepdims=True), start.mean(axis=0)
    spread = ((moved - centre) ** 2).sum(axis=(1, 2))
    match = ((moved - centre) * (start - target)).sum(axis=(1, 2))
    # Coinciding focus points determine no scale.
    scale = np.divide(match, spread, out=np.ones_like(match), where=spread > 1e-9)
    registration = np.zeros((len(offsets), 2, 3))
    registration[:, 0, 0] = registration[:, 1, 1] = scale
    registration[:, :, 2] = target - scale[:, None] * centre[:, 0]
    return registration
