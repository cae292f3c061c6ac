"""A clip that was tracked and solved in Blender's own Movie Clip Editor, as a reconstruction.

Blender's solver is libmv. There pictures have x to the right and y up, in pixels from the lower left corner
of the picture (not from the centre of a pixel), and where pixels are not square y counts in their widths.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.base.arrays import Floats, Ints
from ...core.base.counting import counted
from ...core.base.errors import UserError
from ...core.camera import distortion
from ...core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction, nearest_rotation
from ...core.media.clip import Footage, describe
from ...core.media.video_frame import BlenderView
from ...core.readers.building import ACCURATE, quotient
from ...core.readers.matching import ONLY_TURNS, Imported, at_one_place
from ..solve.camera import FLIP

FORMAT = "Blender movie clip"
_SHOWN = {
    BlenderView.FLIP_X: "mirrored",
    BlenderView.FLIP_Y: "mirrored",
    BlenderView.CROPPED: "uncropped",
    BlenderView.TRACK: "by another video track",
}
"""How Blender shows a clip otherwise than players do."""
GRAY = 128
"""The colour of points: tracks have none."""
SAME_SHAPE = 0.01
"""By which the aspect of two pictures may differ: Blender rounds the sizes of proxies."""
TOO_FAR = 1.0
"""Pixels by which it is of no use."""


@dataclass(frozen=True)
class _Track:
    """A track that has a place in space."""

    bundle: Floats
    """(3,) world coordinates."""
    frames: Ints
    """(n,) of the clip as Blender counts."""
    places: Floats
    """(n, 2) as shares of the picture, y up."""


def read_movie_clip(clip: bpy.types.MovieClip, footage: Footage) -> Imported:
    """Return the camera solve of a movie clip, in Blender's units and with the lens as it was solved.

    Frames are matched with the footage's own: of a video by their place in it, of a sequence by the numbers
    of its files, whatever the clip's start frame in a scene is. The world is that of the solve, where the
    first camera looks along -z with y up; orientation and scale that were set in the editor belong to its
    camera object and are not in it. Raises UserError for a clip that is not solved or does not belong to the
    footage.
    """
    target = next(item for item in clip.tracking.objects if item.is_camera)
    if not target.reconstruction.is_valid or not target.reconstruction.cameras:
        raise UserError(
            f"the movie clip {clip.name} is not solved; track it and solve its camera in the Movie Clip"
            " Editor first"
        )
    notes: list[str] = []
    if len(clip.tracking.objects) > 1:
        others = ", ".join(item.name for item in clip.tracking.objects if not item.is_camera)
        notes.append(f"object tracks are ignored: {others}")
    _check_view(clip, footage)
    lens = _intrinsics(clip, footage, notes)
    numbers = _frame_numbers(clip, footage, notes)
    tracks = _tracks(target, clip.name, notes)
    images = _images(target.reconstruction, tracks, numbers, lens)
    if not any(len(image.points) for image in images):
        raise UserError(
            f"the movie clip {clip.name} shares no solved frames with the chosen clip: it was solved from"
            f" {clip.filepath}, the clip {footage.path.name} has {describe(footage.frames)}"
        )
    left_out = len(target.reconstruction.cameras) - len(images)
    if left_out:
        notes.append(f"{left_out} solved frames are not in the chosen clip")
    without = len(footage.frames) - len(images)
    if without:
        notes.append(f"{without} frames of the chosen clip are not solved")
    reconstruction = _measured(lens, images, np.array([track.bundle for track in tracks]))
    if at_one_place(reconstruction):
        notes.append(ONLY_TURNS)
    return Imported(reconstruction, FORMAT, tuple(notes))


def _check_view(clip: bpy.types.MovieClip, footage: Footage) -> None:
    """UserError where Blender tracked another picture than players, and we, show."""
    view = footage.video.view if footage.video is not None else BlenderView.SAME
    file = Path(bpy.path.abspath(clip.filepath))
    if view and file.exists() and file.samefile(footage.path):
        raise UserError(
            f"Blender's Movie Clip Editor shows {footage.path.name} {_SHOWN[view]}, so its solve does not"
            " fit; convert the clip, for example with FFmpeg, and track that"
        )


def _intrinsics(clip: bpy.types.MovieClip, footage: Footage, notes: list[str]) -> Intrinsics:
    """The tracking camera on the footage's pictures, whose pixels are square."""
    width, height = clip.size
    if not (width and height):
        raise UserError(
            f"the movie clip {clip.name} has no size: Blender cannot read {clip.filepath}; find the missing"
            " file and reload the clip"
        )
    camera = clip.tracking.camera
    aspect = camera.pixel_aspect
    # Pictures of a video without square pixels are stretched by its header's ratio.
    shapes = np.array([1.0, aspect]) * width / height
    if np.all(np.abs(footage.width / footage.height / shapes - 1) > SAME_SHAPE):
        raise UserError(
            f"the movie clip {clip.name} is {width}x{height}, the chosen clip {footage.path.name} is"
            f" {footage.width}x{footage.height}; choose the file the movie clip was made from"
        )
    if abs(footage.width / width - 1) > SAME_SHAPE and abs(footage.height / height - 1) > SAME_SHAPE:
        notes.append(
            f"the clip was solved at {width}x{height} and is scaled to {footage.width}x{footage.height}"
        )
    # The solver sees square pixels in a whole number of rows, in single precision.
    rows = int(np.float32(height) * (np.float32(1) / np.float32(aspect)))
    across, up = camera.principal_point_pixels
    focal = camera.focal_length_pixels
    if not (rows > 0 and focal > 0):
        raise UserError(
            f"the movie clip {clip.name} has a pixel aspect of {aspect:g}, a focal length of {focal:g} px;"
            " set the camera in the Movie Clip Editor and solve again"
        )
    plain = Intrinsics(width, height, focal, focal * height / rows, across, height - up)
    return _with_distortion(plain, camera, notes).scaled(footage.width, footage.height)


def _with_distortion(
    intrinsics: Intrinsics, camera: bpy.types.MovieTrackingCamera, notes: list[str]
) -> Intrinsics:
    """One of Blender's distortion models (intern/libmv/.../distortion_models.h) in COLMAP's terms.

    Polynomial and division are COLMAP's FULL_OPENCV without the rest of its terms. Brown is too, but for k4,
    and y up turns its tangential terms over. Nuke's goes the other way, and a lens is fitted to it.
    """
    match camera.distortion_model:
        case "POLYNOMIAL":
            return _rational(intrinsics, (camera.k1, camera.k2, camera.k3))
        case "DIVISION":
            return _rational(intrinsics, (0.0, 0.0, 0.0), (camera.division_k1, camera.division_k2, 0.0))
        case "BROWN":
            radial = (camera.brown_k1, camera.brown_k2, camera.brown_k3, camera.brown_k4)
            tangential = (-camera.brown_p2, camera.brown_p1)
            if not camera.brown_k4:
                return _rational(intrinsics, radial[:3], tangential=tangential)
            seen = _seen_rays(intrinsics)
            rays = distortion.Brown(radial, tangential).undistort(seen)
            return _fitted(intrinsics, rays, seen, tangential, "Brown", notes)
        case "NUKE":
            if not any((camera.nuke_k1, camera.nuke_k2, camera.nuke_p1, camera.nuke_p2)):
                return intrinsics
            seen = _seen_rays(intrinsics)
            return _fitted(intrinsics, _nuke_rays(intrinsics, camera, seen), seen, (0.0, 0.0), "Nuke", notes)
    raise UserError(
        f"the lens distortion model {camera.distortion_model} of the movie clip is not supported; choose"
        " another one in the Movie Clip Editor and solve again"
    )


def _rational(
    camera: Intrinsics,
    above: tuple[float, float, float],
    below: tuple[float, float, float] = (0.0, 0.0, 0.0),
    tangential: tuple[float, float] = (0.0, 0.0),
) -> Intrinsics:
    """The lens with radial terms above and below the fraction line."""
    if not (above[2] or any(below)):
        return replace(camera, k1=above[0], k2=above[1], p1=tangential[0], p2=tangential[1])
    return replace(camera, model="FULL_OPENCV", terms=(*above[:2], *tangential, above[2], *below))


def _seen_rays(camera: Intrinsics) -> Floats:
    """(n, 2) normalised places all over the picture, as they are seen through the lens."""
    across, down = np.linspace(0, camera.width, 49), np.linspace(0, camera.height, 49)
    pixels = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    return (pixels - camera.principal_point) / camera.focal


def _nuke_rays(intrinsics: Intrinsics, camera: bpy.types.MovieTrackingCamera, seen: Floats) -> Floats:
    """(n, 2) rays of Nuke's model, which counts in halves of the picture's longer side."""
    half = max(intrinsics.width, round(intrinsics.height * intrinsics.fx / intrinsics.fy)) / 2
    square = (seen * intrinsics.fx / half) ** 2
    radius = square.sum(axis=1)
    radial = 1 + camera.nuke_k1 * radius + camera.nuke_k2 * radius**2
    # Each coordinate has a term of the other one.
    return np.asarray(seen / (radial[:, None] + square[:, ::-1] * [camera.nuke_p1, camera.nuke_p2]))


def _fitted(
    camera: Intrinsics,
    rays: Floats,
    seen: Floats,
    tangential: tuple[float, float],
    model: str,
    notes: list[str],
) -> Intrinsics:
    """The lens that sends rays (n, 2) where they are seen (n, 2), by linear least squares."""
    radius = np.linalg.norm(rays, axis=1)
    if not np.isfinite(radius).all():
        raise UserError(f"the {model} lens distortion of the movie clip folds the picture; solve it again")
    straight = seen - distortion.Brown((0.0,), tangential).distort(rays) + rays
    along = (straight * rays).sum(axis=1) / np.maximum(radius, 1e-150)
    found = []
    # Terms besides the radius can make the lower side pass through zero: then the upper one alone.
    for below in (0, 3):
        a1, a2, a3, b1, b2, b3 = quotient(radius, along, 3, below).tolist()
        imitation = _rational(camera, (a1, a2, a3), (b1, b2, b3), tangential)
        missed = float(np.linalg.norm((imitation.distort(rays) - seen) * camera.focal, axis=1).max())
        found.append((missed if np.isfinite(missed) else np.inf, below, imitation))
    missed, _, best = min(found)
    if not missed < TOO_FAR:
        raise UserError(
            f"the {model} lens distortion of the movie clip can only be matched to within {missed:.2f}"
            " pixels; solve it with the Polynomial or Division model"
        )
    if missed > ACCURATE:
        notes.append(f"the {model} lens distortion is matched to within {missed:.3f} pixels")
    return best


def _frame_numbers(clip: bpy.types.MovieClip, footage: Footage, notes: list[str]) -> dict[int, int]:
    """Blender's clip frames, which count from 1 with the first file or picture, -> the footage's."""
    is_video = clip.source == "MOVIE"
    if is_video != footage.is_video:
        if clip.frame_duration != len(footage.frames):
            raise UserError(
                f"the movie clip {clip.name} has {counted(clip.frame_duration, 'frame')} and the chosen"
                f" clip {footage.path.name} {len(footage.frames)}; a video and a sequence must have the"
                " same number"
            )
        notes.append(f"the frames of {Path(clip.filepath).name} and {footage.path.name} are matched in order")
        return {place - clip.frame_offset: frame for place, frame in enumerate(footage.frames, start=1)}
    first = 1 if is_video else _number(Path(clip.filepath))
    return {
        number - first + 1 - clip.frame_offset: frame
        for number, frame in zip(footage.file_numbers, footage.frames, strict=True)
    }


def _number(path: Path) -> int:
    """The last digits of a file name, as Blender counts a sequence."""
    digits = "".join(c if c.isdigit() else " " for c in path.stem).split()
    return int(digits[-1]) if digits else 1


def _tracks(target: bpy.types.MovieTrackingObject, name: str, notes: list[str]) -> list[_Track]:
    """Tracks with a finite place in space, and where they were seen."""
    tracks = []
    for track in target.tracks:
        bundle = np.array(track.bundle, dtype=np.float64)
        if not (track.has_bundle and np.all(np.isfinite(bundle))):
            continue
        count = len(track.markers)
        frames, muted = np.empty(count, np.int32), np.empty(count, bool)
        places = np.empty(2 * count, np.float32)
        track.markers.foreach_get("frame", frames)
        track.markers.foreach_get("mute", muted)
        track.markers.foreach_get("co", places)
        # The offset moves the point that is meant away from the pattern that is followed.
        moved = places.reshape(-1, 2).astype(np.float64) + np.array(track.offset)
        usable = ~muted & np.all(np.isfinite(moved), axis=1)
        tracks.append(_Track(bundle, frames[usable], moved[usable]))
    without = len(target.tracks) - len(tracks)
    if without:
        notes.append(f"{without} of {counted(len(target.tracks), 'track')} without a 3D position left out")
    if not tracks:
        raise UserError(f"the movie clip {name} has no track with a 3D position; solve it again")
    return tracks


def _images(
    reconstruction: bpy.types.MovieTrackingReconstruction,
    tracks: list[_Track],
    numbers: dict[int, int],
    intrinsics: Intrinsics,
) -> tuple[Image, ...]:
    """The solved cameras of the footage's frames, ordered, with the markers on them."""
    point = np.repeat(np.arange(len(tracks), dtype=np.int32), [len(track.frames) for track in tracks])
    seen_in = np.concatenate([track.frames for track in tracks])
    share = np.concatenate([track.places for track in tracks])
    places = np.stack([share[:, 0], 1 - share[:, 1]], axis=1) * [intrinsics.width, intrinsics.height]
    images = []
    for camera in reconstruction.cameras:
        if camera.frame not in numbers:
            continue
        matrix = np.array(camera.matrix, dtype=np.float64)
        rotation = FLIP @ nearest_rotation(matrix[:3, :3]).T
        here = seen_in == camera.frame
        images.append(
            Image(numbers[camera.frame], rotation, -rotation @ matrix[:3, 3], places[here], point[here])
        )
    return tuple(sorted(images, key=lambda image: image.frame))


def _measured(camera: Intrinsics, images: tuple[Image, ...], bundles: Floats) -> Reconstruction:
    """The reconstruction of the points (m, 3) that a frame sees, with their mean reprojection error."""
    seen = np.concatenate([image.points for image in images])
    missed = np.concatenate([
        np.linalg.norm(camera.project(image.to_camera(bundles[image.points])) - image.xy, axis=1)
        for image in images
    ])  # fmt: skip
    views = np.bincount(seen, minlength=len(bundles))
    kept = views > 0
    rows = (np.cumsum(kept) - 1).astype(np.int32)
    error = np.bincount(seen, missed, minlength=len(bundles))[kept] / views[kept]
    colour: NDArray[np.uint8] = np.full((int(kept.sum()), 3), GRAY, dtype=np.uint8)
    moved = tuple(replace(image, points=rows[image.points]) for image in images)
    return Reconstruction((camera,), moved, Points(bundles[kept], colour, error))
