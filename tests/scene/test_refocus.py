"""A focus that outlives a new solve of the same clip."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.core.camera.reconstruction import Intrinsics, Points, Reconstruction
from addon.core.focus.focus import Focus
from addon.core.focus.transfer import carry_focus, depth_ratio
from addon.core.media.clip import open_footage
from addon.core.sfm.process import SolveProcess
from addon.scene.build import build
from addon.scene.focus.focus_marks import set_focus
from addon.scene.focus.refocus import keep_focus, restore_focus
from addon.scene.lens import lens
from addon.ui.base.solving import Solving
from addon.ui.footage.solve import kept_words

from .. import planes
from ..scenes import slanted_plane, write_frames

LENS = Intrinsics(640, 360, 560.0, 560.0, 320.0, 180.0)
FRAMES = (1, 2, 3, 4)
PICKED = (7, 30, 31, 90)


def solved_anew(
    old: Reconstruction, scale: float = 3.0, without: tuple[int, ...] = (), frames: tuple[int, ...] = FRAMES
) -> Reconstruction:
    """The same scene in other units, with the points in another order, and some of them not found."""
    rng = np.random.default_rng(0)
    kept = rng.permutation([p for p in range(len(old.points)) if p not in without])
    number = np.full(len(old.points), -1)
    number[kept] = np.arange(len(kept))
    images = []
    for image in old.images:
        if image.frame in frames:
            seen = np.isin(image.points, kept)
            xy = image.xy[seen] + rng.normal(0, 0.2, (seen.sum(), 2))
            points = number[image.points[seen]].astype(np.int32)
            images.append(replace(image, translation=image.translation * scale, xy=xy, points=points))
    points = old.points
    return Reconstruction(
        old.cameras, tuple(images), Points(points.xyz[kept] * scale, points.rgb[kept], points.error[kept])
    )


@pytest.fixture
def old() -> Reconstruction:
    # Neighbours are some 30 pixels apart.
    return slanted_plane(LENS, FRAMES)


def test_points_are_found_by_their_places(old: Reconstruction) -> None:
    new = solved_anew(old)
    carried = carry_focus(old, new, Focus(PICKED), 2)
    assert carried.scale == pytest.approx(3.0, rel=0.01)
    np.testing.assert_allclose(
        new.points.xyz[list(carried.focus.points)], 3 * old.points.xyz[list(PICKED)], rtol=1e-9
    )


def test_a_point_that_was_not_found_again_is_left_out(old: Reconstruction) -> None:
    new = solved_anew(old, without=PICKED[:2])
    found = carry_focus(old, new, Focus(PICKED), 2).focus.points
    np.testing.assert_allclose(new.points.xyz[list(found)], 3 * old.points.xyz[list(PICKED[2:])], rtol=1e-9)
    # Two make no plane.
    through = Focus(PICKED, through_points=True)
    assert carry_focus(old, new, through, 2).focus.points == ()
    # One alone tells no depth.
    assert carry_focus(old, solved_anew(old, without=PICKED[:3]), Focus(PICKED), 2).focus.points == ()


def test_a_point_on_another_surface_close_by_is_not_taken(old: Reconstruction) -> None:
    new = solved_anew(old)
    image = new.images[0]
    xyz = new.points.xyz.copy()
    for place in old.points.xyz[list(PICKED)] * 3:
        # On the same ray of the frame the focus was picked in, half as far.
        xyz[np.argmin(np.linalg.norm(new.points.xyz - place, axis=1))] = image.centre + 0.5 * (
            place - image.centre
        )
    new = replace(new, points=replace(new.points, xyz=xyz))
    assert carry_focus(old, new, Focus(PICKED), 1).focus.points == ()


def test_lengths_follow_the_scale(old: Reconstruction) -> None:
    new = solved_anew(old, 0.25)
    carried = carry_focus(old, new, Focus(distance=8.0), 2)
    assert carried.focus.points == ()
    assert carried.focus.distance == pytest.approx(2.0, rel=0.01)
    # Where hardly a feature is common, by the medians.
    few = solved_anew(old, 0.25, without=tuple(range(5, 150)))
    assert depth_ratio(old, few, 2) == pytest.approx(0.25, rel=0.3)


def scene_of(scene: bpy.types.Scene, folder: Path, old: Reconstruction) -> bpy.types.PropertyGroup:
    return build(scene, open_footage(write_frames(folder, LENS, FRAMES)), old)


def again(settings: bpy.types.PropertyGroup, new: Reconstruction, folder: Path) -> str:
    kept = keep_focus(settings, folder)
    assert kept is not None
    build(settings.id_data, open_footage(folder), new)
    return restore_focus(settings, kept, new)


def test_points_distance_aperture_and_keys_are_kept(
    scene: bpy.types.Scene, tmp_path: Path, old: Reconstruction
) -> None:
    settings = scene_of(scene, tmp_path, old)
    set_focus(settings, Focus(PICKED), 2)
    settings.aperture_radius = 0.1
    distance = settings.focus_distance
    settings.keyframe_insert("focus_distance", frame=1)
    for frame, value in ((1, 4.0), (4, 8.0)):
        settings.focus_distance = value
        settings.keyframe_insert("focus_distance", frame=frame)
    settings.focus_distance = distance
    assert again(settings, solved_anew(old), tmp_path) == ""
    assert len(settings.marks.points) == 4 and settings.marks.items[0].frame == 2
    assert settings.focus_distance == pytest.approx(3 * distance, rel=0.01)
    assert settings.aperture_radius == pytest.approx(0.3, rel=0.01)
    scene.frame_set(1)
    assert settings.focus_distance == pytest.approx(12, rel=0.01)
    scene.frame_set(4)
    assert settings.focus_distance == pytest.approx(24, rel=0.01)


def test_a_focus_that_is_gone_stays_at_its_distance_and_says_so(
    scene: bpy.types.Scene, tmp_path: Path, old: Reconstruction
) -> None:
    settings = scene_of(scene, tmp_path, old)
    set_focus(settings, Focus(PICKED), 2)
    distance = settings.focus_distance
    note = again(settings, solved_anew(old, without=PICKED), tmp_path)
    assert "were not found again" in note
    assert not lens.focus_of(settings).points
    assert settings.focus_distance == pytest.approx(3 * distance, rel=0.01)


def test_another_clips_focus_is_not_kept(scene: bpy.types.Scene, tmp_path: Path, old: Reconstruction) -> None:
    settings = scene_of(scene, tmp_path / "one", old)
    assert keep_focus(settings, tmp_path / "one") is None
    set_focus(settings, Focus(PICKED), 2)
    assert keep_focus(settings, tmp_path / "one") is not None
    assert keep_focus(settings, write_frames(tmp_path / "other", LENS, FRAMES[:2])) is None
    settings.points = None
    assert keep_focus(settings, tmp_path / "one") is None


@pytest.mark.long
def test_solving_again_keeps_the_focus_and_one_at_a_time(scene: bpy.types.Scene, tmp_path: Path) -> None:
    clip = planes.write_clip(tmp_path / "walk", planes.sideways(12))
    settings = scene.virtual_aperture
    settings.footage, settings.work_dir = str(clip), str(tmp_path / "work")
    settings.lens, settings.equivalent = "GIVEN", 29.42  # solved in half the time
    bpy.ops.virtual_aperture.solve()
    set_focus(settings, Focus((3, 4, 5)), 6)
    distance = settings.focus_distance
    assert kept_words(tmp_path / "work").startswith("Solve of ")
    assert ": 12 of 12 frames, " in kept_words(tmp_path / "work")
    other = SolveProcess(clip, tmp_path / "work", again=True)
    with pytest.raises(RuntimeError, match=r"is being solved into here .*\(Working Folder\)"):
        bpy.ops.virtual_aperture.solve(again=True)
    Solving.running = solving = Solving(lambda: other)
    solving.poll()
    try:
        with pytest.raises(RuntimeError, match="A clip is being solved; ESC cancels it"):
            bpy.ops.virtual_aperture.solve(again=True)
    finally:
        solving.cancel()
    assert bpy.ops.virtual_aperture.solve(again=True) == {"FINISHED"}
    Solving.running = None
    assert len(settings.marks.points) == 3 and settings.marks.items[0].frame == 6
    assert settings.focus_distance == pytest.approx(distance, rel=0.02)
