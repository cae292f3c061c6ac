"""Keys of rendered frames: digests of the contents of all inputs, not of names and places."""

import hashlib

import bpy

from ...core.base.code import code_digest
from ...core.media.clip_identity import clip_digest
from ...scene.base.timeline import go_to
from ...scene.lens.lens import frame_options
from ...scene.sources.shot import Shot, shot_of
from ..views.frame_size import render_size, written_size

ROOMS = "core", "scene", "render"
"""Folders of the add-on whose code pictures depend on: a run that goes on mixes none of other code."""
GRADED = "virtual_aperture_run"
"""Property of a scene with other influences on the pictures, such as the compositor or CG objects. They have
no digest, so the property identifies the run, or file."""


def run_key(scene: bpy.types.Scene) -> str:
    """Return 64 hexadecimal digits of all inputs of a clip's pictures that are common to its frames.

    A keyed lens is that of the clip's first frame, which is shown.
    """
    return _with_lens(scene, _clip_key(scene), shot_of(scene).footage.frames[0])


def frame_keys(scene: bpy.types.Scene, frames: list[int]) -> dict[int, str]:
    """Return 64 hexadecimal digits of all inputs of each frame's picture. The frames are shown."""
    key = _clip_key(scene)
    return {frame: _with_lens(scene, f"{key} {frame}", frame) for frame in frames}


def _clip_key(scene: bpy.types.Scene) -> str:
    """The key of all inputs but the lens."""
    shot = shot_of(scene)
    parts = (
        code_digest(*ROOMS), clip_digest(shot.footage.path), shot.clip_digests, shot.mask_digests,
        _depth_digest(shot), shot.working, render_size(scene.render), written_size(scene.render),
        scene.get(GRADED),
    )  # fmt: skip
    return hashlib.sha256(repr(parts).encode()).hexdigest()


def _with_lens(scene: bpy.types.Scene, key: str, frame: int) -> str:
    """A key together with the lens at a frame: its settings may be keyed."""
    go_to(scene, frame)
    lens = frame_options(scene.virtual_aperture, shot_of(scene).reconstruction)
    return hashlib.sha256(f"{key} {lens!r}".encode()).hexdigest()


def _depth_digest(shot: Shot) -> tuple[str, list[float]] | None:
    if shot.depth is None:
        return None
    return clip_digest(shot.depth.maps.pictures.path), shot.depth.fit.line.tolist()
