"""The focus that a solve begins with."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np

from addon.core.camera.reconstruction import Intrinsics
from addon.scene.build import build
from addon.scene.focus import focus_marks
from addon.scene.lens import lens

from ..scenes import slanted_shot

LENS = Intrinsics(160, 120, 160.0, 160.0, 80.0, 60.0)


def test_a_camera_that_turns_away_from_the_first_focus_keeps_its_distance(
    scene: bpy.types.Scene, tmp_path: Path
) -> None:
    shot = slanted_shot(tmp_path / "clip", LENS)
    first, *others, last = shot.reconstruction.images
    away = replace(last, rotation=np.diag([-1.0, 1.0, -1.0]) @ last.rotation, translation=np.zeros(3))
    turned = replace(shot.reconstruction, images=(first, *others, away))
    settings = build(scene, shot.footage, turned)
    focus_marks.set_first(settings, turned)
    focus = lens.focus_of(settings)
    assert settings.marks.is_first and not focus.points
    assert settings.marks.items[0].places[0].source == "a fixed distance"
    distance = focus.inverse_depth(turned, first.frame)
    assert focus.inverse_depth(turned, last.frame) == distance


def test_a_camera_that_passes_the_first_focus_keeps_its_distance(
    scene: bpy.types.Scene, tmp_path: Path
) -> None:
    shot = slanted_shot(tmp_path / "clip", LENS)
    first, *others, last = shot.reconstruction.images
    settings = build(scene, shot.footage, shot.reconstruction)
    focus_marks.set_first(settings, shot.reconstruction)
    distance = settings.focus_distance
    focus_marks.clear(settings)
    settings.focus_distance = 0.0
    near = replace(last, translation=last.translation - [0.0, 0.0, 0.8 * distance])
    moved = replace(shot.reconstruction, images=(first, *others, near))
    settings = build(scene, shot.footage, moved)
    focus_marks.set_first(settings, moved)
    assert settings.marks.is_first and not lens.focus_of(settings).points


def test_points_stay_in_focus_where_every_camera_has_them_ahead(
    scene: bpy.types.Scene, tmp_path: Path
) -> None:
    shot = slanted_shot(tmp_path / "clip", LENS)
    settings = build(scene, shot.footage, shot.reconstruction)
    focus_marks.set_first(settings, shot.reconstruction)
    assert lens.focus_of(settings).points
