"""Requirements of the bundled libraries on the operating system."""

from __future__ import annotations

import platform

from .errors import UserError

MACOS = 14
"""Oldest version for which PyAV and pycolmap are built, by the names of their wheels. Blender runs on older
ones, and installs a wheel without a check."""


def check_system(macos: str | None = None) -> None:
    """UserError where the system is too old.

    `macos` is its release, such as 14.5, empty for other systems; by default this one's.
    """
    release = platform.mac_ver()[0] if macos is None else macos
    if release and int(release.split(".")[0]) < MACOS:
        raise UserError(
            f"Virtual Aperture needs macOS {MACOS} or newer, and this is macOS {release}; update macOS, or"
            " use it on another machine"
        )
