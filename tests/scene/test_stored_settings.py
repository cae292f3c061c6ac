"""A .blend of every released version keeps its settings: all values, and the numbers of all enumerations."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy
import pytest

from addon.core.focus.focus import Focus

from . import stored_settings

FILES = sorted(stored_settings.STORED.glob("*.blend"))


def lost(before: Any, now: Any, path: str = "") -> list[str]:
    """What of stored values is not there now; more may be."""
    if isinstance(before, dict):
        inner = [(f"{path}.{name}", value, (now or {}).get(name)) for name, value in before.items()]
        return [each for name, value, other in inner for each in lost(value, other, name)]
    if isinstance(before, list) and before and isinstance(before[0], dict):
        if not isinstance(now, list) or len(now) != len(before):
            return [path]
        return [each for a, b in zip(before, now, strict=True) for each in lost(a, b, path)]
    return [] if before == now else [f"{path}: {before!r} is {now!r}"]


def taken_over(before: Any) -> tuple[dict[str, Any], tuple[Any, ...]]:
    """Take what marks have taken over out of the values of 1.0.0; the fields of its mark, and its place."""
    settings, enums = before["values"]["scene"], before["enums"]["scene"]
    # Two methods are gone since.
    assert (enums["method"].pop("grid"), enums["method"].pop("edges")) == (3, 4)
    # A mark that holds its distance was in focus.
    assert settings.pop("focus_by") == "DISTANCE" and enums.pop("focus_by")
    del settings["focus_points"], settings["focus_frame"]
    assert settings["marks"].pop("is_first")
    # A radius that is not 0 is what is stored.
    assert settings.pop("follows_blur")
    (mark,) = settings["marks"]["items"]
    (place,) = mark.pop("places")
    views = {name: mark.pop(name) for name in ("frame", "easing", "pull", "holds")}
    assert place["points"] == [{"point": 1}] and place["through_points"] and place["has_world"]
    assert place["xy"][0] < 0
    focus = Focus((1,), through_points=True)
    return views, (focus, place["frame"], place["distance"], place["source"], place["world"])


def test_there_is_one_of_the_first_release() -> None:
    assert "1.0.0" in [file.stem for file in FILES]


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.stem))
def test_the_settings_of_a_release_are_there(registered: None, file: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(file), load_ui=False)
    scene = bpy.context.scene
    assert scene.render.engine == stored_settings.ENGINE
    before = json.loads(file.with_suffix(".json").read_text())
    if file.stem == "1.0.0":
        views, taken = taken_over(before)
        (mark,) = scene.virtual_aperture.marks.items
        assert {name: getattr(mark, name) for name in views} == views
        (place,) = mark.places
        assert (place.focus, place.frame, place.distance, place.source, list(place.world)) == taken
        assert place.xy is None and scene.virtual_aperture.marks.is_first
    assert lost(before, stored_settings.held_by(scene)) == []


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.stem))
def test_stored_values_are_not_the_defaults(registered: None, file: Path) -> None:
    """A value that is lost could not be told from one that stayed."""
    bpy.ops.wm.read_homefile(app_template="", use_empty=True, use_factory_startup=True)
    before = json.loads(file.with_suffix(".json").read_text())["values"]
    now = stored_settings.held_by(bpy.context.scene)["values"]
    gone = lost(before, now)
    assert len(gone) > 60
    same = [name for name, value in before["scene"].items() if now["scene"].get(name) == value]
    # Objects that nothing was drawn with.
    assert set(same) <= {"mask"}, same


@pytest.mark.parametrize("number", [3, 4], ids=["grid", "edges"])
def test_a_method_that_is_gone_becomes_the_one_most_like_it(
    registered: None, tmp_path: Path, number: int
) -> None:
    bpy.ops.wm.read_homefile(use_empty=True)
    stored: Any = bpy.context.scene.virtual_aperture.bl_system_properties_get(do_create=True)
    stored["method"] = number
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    assert bpy.context.scene.virtual_aperture.method == "features"
