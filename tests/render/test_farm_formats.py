"""Farm jobs for Flamenco and Deadline: their managers can read them, and they give one machine's movie."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from addon.cli.farm_formats import FORMATS
from benchmarks.torture import clip
from benchmarks.torture.bench import contents

from ..command_line import done, here, words_of
from ..movies import assert_same

LENS = ("--focus-distance", "7", "--blur", "0.05", "--method", "features", "--views", "4")
SUBMITTED = {
    "type": "object",
    "additionalProperties": False,
    "required": ["name", "type", "priority", "submitter_platform"],
    "properties": {
        "name": {"type": "string"},
        "type": {"type": "string"},
        "priority": {"type": "integer"},
        "submitter_platform": {"enum": ["linux", "windows", "darwin"]},
        "settings": {"type": "object"},
        "metadata": {"type": "object", "additionalProperties": {"type": "string"}},
    },
}
"""`SubmittedJob` of Flamenco's pkg/api/flamenco-openapi.yaml, without what we do not send."""
COMPILER = """
const author = {
    Task: (name, type) => ({ name, type, commands: [], after: [],
        addCommand(command) { this.commands.push(command); },
        addDependency(other) { this.after.push(other.name); } }),
    Command: (name, parameters) => ({ name, parameters }),
};
const tasks = [];
const submitted = JSON.parse(require("fs").readFileSync(process.argv[2], "utf8"));
compileJob({ settings: submitted.settings, addTask: (task) => tasks.push(task) });
console.log(JSON.stringify({ settings: JOB_TYPE.settings, tasks }));
"""
"""The part of Flamenco's job compiler that job types use."""

pytestmark = pytest.mark.usefixtures("registered")


@pytest.fixture(scope="module")
def work(registered: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The solve of a clip of 6 frames in a folder with a space, and the movie that one machine makes."""
    folder = tmp_path_factory.mktemp("farm") / "my shots"
    clip.solve(clip.write_video(folder / "clip", 6), folder / "work")
    done("render", folder / "work", *LENS, "--out", folder / "one.mp4")
    return folder / "work"


def deadline_jobs(bundle: Path) -> Iterator[tuple[dict[str, str], list[list[str]]]]:
    """Each job that `deadlinecommand submit.txt` submits, and the commands of its tasks."""
    first, second, *rest = (bundle / "submit.txt").read_text().splitlines()
    assert (first, second) == ("-SubmitMultipleJobs", "-Dependent")
    for flag, *files in zip(rest[::3], rest[1::3], rest[2::3], strict=True):
        assert flag == "-Job"
        info, plugin = (
            dict(line.split("=", 1) for line in Path(file).read_text().splitlines()) for file in files
        )
        begin, _, end = info["Frames"].partition("-")
        numbers = range(int(begin), int(end or begin) + 1)
        size = int(info["ChunkSize"])
        tasks = []
        for at in range(0, len(numbers), size):
            part = numbers[at : at + size]
            words = plugin["Arguments"].replace("<STARTFRAME>", str(part[0]))
            words = words.replace("<ENDFRAME>", str(part[-1]))
            tasks.append([plugin["Executable"], *shlex.split(words)])
        yield info, tasks


def flamenco_tasks(bundle: Path) -> list[dict[str, Any]]:
    """The tasks into which Flamenco compiles the job."""
    if (node := shutil.which("node")) is None:
        pytest.skip("no node program to run the job type with")
    script = bundle.parent / "compiler.js"
    script.write_text((bundle / "virtual_aperture.js").read_text() + COMPILER)
    ended = subprocess.run(
        [node, str(script), str(bundle / "job.json")], capture_output=True, text=True, check=True
    )
    compiled = json.loads(ended.stdout)
    settings = json.loads((bundle / "job.json").read_text())["settings"]
    assert settings.keys() == {each["key"] for each in compiled["settings"]}
    found: list[dict[str, Any]] = compiled["tasks"]
    return found


def test_deadline_renders_what_one_machine_renders(work: Path, tmp_path: Path) -> None:
    bundle = tmp_path / "a job"
    said = done("farm", work, *LENS, "--chunk", 4, "--format", "deadline", "--out", bundle)
    assert f"deadlinecommand {bundle / 'submit.txt'}" in said
    jobs = list(deadline_jobs(bundle))
    assert [(info["Name"].split()[-1], len(tasks)) for info, tasks in jobs] == [("Render", 2), ("Join", 1)]
    for info, tasks in jobs:
        assert info["Plugin"] == "CommandLine" and info["OutputDirectory0"] == str(bundle / "output")
        for task in tasks:
            done(*words_of(task))
    assert len(contents(bundle / "output" / "frames")) == 6
    assert_same(bundle / "output" / "movie.mp4", work.parent / "one.mp4")


def test_flamenco_renders_what_one_machine_renders(work: Path, tmp_path: Path) -> None:
    bundle = tmp_path / "a job"
    done("farm", work, *LENS, "--chunk", 4, "--format", "flamenco", "--out", bundle)
    submitted = json.loads((bundle / "job.json").read_text())
    Draft202012Validator(SUBMITTED).validate(submitted)
    assert submitted["type"] == "virtual-aperture"
    # A manager translates settings that begin with a path, and no others.
    assert (
        submitted["settings"]["bundle"] == str(bundle) and str(bundle) not in submitted["settings"]["steps"]
    )
    tasks = flamenco_tasks(bundle)
    assert [each["name"] for each in tasks] == ["Render-1-4", "Render-5-6", "Join"]
    assert [each["after"] for each in tasks] == [[], [], ["Render-1-4", "Render-5-6"]]
    for task in tasks:
        assert task["type"] == "blender"
        (command,) = task["commands"]
        assert command["name"] == "exec"
        done(*words_of([command["parameters"]["exe"], *command["parameters"]["args"]]))
    assert_same(bundle / "output" / "movie.mp4", work.parent / "one.mp4")


def test_jobs_that_solve_first_wait_for_the_step_before(work: Path, tmp_path: Path) -> None:
    source = work.parent / "clip" / "clip.mp4"
    words = ("farm", source, "--fov", 60, *LENS, "--chunk", 3)
    done(*words, "--format", "deadline", "--out", tmp_path / "d")
    jobs = list(deadline_jobs(tmp_path / "d"))
    assert [(info["Frames"], len(tasks)) for info, tasks in jobs] == [
        ("0", 1),
        ("0", 1),
        ("1-6", 2),
        ("0", 1),
    ]
    assert words_of(jobs[0][1][0])[:2] == ["solve", str(tmp_path / "d" / "input" / "clip.mp4")]
    done(*words, "--format", "flamenco", "--out", tmp_path / "f")
    after = {each["name"]: each["after"] for each in flamenco_tasks(tmp_path / "f")}
    assert after == {
        "Solve": [], "Scene": ["Solve"], "Render-1-3": ["Scene"], "Render-4-6": ["Scene"],
        "Join": ["Render-1-3", "Render-4-6"],
    }  # fmt: skip


def test_what_a_farm_cannot_pass_on_is_refused(work: Path, tmp_path: Path) -> None:
    for name, why in (('a "b".mp4', "quotation mark"), ("a\nb.mp4", "more than one line")):
        words = ("farm", work, *LENS, "--format", "deadline", "--movie", name)
        ended = here(*words, "--out", tmp_path / f"job {len(name)}")
        assert ended.returncode == 1 and why in ended.stderr, ended.stderr
        assert not list(tmp_path.rglob("*.*"))


@pytest.mark.parametrize("name", list(FORMATS))
def test_braces_in_names_are_no_variables(work: Path, tmp_path: Path, name: str) -> None:
    movie = "{{Param.Input}}.mp4"
    done("farm", work, *LENS, "--format", name, "--movie", movie, "--out", tmp_path / "job")
    if name == "deadline":
        *_, (_, ((*_, last),)) = deadline_jobs(tmp_path / "job")
    elif name == "flamenco":
        last = flamenco_tasks(tmp_path / "job")[-1]["commands"][0]["parameters"]["args"][-1]
    else:
        job = json.loads((tmp_path / "job" / "template.json").read_text())
        values = {each["name"]: each["default"] for each in job["parameterDefinitions"]}
        last = job["steps"][-1]["script"]["actions"]["onRun"]["args"][-1]
        last = re.sub(r"\{\{Param\.(\w+)\}\}", lambda found: values[found[1]], last)
    assert last.endswith(f"output/{movie}")
