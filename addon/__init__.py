"""Virtual Aperture: depth of field for all-sharp video, made after it was shot.

Blender is only touched inside `register`, so that the solving worker process, which has no bpy, can
import the package.
"""


def register() -> None:
    from . import ui

    ui.register()


def unregister() -> None:
    from . import ui

    ui.unregister()
