"""Virtual Aperture: depth of field for all-sharp video, made after it was shot.

Blender is only touched inside `register`, so that the solving worker process, which has no bpy, can
import the package.
"""


def register() -> None:
    """Register all classes with Blender.

    Raises:
        UserError: The operating system is too old for the bundled libraries.
        ImportError: Other libraries of the same names come before them.
    """
    from .core.base.system import check_libraries, check_system

    # Libraries that the system is too old for fail to load without a reason.
    check_system()
    check_libraries()
    from . import ui
    from .cli import blender_command

    ui.register()
    blender_command.register()


def unregister() -> None:
    """Unregister all classes from Blender."""
    from . import ui
    from .cli import blender_command

    blender_command.unregister()
    ui.unregister()
