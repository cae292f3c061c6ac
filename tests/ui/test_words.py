"""Errors name no interface's controls; each interface adds its own."""

from __future__ import annotations

import ast
from pathlib import Path

import bpy
import numpy as np
import pytest

import addon
from addon.cli.main import run_command
from addon.cli.options import WORDS as COMMAND_LINE
from addon.core.base.errors import Remedy, UserError
from addon.core.sfm.process import SolveProcess
from addon.scene.base.remedy_words import WORDS as INTERFACE

from .. import planes

SHARED = [
    path
    for folder in ("core", "scene", "ui", "render")
    for path in sorted(Path(addon.__file__).parent.joinpath(folder).rglob("*.py"))
    # Their strings are arguments of other processes.
    if path.name not in ("background.py", "launcher.py", "movie.py")
    and path.parts[-3:] != ("ui", "jobs", "export.py")
]


def strings(path: Path) -> list[str]:
    nodes = ast.walk(ast.parse(path.read_text()))
    return [node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)]


def test_no_message_names_an_option_of_the_command_line() -> None:
    assert [(path.name, text) for path in SHARED for text in strings(path) if "--" in text] == []


def test_the_command_line_has_a_word_for_every_remedy() -> None:
    assert set(COMMAND_LINE) == set(Remedy)
    error = UserError("this is so; choose another folder, or replace it", Remedy.WORK_DIR, Remedy.AGAIN)
    assert error.worded(COMMAND_LINE).endswith("; choose another folder, or replace it (--work DIR, --again)")
    assert error.worded(INTERFACE).endswith(
        "; choose another folder, or replace it (Working Folder, Solve Again)"
    )
    assert str(error) == error.worded({})


def test_a_clip_with_a_cut_says_in_each_interface_how_to_take_a_part(
    scene: bpy.types.Scene, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shots = [*planes.sideways(6), *(255 - np.flip(picture) for picture in planes.sideways(6))]
    clip, work = planes.write_clip(tmp_path / "cut", shots), tmp_path / "work"
    process = SolveProcess(clip, work)
    with pytest.raises(UserError, match=r"1 cut; .* frames: 1-6, 7-12$") as refused:
        process.wait()
    assert refused.value.remedies == (Remedy.FRAMES,)
    assert run_command(["solve", str(clip), "--work", str(work)]) == 1
    assert capsys.readouterr().err.strip().endswith("frames: 1-6, 7-12 (--frames A-B)")
    scene.virtual_aperture.footage, scene.virtual_aperture.work_dir = str(clip), str(work)
    with pytest.raises(RuntimeError, match=r"frames: 1-6, 7-12 \(trim the clip to one of them") as raised:
        bpy.ops.virtual_aperture.solve()
    assert "--" not in str(raised.value)
