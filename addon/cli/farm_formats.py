"""Jobs of render farms as files: Open Job Description, and Flamenco and Deadline made from it.

A template of Open Job Description names its folders by parameters. Flamenco and Deadline have none, so files
for them name the bundle by its absolute path, and all machines must see it.
"""

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..core.base.errors import UserError

TEMPLATE = "template.json"
FLAMENCO_JOB, FLAMENCO_TYPE = "job.json", "virtual_aperture.js"
"""Body of Flamenco's `POST /api/v3/jobs`, and the script of its job type for the manager's `scripts`."""
DEADLINE = "submit.txt"
"""Arguments of `deadlinecommand`, one a line."""
TASK_FRAMES = "{{Task.Param.Frames}}"
"""The word of a step's command that is a task's range of frames."""
JOB_TYPE = """\
// SPDX-License-Identifier: GPL-3.0-or-later
// Flamenco's job type virtual-aperture. Put this file into the folder `scripts` beside flamenco-manager.

const JOB_TYPE = {
    label: "Virtual Aperture",
    description: "Depth of field for all-sharp video: job.json of `farm --format flamenco`",
    settings: [
        { key: "program", type: "string", required: true, visible: "web",
          description: "Blender with the extension Virtual Aperture" },
        { key: "bundle", type: "string", subtype: "dir_path", required: true, visible: "web",
          description: "Folder of the job, on storage that all workers see" },
        { key: "steps", type: "string", required: true, visible: "hidden",
          description: "JSON: names of steps, their arguments, and their ranges of frames" },
    ],
};

// A step has a task for each of its ranges, and follows the step before. Of its arguments, `null` is the
// range, and [PATH] is in the bundle. The manager translates the bundle's own path for other systems.
function compileJob(job) {
    const settings = job.settings;
    const filled = (word, range) => (word === null ? range : Array.isArray(word)
        ? `${settings.bundle}/${word[0]}` : word);
    let before = [];
    for (const step of JSON.parse(settings.steps)) {
        const tasks = step.ranges.map((range) => {
            const task = author.Task(range ? `${step.name}-${range}` : step.name, "blender");
            const args = step.args.map((word) => filled(word, range));
            task.addCommand(author.Command("exec", { exe: settings.program, args: args }));
            before.forEach((other) => task.addDependency(other));
            job.addTask(task);
            return task;
        });
        before = tasks;
    }
}
"""


def open_job_description(job: dict[str, Any], bundle: Path) -> tuple[dict[str, str], str]:
    """Return the files of a job by name, and the command that runs it."""
    text = json.dumps(job, indent=1) + "\n"
    return {TEMPLATE: text}, f"run it here: openjd run {bundle / TEMPLATE} --step Join --run-dependencies"


def flamenco(job: dict[str, Any], bundle: Path) -> tuple[dict[str, str], str]:
    """Return Flamenco's files for a job by name, and how it is submitted."""
    values, inside = _values(job, bundle), f"{bundle.as_posix()}/"

    def filled(word: str) -> str | list[str] | None:
        text = None if word == TASK_FRAMES else _filled(word, values)
        is_inside = text is not None and word.startswith(("{{Param.Input}}", "{{Param.Output}}"))
        return [text.removeprefix(inside)] if text is not None and is_inside else text

    steps = [
        {"name": step["name"], "args": [*map(filled, _words(step))], "ranges": _ranges(step) or [""]}
        for step in job["steps"]
    ]
    program = values["Param.Program"]
    settings = {
        # The manager's variable for the path of Blender on each worker.
        "program": "{blender}" if program == "blender" else program,
        "bundle": bundle.as_posix(),
        "steps": json.dumps(steps),
    }
    submitted = {
        "name": job["name"],
        "type": Path(FLAMENCO_TYPE).stem.replace("_", "-"),
        "priority": 50,
        "submitter_platform": {"win32": "windows"}.get(sys.platform, sys.platform),
        "settings": settings,
        "metadata": {"project": job["name"]},
    }
    files = {FLAMENCO_JOB: json.dumps(submitted, indent=1) + "\n", FLAMENCO_TYPE: JOB_TYPE}
    return files, f"submit {bundle / FLAMENCO_JOB} to the manager's /api/v3/jobs, which needs {FLAMENCO_TYPE}"


def deadline(job: dict[str, Any], bundle: Path) -> tuple[dict[str, str], str]:
    """Return Deadline's files for a job by name, and how it is submitted: each step is a job there."""
    values = _values(job, bundle)
    files, submitted = dict[str, str](), ["-SubmitMultipleJobs", "-Dependent"]
    for step in job["steps"]:
        name, ranges = step["name"].lower(), _ranges(step)
        ends = [part.split("-") for part in ranges]
        words = [
            "<STARTFRAME>-<ENDFRAME>" if word == TASK_FRAMES else _quoted(_filled(word, values))
            for word in _words(step)
        ]
        info = {
            "Plugin": "CommandLine",
            "Name": f"{job['name']} {step['name']}",
            "BatchName": job["name"],
            "Frames": f"{ends[0][0]}-{ends[-1][-1]}" if ends else "0",
            "ChunkSize": int(ends[0][1]) - int(ends[0][0]) + 1 if ends else 1,
            "OutputDirectory0": values["Param.Output"],
        }
        plugin = {"Executable": values["Param.Program"], "Arguments": " ".join(words)}
        for part, held in (("job", info), ("plugin", plugin)):
            files[f"{name}_{part}.txt"] = "".join(f"{key}={_line(value)}\n" for key, value in held.items())
        submitted += ["-Job", *(str(bundle / f"{name}_{part}.txt") for part in ("job", "plugin"))]
    files[DEADLINE] = "".join(f"{_line(each)}\n" for each in submitted)
    return files, f"submit it: deadlinecommand {bundle / DEADLINE}"


type Format = Callable[[dict[str, Any], Path], tuple[dict[str, str], str]]

FORMATS: dict[str, Format] = {
    "openjd": open_job_description, "flamenco": flamenco, "deadline": deadline,
}  # fmt: skip
"""Functions that turn a template and the path of its folder into files and a line for the user, by format."""


def _values(job: dict[str, Any], bundle: Path) -> dict[str, str]:
    """Values of a template's parameters by the names of its variables; folders are those of the bundle."""
    return {
        f"Param.{each['name']}": (bundle / each["default"]).as_posix()
        if each["type"] == "PATH"
        else each["default"]
        for each in job["parameterDefinitions"]
    }


def _filled(word: str, values: dict[str, str]) -> str:
    return re.sub(r"\{\{([\w.]+)\}\}", lambda found: values[found[1]], word)


def _words(step: dict[str, Any]) -> list[str]:
    """Arguments of a step's command."""
    return list(step["script"]["actions"]["onRun"]["args"])


def _ranges(step: dict[str, Any]) -> list[str]:
    """Ranges of frames of a step's tasks, none for a step with one task."""
    space = step.get("parameterSpace", {}).get("taskParameterDefinitions", [])
    return [text for each in space for text in each["range"]]


def _quoted(word: str) -> str:
    """A word as Deadline's Arguments take it: its command lines have no escape for a quote."""
    if '"' in word:
        raise UserError(f"Deadline cannot pass on {word!r}, which has a quotation mark; rename it")
    return f'"{word}"' if not word or re.search(r"\s", word) else word


def _line(value: object) -> str:
    """A value of a file of Deadline, which has one a line."""
    text = str(value)
    if text.splitlines() != [text]:
        raise UserError(f"Deadline cannot take {text!r}, which has more than one line; rename it")
    return text
