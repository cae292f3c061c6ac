"""Cameras and points of unordered photos, by COLMAP's incremental mapping. Worker process only.

SIFT's keypoints (`sift`) of each photo are matched with all others', of each pair those that are each other's
best match. Photos of one size and focal length share a camera: a focal length and one term of radial
distortion, which wide angles between the photos determine. With narrow angles both are held at their priors.
Schönberger and Frahm, "Structure-from-motion revisited", 2016. Places are in pixels of each photo, the first
pixel's middle at (0.5, 0.5).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

# The order matters: imported after pycolmap, OpenCV's PNG writer frees memory twice.
import cv2  # noqa: F401
import numpy as np
import pycolmap
from numpy.typing import NDArray

from ...base.arrays import Floats, Ints
from ...base.atomic import temporary_folder
from ...base.counting import counted
from ...base.errors import UserError
from ...camera.reconstruction import Image, Intrinsics, Points, Reconstruction, normalise
from ...media.clip import MOST_STILLS, Footage
from ...media.light import to_gray8
from ..adjustment.solution import MIN_POINTS, observed, outermost_angles
from ..report import Figures, Solved
from ..steps import progress
from ..tracking.sift import Descriptors, keypoints, make_sift, matched
from ..tracking.tracks import colours_at
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
LONG_SIDE = 1600
"""Longer side, in pixels, to which larger photos are reduced before their features are detected."""
FEATURES = 4000
"""The strongest keypoints of a photo that are matched, of up to `FEW` photos."""
FEW = 30
"""Photos past which fewer of their keypoints are matched, so that all pairs take minutes, not hours."""
LEAST_FEATURES = 2000
"""The strongest keypoints of a photo that are matched, of many photos."""


@dataclass(frozen=True)
class Photo:
    """The features of one picture."""

    frame: int
    name: str
    width: int
    height: int
    xy: Floats
    """(n, 2) pixels."""
    descriptors: Descriptors
    """(n, 128)"""
    rgb: NDArray[np.uint8]
    """(n, 3) sRGB."""


def place_photos(
    footage: Footage, given: float | None, prior: Callable[[Path, int, int], float | None]
) -> Solved:
    """Return cameras and points of photos, normalised, and their figures.

    Args:
        footage: The photos.
        given: Known focal length of the first photo in pixels, which is held; or None.
        prior: Returns the focal length in pixels that a file of a width and height states, or None.

    Raises:
        UserError: There are too few photos or too many, one cannot be read, or no two of them show one scene
            from different places.
    """
    photos, first = _find_features(footage), max(footage.width, footage.height)
    known = [
        # Other photos of the same camera differ in size at most.
        given * max(photo.width, photo.height) / first if given
        else prior(footage.file(photo.frame), photo.width, photo.height)
        for photo in photos
    ]  # fmt: skip
    best, is_calibrated, lens_of = _mapped(photos, _match_all(photos), known, not given)
    result = normalise(_collected(best, photos, lens_of))
    point, _, rays = observed(result)
    angle = float(np.nanmedian(outermost_angles(rays, point, len(result.points))))
    if angle < MIN_ANGLE:
        raise UserError(
            f"these photos are taken from one place ({angle:.2f} degrees between them): too little parallax;"
            " take them from places a step apart"
        )
    there = set(result.frames.tolist())
    lost = [photo.name for photo in photos if photo.frame not in there]
    note = f"{len(lost)} photos could not be matched with the others: {', '.join(lost)}"
    source = "clip" if is_calibrated else "given" if given else "metadata" if any(known) else "guess"
    return result, Figures("stills", source, tracker="sift", notes=(note,) * bool(lost))


def _find_features(footage: Footage) -> list[Photo]:
    """The features of all photos; UserError for too few or too many."""
    count = len(footage.frames)
    if not 2 <= count <= MOST_STILLS:
        raise UserError(
            f"{footage.path.name} has {counted(count, 'photo')}; 2 to {MOST_STILLS} can be matched with"
            " each other; put those of one scene in a folder"
        )
    most = FEATURES if count <= FEW else LEAST_FEATURES
    sift, found = make_sift(0.01), []
    for done, frame in enumerate(footage.frames):
        progress("Finding features", done, count)
        picture = footage.read(frame)
        height, width = picture.shape[:2]
        gray = to_gray8(picture, LONG_SIDE)
        points = keypoints(sift, gray)
        points = points.kept(np.sort(np.argsort(-points.response, kind="stable")[:most]))
        xy = (points.places.astype(np.float64) + 0.5) * np.array(
            [width / gray.shape[1], height / gray.shape[0]]
        )
        colours = colours_at(picture, xy)
        found.append(Photo(frame, footage.file(frame).name, width, height, xy, points.descriptors, colours))
    return found


def _match_all(photos: Sequence[Photo]) -> dict[tuple[int, int], Ints]:
    """Rows (n, 2) of the features that match in two photos, by numbers (i, j) of photos, i < j."""
    pairs = list(combinations(range(len(photos)), 2))
    found = {}
    for done, (i, j) in enumerate(pairs):
        progress("Matching photos", done, len(pairs))
        found[i, j] = np.column_stack(matched(photos[i].descriptors, photos[j].descriptors)).astype(np.int32)
    return found


def _mapped(
    photos: Sequence[Photo], matches: dict[tuple[int, int], Ints], known: Sequence[float | None], frees: bool
) -> tuple[pycolmap.Reconstruction, bool, list[int]]:
    """The best model, whether its focal lengths are the photos' own, and the numbers of their cameras."""
    with temporary_folder() as folder:
        lens_of = _write_database(folder, photos, matches, known)
        progress("Placing photos", 0, len(photos))
        longest = max(max(photo.width, photo.height) for photo in photos)
        verify(folder, MAX_ERROR * longest / 1000)
        tried: list[tuple[pycolmap.Reconstruction, bool, list[int]]] = []
        angles = [(angle, frees) for angle in WIDE_ANGLES] + [(angle, False) for angle in NARROW_ANGLES]
        for angle, is_free in angles:
            settings = _settings(angle, is_free, longest)
            model = mapped(folder, settings, "Placing photos", len(photos))
            if model is None or model.num_reg_images() < 2 or model.num_points3D() < MIN_POINTS:
                continue
            tried.append((model, is_free, lens_of))
            if model.num_reg_images() >= ENOUGH * len(photos):
                break
    if not tried:
        raise UserError(
            "no two of these photos show the same things from different places; take more, a step apart,"
            " with plenty of overlap"
        )
    return max(tried, key=lambda each: (each[0].num_reg_images(), each[0].num_points3D()))


def _write_database(
    folder: Path,
    photos: Sequence[Photo],
    matches: dict[tuple[int, int], Ints],
    known: Sequence[float | None],
) -> list[int]:
    """The photos, image i + 1 being photo i, as COLMAP reads them; the numbers of their cameras."""
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
