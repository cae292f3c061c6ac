"""The user's changes of the clip's camera: the render has the solve's own camera, the viewport does not."""

from collections.abc import Iterator, Mapping

import bpy
import numpy as np

from ..core.base.arrays import Floats
from ..core.base.errors import UserError
from ..core.base.lru_cache import remembered
from ..core.camera.reconstruction import Reconstruction
from . import parts
from .solve.camera import INTRINSICS, POSE, UNMOVED, VIEW, curves_of, pixel_aspect, rotations_of, view_of
from .sources.shot import IDENTITY, reconstruction_of

ROUNDING = 1e-5
"""Relative difference of a number that Blender keeps in single precision (1.2e-7), and interpolates."""
Expected = dict[str, Floats]
"""Values (k, n) of properties at the registered frames, by path."""
OFFSET = "virtual_aperture_offset"
"""Property of the background image: the frame offset that the solve has set."""


def edits(scene: bpy.types.Scene) -> tuple[str, ...]:
    """Return Blender's names of the changed properties of the clip's camera; none without a solve."""
    settings = scene.virtual_aperture
    camera = settings.camera
    if not parts.is_in(scene, camera) or camera.type != "CAMERA":
        return ()
    try:
        reconstruction = reconstruction_of(settings)
    except UserError:
        return ()
    pose, lens, fixed = _solved(reconstruction)
    found = [
        *_animated(camera, pose, reconstruction), *_changed(camera, UNMOVED),
        *["Parent"] * (camera.parent != settings.root),
        *["Constraints"] * any(not each.mute and each.influence > 0 for each in camera.constraints),
        *_animated(camera.data, lens, reconstruction), *_changed(camera.data, fixed),
        *_changed(scene.render, pixel_aspect(reconstruction.cameras[0])), *_background(settings),
    ]  # fmt: skip
    return tuple(dict.fromkeys(found))


@remembered(1)
def _solved(reconstruction: Reconstruction) -> tuple[Expected, Expected, dict[str, object]]:
    """The camera's pose, its animated lens and its other properties as solved: panels ask at every redraw."""
    views = [view_of(reconstruction.intrinsics(image)) for image in reconstruction.images]
    places = np.array([image.centre for image in reconstruction.images])
    pose = dict(zip(POSE, (places, rotations_of(reconstruction)), strict=True))
    lens = {path: np.array([[view[path]] for view in views]) for path in INTRINSICS}
    return pose, lens, {path: views[0][path] for path in VIEW if path not in INTRINSICS}


def _animated(data: bpy.types.ID, expected: Expected, reconstruction: Reconstruction) -> Iterator[str]:
    """Properties that are not as expected at the registered frames, (k, n) by path, or not now."""
    frames = reconstruction.frames.astype(np.float64)
    for path, values in expected.items():
        off = ROUNDING * max(float(np.abs(values).max()), float(np.ptp(values, axis=0).max()), ROUNDING)
        curves = [curve for curve in curves_of(data) if curve.data_path == path]
        seen = {curve.array_index: _values(curve, frames) for curve in curves}
        is_moving = [bool(np.ptp(column) > off) or path in POSE for column in values.T]
        lacks = any(moving and index not in seen for index, moving in enumerate(is_moving))
        differs = any(np.abs(line - values[:, index]).max() > off for index, line in seen.items())
        now = np.ravel(np.array(getattr(data, path), np.float64))
        if lacks or differs or _distance(now, values) > off:
            yield _name(data, path)
    animation = data.animation_data
    if animation is None:
        return
    watched = (*expected, *UNMOVED, *VIEW)
    curves = [*animation.drivers, *(c for c in curves_of(data) if c.data_path not in expected)]
    yield from (_name(data, each.data_path) for each in curves if each.data_path in watched)
    if any(not track.mute and len(track.strips) for track in animation.nla_tracks):
        yield "Nonlinear Animation"


def _values(curve: bpy.types.FCurve, frames: Floats) -> Floats:
    """The values (k,) of a curve at frames; infinite if it is muted."""
    if curve.mute or (curve.group is not None and curve.group.mute):
        return np.full(len(frames), np.inf)
    keys = np.zeros((len(curve.keyframe_points), 2), np.float32)
    curve.keyframe_points.foreach_get("co", keys.ravel())
    if not len(curve.modifiers) and np.array_equal(keys[:, 0], frames):
        return keys[:, 1].astype(np.float64)
    return np.array([curve.evaluate(frame) for frame in frames])


def _distance(now: Floats, path: Floats) -> float:
    """How far values (n,) are from a path through others (k, n).

    Blender's values can be those of another frame: of the one that another scene with this camera shows.
    """
    if len(path) == 1:
        return float(np.linalg.norm(now - path[0]))
    steps = np.diff(path, axis=0)
    lengths = np.maximum((steps**2).sum(axis=1), 1e-30)
    share = np.clip(((now - path[:-1]) * steps).sum(axis=1) / lengths, 0, 1)
    return float(np.linalg.norm(path[:-1] + share[:, None] * steps - now, axis=1).min())


def _changed(data: bpy.types.bpy_struct, expected: Mapping[str, object]) -> Iterator[str]:
    """Properties that have other values than expected."""
    for path, value in expected.items():
        now = getattr(data, path)
        if isinstance(value, str):
            is_same = now == value
        else:
            is_same = np.allclose(np.array(now, np.float64), np.array(value), ROUNDING, ROUNDING)
        if not is_same:
            yield _name(data, path)


def _background(settings: bpy.types.PropertyGroup) -> Iterator[str]:
    """Changes that show another part or another frame of the clip behind the camera."""
    for each in settings.camera.data.background_images:
        if each.image is None or not each.image.get(IDENTITY):
            continue
        offset = each.image.get(OFFSET, each.image_user.frame_offset)
        frames = {"frame_start": settings.clip_first, "frame_offset": offset}
        placed = {"offset": (0.0, 0.0), "scale": 1.0, "rotation": 0.0}
        for name in (*_changed(each.image_user, frames), *_changed(each, placed)):
            yield f"Background {name}"


def _name(data: bpy.types.bpy_struct, path: str) -> str:
    """A property as Blender names it."""
    return str(data.bl_rna.properties[path].name)
