"""The solving worker: `python -m addon.core.sfm.worker FOLDER`, a child process by `base.messages`."""

import contextlib
import os
import shutil
import signal
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.calls import serve, show
from ..base.errors import Remedy, UserError
from ..base.file_lock import FolderLock
from ..base.messages import speak
from ..camera.focal_length import from_equivalent, is_plausible
from ..camera.reconstruction import upright
from ..media import picture_file
from ..media.clip import Footage, open_footage
from ..media.container import equivalent_focal
from ..media.exif import photo_data
from ..media.fixed_area import fixed_area
from ..readers.colmap_export import write_model
from ..readers.matching import Imported
from ..subjects.networks import Networks
from .mapping import known_poses
from .report import LEFT_OUT, Figures, Solved
from .steps import Record, Watch, table
from .tracking.degeneracy import StaysError, refuse_cuts
from .tracking.people_left_out import outside, without_people
from .tracking.tracks import Tracks, are_bridged, check_shape, cuts, match_features, track_features

METADATA_SIGMA = 0.1
"""Relative standard deviation of a focal length from metadata: video is cropped more than photos."""
SQUEEZES = (2.0, 0.5)
"""Pixel aspects that are tried on a refused clip: of anamorphic lenses, and of pictures on their side."""
UNSQUEEZED = 0.9
"""Share of the observations from which such a trial counts: 0.985 of a clip that was squeezed by 2, which is
refused at 1 and at 0.5 (`tests/sfm/test_squeezed.py`)."""
PATIENCE = 5.0
"""Seconds in which a process that ends has let go of all that it held."""


def main(*folder: Path) -> None:
    """Answer calls; the folder that `solve` fills, if one is given, is removed if the parent ends."""
    speak(*(partial(_end_alone, each) for each in folder))
    serve()


@dataclass(frozen=True)
class SolveJob:
    """A clip to solve, and the settings of the solve."""

    clip: Footage
    focal: float | None = None
    """Known focal length in pixels."""
    zooms: bool = False
    """True if the lens zooms."""
    fixed: bool = False
    """True to leave out what is burnt into the clip."""
    may_stay: bool = False
    """True for a clip with depth maps, whose camera may stay in its place."""
    segmenter: Path | None = None
    """The user's own."""
    cameras: Imported | None = None
    """Another program's cameras, which are held."""


def solve(job: SolveJob, folder: Path) -> Figures:
    """Solve a clip into a folder, in the worker process, and return the solve's figures."""
    began = time.monotonic()
    # After cv2 has been imported, and with pycolmap's own handler for SIGTERM, which can hang, taken out.
    import pycolmap

    from .mapping.photo_mapping import place_photos

    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    picture_file.exr_decoder = _exr
    clip = job.clip
    footage = open_footage(clip.path, clip.frames, clip.video, clip.is_stills, pixel_aspect=clip.pixel_aspect)
    is_clip = not footage.is_stills or job.cameras is not None
    if is_clip:
        check_shape(footage)
        if job.fixed:
            footage = replace(footage, fixed=fixed_area(footage.read, footage.frames))
    reconstruction, figures = (
        _solve_clip(footage, job) if is_clip else place_photos(footage, job.focal, _photo_focal)
    )
    (folder / "model").mkdir()
    write_model(folder / "model", reconstruction)
    return replace(
        figures, notes=(*footage.notes, *figures.notes), stills=footage.is_stills, fps=footage.fps,
        versions={"numpy": np.__version__, "opencv": cv2.__version__, "pycolmap": pycolmap.__version__},
        seconds=round(time.monotonic() - began, 1),
    )  # fmt: skip


def _solve_clip(footage: Footage, job: SolveJob) -> Solved:
    """Cameras and points of a clip."""
    record = Record()
    tracker, tracks = "harris", _of_scene(track_features(footage, Watch(show)), footage)
    record.add("tracking")
    if (jumps := cuts(tracks)) and (job.cameras or are_bridged(footage, jumps)):
        # Known cameras connect shots. A fast motion of the camera loses corners, but not keypoints.
        tracker, tracks = "sift", _of_scene(match_features(footage), footage)
        record.add("matching")
    if job.cameras is not None:
        return _held(job.cameras, tracker, tracks)
    refuse_cuts(tracks)
    try:
        return _solved(job, footage, tracker, tracks, record)
    except UserError as error:
        error.add_note(table(record.attempts))
        raise


def _of_scene(tracks: Tracks, footage: Footage) -> Tracks:
    """The tracks outside of the fixed pixels."""
    fixed = footage.fixed
    return tracks if fixed is None else outside(tracks, lambda _: fixed.covered)


@dataclass(frozen=True)
class _Hypothesis:
    """Tracks that a clip may be solved from."""

    name: str
    tracks: Tracks
    has_subjects: bool = False
    """As of `incremental_mapping.reconstruct`."""
    pixel_aspect: float = 0.0
    """If it is not 0 a solve is none, but shows why the clip was refused."""


def _hypotheses(
    job: SolveJob, footage: Footage, tracker: str, tracks: Tracks, refusals: list[UserError]
) -> Iterator[_Hypothesis]:
    """Tracks to solve a clip from, the cheapest first; `refusals` holds those that are shown."""
    yield _Hypothesis("corners" if tracker == "harris" else "sift", tracks)
    still = without_people(tracks, footage, Networks(segmenter=job.segmenter))
    if still is not None:
        yield _Hypothesis("no subjects", still, has_subjects=True)
    if isinstance(refusals[-1], StaysError):
        return
    if tracker != "sift":
        yield _Hypothesis("sift", _of_scene(match_features(footage), footage))
    # A file or the user may have set the pixel aspect.
    is_free = not footage.pixel_aspect and footage.stored_size == (footage.width, footage.height)
    for ratio in SQUEEZES if is_free else ():
        wide = replace(tracks, width=round(ratio * tracks.width), xy=tracks.xy * [ratio, 1.0])
        yield _Hypothesis(f"pixel aspect {ratio:g}", wide, pixel_aspect=ratio)


def _solved(job: SolveJob, footage: Footage, tracker: str, tracks: Tracks, record: Record) -> Solved:
    """Cameras and points by the first hypothesis that is not refused."""
    from .mapping.incremental_mapping import FocalPrior, reconstruct

    prior = FocalPrior(zooms=job.zooms)
    if job.focal:
        prior = FocalPrior(job.focal, 0.0, job.zooms, "given")
    elif not job.zooms and (focal := _metadata_focal(footage)):
        prior = FocalPrior(focal, METADATA_SIGMA, source="metadata")
    refusals: list[UserError] = []
    for each in _hypotheses(job, footage, tracker, tracks, refusals):
        record.hypothesis = each.name
        try:
            result, figures = reconstruct(each.tracks, prior, record, job.may_stay, each.has_subjects)
        except UserError as error:
            record.add(refusal=str(error))
            if each.has_subjects:
                refusals.append(type(error)(f"{error} ({LEFT_OUT})", *error.remedies))
            elif not refusals:
                refusals.append(error)
            continue
        if not each.pixel_aspect:
            tracker = "sift" if each.name == "sift" else tracker
            return result, replace(figures, tracker=tracker, attempts=tuple(record.attempts))
        if (figures.explained or 0.0) >= UNSQUEEZED:
            raise UserError(
                f"{refusals[-1]}; with a pixel aspect of {each.pixel_aspect:g} the clip fits a static scene:"
                " the picture may be squeezed",
                *refusals[-1].remedies,
                Remedy.PIXEL_ASPECT,
            )
    raise refusals[-1]


def _held(held: Imported, tracker: str, tracks: Tracks) -> Solved:
    """Points before cameras that another program found."""
    try:
        known = known_poses.triangulate(held.reconstruction, tracks)
        found, explained = known.reconstruction, known.explained
        note = (
            "the cameras are used as they are, and points were tracked for them: the median error is"
            f" {known.miss * max(tracks.width, tracks.height) / 1000:.2f} px"
        )
    except known_poses.NoDepthError:
        if not len(held.reconstruction.points):
            raise
        found, explained = held.reconstruction, None
        note = (
            "the cameras show no depth, because they hardly move: the model's own points are used, and how"
            " well they fit the clip is unknown"
        )
    figures = Figures(held.format, notes=(*held.notes, note), tracker=tracker, explained=explained)
    return found if held.placed else upright(found), replace(figures, observed=explained is not None)


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
    main(*map(Path, sys.argv[1:]))
