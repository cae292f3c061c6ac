"""Requirements of the bundled libraries for the operating system."""

import platform

from .errors import UserError

MACOS = 14
"""Oldest macOS for which PyAV and pycolmap have wheels. Blender runs on older ones, and installs a wheel
without a check."""


def check_system(macos: str | None = None) -> None:
    """Raise UserError if a macOS release, such as "14.5", is too old; by default this system's, if any."""
    release = platform.mac_ver()[0] if macos is None else macos
    if release and int(release.split(".")[0]) < MACOS:
        raise UserError(
            f"Virtual Aperture needs macOS {MACOS} or newer, and this is macOS {release}; update macOS, or"
            " use it on another machine"
        )
