"""The solving worker: `python -m addon.core.sfm.worker FOLDER`, a child process by `base.messages`."""

import contextlib
import os
import shutil
import signal
import sys
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.calls import serve, show
from ..base.errors import Remedy, UserError
from ..base.file_lock import FolderLock
from ..base.messages import speak
from ..camera.focal_length import from_equivalent, is_plausible
from ..camera.reconstruction import Reconstruction, upright
from ..media import picture_file
from ..media.clip import Footage, open_footage
from ..media.container import equivalent_focal
from ..media.exif import photo_data
from ..media.fixed_area import fixed_area
from ..readers.colmap_export import write_model
from ..readers.matching import Imported
from ..subjects.networks import Networks
from .calibration import lens
from .mapping import known_poses
from .mapping.report import STAYS
from .tracking.degeneracy import StaysError, check_motion, refuse_cuts
from .tracking.people_left_out import outside, without_people
from .tracking.photo_matching import Photo, find_features, match_all
from .tracking.tracker_pictures import Watch
from .tracking.tracks import Tracks, are_bridged, check_shape, cuts, match_features, track_features

METADATA_SIGMA = 0.1
"""Relative standard deviation of a focal length from metadata: video is cropped more than photos."""
POINTS_FOUND = (
    "the cameras are used as they are, and points were tracked for them: the median error is {miss:.2f} px"
)
POINTS_TAKEN = (
    "the cameras show no depth, because they hardly move: the model's own points are used, and how well"
    " they fit the clip is unknown"
)
LEFT_OUT = "the clip's subjects were left out of the solve"
SQUEEZES = (2.0, 0.5)
"""Pixel aspects that are tried on a refused clip: of anamorphic lenses, and of pictures on their side."""
UNSQUEEZED = 0.9
"""Share of the observations from which such a trial counts: 0.985 of a clip that was squeezed by 2, which is
refused at 1 and at 0.5 (`tests/sfm/test_squeezed.py`)."""
ZOOMED = "the clip looks as if its lens zooms; if it does not, set the focal length"
PATIENCE = 5.0
"""Seconds in which a process that ends has let go of all that it held."""


def main(folder: Path) -> None:
    """Answer calls of `solve`; the folder is removed if the parent ends."""
    speak(lambda: _end_alone(folder))
    serve()


def solve(job: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Solve a clip into a folder, in the worker process, and return the report's figures."""
    began = time.monotonic()
    # After cv2 has been imported, and with pycolmap's own handler for SIGTERM, which can hang, taken out.
    from .mapping import incremental_mapping

    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    picture_file.exr_decoder = _exr
    clip: Footage = job["clip"]
    footage = open_footage(clip.path, clip.frames, clip.video, clip.is_stills, pixel_aspect=clip.pixel_aspect)
    is_clip = not footage.is_stills or job["cameras"] is not None
    if is_clip:
        check_shape(footage)
        if job["fixed"]:
            footage = replace(footage, fixed=fixed_area(footage.read, footage.frames))
    found = _solve_clip(footage, job) if is_clip else _solve_photos(footage, job)
    result, model, said = found.reconstruction, folder / "model", found.said
    model.mkdir()
    write_model(model, result)
    return {
        **said,
        "notes": [*footage.notes, *said["notes"]],
        "stills": footage.is_stills,
        "fps": footage.fps,
        "versions": incremental_mapping.versions(),
        "seconds": round(time.monotonic() - began, 1),
    }


@dataclass(frozen=True)
class _Found:
    """Cameras and points of a clip, and the report's figures."""

    reconstruction: Reconstruction
    said: dict[str, Any]


def _solve_photos(footage: Footage, job: dict[str, Any]) -> _Found:
    """Cameras and points of unordered photos."""
    from .mapping.photo_mapping import place_photos

    given, first = job["lens"]["focal"], max(footage.width, footage.height)
    photos = find_features(footage)

    def focal(photo: Photo) -> float | None:
        if given:
            # It is the first photo's; others of its camera differ in size at most.
            return float(given) * max(photo.width, photo.height) / first
        return _photo_focal(footage.file(photo.frame), photo.width, photo.height)

    said = any(focal(photo) for photo in photos)
    matches = match_all(photos)
    result, is_calibrated = place_photos(photos, matches, focal, bool(given))
    there = set(result.frames.tolist())
    lost = [photo.name for photo in photos if photo.frame not in there]
    notes = [f"{len(lost)} photos could not be matched with the others: {', '.join(lost)}"] if lost else []
    figures = {
        "focal_sigma": None,
        "focal_from": _focal_source(job["lens"], said, is_calibrated),
        "method": "stills",
        "tracker": "sift",
        "notes": notes,
    }
    return _Found(result, figures)


def _solve_clip(footage: Footage, job: dict[str, Any]) -> _Found:
    """Cameras and points of a clip."""
    tracker, tracks = "harris", _of_scene(track_features(footage, Watch(show)), footage)
    if (jumps := cuts(tracks)) and (job["cameras"] or are_bridged(footage, jumps)):
        # Known cameras connect shots. A fast motion of the camera loses corners, but not keypoints.
        tracker, tracks = "sift", _of_scene(match_features(footage), footage)
    if job["cameras"] is None:
        refuse_cuts(tracks)
    found = _held(job["cameras"], tracks) if job["cameras"] else _solved(job, footage, tracks)
    return replace(found, said={"tracker": tracker, **found.said})


def _of_scene(tracks: Tracks, footage: Footage) -> Tracks:
    """The tracks outside of the fixed pixels."""
    fixed = footage.fixed
    return tracks if fixed is None else outside(tracks, lambda _: fixed.covered)


def _solved(job: dict[str, Any], footage: Footage, tracks: Tracks) -> _Found:
    """Cameras and points of a clip; before a refusal, without its subjects, and then from SIFT keypoints."""
    try:
        return _mapped(job, footage, tracks)
    except UserError as error:
        refusal = error
    networks = Networks(segmenter=job["segmenter"])
    if (still := without_people(tracks, footage, networks)) is not None:
        try:
            return _mapped(job, footage, still, LEFT_OUT)
        except UserError as error:
            refusal = type(error)(f"{error} ({LEFT_OUT})", *error.remedies)
    if not isinstance(refusal, StaysError):
        with contextlib.suppress(UserError):
            return _mapped(job, footage, _of_scene(match_features(footage), footage))
        if ratio := _squeeze(job, footage, tracks):
            raise UserError(
                f"{refusal}; with a pixel aspect of {ratio:g} the clip fits a static scene: the picture may"
                " be squeezed",
                *refusal.remedies,
                Remedy.PIXEL_ASPECT,
            )
    raise refusal


def _squeeze(job: dict[str, Any], footage: Footage, tracks: Tracks) -> float:
    """The pixel aspect with which the clip is solved well, if neither file nor user has set one; else 0."""
    if footage.pixel_aspect or footage.stored_size != (footage.width, footage.height):
        return 0.0
    for ratio in SQUEEZES:
        wide = replace(tracks, width=round(ratio * tracks.width), xy=tracks.xy * [ratio, 1.0])
        with contextlib.suppress(UserError):
            if _mapped(job, footage, wide).said["explained"] >= UNSQUEEZED:
                return ratio
    return 0.0


def _mapped(job: dict[str, Any], footage: Footage, tracks: Tracks, left_out: str = "") -> _Found:
    """Both found from tracks; `left_out` is a note on tracks of subjects that are missing."""
    from .mapping import incremental_mapping

    prior = incremental_mapping.FocalPrior(**job["lens"])
    metadata_focal = None if prior.focal or prior.zooms else _metadata_focal(footage)
    if metadata_focal:
        prior = incremental_mapping.FocalPrior(metadata_focal, METADATA_SIGMA)
    # Subjects have distances without parallax, too.
    has_subjects = bool(left_out) and not job["may_stay"]
    mapped = None
    try:
        mapped = incremental_mapping.reconstruct(tracks, prior, has_subjects or job["may_stay"])
    except UserError:
        # A steadied or bent picture may be explained by no camera, and yet show hardly any depth; subjects
        # may leave too few features for a test.
        moves = False
        with contextlib.suppress(UserError):
            moves = check_motion(tracks) >= incremental_mapping.DOUBTFUL_PARALLAX
        if moves or not has_subjects:
            raise
    if mapped is None or (has_subjects and mapped.weak_depth is not None):
        mapped = incremental_mapping.staying(tracks, prior)
    result = mapped.reconstruction
    said = {
        "focal_sigma": mapped.focal_sigma,
        "focal_from": _focal_source(job["lens"], metadata_focal, mapped.focal_from_clip),
        "method": mapped.method,
        "explained": mapped.explained,
        "notes": [ZOOMED] * (mapped.zooms != prior.zooms) + [left_out] * bool(left_out),
        "depth_estimated": has_subjects and mapped.method == STAYS,
        "depth_evidence": asdict(mapped.depth_evidence) if mapped.depth_evidence else None,
        "weak_depth": mapped.weak_depth,
        # A zoom's lens, and that of a camera that stays, are not looked for.
        **({} if mapped.zooms or mapped.method == STAYS else lens.said(mapped.lens, result.cameras[0].fx)),
    }
    return _Found(result, said)


def _held(held: Imported, tracks: Tracks) -> _Found:
    """Points before cameras that another program found."""
    said: dict[str, Any] = {"focal_from": "file", "method": held.format, "notes": list(held.notes)}
    try:
        known = known_poses.triangulate(held.reconstruction, tracks)
    except known_poses.NoDepthError:
        if not len(held.reconstruction.points):
            raise
        said["notes"].append(POINTS_TAKEN)
        said["observed"] = False
        return _Found(upright(held.reconstruction), said)
    said["explained"] = known.explained
    said["notes"].append(POINTS_FOUND.format(miss=known.miss * max(tracks.width, tracks.height) / 1000))
    return _Found(known.reconstruction if held.placed else upright(known.reconstruction), said)


def _metadata_focal(footage: Footage) -> float | None:
    """The focal length in pixels from the files' metadata, if it agrees with the pictures."""
    width, height = footage.width, footage.height
    if footage.is_video:
        equivalent = equivalent_focal(footage.path)
        return from_equivalent(equivalent, width, height) if equivalent else None
    return _photo_focal(footage.files[0], width, height)


def _photo_focal(file: Path, width: int, height: int) -> float | None:
    """The focal length in pixels from the metadata of a photo of this size."""
    lens = photo_data(file)
    if lens is None or lens.was_cropped(width, height):
        return None
    if lens.equivalent or lens.resolution or not lens.focal_mm:
        return lens.focal(width, height)
    import pycolmap

    # pycolmap knows the sensors of many cameras by name, which do not include the pixel size.
    try:
        camera = pycolmap.infer_camera_from_image(file)
    except (RuntimeError, ValueError):
        return None
    focal = float(camera.mean_focal_length())
    return focal if camera.has_prior_focal_length and is_plausible(focal, width, height) else None


def _focal_source(lens: dict[str, Any], metadata_focal: float | bool | None, from_clip: bool) -> str:
    """As `solve_report.Report.focal_from`."""
    return "clip" if from_clip else "given" if lens["focal"] else "metadata" if metadata_focal else "guess"


def _end_alone(folder: Path) -> None:
    """Remove the unfinished solve and end: the parent process is gone."""
    # The solve goes on beside us and may put a file into a folder that is being emptied.
    while folder.exists():
        shutil.rmtree(folder, ignore_errors=True)
    # The lock ends with its owner, its file does not. Our pipe may be closed a moment before the lock is, and
    # another process that solves there keeps it already.
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        with contextlib.suppress(UserError, OSError):
            FolderLock(folder.parent).release()
            break
        time.sleep(0.05)
    os._exit(1)


def _exr(path: Path | bytes) -> NDArray[np.float32]:
    # Eight bits are enough to follow features; the picture itself is read in Blender.
    import pycolmap

    bitmap = pycolmap.Bitmap.read(str(path), True)
    if bitmap is None:
        raise OSError("it is not an image")
    return (np.asarray(bitmap.to_array()) / 255).astype(np.float32)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
