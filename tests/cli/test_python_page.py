"""The public functions: the script of docs/python.md with the extension installed, and what each promises."""

from __future__ import annotations

import ast
import inspect
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from addon import api
from addon.core.base.errors import UserError

from .. import planes
from ..command_line import done, here
from .solved_clips import import_planes

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "python.md").read_text()
SCRIPT = re.findall(r"^```\n(.*?)^```", PAGE, re.M | re.S)[0]
FUNCTIONS = ("solve", "pick", "depth", "render", "export")
LENS = {"focus_distance": 7, "blur": 0.02, "views": 4, "method": "features"}
INSTALL = """
import sys, bpy
bpy.ops.extensions.package_install_files(filepath=sys.argv[1], repo='user_default', enable_on_install=True)
exec(compile(open(sys.argv[2]).read(), sys.argv[2], 'exec'))
"""


@pytest.fixture(scope="module")
def work(registered: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return import_planes(tmp_path_factory.mktemp("planes"))


def test_the_page_names_every_function() -> None:
    assert set(api.__all__) == {*FUNCTIONS, "UserError"}
    rows = re.findall(r"^\| `(\w+)(\(.*?\))` \|", PAGE, re.M)
    assert [name for name, _ in rows] == list(FUNCTIONS)
    for name, signature in rows:
        own = inspect.signature(getattr(api, name)).parameters
        assert re.findall(r"(?:^|[(, ])\*{0,2}(\w+)", re.sub(r"=[^,)]+", "", signature)) == list(own), name
    root = ast.parse((ROOT / "__init__.py").read_text())
    names = [each.name for node in root.body if isinstance(node, ast.ImportFrom) for each in node.names]
    assert set(names) == {*api.__all__, "register", "unregister"}


@pytest.mark.long
def test_the_script_of_the_page_runs_with_the_extension_installed(tmp_path: Path) -> None:
    assert len(SCRIPT.splitlines()) <= 15
    out = tmp_path / "dist"
    build = [sys.executable, str(ROOT / "tools" / "build_zip.py"), "--no-wheels"]
    subprocess.run([*build, "--out", str(out), "--stage", str(out / "stage")], check=True)
    (tmp_path / "script.py").write_text(SCRIPT)
    (tmp_path / "install.py").write_text(INSTALL)
    planes.write_video(tmp_path / "clip.mp4", 5)
    ended = subprocess.run(
        [sys.executable, "install.py", str(next(out.glob("*.zip"))), "script.py"],
        capture_output=True, text=True, check=False, cwd=tmp_path,
        env=os.environ | {"BLENDER_USER_RESOURCES": str(tmp_path / "blender")},
    )  # fmt: skip
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "5 of 5 frames" in ended.stdout and "focus goes from" in ended.stdout
    assert (tmp_path / "pulled.mp4").stat().st_size > 0
    assert len(list((tmp_path / "layers").glob("*.exr"))) == 2


def test_solve_takes_the_solve_and_returns_its_report(registered: None, desk: Path, desk_work: Path) -> None:
    work = desk_work
    assert api.solve(desk, work) == json.loads(done("report", work, "--json"))


def test_pick_measures_what_is_there(work: Path) -> None:
    near, far = api.pick(work, 0.68, 0.5, frame=3), api.pick(work, 0.95, 0.5, 3)
    assert near["frame"] == 3 and near["distance"] == pytest.approx(4.0, rel=0.05)
    assert far["distance"] == pytest.approx(10.0, rel=0.1) and far["source"]
    said = done("pick", work, "--focus-at", "0.68,0.5@3")
    assert f"in focus: {near['distance']:.4g} away at frame 3" in said


def test_render_gives_the_frames_of_the_command(work: Path, tmp_path: Path) -> None:
    api.render(work, tmp_path / "a" / "####.png", frames="2-3", **LENS)
    words = [word for name, value in LENS.items() for word in (f"--{name.replace('_', '-')}", value)]
    done("render", work, *words, "--frames", "2-3", "--out", tmp_path / "b" / "####.png")
    ours, theirs = (
        {each.name: each.read_bytes() for each in (tmp_path / name).iterdir()} for name in ("a", "b")
    )
    assert ours == theirs and len(ours) == 2


def test_options_become_those_of_the_command_line() -> None:
    assert api._words({
        "focus_at": ["0.1,0.5@1", "-0.2,0.5@4"], "focus_point": [3, 4], "subject": [["0.1,0.2", "0.3,0.4@5"]],
        "borrow": False, "overwrite": True, "again": False, "jobs": None, "swing": -2.5,
        "depth": Path("maps"), "aperture": ["blades=6", "rotation=15"],
    }) == [
        "--focus-at=0.1,0.5@1", "--focus-at=-0.2,0.5@4", "--focus-point", "3", "4",
        "--subject", "0.1,0.2", "0.3,0.4@5", "--borrow=off", "--overwrite", "--swing=-2.5", "--depth=maps",
        "--aperture", "blades=6", "rotation=15",
    ]  # fmt: skip


def test_what_cannot_be_done_is_an_error_with_the_options_to_use(work: Path, tmp_path: Path) -> None:
    for call, why in (
        (lambda: api.render(work, tmp_path / "a.mp4"), "one of --focus-at"),
        (lambda: api.render(work, tmp_path / "a.mp4", colour="red"), "unrecognized arguments: --colour=red"),
        (lambda: api.render(work, tmp_path / "a.mp4", **{**LENS, "blur": 0.9}), "at most 0.5 can be drawn"),
        (lambda: api.pick(work, 1.5, 0.5), "outside the picture"),
        (lambda: api.solve(tmp_path / "none.mp4", tmp_path / "work"), "none.mp4"),
    ):
        with pytest.raises(UserError, match=re.escape(why)):
            call()
    assert not list(tmp_path.glob("a.mp4*"))
    ended = here("pick", work, "--focus-distance", 5)
    assert ended.returncode == 2 and "use --focus-at or --focus-subject" in ended.stderr
