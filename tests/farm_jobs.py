"""A farm's job, as a scheduler reads it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from .command_line import HEADLESS


def tasks(job: dict[str, Any], bundle: Path) -> dict[str, list[list[str]]]:
    """The commands of each step as a scheduler runs them, with the bundle where it lies now."""
    values = {each["name"]: each["default"] for each in job["parameterDefinitions"]}
    values |= {name: str(bundle / values[name]) for name in ("Input", "Output")}
    found = {}
    for step in job["steps"]:
        run = step["script"]["actions"]["onRun"]
        space = step.get("parameterSpace", {}).get("taskParameterDefinitions", [{"name": "", "range": [""]}])[
            0
        ]
        found[step["name"]] = commands = []
        for value in space["range"]:
            given = {f"Param.{name}": each for name, each in values.items()} | {
                f"Task.Param.{space['name']}": value
            }
            words = [run["command"], *run["args"]]
            for name, each in given.items():
                words = [word.replace(f"{{{{{name}}}}}", each) for word in words]
            commands.append(words)
    return found


def words_of(task: list[str]) -> list[str]:
    """What follows the program in a task's command."""
    return task[task.index(str(HEADLESS)) + 1 :]
