"""Profile a process of the command line and its workers, when `VIRTUAL_APERTURE_PROFILES` names a folder.

Python imports this file at the start of a process whose PYTHONPATH has its folder. The product ends its
processes by `os._exit`, so the profile is written there and at an ordinary end.
"""

import atexit
import cProfile
import os
from pathlib import Path
from typing import NoReturn

folder = os.environ.get("VIRTUAL_APERTURE_PROFILES", "")
if folder:
    profiler = cProfile.Profile()
    ended = os._exit

    def _write() -> None:
        profiler.disable()
        profiler.dump_stats(Path(folder) / f"{os.getpid()}.prof")

    def _exit(status: int) -> NoReturn:
        _write()
        ended(status)

    os._exit = _exit
    atexit.register(_write)
    profiler.enable()
