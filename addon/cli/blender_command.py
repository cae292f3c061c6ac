"""The command line of an installed extension: `blender --command virtual_aperture ARGS`.

A Blender without the extension ends with status 1 and an error about the command, so that no other engine
renders instead.
"""

from typing import Any

import bpy

from . import NAME

_handles: list[Any] = []


def register() -> None:
    """Let this Blender's `--command` know us."""
    _handles.append(bpy.utils.register_cli_command(NAME, _run))


def unregister() -> None:
    """Undo `register`."""
    bpy.utils.unregister_cli_command(_handles.pop())


def _run(arguments: list[str]) -> int:
    # Only here: the commands import what a window never needs.
    from .main import run_command

    return run_command(arguments)
