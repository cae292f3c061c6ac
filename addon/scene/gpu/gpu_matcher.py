"""Choice between GPU and processor for the plane sweep.

A real GPU is used if its result agrees with the processor's.
"""

import contextlib
import os
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import bpy
import cv2
import gpu
import numpy as np

from ...core.base.arrays import Bytes, Floats, Map
from ...core.base.errors import UserError
from ...core.base.file_lock import FileLock
from ...core.base.messages import Warned, send
from ...core.base.progress import Cancelled, checkpoint
from ...core.base.streams import say_to
from ...core.depth import matching
from ...core.depth.matching import Winners
from ...core.depth.plane_sweep import View
from . import gpu_sweep
from .main_thread import has_gpu_context, is_here

GPU = "VIRTUAL_APERTURE_GPU"
"""In the environment: 1 lets a software renderer sweep, too, as tests do; 0 lets no GPU, whatever it is."""
SOFTWARE = ("llvmpipe", "lavapipe", "softpipe", "swrast", "swiftshader", "basic render", "gdi generic")
"""In the names of renderers that are the processor: it sweeps 8 to 12 times as fast without them (`python
-m benchmarks.special gpu_sweep`)."""
ALIKE, NEARLY_ALL = 0.5, 0.99
"""Levels by which a GPU's result may differ from the processor's, and the share of pixels in which it may not
differ by more. Chosen by inspection: on software OpenGL and Vulkan no pixel of the small picture differs by
more than 0.001."""
SURE = 0.05
"""The same of costs, in grey levels, from which confidence follows."""
PATIENCE, LOOK = 30.0, 0.05
"""Seconds that a sweep waits for the GPU, and between two checkpoints. The wait is long enough that it fails
only if another process hangs: results do not depend on which came first. Chosen by inspection."""
_problem: str | None = None
"""Reason for which this process sweeps on the processor; empty on the GPU, None before the first check."""


def winning_levels(picture: Bytes, views: Sequence[View], levels: Floats, guide: Map, known: Map) -> Winners:
    """Find depth levels on the GPU if it agrees with the processor; see `matching.winning_levels`.

    One process sweeps on the GPU at a time, which limits its memory; without a turn, or after a failure, the
    processor sweeps.
    """
    given = picture, views, levels, guide, known
    if _sweeps():
        try:
            with _turn():
                return gpu_sweep.winning_levels(*given)
        except UserError:
            # Others have it.
            pass
        except Cancelled:
            raise
        except Exception as error:  # Blender's GPU module raises RuntimeError or SystemError, by platform
            _refuse(str(error) or type(error).__name__)
    return matching.winning_levels(*given)


def is_real() -> bool:
    """Return whether this process has a GPU context, and of a GPU rather than of a software renderer."""
    try:
        kind, name = gpu.platform.device_type_get(), gpu.platform.renderer_get().lower()
    except Exception:  # as above: there is no context in background mode before it is asked for
        return False
    return kind != "SOFTWARE" and not any(each in name for each in SOFTWARE)


def _sweeps() -> bool:
    """Whether the GPU is to be asked: it is real, the thread may use it, and it was right at a small size."""
    global _problem
    wish = os.environ.get(GPU, "")
    if wish == "0" or not (wish == "1" or is_real()):
        return False
    # In a window the main thread sweeps for the others.
    if not (has_gpu_context() if is_here() else not bpy.app.background):
        return False
    if _problem is None:
        _problem = ""
        try:
            problem = difference()
        except Cancelled:
            _problem = None
            raise
        except Exception as error:  # as above
            problem = str(error) or type(error).__name__
        if problem:
            _refuse(problem)
    return not _problem


def _refuse(problem: str) -> None:
    """Leave the sweep to the processor from now on, with one note."""
    global _problem
    _problem = problem
    text = f"depth is found on the CPU instead of the GPU ({' '.join(problem.split())})"
    say_to(2, f"note: {text}")
    send(Warned(text))


def _turn() -> contextlib.AbstractContextManager[None]:
    """The machine's GPU for one of this user's processes; UserError where others have it for long."""
    name = f"virtual-aperture-gpu-{os.getuid() if hasattr(os, 'getuid') else 0}.lock"
    path, until = Path(tempfile.gettempdir()) / name, time.monotonic() + PATIENCE
    while True:
        checkpoint()
        try:
            return FileLock(path, UserError, LOOK)
        except OSError:
            # Nothing can be written there: the driver shares the GPU out.
            return contextlib.nullcontext()
        except UserError:
            if time.monotonic() > until:
                raise


def difference() -> str:
    """Return the difference of the GPU's result from the processor's for a small picture.

    It is empty except for rounding. Raises the GPU's errors.
    """
    given = sample()
    ours, its = matching.winning_levels(*given), gpu_sweep.winning_levels(*given)
    for name, most in (("level", ALIKE), ("rivals", ALIKE), ("cost", SURE), ("spread", SURE)):
        alike = np.mean(np.abs(getattr(ours, name) - getattr(its, name)) < most)
        if alike < NEARLY_ALL:
            return f"its {name} is another one in {100 * (1 - alike):.1f}% of a test's pixels"
    return ""


def sample(width: int = 61, height: int = 43, count: int = 14) -> tuple[Bytes, list[View], Floats, Map, Map]:
    """Return arguments of `winning_levels` with a number of levels.

    They have two surfaces seen from both sides, levels that one view does not see, places past its lens's
    picture and places with features.
    """
    noise = np.random.default_rng(1).integers(0, 256, (height, width + 32, 3)).astype(np.float32)
    wide = cv2.GaussianBlur(noise, (0, 0), 1.0)
    wide = np.clip(128 + 3 * (wide - 128), 0, 255).astype(np.uint8)
    near = np.zeros((height, width), bool)
    near[height // 4 : 2 * height // 3, width // 3 : 2 * width // 3] = True

    def seen(shift: int) -> Bytes:
        """With its far surface moved by so many pixels, and its near one by twice as many."""
        far, close = (wide[:, 16 - each : 16 - each + width] for each in (shift, 2 * shift))
        colours = np.where(np.roll(near, 2 * shift, axis=1)[..., None], close, far)
        return np.dstack([colours, np.full((height, width), 255, np.uint8)])

    picture = seen(0)
    picture[:4, :9, 3] = 0
    guide = np.asarray(cv2.cvtColor(picture[..., :3], cv2.COLOR_RGB2GRAY), np.float32)
    known = np.full((height, width), np.nan, np.float32)
    known[height // 2 : height // 2 + 3, width // 2 : width // 2 + 3] = 0.6 * count
    turned = np.array([[1, 1e-3, 0.2], [-1e-3, 1, -0.1], [0, 0, 1]])
    views = [
        View(seen(shift), turned, np.array([[0, 0, shift], [0, 0, 0], [0, 0, bend]]), int(np.sign(shift)))
        for shift, bend in ((4, 0.0), (-2, 0.0), (-4, -0.49))
    ]
    return picture, views, np.linspace(0, 2, count), guide, known
