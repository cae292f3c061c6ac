"""Solving keyframes with pycolmap, and how far their focal length can be believed. Worker process only."""

from __future__ import annotations

import tempfile
from pathlib import Path

# The order matters: imported after pycolmap, OpenCV's PNG writer frees memory twice.
import cv2  # noqa: F401
import numpy as np
import pycolmap

from .errors import UserError
from .reconstruction import Floats, Ints
from .tracks import Progress, Tracks

KEYFRAMES = 40
MAX_FOCAL_SIGMA = 0.02
FOCAL_RANGE = (0.4, 3.0)
"""Long sides of the frame."""
MIN_GAIN = 0.02
"""Share by which a free focal length must lower the reprojection error to be believed."""
MIN_POINTS = 12
ENOUGH_FEATURES = 500
"""In a keyframe, to find its pose."""


def keyframes(tracks: Tracks) -> list[int]:
    """Indices of frames at equal steps of image motion, first and last included."""
    count = len(tracks.frames)
    flow = np.zeros(count)
    for index in range(1, count):
        (before, a), (after, b) = tracks.in_frame(index - 1), tracks.in_frame(index)
        _, i, j = np.intersect1d(before, after, assume_unique=True, return_indices=True)
        flow[index] = np.median(np.linalg.norm(b[j] - a[i], axis=1)) if len(i) else 1.0
    path = np.cumsum(flow + 1e-3)
    steps = np.linspace(path[0], path[-1], min(KEYFRAMES, count))
    return sorted(set(np.clip(np.searchsorted(path, steps - 1e-9), 0, count - 1).tolist()) | {0, count - 1})


def keyframe_features(tracks: Tracks, keys: list[int]) -> list[tuple[Ints, Floats]]:
    """Track numbers (n,) and places (n, 2) of each keyframe, without those that would only cost time.

    Poses need no more than an even choice of the tracks; the others get their points later, and take part
    in the last adjustment.
    """
    features = [tracks.in_frame(index) for index in keys]
    usual = float(np.median([len(ids) for ids, _ in features]))
    kept = np.random.default_rng(0).random(tracks.count) < ENOUGH_FEATURES / max(usual, 1.0)
    return [(ids[kept[ids]], xy[kept[ids]]) for ids, xy in features]


def map_keyframes(
    tracks: Tracks, features: list[tuple[Ints, Floats]], focal: float, progress: Progress
) -> pycolmap.Reconstruction:
    """The best model of the keyframes that have these features; image i + 1 is keyframe i.

    Raises UserError where there is none.
    """
    keys = len(features)
    with tempfile.TemporaryDirectory(prefix="virtual-aperture-") as name:
        folder = Path(name)
        database = folder / "database.db"
        _write_database(database, tracks, features, focal)
        progress("Verifying matches", 0, 1)
        verification = pycolmap.TwoViewGeometryOptions()
        verification.ransac.max_error = 4.0
        verification.ransac.random_seed = 0
        pycolmap.geometric_verification(database, two_view_geometry_options=verification)
        done = [2]

        def next_image() -> None:
            done[0] += 1
            progress("Solving cameras", min(done[0], keys), keys)

        models = {}
        for angle in (3.0, 1.5, 0.7):
            (folder / "model").mkdir(exist_ok=True)
            progress("Solving cameras", 2, keys)
            models = pycolmap.incremental_mapping(
                database, folder, folder / "model", _mapper_options(angle), next_image_callback=next_image
            )
            if models and max(m.num_reg_images() for m in models.values()) >= 0.8 * keys:
                break
            done[0] = 2
        # The first model is often a stump: the one with most images and points is taken.
        best = max(models.values(), key=lambda m: (m.num_reg_images(), m.num_points3D()), default=None)
    if best is None or best.num_reg_images() < 2 or best.num_points3D() < MIN_POINTS:
        raise UserError(
            "no camera path explains this clip: too little parallax, or too much moves on its own;"
            " choose another range with --frames, or film with more sideways movement"
        )
    return best


def _mapper_options(angle: float) -> pycolmap.IncrementalPipelineOptions:
    options = pycolmap.IncrementalPipelineOptions()
    options.multiple_models = False
    options.min_model_size = 3
    options.extract_colors = False
    options.random_seed = 0
    options.ba_refine_focal_length = False
    options.ba_refine_extra_params = False
    options.ba_global_frames_ratio = options.ba_global_points_ratio = 1.4
    options.ba_global_max_refinements = 2
    options.ba_local_max_refinements = 1
    options.max_runtime_seconds = 600
    mapper = options.mapper
    mapper.abs_pose_refine_focal_length = False
    mapper.abs_pose_refine_extra_params = False
    mapper.init_min_tri_angle = angle
    mapper.init_max_forward_motion = 1.0
    mapper.init_min_num_inliers = 50
    mapper.filter_min_tri_angle = 0.25
    mapper.filter_max_reproj_error = 2.0
    mapper.abs_pose_max_error = 6.0
    mapper.ba_local_min_tri_angle = 1.0
    mapper.random_seed = 0
    options.triangulation.min_angle = 0.25
    return options


def _write_database(path: Path, tracks: Tracks, features: list[tuple[Ints, Floats]], focal: float) -> None:
    with pycolmap.Database.open(path) as database, pycolmap.DatabaseTransaction(database):
        camera = new_camera(tracks, focal)
        camera.has_prior_focal_length = True
        database.write_camera(camera, use_camera_id=True)
        rig = pycolmap.Rig()
        rig.rig_id = 1
        rig.add_ref_sensor(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, 1))
        database.write_rig(rig, use_rig_id=True)
        for number, (_, xy) in enumerate(features, 1):
            image = pycolmap.Image(name=f"{number:06d}", camera_id=1, image_id=number)
            database.write_image(image, use_image_id=True)
            frame = pycolmap.Frame()
            frame.frame_id = number
            frame.rig_id = 1
            frame.add_data_id(image.data_id)
            database.write_frame(frame, use_frame_id=True)
            database.write_keypoints(number, xy.astype(np.float32))
        gaps = sorted({*range(1, 11), 16, 32})
        for i in range(len(features)):
            for j in (i + gap for gap in gaps if i + gap < len(features)):
                _, a, b = np.intersect1d(
                    features[i][0], features[j][0], assume_unique=True, return_indices=True
                )
                if len(a) >= 30:
                    database.write_matches(i + 1, j + 1, np.column_stack([a, b]).astype(np.uint32))


def new_camera(tracks: Tracks, focal: float) -> pycolmap.Camera:
    return pycolmap.Camera.create_from_model_name(
        camera_id=1, model_name="SIMPLE_RADIAL", focal_length=focal, width=tracks.width, height=tracks.height
    )


def free_focal(model: pycolmap.Reconstruction, start: float) -> tuple[float, bool]:
    """Adjust with a free focal length and keep it only where the data determine it; (sigma_f / f, held).

    With a path of a few per cent of the depth, focal length and distortion are hardly determined and run
    off; in straight-ahead motion the focal length is not determined at all (its sigma shows it).
    """
    pycolmap.bundle_adjustment(model, adjustment_options(refine_focal=False, iterations=50))
    before = model.compute_mean_reprojection_error()
    held = {i: model.points3D[i].xyz.copy() for i in model.points3D}
    poses = {i: model.frames[i].rig_from_world for i in model.reg_frame_ids()}
    poses = {i: pycolmap.Rigid3d(p.rotation, p.translation.copy()) for i, p in poses.items()}
    options = adjustment_options(refine_focal=True, iterations=100)
    config = pycolmap.BundleAdjustmentConfig()
    for image in model.reg_image_ids():
        config.add_image(image)
    config.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
    adjuster = pycolmap.create_default_ceres_bundle_adjuster(options, config, model)
    adjuster.solve()
    # The adjuster moves the points and leaves the errors that are kept with them as they were.
    model.update_point_3d_errors()
    covariance = pycolmap.estimate_ba_covariance(
        pycolmap.BACovarianceOptions(params=pycolmap.BACovarianceOptionsParams.ALL), model, adjuster
    )
    camera = model.cameras[1]
    focal = camera.params[0]
    spread = covariance.get_other_params_cov(camera.params) if covariance else None
    error = model.compute_mean_reprojection_error()
    sigma = float(np.sqrt(spread[0, 0]) * error / focal) if spread is not None and len(spread) else np.inf
    long_side = max(camera.width, camera.height)
    believed = (
        sigma < MAX_FOCAL_SIGMA
        and FOCAL_RANGE[0] < focal / long_side < FOCAL_RANGE[1]
        and error < (1 - MIN_GAIN) * before
    )
    if not believed:
        camera.params = [start, *camera.params[1:]]
        for i, xyz in held.items():
            model.points3D[i].xyz = xyz
        for i, pose in poses.items():
            model.frames[i].rig_from_world = pose
    return sigma, not believed


def adjustment_options(refine_focal: bool, iterations: int) -> pycolmap.BundleAdjustmentOptions:
    """Bundle adjustment with a soft loss; distortion and principal point are always held."""
    options = pycolmap.BundleAdjustmentOptions()
    options.refine_focal_length = refine_focal
    options.refine_extra_params = options.refine_principal_point = False
    options.print_summary = False
    options.ceres.loss_function_type = pycolmap.LossFunctionType.SOFT_L1
    options.ceres.solver_options.max_num_iterations = iterations
    options.ceres.solver_options.function_tolerance = 1e-5
    return options
