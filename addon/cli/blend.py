"""Scenes that are opened from .blend files, as other processes and machines are sent them."""

from __future__ import annotations

from pathlib import Path

import bpy

from ..core.base.errors import UserError
from ..core.media.clip import Footage, FrameRange, open_footage
from ..render.quiet import quiet
from ..scene.properties import VirtualApertureSettings
from ..scene.shot import forget, shot_of


def is_blend(path: Path) -> bool:
    """Whether a path is that of a .blend, and not of a working folder."""
    return path.suffix.lower() == ".blend" and not path.is_dir()


def open_scene(blend: Path, scripts: bool = False) -> bpy.types.Scene:
    """The scene that a .blend shows; UserError where it cannot be opened."""
    if not blend.is_file():
        raise UserError(f"{blend} does not exist")
    try:
        with quiet(1):
            bpy.ops.wm.open_mainfile(filepath=str(blend.absolute()), load_ui=False, use_scripts=scripts)
    except RuntimeError as error:
        raise UserError(f"{blend} cannot be opened: {str(error).strip().splitlines()[0]}") from None
    return bpy.context.scene


def open_blend(
    blend: Path, name: str = "", scripts: bool = False
) -> tuple[bpy.types.Scene, VirtualApertureSettings, Footage]:
    """The scene of a .blend, or its scene of that name, to have the clip's frames rendered, and those of the
    clip that were solved; its own scripts run where `scripts` says so.

    What frames have no key of is as in a fresh scene: the compositor, the sequencer, the border and the view
    transform have no part in them. UserError where it cannot be opened or holds no solved clip.
    """
    if not blend.is_file():
        raise UserError(f"{blend} is not there; name a .blend that save or farm wrote")
    scene = open_scene(blend, scripts)
    forget()
    scene = bpy.data.scenes[name] if name else scene
    settings: VirtualApertureSettings = scene.virtual_aperture
    clip = shot_of(scene).footage
    solved = FrameRange(settings.clip_first, settings.clip_last, max(settings.clip_step, 1))
    # Older versions kept no range.
    frames = solved.of(clip.frames) or clip.frames
    render, view = scene.render, scene.view_settings
    render.engine = "VIRTUAL_APERTURE"
    render.use_compositing = render.use_sequencer = render.use_border = False
    view.view_transform, view.look, view.exposure, view.gamma = "Standard", "None", 0.0, 1.0
    view.use_curve_mapping = False
    return scene, settings, open_footage(clip.path, frames, info=clip.video, stills=clip.is_stills)
