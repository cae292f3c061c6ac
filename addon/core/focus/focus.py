"""The focal plane, and the aperture that gives a wanted blur."""

from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Floats, Ints
from ..base.errors import UserError
from ..camera.reconstruction import Intrinsics, Reconstruction
from ..depth.flat_scene import BEYOND
from ..depth.sparse import FrameFeatures, frame_features, point_inverse_depths
from ..optics.thin_lens import ThinLens
from ..optics.zone import NO_ZONE, InFocusZone

FEWEST_IN_PLANE = 3
"""Points in focus that make a plane."""
NEAREST = 0.01
"""Least distance of the focus, as a share of the distance of the nearest things: at a nearer one all blur
discs are equal within 1 %."""
COLLINEAR = 1e-3
"""Share of the extent of the points in focus; points closer to a line define no plane. Chosen by
inspection."""
AT_BACKGROUND = 0.05
"""Relative difference of inverse depths of the focus and the farthest background up to which that is in
focus. Chosen by inspection."""
IN_PLANE = 1e-6
"""Share of the distance of the points in focus; a camera closer to their plane sees it as a line. Chosen by
inspection."""


@dataclass(frozen=True)
class Focus:
    """The thing in focus: 3D points that are followed through the clip, or a constant distance."""

    points: tuple[int, ...] = ()
    distance: float | None = None
    """Depth along the optical axis, in scene units, or infinity; used where there are no points."""
    through_points: bool = False
    """Whether the focal plane is tilted to go through the points, three or more, and stays with them."""
    tilt: float = 0.0
    """Radians by which the focal plane's upper part leans away from the camera, about its place on the
    optical axis; not of a plane through points."""
    swing: float = 0.0
    """Radians by which the focal plane's right part leans away from the camera, as `tilt`."""

    @property
    def is_tilted(self) -> bool:
        """Return whether the focal plane can be tilted against the picture."""
        return bool(self.through_points and self.points) or self.tilt != 0 or self.swing != 0

    def lens(
        self, reconstruction: Reconstruction, frame: int, pinhole: Intrinsics, radius: float
    ) -> ThinLens:
        """Return the thin lens of an aperture radius in scene units at a frame, for a pinhole.

        Raises:
            UserError: As of `inverse_depth`; or the points in focus define no plane.
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
        """Inverse depth on the axis, and slopes a pixel, of the least-squares plane through the points."""
        if len(self.points) < FEWEST_IN_PLANE:
            raise UserError(
                f"a focal plane through points takes {FEWEST_IN_PLANE} or more; {len(self.points)} are picked"
            )
        xyz = reconstruction.points.xyz[check_points(reconstruction, self.points)]
        centre = xyz.mean(axis=0)
        _, extent, axes = np.linalg.svd(xyz - centre, full_matrices=False)
        if not extent[1] > COLLINEAR * extent[0]:
            raise UserError("the points in focus lie on a line; pick points that span a plane")
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
        """Return the inverse depth of the focal plane at a frame.

        3D points are projected: they need not be seen in the frame.

        Raises:
            UserError: Nothing is picked, or the points lie behind the camera.
        """
        if not self.points:
            if self.distance is None:
                raise UserError("nothing is in focus; pick what should be sharp, or give a focus distance")
            # The smallest normal number is the last whose inverse is one.
            if not self.distance >= np.finfo(float).tiny:
                raise UserError(f"the focus distance is {self.distance:g}; it must be greater than zero")
            return 1.0 / float(self.distance)
        ids = check_points(reconstruction, self.points)
        inverse = point_inverse_depths(reconstruction, frame, ids)
        ahead = inverse[inverse > 0]
        if not len(ahead):
            raise UserError(
                f"frame {frame}: no focus point is in front of the camera; pick points that are in front of"
                " it"
            )
        return float(ahead.mean())


def check_points(reconstruction: Reconstruction, points: tuple[int, ...]) -> Ints:
    """Point IDs (n,); UserError naming the first one that does not exist."""
    ids = np.array(points, dtype=np.int64)
    wrong = ids[(ids < 0) | (ids >= len(reconstruction.points))]
    if len(wrong) and not len(reconstruction.points):
        raise UserError("the reconstruction has no points to focus on; solve the clip again")
    if len(wrong):
        raise UserError(
            f"there is no focus point {wrong[0]}; the points are 0 to {len(reconstruction.points) - 1}"
        )
    return ids.astype(np.int32)


def check_distance(reconstruction: Reconstruction, distance: float) -> None:
    """Check that a focal plane at a distance leaves some things sharper than others.

    Args:
        reconstruction: Solve of the clip.
        distance: Depth along the optical axis, in scene units.

    Raises:
        UserError: The distance is below `NEAREST` times the distance of everything in the clip.
    """
    images = [image for image in reconstruction.images if len(image.points)]
    depths = [image.to_camera(reconstruction.points.xyz[image.points])[:, 2] for image in images]
    nearest = min((float(np.percentile(z, 2)) for z in depths), default=0.0)
    if distance < NEAREST * nearest:
        raise UserError(
            f"the focus distance is {distance:g}, but nothing in the clip is nearer than {nearest:.4g}, so"
            f" all would be blurred alike; give a distance from {NEAREST * nearest:.4g} on, in the solve's"
            " own unit"
        )


def radius_for_blur(reconstruction: Reconstruction, focus: Focus, frame: int, blur: float) -> float:
    """Aperture radius in scene units that blurs the farthest background into a disc of `blur` image widths.

    D = 2 R f |1/Z - 1/Zf|. The farthest background is the 2nd percentile of the frame's inverse depths
    (single points farther away are mostly wrong). With the background itself in focus, the nearest
    foreground, the 98th percentile, takes its place; whether it is in focus is judged by the 90th, as points
    on moving people seem close to the camera. Points without depth are all background, before which subjects
    stand as in `FlatScene`. UserError where there is nothing to blur.
    """
    canvas = reconstruction.canvas(frame)
    # First: where nothing is in focus a million points need not be looked at.
    lens = focus.lens(reconstruction, frame, canvas.pinhole, 1.0)
    features = frame_features(reconstruction, frame, canvas)
    if not len(features.points):
        raise UserError(
            f"frame {frame} has no usable feature points to measure blur by; pick the focus in another"
            " frame, set the aperture radius, or solve the clip again"
        )
    inverse, (far, near, nearest) = lens.focus, _extent(reconstruction, lens, features)
    contrast = inverse - far
    if contrast < max(0.25 * (near - inverse), AT_BACKGROUND * inverse):
        contrast = max(contrast, nearest - inverse)
    if contrast <= 1e-6 * inverse:
        raise UserError(
            "everything in the picture lies in the focal plane, so there is nothing to blur; focus"
            " elsewhere or set the aperture radius"
        )
    return blur / float(2 * canvas.camera.fx * contrast / canvas.camera.width)


def _extent(reconstruction: Reconstruction, lens: ThinLens, features: FrameFeatures) -> Floats:
    """Return the 2nd, 90th and 98th percentile (3,) of `rectified` inverse depths, or assumed ones."""
    found = np.percentile(lens.rectified(features.inverse_depth, features.observed), [2, 90, 98])
    away = reconstruction.points.xyz[features.points] - reconstruction.images[0].centre
    if reconstruction.stays and np.allclose(np.linalg.norm(away, axis=1), np.linalg.norm(away[0])):
        found[1:] = BEYOND * found[0]
    return found


def largest_discs(
    reconstruction: Reconstruction, focus: Focus, frame: int, radius: float, zone: InFocusZone = NO_ZONE
) -> tuple[float, float]:
    """Return the diameters of a frame's largest blur discs, in image widths.

    The nearest and farthest 2 % of its points are left out.

    Returns:
        The diameter in front of the focal plane and the one behind it; 0 on a side without points.
    """
    canvas = reconstruction.canvas(frame)
    features = frame_features(reconstruction, frame, canvas)
    if not len(features.points):
        return 0.0, 0.0
    lens = replace(focus.lens(reconstruction, frame, canvas.pinhole, radius), zone=zone)
    plane, (far, _, near) = lens.focus, _extent(reconstruction, lens, features)
    of_contrast = 2 * radius * canvas.camera.fx / canvas.camera.width
    return float(of_contrast * max(near - plane, 0.0)), float(of_contrast * max(plane - far, 0.0))


def sharp_distances(
    reconstruction: Reconstruction, focus: Focus, frame: int, radius: float, zone: InFocusZone = NO_ZONE
) -> tuple[float, float]:
    """Return `ThinLens.sharp_distances` at a frame, for an aperture radius in scene units."""
    image, _ = reconstruction.image_at(frame)
    plain = reconstruction.intrinsics(image).without_distortion()
    return replace(focus.lens(reconstruction, frame, plain, radius), zone=zone).sharp_distances
