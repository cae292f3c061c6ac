"""Scenes that are opened from .blend files, as other processes and machines are sent them."""

import uuid
from pathlib import Path

import bpy

from ..core.base.digest import file_digest
from ..core.base.errors import UserError
from ..core.media.clip import Footage
from ..render.output.frame_files import GRADED
from ..render.views.quiet import quiet
from ..scene.cg_objects import cg_objects
from ..scene.properties import VirtualApertureSettings
from ..scene.sources import hdr_view
from ..scene.sources.clip import solved_part
from ..scene.sources.shot import forget, shot_of


def is_blend(path: Path) -> bool:
    """Return whether a path is that of a .blend, and not of a working folder."""
    return path.suffix.lower() == ".blend" and not path.is_dir()


def open_scene(blend: Path, scripts: bool = False) -> bpy.types.Scene:
    """Return the scene that a .blend shows; UserError where it cannot be opened."""
    if not blend.is_file():
        raise UserError(f"{blend} does not exist")
    try:
        with quiet(1):
            bpy.ops.wm.open_mainfile(filepath=str(blend.absolute()), load_ui=False, use_scripts=scripts)
    except RuntimeError as error:
        raise UserError(f"{blend} cannot be opened: {str(error).strip().splitlines()[0]}") from None
    return bpy.context.scene


def open_blend(
    blend: Path, name: str = "", scripts: bool = False, as_is: bool = False
) -> tuple[bpy.types.Scene, VirtualApertureSettings, Footage]:
    """Open a scene of a .blend to render the clip's frames.

    Inputs that frames have no key of are as in a fresh scene: the compositor, the sequencer, the border and
    the view transform have no influence. With `as_is` they have, and other runs' frames are not reused.

    Args:
        blend: The file.
        name: Name of the scene; the file's own by default.
        scripts: True to run the file's scripts.
        as_is: True to keep the scene unchanged.

    Returns:
        The scene, its settings, and the solved frames of the clip.

    Raises:
        UserError: It cannot be opened or has no solved clip.
    """
    if not blend.is_file():
        raise UserError(f"{blend} is not there; name a .blend that save or farm wrote")
    scene = open_scene(blend, scripts)
    forget()
    scene = bpy.data.scenes[name] if name else scene
    settings: VirtualApertureSettings = scene.virtual_aperture
    solved = solved_part(settings, shot_of(scene).footage)
    render, view = scene.render, scene.view_settings
    render.engine = "VIRTUAL_APERTURE"
    scene.camera = scene.camera or settings.camera
    if as_is and not _is_plain(scene):
        if GRADED not in scene:  # as it is where this is a share of a run
            scene[GRADED] = uuid.uuid4().hex
        return scene, settings, solved
    if GRADED not in scene and any(cg_objects(scene, layer) for layer in scene.view_layers if layer.use):
        # Nor have they a key: with the same file they are the same.
        scene[GRADED] = file_digest(blend)
    render.use_compositing = render.use_sequencer = render.use_border = False
    view.view_transform, view.look, view.exposure, view.gamma = "Standard", "None", 0.0, 1.0
    view.use_curve_mapping = view.use_white_balance = False
    scene.display_settings.display_device, render.dither_intensity = "sRGB", 1.0
    hdr_view.follow(scene)
    render.image_settings.color_management = "FOLLOW_SCENE"
    return scene, settings, solved


def _is_plain(scene: bpy.types.Scene) -> bool:
    """Return whether Blender writes the engine's frames unchanged."""
    render, view, editor = scene.render, scene.view_settings, scene.sequence_editor
    is_composited = render.use_compositing and scene.compositing_node_group is not None
    is_cut = render.use_sequencer and editor and any(strip.type != "SOUND" for strip in editor.strips)
    has_curve = view.use_curve_mapping and not hdr_view.has_curve(view)
    looks = view.view_transform, view.look, view.exposure, view.gamma, has_curve
    has_own_look = render.image_settings.color_management == "OVERRIDE" or view.use_white_balance
    has_own_look |= scene.display_settings.display_device != "sRGB" or render.dither_intensity != 1
    is_graded = has_own_look or looks != ("Standard", "None", 0.0, 1.0, False)
    return not (is_composited or is_cut or is_graded or render.use_border)
