"""Requirements for the operating system, and for the libraries that a process has loaded."""

import importlib
import importlib.util
import platform
import re
from operator import attrgetter

from .errors import UserError

MACOS = 14
"""Oldest macOS for which PyAV and pycolmap have wheels. Blender runs on older ones, and installs a wheel
without a check."""
LIBRARIES = {
    "numpy": ("NumPy", 2, ("ndarray",)),
    "cv2": ("OpenCV with its contrib modules", 5, ("dnn.ENGINE_CLASSIC", "ximgproc.guidedFilter")),
    "av": ("PyAV", 19, ("open", "VideoFrame")),
}
"""Names, oldest major versions and needed parts, by module. Modules of another add-on, of the user's own
packages or of PYTHONPATH can come before ours, which are of these versions; NumPy is Blender's."""


def check_system(macos: str | None = None) -> None:
    """Raise UserError if a macOS release, such as "14.5", is too old; by default this system's, if any."""
    release = platform.mac_ver()[0] if macos is None else macos
    if release and int(release.split(".")[0]) < MACOS:
        raise UserError(
            f"Virtual Aperture needs macOS {MACOS} or newer, and this is macOS {release}; update macOS, or"
            " use it on another machine"
        )


def check_libraries() -> None:
    """Import the libraries; raise ImportError naming the file of one that is too old or incomplete."""
    for module, (name, least, parts) in LIBRARIES.items():
        version, place, problem = "", "", "is too old"
        try:
            loaded = importlib.import_module(module)
            version = str(getattr(loaded, "__version__", ""))
            place = getattr(loaded, "__file__", None) or next(iter(loaded.__path__), "")
            for part in parts:
                attrgetter(part)(loaded)
            number = re.match(r"\d+", version)
            if number is not None and int(number[0]) >= least:
                continue
        except Exception as error:  # whatever a foreign module fails with
            found = None if place else importlib.util.find_spec(module)
            place = place or (found and found.origin) or "any folder of Python's path"
            problem = f"cannot be used ({type(error).__name__}: {' '.join(str(error).split())})"
        raise ImportError(
            f"Virtual Aperture needs {name} {least} or newer, but {module} {version or 'of unknown version'}"
            f" from {place} {problem}; disable the add-on that brings it, or remove it from PYTHONPATH or"
            " from Python's user packages, and start again"
        )
