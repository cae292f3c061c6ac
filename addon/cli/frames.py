"""Frames that are drawn for the render of another process: see `render.frames_ahead`."""

from __future__ import annotations

import argparse

import bpy

from ..core.base.arrays import LinearRGBA
from ..core.base.errors import UserError
from ..core.base.messages import Progress, send
from ..core.media.clip import FrameRange
from ..render import cg_process, engine
from ..render.frames_ahead import DrawnFrame, draw_ahead
from ..render.gpu_views import check_gpu
from ..render.launcher import CHILD
from .blend import open_blend
from .options import whole
from .paths import path


def add_command(
    commands: argparse._SubParsersAction[argparse.ArgumentParser], common: argparse.ArgumentParser
) -> None:
    """`frames FILE.blend`, for the engine alone: without help it is not listed."""
    command = commands.add_parser("frames", parents=[common])
    command.add_argument("blend", type=path)
    command.add_argument("--scene", required=True)
    command.add_argument("--frames", type=FrameRange.parse, required=True)
    command.add_argument("--reach", type=whole(1), required=True)
    command.add_argument("--into", type=path, required=True)
    command.add_argument("--scripts", action="store_true")
    command.add_argument(CHILD, action="store_true")
    command.set_defaults(command=frames)


def frames(options: argparse.Namespace) -> None:
    """Draw a scene's frames, by its own numbers, until the render that they are for is over."""
    scene, _, _ = open_blend(options.blend, options.scene, options.scripts)
    wanted = options.frames
    check_gpu()

    def draw(frame: int) -> DrawnFrame:
        scene.frame_set(frame)
        with engine.watched() as watch:
            watch.pictures = pictures = dict[str, LinearRGBA]()
            try:
                bpy.ops.render.render(scene=scene.name)
            except RuntimeError as error:
                watch.raise_error()
                raise UserError(str(error).strip()) from error
            watch.check_drawn()
            return DrawnFrame(pictures, tuple(watch.notes))

    numbers = range(wanted.first, wanted.last + 1, wanted.step)
    with cg_process.kept():
        for done, frame in enumerate(draw_ahead(options.into, numbers, options.reach, draw), 1):
            send(Progress("frames", done, len(numbers), frame))
