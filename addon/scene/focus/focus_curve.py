"""The F-curve of the focus distance, written by focus marks where the distance changes.

Keys at marks have the type Keyframe, those between, for followed or eased focus, the type Generated, or
Jitter at frames that do not show a followed place: the dope sheet has a colour for each. After any edit the
curve belongs to the user: marks do not write it until the user allows it.
"""

import hashlib
from collections.abc import Sequence

import bpy
import numpy as np

from ...core.focus.pull import FocusMark, pull
from ..lens import lens
from ..solve.camera import curves_of
from ..sources.shot import reconstruction_of

GROUP = "Focus"
"""Name of the F-curve's group in the dope sheet."""


def write(settings: bpy.types.PropertyGroup, marks: Sequence[FocusMark], unseen: Sequence[int]) -> None:
    """Make the curve of marks, in place of the one that is there.

    At frames `unseen` a mark is carried that they do not show.
    """
    own = {mark.frame for mark in marks}
    frames = sorted(own | set(range(settings.clip_first, settings.clip_last + 1)))
    curve = _made(settings)
    keys = curve.keyframe_points
    keys.clear()
    keys.add(len(frames))
    places = np.array(list(pull(marks, reconstruction_of(settings), frames).items()), np.float32)
    keys.foreach_set("co", places.ravel())
    kinds = _kinds()
    hidden = set(unseen)
    names = ["KEYFRAME" if f in own else "JITTER" if f in hidden else "GENERATED" for f in frames]
    keys.foreach_set("type", np.array([kinds[name] for name in names], np.int32))
    # Linear between frames.
    keys.foreach_set("interpolation", np.ones(len(frames), np.int32))
    # New ones are selected: where one is dragged onto another selected one, Blender keeps their mean.
    for part in ("control_point", "left_handle", "right_handle"):
        keys.foreach_set(f"select_{part}", np.zeros(len(frames), dtype=bool))
    curve.update()
    settings.marks.written = _digest(curve)


def value(settings: bpy.types.PropertyGroup, frame: int) -> float:
    """Return the distance at a frame, of the curve that is there."""
    curve = lens.keys_of(settings, "focus_distance")
    assert curve is not None
    return float(curve.evaluate(frame))


def remove(settings: bpy.types.PropertyGroup) -> None:
    """Remove the curve that marks wrote, if there is one; its action goes with its last curve."""
    curve = lens.keys_of(settings, "focus_distance")
    settings.marks.written = ""
    if curve is None:
        return
    curves_of(settings.id_data).remove(curve)


def is_users(settings: bpy.types.PropertyGroup) -> bool:
    """Return whether the curve is not the one that marks wrote: another, an edited, or a deleted one."""
    curve = lens.keys_of(settings, "focus_distance")
    return bool(settings.marks.written != ("" if curve is None else _digest(curve)))


def _made(settings: bpy.types.PropertyGroup) -> bpy.types.FCurve:
    """The curve of the focus distance, made where there is none."""
    if lens.keys_of(settings, "focus_distance") is None:
        scene = settings.id_data
        scene.keyframe_insert(settings.path_from_id("focus_distance"), group=GROUP)
    curve = lens.keys_of(settings, "focus_distance")
    assert curve is not None
    return curve


def _kinds() -> dict[str, int]:
    return {kind.identifier: kind.value for kind in bpy.types.Keyframe.bl_rna.properties["type"].enum_items}


def _digest(curve: bpy.types.FCurve) -> str:
    """16 hexadecimal digits of its keys' frames and values."""
    places = np.zeros((len(curve.keyframe_points), 2), np.float32)
    curve.keyframe_points.foreach_get("co", places.ravel())
    return hashlib.sha256(places.tobytes()).hexdigest()[:16]
