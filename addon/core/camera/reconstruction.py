"""Cameras, poses and 3D feature points of a clip from structure from motion.

Conventions are COLMAP's: world-to-camera poses, camera axes x right, y down, z forward, the centre of the
first pixel at (0.5, 0.5). All geometry is float64.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, Ints
from ..base.errors import UserError
from .canvas import Canvas
from .intrinsics import Intrinsics as Intrinsics

MEDIAN_DEPTH = 10.0
"""Median distance between cameras and points after `normalise`, in scene units."""
STAYS = 1e-7
"""Share of the points' distance within which cameras are in one place: the precision of files."""
NEAREST = 1e-6
"""Share of a frame's median depth nearer than which a point is an error: it would outweigh all the others.
Chosen by inspection."""
UNSEEN_TURN = 0.05
"""Pixels by which a rolling shutter moves the border of frames, with less of which they are taken as read at
once: a fifth of a good solve's errors, and resampling would cost more."""


@dataclass(frozen=True)
class Image:
    """One registered frame: its pose and the features it sees that have a 3D point."""

    frame: int
    """Frame number of the clip."""
    rotation: Floats
    """(3, 3) world-to-camera rotation."""
    translation: Floats
    """(3,) world-to-camera translation: camera = rotation @ world + translation."""
    xy: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    """(n, 2) observed feature positions in pixels of the source frame."""
    points: Ints = field(default_factory=lambda: np.zeros(0, np.int32))
    """(n,) rows of `Reconstruction.points` that the features belong to."""
    camera: int = 0
    """Index into `Reconstruction.cameras`."""

    @property
    def centre(self) -> Floats:
        """(3,) projection centre in world coordinates."""
        return -self.rotation.T @ self.translation

    def to_camera(self, world: Floats) -> Floats:
        """Return world points (..., 3) in camera space (..., 3), with z as depth; other values stay NaN."""
        with np.errstate(invalid="ignore", over="ignore"):
            return np.asarray(world @ self.rotation.T + self.translation)


@dataclass(frozen=True)
class Points:
    """The m feature points of a reconstruction. A point's row is its ID everywhere."""

    xyz: Floats
    """(m, 3) world coordinates."""
    rgb: NDArray[np.uint8]
    """(m, 3) sRGB colour."""
    error: Floats
    """(m,) mean reprojection error in pixels."""

    def __len__(self) -> int:
        return len(self.xyz)


NO_POINTS = Points(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0))


@dataclass(frozen=True)
class Reconstruction:
    """The result of structure from motion; `images` are in the order of frame numbers.

    The unit of length is that of the model it was read from, such as metres; for our own solves it is that of
    `normalise`. Focus distances and aperture radii are in the same unit everywhere.
    """

    cameras: tuple[Intrinsics, ...]
    images: tuple[Image, ...]
    points: Points
    is_ordered: bool = True
    """True if frames follow each other in time, as those of a clip. Photos do not; their neighbours follow
    from the cameras alone."""
    readout: tuple[float, float] = (0.0, 0.0)
    """Time in which a rolling shutter reads a picture's width and its height, of the time from a frame to the
    next; positive where what is farther right or down is read later. Poses are those at the time when the
    middle of the picture is read."""

    @cached_property
    def frames(self) -> Ints:
        """(k,) registered frame numbers, ascending."""
        return np.array([image.frame for image in self.images], dtype=np.int32)

    @cached_property
    def stays(self) -> bool:
        """Return whether all cameras stand in one place, so that pictures have no parallax.

        False for poses that are not finite, which are refused where they are used.
        """
        if len(self.images) < 2:
            return False
        with np.errstate(invalid="ignore"):
            centres = np.array([image.centre for image in self.images])
            away = np.linalg.norm(self.points.xyz - centres[0], axis=1)
            known = away[np.isfinite(away)]
            reach = np.median(known) if len(known) else 1.0
            return bool(np.ptp(centres, axis=0).max() <= STAYS * reach)

    @cached_property
    def views_per_point(self) -> Ints:
        """(m,) number of registered frames that see each point."""
        seen = np.concatenate([i.points for i in self.images]) if self.images else np.zeros(0, int)
        return np.bincount(seen, minlength=len(self.points)).astype(np.int32)

    def median_depth(self, image: Image) -> float:
        """Return the median depth of a frame's points ahead; 0 without any.

        It is remembered for registered frames: a pull needs it in every frame and for every mark.
        """
        known = self._median_depths.get(image.frame)
        if known is not None and known[0] is image:
            return known[1]
        depths = image.to_camera(self.points.xyz[image.points])[:, 2]
        depths = depths[np.isfinite(depths) & (depths > 0)]
        median = float(np.median(depths)) if len(depths) else 0.0
        self._median_depths[image.frame] = image, median
        return median

    @cached_property
    def typical_depth(self) -> float:
        """The median over the frames of their median depths; 0 without points."""
        return float(np.median([self.median_depth(image) for image in self.images] or [0.0]))

    @cached_property
    def _median_depths(self) -> dict[int, tuple[Image, float]]:
        """By frame; the image that it is of, as one between registered frames is made anew each time."""
        return {}

    def intrinsics(self, image: Image) -> Intrinsics:
        """Return the camera of an image, in pixels of the clip, with its turn during readout."""
        camera = self.cameras[image.camera]
        if not any(self.readout):
            return camera
        x, y, z = self.turn_at(image.frame).tolist()
        largest = float(np.linalg.norm(self._turns[1], axis=1).max(initial=0.0))
        rolling = replace(camera, turn=(x, y, z), largest_turn=largest, readout=self.readout)
        return camera if rolling.most_read_away * camera.fx < UNSEEN_TURN else rolling

    def canvas(self, of: Image | int, size: tuple[int, int] | None = None) -> Canvas:
        """Get the undistorted canvas of an image, or of the frame of a number.

        Args:
            of: A registered frame or one of `image_at`, or a number, with errors as of `image_at`.
            size: Width and height of the picture in pixels; the clip's own by default.

        Returns:
            The canvas. It is made once per frame and size.
        """
        image = of if isinstance(of, Image) else self.image_at(of)[0]
        key = image.frame, image.camera, size
        if key not in self._canvases:
            camera = self.intrinsics(image)
            self._canvases[key] = Canvas(camera if size is None else camera.scaled(*size))
        return self._canvases[key]

    @cached_property
    def _canvases(self) -> dict[tuple[int, int, tuple[int, int] | None], Canvas]:
        """By frame, camera and size."""
        return {}

    def turn_at(self, frame: int) -> Floats:
        """Return the rotation vector (3,) in radians from a frame to the next, in its camera's axes."""
        frames, turns = self._turns
        return np.array([np.interp(frame, frames, axis) for axis in turns.T])

    @cached_property
    def _turns(self) -> tuple[Ints, Floats]:
        """Frames (k,) whose pose is finite, and as `turn_at` (k, 3)."""
        known = [image for image in self.images if np.all(np.isfinite(image.rotation))]
        frames = np.array([image.frame for image in known], dtype=np.int32)
        return frames, turning_speeds(np.array([image.rotation for image in known]).reshape(-1, 3, 3), frames)

    def image_at(self, frame: int) -> tuple[Image, bool]:
        """Return the image of a frame, and whether its pose is interpolated between those of its neighbours.

        A frame that was not registered gets a pose interpolated between the registered frames
        around it (or the nearest one's, outside their range) and those frames' points.
        Raises UserError where there is no registered frame, or a pose that is needed is not finite, and for
        a photo that was not registered.
        """
        if not self.images:
            raise UserError("the reconstruction has no registered frames; solve the clip again")
        at = int(np.searchsorted(self.frames, frame))
        if at < len(self.images) and self.frames[at] == frame:
            _check_pose(self.images[at])
            return self.images[at], False
        if not self.is_ordered:
            raise UserError(
                f"photo {frame} (by name) could not be matched with the others, so it has no camera; leave"
                " it out, or add photos from places in between"
            )
        before, after = self.images[max(at - 1, 0)], self.images[min(at, len(self.images) - 1)]
        _check_pose(before)
        _check_pose(after)
        span = after.frame - before.frame
        share = (frame - before.frame) / span if span else 0.0
        turn = rotation_vector(after.rotation @ before.rotation.T)
        rotation = rotation_matrix(share * turn) @ before.rotation
        centre = (1 - share) * before.centre + share * after.centre
        seen = np.union1d(before.points, after.points).astype(np.int32)
        between = Image(frame, rotation, -rotation @ centre, np.zeros((0, 2)), seen, before.camera)
        local = between.to_camera(self.points.xyz[seen])
        camera = self.intrinsics(between)
        xy = camera.project(local)
        inside = (local[:, 2] > 0) & np.all((xy >= 0) & (xy <= [camera.width, camera.height]), axis=1)
        return replace(between, xy=xy[inside], points=seen[inside]), True


def _check_pose(image: Image) -> None:
    if not (np.all(np.isfinite(image.rotation)) and np.all(np.isfinite(image.translation))):
        raise UserError(
            f"the camera of frame {image.frame} has an invalid position or rotation; solve the clip again,"
            " or remove the frame from the reconstruction"
        )


def turning_speeds(rotation: Floats, frames: Ints) -> Floats:
    """Return rotation vectors (F, 3) from a frame to the next, in camera axes.

    They are half of those from the frame before to the frame after, and at the ends those of one step.

    Args:
        rotation: (F, 3, 3) world-to-camera.
        frames: (F,) numbers.
    """
    each = np.arange(len(frames))
    before, after = np.maximum(each - 1, 0), np.minimum(each + 1, len(each) - 1)
    gap = np.maximum(frames[after] - frames[before], 1)
    steps = rotation[after] @ np.swapaxes(rotation[before], 1, 2)
    vectors = np.array([rotation_vector(step) for step in steps])
    return np.asarray(vectors.reshape(-1, 3) / gap[:, None])


def nearest_rotation(matrix: Floats) -> Floats:
    """Return the rotation nearest to a matrix (3, 3) in the Frobenius norm: its polar factor.

    Higham, "Matrix nearness problems", 1989.
    """
    left, _, right = np.linalg.svd(matrix)
    return np.asarray(left @ right)


def rotation_vector(matrix: Floats) -> Floats:
    """Return (3, 3) rotation -> (3,) axis times angle in radians (logarithm map of SO(3))."""
    quaternion = quaternion_from_matrix(matrix)
    sine = np.linalg.norm(quaternion[1:])
    if sine < 1e-300:
        return np.zeros(3)
    return np.asarray(2 * np.arctan2(sine, quaternion[0]) / sine * quaternion[1:])


def rotation_matrix(vector: Floats) -> Floats:
    """Return (3,) axis times angle in radians -> (3, 3) rotation (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    half = angle / 2
    return matrix_from_quaternion(np.concatenate([[np.cos(half)], np.sin(half) / angle * vector]))


def matrix_from_quaternion(quaternion: Floats) -> Floats:
    """Return (4,) quaternion w, x, y, z of any non-zero length -> (3, 3) rotation; else UserError."""
    largest = np.abs(quaternion).max()
    if not (np.isfinite(largest) and largest > 0):
        raise UserError(f"a camera's quaternion is {np.asarray(quaternion)}; it must be finite and not zero")
    # Divided before the norm too, so that its squares neither vanish nor overflow.
    shortened = np.asarray(quaternion, dtype=np.float64) / largest
    w, x, y, z = shortened / np.linalg.norm(shortened)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def quaternion_from_matrix(matrix: Floats) -> Floats:
    """Return (3, 3) rotation -> (4,) unit quaternion w, x, y, z with w >= 0.

    Bar-Itzhack, "New method for extracting the quaternion from a rotation matrix", 2000: the
    eigenvector of the largest eigenvalue, stable at every angle and for slightly skewed input.
    """
    m = matrix
    k = np.array([
        [m[0, 0] + m[1, 1] + m[2, 2], m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]],
        [0.0, m[0, 0] - m[1, 1] - m[2, 2], m[1, 0] + m[0, 1], m[2, 0] + m[0, 2]],
        [0.0, 0.0, m[1, 1] - m[0, 0] - m[2, 2], m[2, 1] + m[1, 2]],
        [0.0, 0.0, 0.0, m[2, 2] - m[0, 0] - m[1, 1]],
    ])  # fmt: skip
    quaternion = np.linalg.eigh(k, UPLO="U")[1][:, -1]
    return np.asarray(quaternion if quaternion[0] >= 0 else -quaternion)


def typical_distance(reconstruction: Reconstruction) -> float:
    """Return the median distance of the points from the mean camera centre, in the model's unit.

    Raises:
        UserError: The scale is undetermined.
    """
    images = reconstruction.images
    if not images or not len(reconstruction.points):
        raise UserError("the reconstruction has no cameras or no points; solve the clip again")
    for image in images:
        _check_pose(image)
    centre = np.mean([image.centre for image in images], axis=0)
    with np.errstate(over="ignore", invalid="ignore"):
        distances = np.linalg.norm(reconstruction.points.xyz - centre, axis=1)
    distances = distances[np.isfinite(distances)]
    typical = float(np.median(distances)) if len(distances) else 0.0
    if not typical > 0:
        raise UserError(
            "the reconstruction's points are invalid or lie inside the camera, so it has no scale; solve"
            " the clip again"
        )
    return typical


def normalise(reconstruction: Reconstruction) -> Reconstruction:
    """Recentre, turn upright and rescale a solve, which has no unit.

    As `upright`, and the median distance of the points becomes `MEDIAN_DEPTH`.
    """
    return _moved(reconstruction, MEDIAN_DEPTH / typical_distance(reconstruction))


def upright(reconstruction: Reconstruction) -> Reconstruction:
    """Recentre and turn upright, with unchanged lengths.

    Blender's float32 holds any unit, but no scene far from the origin. The mean camera centre becomes the
    origin, the mean camera up direction +z, and the mean viewing direction points to +y. Points that are not
    finite stay so.

    Raises:
        UserError: A camera is not finite, or the scale is undetermined.
    """
    typical_distance(reconstruction)
    return _moved(reconstruction, 1.0)


def level_axes(images: Sequence[Image]) -> Floats:
    """Return the unit vectors (3, 3) to the right of cameras, forward and up, along world axes.

    They follow from the mean up direction and the mean viewing direction.
    """
    up = -np.mean([image.rotation[1] for image in images], axis=0)
    forward = np.mean([image.rotation[2] for image in images], axis=0)
    # A clip that turns all the way round has no mean direction; then the first camera gives it.
    if min(np.linalg.norm(up), np.linalg.norm(np.cross(up, forward))) < 1e-3:
        up, forward = -images[0].rotation[1], images[0].rotation[2]
    z = up / np.linalg.norm(up)
    x = np.cross(forward, z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def _moved(reconstruction: Reconstruction, scale: float) -> Reconstruction:
    images = reconstruction.images
    centre = np.mean([image.centre for image in images], axis=0)
    turn = level_axes(images)

    def moved(image: Image) -> Image:
        rotation = image.rotation @ turn.T
        return replace(
            image, rotation=rotation, translation=-rotation @ (scale * turn @ (image.centre - centre))
        )

    with np.errstate(over="ignore", invalid="ignore"):
        xyz = scale * (reconstruction.points.xyz - centre) @ turn.T
    points = replace(reconstruction.points, xyz=xyz)
    return replace(reconstruction, images=tuple(moved(image) for image in images), points=points)


def seen_by(image: Image, reconstruction: Reconstruction, points: Ints) -> tuple[Floats, NDArray[np.bool_]]:
    """Return points in a camera's space (k, 3), and which of them (k,) are finite and ahead of the camera.

    Ahead is farther than `NEAREST` times the median depth of the frame's points, in any units.
    """
    local = image.to_camera(reconstruction.points.xyz[points])
    # The smallest normal number is the last whose inverse is one.
    nearest = max(NEAREST * reconstruction.median_depth(image), float(np.finfo(float).tiny))
    return local, np.all(np.isfinite(local), axis=1) & (local[:, 2] > nearest)
