"""Rendering the solved clip with Blender's own render job."""

from __future__ import annotations

from typing import Any

import bpy

from ..scene import parts
from ..scene.clip import solved_clip_path
from ..scene.lens import frame_options
from ..scene.shot import reconstruction_of
from .operators import NO_CAMERA, Result, has_focus, is_met, refused, reported


def can_render(cls: Any, context: bpy.types.Context) -> bool:
    """Poll: something is in focus and the scene has a camera, without which Blender renders nothing."""
    scene = context.scene
    is_there = any(parts.is_in(scene, camera) for camera in (scene.camera, scene.virtual_aperture.camera))
    return has_focus(cls, context) and is_met(cls, is_there, NO_CAMERA)


def prepare_render(scene: bpy.types.Scene) -> None:
    """Have Blender render with our engine; UserError where the settings mean nothing."""
    settings = scene.virtual_aperture
    frame_options(settings, reconstruction_of(settings))
    scene.render.engine = "VIRTUAL_APERTURE"
    # Whichever camera it is: the picture is the clip's.
    scene.camera = scene.camera or settings.camera


class _Render:
    """What the two render operators share."""

    animation = False

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return can_render(cls, context)

    @reported
    def execute(self, context: bpy.types.Context) -> Result:
        prepare_render(context.scene)
        solved_clip_path(context.scene.virtual_aperture)
        how = "EXEC_DEFAULT" if bpy.app.background else "INVOKE_DEFAULT"
        try:
            bpy.ops.render.render(how, animation=self.animation, use_viewport=True)
        except RuntimeError as error:
            raise refused(error) from None
        return {"FINISHED"}


class VIRTUAL_APERTURE_OT_render_frame(_Render, bpy.types.Operator):  # noqa: N801
    """Render the current frame with depth of field"""

    bl_idname = "virtual_aperture.render_frame"
    bl_label = "Render Frame"


class VIRTUAL_APERTURE_OT_render_clip(_Render, bpy.types.Operator):  # noqa: N801
    """Render the scene's frame range with depth of field to the scene's output"""

    bl_idname = "virtual_aperture.render_clip"
    bl_label = "Render Clip"
    animation = True


CLASSES = (VIRTUAL_APERTURE_OT_render_frame, VIRTUAL_APERTURE_OT_render_clip)
