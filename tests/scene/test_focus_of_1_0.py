"""A .blend that version 1.0 stored, at commit 9ca72518, has the same focus in this version.

Its scenes have each another kind of focus, and its JSON what 1.0 draws: at every frame points, plane through
them, tilt, inverse depth and aperture radius, and the marks.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy
import pytest

from addon.core.focus.focus import Focus
from addon.scene.focus import focus_curve, focus_marks
from addon.scene.lens import lens
from addon.scene.sources.shot import reconstruction_of

STORED = Path(__file__).parent / "stored_focus" / "1.0.0.blend"
EXPECTED: dict[str, Any] = json.loads(STORED.with_suffix(".json").read_text())
BY_SCRIPT = {"script": "Point cloud", "plane": "Point cloud", "by_distance": "Distance"}
"""Scenes whose focus had no mark in 1.0, and has one now."""


@pytest.fixture
def opened(registered: None) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(STORED), load_ui=False)


def drawn(scene: bpy.types.Scene, frame: int) -> list[Any]:
    settings = scene.virtual_aperture
    solve = reconstruction_of(settings)
    scene.frame_set(frame)
    focus = lens.focus_of(settings)
    radius = lens.frame_options(settings, solve).radius
    return [
        list(focus.points), focus.through_points, focus.tilt, focus.inverse_depth(solve, frame), radius,
    ]  # fmt: skip


def check(scene: bpy.types.Scene, expected: dict[str, Any]) -> None:
    settings = scene.virtual_aperture
    for frame, before in enumerate(expected["frames"], 1):
        now = drawn(scene, frame)
        assert now[:2] == before[:2] and now[2:] == pytest.approx(before[2:], rel=1e-6)
    marks = [[m.frame, m.name, m.distance, m.easing, m.pull, m.holds] for m in settings.marks.items]
    if scene.name.split(".")[0] in BY_SCRIPT:
        assert [mark[1] for mark in marks] == [BY_SCRIPT[scene.name.split(".")[0]]]
    else:
        assert marks == expected["marks"]
    assert settings.marks.is_first == expected["is_first"]


@pytest.mark.parametrize("name", EXPECTED)
def test_the_focus_of_1_0_is_the_same(opened: None, name: str) -> None:
    check(bpy.data.scenes[name], EXPECTED[name])


@pytest.mark.parametrize("name", ["script", "pull", "first"])
def test_the_focus_of_an_appended_scene_is_the_same(scene: bpy.types.Scene, name: str) -> None:
    with bpy.data.libraries.load(str(STORED)) as (_, wanted):
        wanted.scenes = [name]
    check(wanted.scenes[0], EXPECTED[name])


@pytest.mark.parametrize("name", ["script", "pull", "picked", "first"])
def test_marks_of_1_0_are_written_and_kept(opened: None, tmp_path: Path, name: str) -> None:
    settings = bpy.data.scenes[name].virtual_aperture
    assert not focus_curve.is_users(settings)
    focus_marks.write(settings)
    check(bpy.data.scenes[name], EXPECTED[name])
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "now.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "now.blend"))
    check(bpy.data.scenes[name], EXPECTED[name])


def test_what_is_followed_is_kept(opened: None) -> None:
    world, both, bare = bpy.data.scenes["pull"].virtual_aperture.marks.items
    (place,) = world.places
    assert place.world == pytest.approx([0.2, -0.1, 7.0]) and place.xy == pytest.approx((0.52, 0.47))
    mover, points = both.places
    assert mover.followed == {4: 4.5, 5: 4.0, 6: 3.5} and points.focus == Focus((5, 6))
    assert bare.places[0].focus == Focus(distance=12.0)


def test_a_pick_replaces_a_focus_of_1_0(opened: None) -> None:
    settings = bpy.data.scenes["script"].virtual_aperture
    settings.focus_distance = 7.5
    assert lens.focus_of(settings) == Focus(distance=7.5)
    focus_marks.clear(settings)
    settings.focus_distance = 0.0
    assert not lens.is_in_focus(settings)
