"""The command line: solve, render, run and save without a window.

    blender -b --python addon/headless.py -- ARGS
    python addon/headless.py ARGS          (with the bpy module)

As a script this file is outside its package. It finds it: the installed and enabled extension, or else the
folder that it lies in.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import os
import shutil
import signal
import sys
from pathlib import Path
from types import ModuleType
from typing import NoReturn

PACKAGE = "addon"


def main(arguments: list[str]) -> int:
    """Run one command; the exit status."""
    try:
        if "bpy" not in sys.modules:
            _prepare()
        commands = _commands()
        importlib.import_module(commands.__name__.removesuffix("cli.main") + "core.base.memory").keep_freed()
    except (ImportError, MemoryError) as error:
        with contextlib.suppress(OSError):
            why = f"error: the program cannot be loaded: {error}".splitlines()[0]
            print(why, file=sys.stderr, flush=True)
        return 1
    return int(commands.run_command(arguments))


def _prepare() -> None:
    _load_folder()
    # Before Blender loads NumPy.
    for name, value in importlib.import_module(f"{PACKAGE}.core.base.worker").ONE_BLAS_THREAD.items():
        os.environ.setdefault(name, value)
    # Before Blender loads NumPy, which may be another.
    importlib.import_module(f"{PACKAGE}.core.base.system").check_libraries()
    # Before Blender opens files.
    importlib.import_module(f"{PACKAGE}.core.base.streams").open_all()


def _commands() -> ModuleType:
    import bpy

    name = next((n for n in sys.modules if n.endswith(".virtual_aperture.addon.ui")), None)
    if name is None:
        if PACKAGE not in sys.modules:
            _load_folder()
        name = f"{PACKAGE}.ui"
        if not hasattr(bpy.types.Scene, "virtual_aperture"):
            importlib.import_module(PACKAGE).register()
    return importlib.import_module(name.removesuffix(".ui") + ".cli.main")


def _end(number: int, _frame: object) -> None:
    """A signal that ends the command while nothing is begun yet."""
    with contextlib.suppress(OSError):
        os.write(2, b"error: interrupted\n")
    os._exit(128 + number)


def _leave(status: int) -> NoReturn:
    """End the process with a status immediately.

    Written files are complete and in place, and our locks and folders are removed. Shutting down Blender, the
    driver and their threads repeats the system's work, and can fail: one run did not end after its last line,
    and with little memory libraries crash then, with another status.
    """
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except OSError:
        # The listener is gone. Python's own status for this case.
        status = status or 120
    if bpy := sys.modules.get("bpy"):
        own = Path(bpy.app.tempdir)
        # Without Blender's temporary folder, this is the folder shared by all programs.
        if own.name.startswith("blender_"):
            shutil.rmtree(own, ignore_errors=True)
    os._exit(status)


def _load_folder() -> None:
    """Make the folder of this file importable as the package that it is."""
    folder = Path(__file__).resolve().parent
    spec = importlib.util.spec_from_file_location(
        PACKAGE, folder / "__init__.py", submodule_search_locations=[str(folder)]
    )
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[PACKAGE] = module
    spec.loader.exec_module(module)


if __name__ == "__main__":
    given = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    ending = [signal.SIGINT, signal.SIGTERM]
    # Under `nohup` it is ignored, and stays so.
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        ending.append(signal.SIGHUP)
    for heard in ending:
        signal.signal(heard, _end)
    status = main(given)
    # The command is done, or its failure was reported.
    for heard in ending:
        signal.signal(heard, signal.SIG_IGN)
    _leave(status)
