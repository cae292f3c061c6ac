"""The steps by pycolmap: solving keyframes, and adjusting all frames. Worker process only."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

# The order matters: imported after pycolmap, OpenCV's PNG writer frees memory twice.
import cv2  # noqa: F401
import numpy as np
import pycolmap

from ...base.arrays import Floats, Ints
from ...base.atomic import temporary_folder
from ..adjustment.bundle import loss_of
from ..adjustment.solution import Solution, triangulate
from ..steps import progress
from ..tracking.tracks import Tracks

pycolmap.logging.minloglevel = 3
# Else every process leaves a file in the folder for temporary ones. `logtostderr` alone does not last: an
# adjustment sets it back.
for _level in pycolmap.logging.Level.__members__.values():
    pycolmap.logging.set_log_destination(_level, "")

DATABASE = "database.db"
THREADS = 1
"""Number of pycolmap's threads. With more, the order in which pairs are stored and sums are added up is
whatever thread was faster, and the same clip gives one model today and another tomorrow."""
# Chosen by inspection of solved clips.
START_FOCAL = 0.85
"""Focal length to begin with, in long sides of the frame: a phone's main camera."""
LEAST = 40
"""Keyframes at least, of a clip that has as many frames."""
STEP = 0.06
"""Median motion of the tracks from a keyframe to the next, at most, in long sides of the frame."""
FEATURES = 250
"""Median number of features in a keyframe past which only an even choice of the tracks is mapped. With 500,
solves of seven filmed motions take 22 % more CPU seconds and come no closer to the truth."""
OBSERVATIONS = 400_000
"""Observations past which only an even choice of the tracks takes part in an adjustment of all frames."""


def keyframes(tracks: Tracks) -> list[int]:
    """Choose frames at equal steps of image motion, first and last included; return their indices."""
    count = len(tracks.frames)
    flow = np.zeros(count)
    for index in range(1, count):
        a, b = tracks.shared(index - 1, index)
        flow[index] = np.median(np.linalg.norm(b - a, axis=1)) if len(a) else 1.0
    path = np.cumsum(flow + 1e-3)
    wanted = (path[-1] - path[0]) / (STEP * max(tracks.width, tracks.height)) + 1
    steps = np.linspace(path[0], path[-1], min(max(LEAST, round(wanted)), count))
    return sorted(set(np.clip(np.searchsorted(path, steps - 1e-9), 0, count - 1).tolist()) | {0, count - 1})


def keyframe_features(tracks: Tracks, keys: list[int]) -> list[tuple[Ints, Floats]]:
    """Track numbers (n,) and places (n, 2) of each keyframe, without those that would only cost time.

    Poses need no more than an even choice of the tracks; the others get their points later, and take part
    in the last adjustment.
    """
    features = [tracks.in_frame(index) for index in keys]
    median = float(np.median([len(ids) for ids, _ in features]))
    kept = np.random.default_rng(0).random(tracks.count) < FEATURES / max(median, 1.0)
    return [(ids[kept[ids]], xy[kept[ids]]) for ids, xy in features]


def map_keyframes(
    tracks: Tracks, features: list[tuple[Ints, Floats]], focal: float
) -> pycolmap.Reconstruction | None:
    """Return the best model of the keyframes; image i + 1 is keyframe i.

    Args:
        tracks: Those of the clip.
        features: IDs (n,) and places (n, 2) in pixels of each keyframe.
        focal: In pixels.
    """
    keys, best = len(features), None
    with temporary_folder() as folder:
        camera = new_camera("SIMPLE_PINHOLE", focal, (tracks.width, tracks.height))
        write_database(folder, [camera], [(1, xy) for _, xy in features], _shared(features))
        progress("Verifying matches", 0, 1)
        verify(folder, 4.0)
        for angle in (3.0, 1.5, 0.7):
            best = mapped(folder, mapper_options(angle), "Solving cameras", keys)
            if best is not None and best.num_reg_images() >= 0.8 * keys:
                break
    return best if best is not None and best.num_reg_images() >= 2 else None


def _shared(features: list[tuple[Ints, Floats]]) -> Iterator[tuple[tuple[int, int], Ints]]:
    """Pairs of keyframes, by index, and the rows (k, 2) of the tracks that both have."""
    for i, (tracks, _) in enumerate(features):
        for gap in (*range(1, 11), 16, 32):
            if i + gap < len(features):
                both = np.intersect1d(tracks, features[i + gap][0], assume_unique=True, return_indices=True)
                if len(both[0]) >= 30:
                    yield (i, i + gap), np.column_stack(both[1:])


def verify(folder: Path, largest_error: float) -> None:
    """Verify the matches of a database within so many pixels of the epipolar line."""
    options, threads = pycolmap.TwoViewGeometryOptions(), pycolmap.GeometricVerifierOptions()
    options.ransac.max_error, options.ransac.random_seed = largest_error, 0
    threads.num_threads = THREADS
    pycolmap.geometric_verification(folder / DATABASE, threads, two_view_geometry_options=options)


def mapped(
    folder: Path, options: pycolmap.IncrementalPipelineOptions, stage: str, count: int
) -> pycolmap.Reconstruction | None:
    """Map a verified database of `count` images; returns the model with most images and points, or None."""
    done = [2]

    def next_image() -> None:
        done[0] += 1
        progress(stage, min(done[0], count), count)

    progress(stage, 2, count)
    (folder / "model").mkdir(exist_ok=True)
    models = pycolmap.incremental_mapping(
        folder / DATABASE, folder, folder / "model", options, next_image_callback=next_image
    )
    # The first model is often a stump.
    return max(models.values(), key=lambda m: (m.num_reg_images(), m.num_points3D()), default=None)


def mapper_options(angle: float) -> pycolmap.IncrementalPipelineOptions:
    """Return options for pictures of which two see a point at least `angle` degrees apart."""
    options = pycolmap.IncrementalPipelineOptions()
    mapper = options.mapper
    options.multiple_models = options.extract_colors = False
    options.min_model_size = 3
    options.random_seed = options.triangulation.random_seed = mapper.random_seed = 0
    options.num_threads = mapper.num_threads = THREADS
    options.ba_refine_focal_length = options.ba_refine_extra_params = False
    options.ba_global_frames_ratio = options.ba_global_points_ratio = 1.4
    options.ba_global_max_refinements = 2
    options.ba_local_max_refinements = 1
    options.max_runtime_seconds = 600
    mapper.abs_pose_refine_focal_length = mapper.abs_pose_refine_extra_params = False
    mapper.init_min_tri_angle = angle
    mapper.init_max_forward_motion = 1.0
    mapper.init_min_num_inliers = 50
    mapper.filter_min_tri_angle = 0.25
    mapper.filter_max_reproj_error = 2.0
    mapper.abs_pose_max_error = 6.0
    mapper.ba_local_min_tri_angle = 1.0
    options.triangulation.min_angle = 0.25
    return options


def write_database(
    folder: Path,
    cameras: Sequence[pycolmap.Camera],
    images: Sequence[tuple[int, Floats]],
    matches: Iterable[tuple[tuple[int, int], Ints]],
) -> None:
    """Write a database for COLMAP.

    Args:
        folder: Its folder.
        cameras: Their focal lengths are taken for known: COLMAP frees no other in two views, and a guess is
            better than none.
        images: Number of the camera, and places (n, 2) of the features in pixels.
        matches: Pairs of images, by index, and the rows (k, 2) of the features that both have.
    """
    with pycolmap.Database.open(folder / DATABASE) as database, pycolmap.DatabaseTransaction(database):
        for camera in cameras:
            camera.has_prior_focal_length = True
            database.write_camera(camera, use_camera_id=True)
            rig = pycolmap.Rig()
            rig.rig_id = camera.camera_id
            rig.add_ref_sensor(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, camera.camera_id))
            database.write_rig(rig, use_rig_id=True)
        for number, (camera_id, xy) in enumerate(images, 1):
            image = pycolmap.Image(name=f"{number:06d}", camera_id=camera_id, image_id=number)
            database.write_image(image, use_image_id=True)
            frame = pycolmap.Frame()
            frame.frame_id, frame.rig_id = number, camera_id
            frame.add_data_id(image.data_id)
            database.write_frame(frame, use_frame_id=True)
            database.write_keypoints(number, xy.astype(np.float32))
        for (i, j), rows in matches:
            database.write_matches(i + 1, j + 1, rows.astype(np.uint32))


def new_camera(model: str, focal: float, size: tuple[int, int], number: int = 1) -> pycolmap.Camera:
    """Return a camera of a model of COLMAP's, with a focal length and a (width, height) in pixels."""
    return pycolmap.Camera.create_from_model_name(
        number, model, focal_length=focal, width=size[0], height=size[1]
    )


def adjust(solution: Solution) -> None:
    """Adjust all poses and points with a soft loss; intrinsics are held."""
    tracks = solution.tracks
    share = OBSERVATIONS / max(int(solution.used.sum()), 1)
    chosen = np.random.default_rng(0).random(tracks.count) < share
    rows = np.nonzero(solution.used & chosen[tracks.track])[0]
    images = tracks.frame_index[rows]
    first = np.searchsorted(images, images)
    place = np.arange(len(rows)) - first
    model = pycolmap.Reconstruction()
    one = bool(np.ptp(solution.focal) == 0)
    for number in [0] if one else np.unique(images):
        focal, size = float(solution.focal[number]), (tracks.width, tracks.height)
        model.add_camera_with_trivial_rig(new_camera("SIMPLE_PINHOLE", focal, size, int(number) + 1))
    for index in np.unique(images):
        image = pycolmap.Image(
            name=f"{index:06d}",
            keypoints=tracks.xy[rows[images == index]],
            camera_id=1 if one else int(index) + 1,
            image_id=int(index) + 1,
        )
        pose = pycolmap.Rigid3d(pycolmap.Rotation3d(solution.rotation[index]), solution.translation[index])
        model.add_image_with_trivial_frame(image, pose)
    by_track = np.argsort(tracks.track[rows], kind="stable")
    numbers, starts = np.unique(tracks.track[rows][by_track], return_index=True)
    points = {}
    # pycolmap takes points one by one; there is no call for arrays.
    for number, members in zip(numbers, np.split(by_track, starts[1:]), strict=True):
        track = pycolmap.Track()
        for member in members:
            track.add_element(int(images[member]) + 1, int(place[member]))
        points[number] = model.add_point3D(solution.xyz[number], track)
    pycolmap.bundle_adjustment(model, _adjustment_options(loss_of(solution.errors()[rows])))
    for number, point in points.items():
        solution.xyz[number] = model.points3D[point].xyz
    for index in np.unique(images):
        pose = model.images[int(index) + 1].cam_from_world()
        solution.rotation[index], solution.translation[index] = pose.rotation.matrix(), pose.translation
    if not chosen.all():
        solution.xyz[~chosen] = np.nan
        triangulate(solution)


def _adjustment_options(loss: float) -> pycolmap.BundleAdjustmentOptions:
    """Bundle adjustment with a soft loss from so many pixels, intrinsics held."""
    options = pycolmap.BundleAdjustmentOptions()
    options.refine_focal_length = options.refine_extra_params = options.refine_principal_point = False
    options.print_summary = False
    options.ceres.loss_function_type = pycolmap.LossFunctionType.SOFT_L1
    options.ceres.loss_function_scale = loss
    solver = options.ceres.solver_options
    solver.num_threads, solver.max_num_iterations, solver.function_tolerance = THREADS, 25, 1e-4
    return options
