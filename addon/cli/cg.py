"""CG objects that are drawn for the render of another process: see `render.cg_process`."""

from __future__ import annotations

import argparse

import bpy

from ..render.cycles_layers import serve
from ..render.launcher import CHILD
from .blend import open_scene
from .paths import path


def add_command(
    commands: argparse._SubParsersAction[argparse.ArgumentParser], common: argparse.ArgumentParser
) -> None:
    """`cg FILE.blend`, for the engine alone: without help it is not listed."""
    command = commands.add_parser("cg", parents=[common])
    command.add_argument("blend", type=path)
    command.add_argument("--scene", required=True)
    for name in ("--scripts", "--preview"):
        command.add_argument(name, action="store_true")
    command.add_argument(CHILD, action="store_true")
    command.set_defaults(command=cg)


def cg(options: argparse.Namespace) -> None:
    """Draw the CG objects of a scene for the render that they are for, until it ends this process."""
    open_scene(options.blend, options.scripts)
    serve(bpy.data.scenes[options.scene], options.blend.absolute().parent, options.preview)
