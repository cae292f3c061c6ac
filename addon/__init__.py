"""Virtual Aperture: depth of field for all-sharp video, made after it was shot.

Blender is only touched inside `register`, so that the solving worker process, which has no bpy, can
import the package.
"""


def register() -> None:
    from . import ui
    from .cli import blender_command

    ui.register()
    blender_command.register()


def unregister() -> None:
    from . import ui
    from .cli import blender_command

    blender_command.unregister()
    ui.unregister()
