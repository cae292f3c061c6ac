"""Files in unlucky places and with unlucky names: a solve stays, a .blend and a job can be used."""

from __future__ import annotations

import json
import re
import shutil
import zipfile
from pathlib import Path

import bpy
import pytest

from addon.core.sfm.workspace import load_solve

from ..command_line import run
from ..scenes import LENS, write_frames
from ..slanted_clip import LENS_OPTIONS, keep, video


@pytest.mark.parametrize("name", ["link.json", "moved.json", "template.json"])
def test_no_report_replaces_a_solve_or_a_job(
    registered: None, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    work = tmp_path / "work"
    keep(video(tmp_path / "clip.mp4"), work)
    (tmp_path / "link.json").symlink_to(work / "solve.json")
    shutil.copy(work / "solve.json", tmp_path / "moved.json")
    (tmp_path / "template.json").write_text('{"specificationVersion": "jobtemplate-2023-09"}')
    report = (work if name == "solve.json" else tmp_path) / name
    before = report.read_bytes()
    words = (*LENS_OPTIONS, "--out", tmp_path / "o" / "####.png", "--report", report, "--overwrite")
    assert run("render", work, *words) == 1
    assert "which a report must not replace; choose another file" in capsys.readouterr().err
    assert report.read_bytes() == before and not (tmp_path / "o").exists()
    assert load_solve(work).frames == (1, 2, 3)


def test_no_report_replaces_a_damaged_solve(
    registered: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    work = tmp_path / "work"
    keep(video(tmp_path / "clip.mp4"), work)
    (work / "solve.json").write_text("{")
    words = ("--out", tmp_path / "o" / "####.png", "--report", work / "solve.json", "--overwrite")
    assert run("render", work, *LENS_OPTIONS, *words) == 1
    assert "which a report must not replace" in capsys.readouterr().err
    # Nor one that is to be made first.
    shutil.rmtree(work)
    assert run("run", tmp_path / "clip.mp4", "--work", work, *LENS_OPTIONS, *words) == 1
    assert "is where the solve will be kept; choose another file" in capsys.readouterr().err
    assert not work.exists()


def test_a_blend_among_its_clips_own_pictures(
    registered: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    clip, work = write_frames(tmp_path / "shot", LENS), tmp_path / "work"
    keep(clip, work)
    pictures = sorted(path.name for path in clip.iterdir())
    blend = clip / "a.blend"
    assert run("save", work, *LENS_OPTIONS, "--blend", blend, "--pack") == 0
    said = capsys.readouterr().out
    assert f"send it together with {', '.join(pictures)} next to it" in said
    assert sorted(path.name for path in clip.iterdir()) == ["a.blend", "a.zip", *pictures]
    with zipfile.ZipFile(clip / "a.zip") as archive:
        archive.extractall(tmp_path / "sent")
    shutil.rmtree(clip)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "sent" / "a" / "a.blend"))
    scene = bpy.context.scene
    scene.frame_start = scene.frame_end = 2
    bpy.ops.render.render(animation=True)
    assert len(list((tmp_path / "sent" / "a" / "render").iterdir())) == 1


@pytest.mark.parametrize("solved", [False, True])
def test_names_in_braces_are_no_words_of_a_job(registered: None, tmp_path: Path, solved: bool) -> None:
    clip, work, job = video(tmp_path / "{{Param.Input}}.mp4"), tmp_path / "work", tmp_path / "job"
    keep(clip, work)
    masks = tmp_path / "masks"
    masks.mkdir()
    for frame in (1, 2, 3):
        shutil.copy(
            write_frames(tmp_path / "shot", LENS) / f"clip_000{frame}.png", masks / f"{{{{m}}}}_{frame}.png"
        )
    words = [*LENS_OPTIONS[:-4], "--mask", masks / "{{m}}_#.png", "--movie", "{{Task.Param.Frames}}.mp4"]
    assert run("farm", work if solved else clip, *words, "--out", job) == 0
    template = json.loads((job / "template.json").read_text())
    parameters = {each["name"]: each["default"] for each in template["parameterDefinitions"]}
    assert "{{" not in template["name"]
    used = set(re.findall(r"{{(.*?)}}", json.dumps(template["steps"])))
    assert used <= {f"Param.{name}" for name in parameters} | {"Task.Param.Frames"}
    # With the values in their places the words are the user's.
    steps = {step["name"]: step["script"]["actions"]["onRun"]["args"] for step in template["steps"]}
    values = parameters | {"Input": str(job / "input")}

    def filled(step: str) -> list[str]:
        return [re.sub(r"{{Param\.(\w+)}}", lambda found: values[found[1]], word) for word in steps[step]]

    assert "output/{{Task.Param.Frames}}.mp4" in filled("Join")
    if solved:
        bpy.ops.wm.open_mainfile(filepath=str(job / "input" / "scene.blend"))
        assert bpy.context.scene.virtual_aperture.masks == "//masks/{{m}}_#.png"
    else:
        assert json.loads((job / "input" / "lens.json").read_text())["mask"] == "masks/{{m}}_#.png"
    assert (job / "input" / "masks" / "{{m}}_1.png").exists()
    assert steps["Render"].count("{{Task.Param.Frames}}") == 1
    if not solved:
        (place,) = (word for word in filled("Solve") if word.endswith(".mp4"))
        assert Path(place).read_bytes() == clip.read_bytes()
