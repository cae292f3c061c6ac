"""The JSON that commands write is what `docs/reports.schema.json` describes, no more and no less."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from addon.core.frame.report import FrameReport
from addon.core.sfm.report import LensReport, Report

from ..command_line import done
from .solved_clips import import_planes

SCHEMA: dict[str, Any] = json.loads(
    (Path(__file__).resolve().parents[2] / "docs" / "reports.schema.json").read_text()
)
PARTS = SCHEMA["$defs"]
LENS = ("--focus-at", "0.5,0.5", "--blur", "0.02", "--views", "8")


def breaches(part: str, held: object) -> list[str]:
    """What of a report is not as one part of the schema describes it."""
    checks = Draft202012Validator({"$ref": f"#/$defs/{part}", "$defs": PARTS})
    return [error.message for error in checks.iter_errors(held)]


def test_the_schema_is_one() -> None:
    Draft202012Validator.check_schema(SCHEMA)


@pytest.mark.parametrize(("part", "kind"), [("solve", Report), ("lens", LensReport), ("frame", FrameReport)])
def test_every_field_is_described(part: str, kind: type) -> None:
    described = PARTS[part]["properties"]
    assert list(described) == [field.name for field in fields(kind)] == PARTS[part]["required"]
    assert all(field["description"].endswith(".") for field in described.values())


def test_reports_of_a_solve(registered: None, desk_work: Path) -> None:
    held = json.loads(done("report", desk_work, "--json"))
    assert breaches("solve", held) == [] and held["lens"] is not None
    for name in held:
        assert breaches("solve", {key: value for key, value in held.items() if key != name}), name
    for name, wrong in (
        ("frames", -1),
        ("explained", 1.5),
        ("focal_from", "sky"),
        ("angle", [1, 2]),
        ("new", 0),
    ):
        assert breaches("solve", held | {name: wrong}), name


def test_reports_of_an_import_and_its_frames(registered: None, tmp_path: Path) -> None:
    work = import_planes(tmp_path)
    assert breaches("solve", json.loads(done("report", work, "--json"))) == []
    done("inspect", work, "--frame", 2, *LENS, "--out", tmp_path / "seen")
    assert breaches("frame", json.loads((tmp_path / "seen" / "report.json").read_text())) == []
    file = tmp_path / "frames.json"
    done("render", work, "--frames", "2-3", *LENS, "--out", tmp_path / "####.png", "--report", file)
    held = json.loads(file.read_text())
    assert breaches("run", held) == [] and len(held["frames"]) == 2
    assert breaches("run", {**held, "frames": [{**held["frames"][0], "own": "all"}]})
