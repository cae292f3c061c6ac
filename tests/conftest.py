"""Fixtures shared by all tests, which tests are fast and which need real data, and how Ctrl-C ends them.

What is dear to make is made once for all test processes, in a folder that they share: tests that change it
take a copy.
"""

from __future__ import annotations

import ast
import contextlib
import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest

from addon.core.base.errors import UserError
from addon.core.base.file_lock import FileLock

from . import ending

type Shared = Callable[[str, Callable[[Path], object]], Path]

ROOT = Path(__file__).resolve().parents[1]
DATA = Path(os.environ.get("VA_DATA", ROOT.parent / "shared" / "data"))
"""Real footage, which is never part of the project."""
NO_DATA = "no real test data"
LONGEST = (
    "render/test_farm", "cli/test_headless", "sfm/test_solve", "benchmarks/test_truth",
    "benchmarks/test_figures", "cli/test_page_commands", "media/test_stale_inputs", "benchmarks/test_scenes",
)  # fmt: skip
"""Files that take longest (`make test` with `--durations=60`): they begin, so that no process ends alone."""
SLOW_LIBRARIES = {"bpy", "gpu", "mathutils", "bpy_extras", "pycolmap", "subprocess", "multiprocessing"}
SLOW_MODULES = (
    "addon.scene", "addon.render", "addon.ui", "addon.cli", "addon.core.sfm.process", "sample_scenes",
    "tests.scenes.slanted_shot", "addon.core.subjects.networks", "tests.subjects.walls",
)  # fmt: skip
SLOW_FIXTURES = {"registered", "scene", "data", "duck", "desk", "desk_work"}
DATA_FIXTURES = {"data", "duck"}


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "data: needs real footage; given to tests by their fixtures")
    config.addinivalue_line("markers", "long: more than some ten seconds, for `make test-all`")
    config.addinivalue_line(
        "markers", "smoke: in a window, what a first film takes, for `make test-window-smoke`"
    )
    config.pluginmanager.register(ending)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--fast", action="store_true", help="only what needs no Blender, solve, network or other process"
    )


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """With `--fast`, leave files out that import anything slow, so that it is not even loaded."""
    if config.getoption("--fast") and collection_path.suffix == ".py" and _is_slow(collection_path):
        return True
    return None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """The longest files first, real data marked; with `--fast` without tests whose fixtures are slow."""
    for item in items:
        if DATA_FIXTURES & set(getattr(item, "fixturenames", ())):
            item.add_marker("data")
    if config.getoption("--fast"):
        items[:] = [item for item in items if not SLOW_FIXTURES & set(getattr(item, "fixturenames", ()))]

    def rank(item: pytest.Item) -> int:
        name = item.path.relative_to(ROOT / "tests").with_suffix("").as_posix()
        return LONGEST.index(name) if name in LONGEST else len(LONGEST)

    items.sort(key=rank)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """One line for everything that was skipped because there is no real data."""
    skipped = [each for each in terminalreporter.stats.get("skipped", ()) if NO_DATA in str(each.longrepr)]
    if skipped:
        terminalreporter.write_line(
            f"{len(skipped)} tests skipped: real data not found at {DATA} (set VA_DATA)"
        )


@pytest.fixture(scope="session", autouse=True)
def fast_is_without_blender(request: pytest.FixtureRequest) -> Iterator[None]:
    """The last of the fast tests fails if one of them loaded Blender: then SLOW_MODULES misses something."""
    yield
    assert not (request.config.getoption("--fast") and "bpy" in sys.modules)


def _is_slow(path: Path, within: bool = True) -> bool:
    """Whether a file imports anything slow, also `within` its functions."""
    return any(_reaches_slow(module) for module in _imports(path, within))


@cache
def _reaches_slow(module: str) -> bool:
    """Whether importing it loads Blender or a solver, or may start a process. Modules of `addon.core` do not
    (tests/test_layering.py), so they are not looked into.
    """
    if module.split(".")[0] in SLOW_LIBRARIES or module.startswith(SLOW_MODULES):
        return True
    path = ROOT.joinpath(*module.split(".")).with_suffix(".py")
    return not module.startswith("addon.core") and path.is_file() and _is_slow(path, within=False)


def _imports(path: Path, within: bool) -> Iterator[str]:
    """Modules that a file names in imports, and what it takes from them, by their full names."""
    package, tree = path.relative_to(ROOT).parts[:-1], ast.parse(path.read_text())
    for node in ast.walk(tree) if within else tree.body:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            module = ".".join(filter(None, (base, node.module)))
            yield from (module, *(f"{module}.{alias.name}" for alias in node.names))


@pytest.fixture(scope="session")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Shared:
    """Called with a name and what fills an empty folder: that folder, filled by the first test process."""
    top = tmp_path_factory.getbasetemp()
    # The test processes of xdist have folders beside each other.
    top = (top.parent if "PYTEST_XDIST_WORKER" in os.environ else top) / "shared"
    top.mkdir(exist_ok=True)

    def made(name: str, fill: Callable[[Path], object]) -> Path:
        folder, done = top / name, top / f"{name}.done"
        while not done.exists():
            # The lock ends with its process; whoever waits then fills the folder anew.
            with contextlib.suppress(UserError), FileLock(top / f"{name}.lock", lambda who: UserError(who)):
                if not done.exists():
                    shutil.rmtree(folder, ignore_errors=True)
                    folder.mkdir()
                    fill(folder)
                    done.touch()
            time.sleep(0.1)
        return folder

    return made


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of real test data, which is never part of the project; skips where it is missing."""
    if not DATA.is_dir():
        pytest.skip(f"{NO_DATA}: {DATA} is missing (set VA_DATA to the folder that holds it)")
    return DATA


@pytest.fixture(scope="session")
def registered() -> Iterator[None]:
    """Register once: Blender refuses a class that is registered twice."""
    import addon

    addon.register()
    yield
    addon.unregister()


@pytest.fixture
def scene(registered: None) -> Iterator[object]:
    """A fresh, empty scene."""
    import bpy

    bpy.ops.wm.read_homefile(app_template="", use_empty=True, use_factory_startup=True)
    yield bpy.context.scene
    # A clip that stays open would be the next test's.
    from addon.scene.sources import shot

    shot.forget()


@pytest.fixture(scope="session")
def duck(data: Path, shared: Shared) -> Path:
    """The working folder of the real clip: solving it takes half a minute."""
    return shared("duck", lambda folder: _solve(data / "duck" / "demo.mp4", folder / "work")) / "work"


@pytest.fixture(scope="session")
def desk(shared: Shared) -> Path:
    """The sample clip with a sound at half its size, 320x180: a frame is drawn in a third of the time."""
    return shared("desk", _halve) / "desk.mp4"


@pytest.fixture(scope="session")
def desk_work(desk: Path, shared: Shared) -> Path:
    """The working folder of the halved sample clip, and beside it what the command said, `said.txt`."""

    def fill(folder: Path) -> None:
        from .command_line import headless

        ended = headless("solve", desk, "--work", folder / "desk.aperture")
        assert ended.returncode == 0, ended.stderr
        (folder / "said.txt").write_text(ended.stdout)

    return shared("desk_work", fill) / "desk.aperture"


def _solve(clip: Path, work: Path) -> None:
    """Solve a clip in a worker process, as every interface does."""
    from addon.core.sfm.process import SolveProcess

    process = SolveProcess(clip, work)
    try:
        process.wait()
    finally:
        process.cancel()


def _halve(folder: Path) -> None:
    """Write the sample clip at half its size, with a sound of its length, as `desk.mp4`."""
    import cv2

    from addon.render.views.quiet import quiet
    from sample_scenes import clip, desk

    movie, pictures = cv2.VideoCapture(str(Path(desk.__file__).with_name("desk.mp4"))), []
    while (read := movie.read())[0]:
        pictures.append(folder / f"{len(pictures):04d}.png")
        small = cv2.resize(read[1], None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        cv2.imwrite(str(pictures[-1]), small)
    clip.write_sound(folder / "tone.wav", clip.ticking(len(pictures) / desk.FPS))
    with quiet(1):
        clip.encode(pictures, folder / "desk.mp4", desk.FPS, folder / "tone.wav")
    for path in pictures:
        path.unlink()
