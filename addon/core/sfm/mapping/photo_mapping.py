"""Cameras and points of unordered photos, by COLMAP's incremental mapping. Worker process only.

Photos of one size and focal length share a camera: a focal length and one term of radial distortion, which
wide angles between the photos determine. With narrow angles both are held at their priors. Schönberger and
Frahm, "Structure-from-motion revisited", 2016.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

# The order matters: imported after pycolmap, OpenCV's PNG writer frees memory twice.
import cv2  # noqa: F401
import numpy as np
import pycolmap

from ...base.arrays import Ints
from ...base.atomic import temporary_folder
from ...base.errors import UserError
from ...camera.reconstruction import Image, Intrinsics, Points, Reconstruction, normalise
from ..adjustment.solution import MIN_POINTS, observed, outermost_angles
from ..steps import progress
from ..tracking.photo_matching import Photo
from .keyframes import START_FOCAL, mapped, mapper_options, new_camera, verify, write_database

MODEL = "SIMPLE_RADIAL"
# Chosen by inspection of solved photos where no line below gives a measurement.
WIDE_ANGLES = (8.0, 4.0)
"""Degrees between two photos of a point to begin with, at which focal lengths are found, too; COLMAP's 16
fail on photos taken from one place with a stretched arm."""
NARROW_ANGLES = (2.0, 1.0)
"""Degrees with which focal lengths are held: see `keyframes.map_keyframes`."""
ENOUGH = 0.8
"""Share of the photos in a model from which on no other angle is tried."""
MAX_ERROR = 4.0
"""Pixels of a 1,000-pixel photo by which a match may miss its epipolar line: lenses bend."""
MIN_ANGLE = 0.5
"""Least angle in degrees between the outermost rays of a point, median over the points; photos with less have
too little parallax and are refused."""


def place_photos(
    photos: Sequence[Photo],
    matches: dict[tuple[int, int], Ints],
    focal: Callable[[Photo], float | None],
    is_held: bool,
) -> tuple[Reconstruction, bool]:
    """Return cameras and points of photos from their matches, normalised.

    Args:
        photos: The photos.
        matches: Matched features of pairs.
        focal: Returns a photo's prior focal length in pixels.
        is_held: True to hold it.

    Returns:
        The solve, and whether its focal lengths come from the photos, not from their priors.

    Raises:
        UserError: No two photos show one scene from different places.
    """
    with temporary_folder() as folder:
        lens_of = _write_database(folder, photos, matches, focal)
        progress("Placing photos", 0, len(photos))
        longest = max(max(photo.width, photo.height) for photo in photos)
        verify(folder, MAX_ERROR * longest / 1000)
        tried: list[tuple[pycolmap.Reconstruction, bool]] = []
        angles = [(angle, not is_held) for angle in WIDE_ANGLES]
        angles += [(angle, False) for angle in NARROW_ANGLES]
        for angle, frees in angles:
            settings = _settings(angle, frees, longest)
            model = mapped(folder, settings, "Placing photos", len(photos))
            if model is None or model.num_reg_images() < 2 or model.num_points3D() < MIN_POINTS:
                continue
            tried.append((model, frees))
            if model.num_reg_images() >= ENOUGH * len(photos):
                break
    if not tried:
        raise UserError(
            "no two of these photos show the same things from different places; take more, a step apart,"
            " with plenty of overlap"
        )
    best, is_calibrated = max(tried, key=lambda each: (each[0].num_reg_images(), each[0].num_points3D()))
    reconstruction = normalise(_collected(best, photos, lens_of))
    point, _, rays = observed(reconstruction)
    angle = float(np.nanmedian(outermost_angles(rays, point, len(reconstruction.points))))
    if angle < MIN_ANGLE:
        raise UserError(
            f"these photos are taken from one place ({angle:.2f} degrees between them): too little parallax;"
            " take them from places a step apart"
        )
    return reconstruction, is_calibrated


def _write_database(
    folder: Path,
    photos: Sequence[Photo],
    matches: dict[tuple[int, int], Ints],
    focal: Callable[[Photo], float | None],
) -> list[int]:
    """The photos, image i + 1 being photo i, as COLMAP reads them; the numbers of their cameras."""
    known = [focal(photo) for photo in photos]
    keys = [
        (photo.width, photo.height, None if own is None else round(own, 1))
        for photo, own in zip(photos, known, strict=True)
    ]
    numbers = {key: number for number, key in enumerate(dict.fromkeys(keys), 1)}
    cameras = [
        new_camera(MODEL, own or START_FOCAL * max(width, height), (width, height), number)
        for (width, height, own), number in numbers.items()
    ]
    lens_of = [numbers[key] for key in keys]
    images = [(number, photo.xy) for number, photo in zip(lens_of, photos, strict=True)]
    write_database(folder, cameras, images, ((pair, rows) for pair, rows in matches.items() if len(rows)))
    return lens_of


def _settings(angle: float, frees: bool, longest: int) -> pycolmap.IncrementalPipelineOptions:
    """The mapper's, for photos of a longest side in pixels; `frees` their focal lengths."""
    settings = mapper_options(angle)
    settings.min_model_size = 2
    settings.ba_refine_focal_length = settings.ba_refine_extra_params = frees
    mapper = settings.mapper
    mapper.abs_pose_refine_focal_length = mapper.abs_pose_refine_extra_params = frees
    mapper.init_min_num_inliers = 30
    mapper.filter_max_reproj_error = max(2.0, MAX_ERROR * longest / 2000)
    mapper.abs_pose_max_error = 3 * mapper.filter_max_reproj_error
    return settings


def _collected(
    model: pycolmap.Reconstruction, photos: Sequence[Photo], lens_of: Sequence[int]
) -> Reconstruction:
    """COLMAP's model as our own type."""
    numbers = {point: row for row, point in enumerate(sorted(model.points3D))}
    xyz = np.array([model.points3D[point].xyz for point in numbers])
    error = np.array([model.points3D[point].error for point in numbers])
    rgb = np.zeros((len(numbers), 3), np.uint8)
    used = sorted({lens_of[number - 1] for number in model.reg_image_ids()})
    images = []
    for number in sorted(model.reg_image_ids()):
        photo, image = photos[number - 1], model.images[number]
        # pycolmap gives features one by one.
        seen = [(row, numbers[p.point3D_id]) for row, p in enumerate(image.points2D) if p.has_point3D()]
        rows, points = np.array(seen, np.int32).reshape(-1, 2).T
        rgb[points] = photo.rgb[rows]
        pose = image.cam_from_world()
        images.append(
            Image(
                photo.frame, pose.rotation.matrix(), np.asarray(pose.translation), photo.xy[rows], points,
                used.index(lens_of[number - 1]),
            )
        )  # fmt: skip
    lenses = tuple(
        Intrinsics.from_parameters(MODEL, camera.width, camera.height, camera.params.tolist())
        for camera in (model.cameras[number] for number in used)
    )
    return Reconstruction(lenses, tuple(images), Points(xyz, rgb, error), is_ordered=False)
