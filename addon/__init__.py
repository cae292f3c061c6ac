"""Virtual Aperture: depth of field for all-sharp video, made after it was shot.

Blender is only touched inside `register`, so that the solving worker process, which has no bpy, can
import the package.
"""


def register() -> None:
    """Register everything with Blender; UserError where the system is too old for it."""
    from .core.base.system import check_system

    # Before the libraries are loaded, which would fail with no word of why.
    check_system()
    from . import ui
    from .cli import blender_command

    ui.register()
    blender_command.register()


def unregister() -> None:
    from . import ui
    from .cli import blender_command

    blender_command.unregister()
    ui.unregister()
