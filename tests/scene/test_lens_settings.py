"""Focus, blur and aperture radius as the user sets them."""

from __future__ import annotations

from pathlib import Path

import bpy
import pytest

from addon.core.base.errors import UserError
from addon.core.camera.reconstruction import Intrinsics
from addon.core.focus.focus import Focus, radius_for_blur
from addon.scene.build import build
from addon.scene.focus import focus_marks
from addon.scene.focus.focus_marks import set_focus
from addon.scene.lens import lens
from addon.scene.lens.lens import frame_options
from addon.scene.solve.camera import curves_of
from addon.scene.sources.shot import Shot

from ..scenes import slanted_shot

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
PICKED = (3, 9, 30, 60)


@pytest.fixture
def shot(tmp_path: Path) -> Shot:
    return slanted_shot(tmp_path / "clip", LENS, tuple(range(1, 6)))


@pytest.fixture
def settings(scene: bpy.types.Scene, shot: Shot) -> bpy.types.PropertyGroup:
    return build(scene, shot.footage, shot.reconstruction)


def radii(scene: bpy.types.Scene, shot: Shot) -> list[float]:
    """The aperture's radius at every frame, as the engine reads it."""
    found = []
    for frame in shot.footage.frames:
        scene.frame_set(frame)
        evaluated = scene.evaluated_get(bpy.context.evaluated_depsgraph_get())
        found.append(frame_options(evaluated.virtual_aperture, shot.reconstruction).radius)
    return found


def depth(shot: Shot, frame: int) -> float:
    return 1 / Focus(points=PICKED).inverse_depth(shot.reconstruction, frame)


def test_the_lens_stays_the_same_while_the_focus_is_pulled(scene, shot, settings) -> None:
    scene.frame_set(1)
    settings.focus_distance = 6.0
    assert scene.keyframe_insert("virtual_aperture.focus_distance")
    scene.frame_set(5)
    settings.focus_distance = 12.0
    assert scene.keyframe_insert("virtual_aperture.focus_distance")
    scene.frame_set(1)
    assert settings.focus_distance == pytest.approx(6.0)
    expected = radius_for_blur(shot.reconstruction, Focus(distance=6.0), 1, 0.03)
    assert radii(scene, shot) == [pytest.approx(expected, rel=1e-5)] * 5


def test_picked_points_set_the_distance_that_can_be_keyed(scene, shot, settings) -> None:
    set_focus(settings, Focus(points=PICKED), 2)
    assert settings.focus_distance == pytest.approx(depth(shot, 2))
    assert lens.focus_of(settings).points == PICKED
    scene.frame_set(2)
    radius = settings.aperture_radius
    assert settings.aperture_radius > 0
    assert radius == pytest.approx(radius_for_blur(shot.reconstruction, Focus(points=PICKED), 2, 0.03))
    scene.keyframe_insert("virtual_aperture.focus_distance")
    scene.frame_set(5)
    settings.focus_distance = 11.0
    scene.keyframe_insert("virtual_aperture.focus_distance")
    # The points are kept in the mark, the keyed distance is active.
    assert settings.marks.points == PICKED
    assert lens.focus_of(settings) == Focus(distance=11.0)
    assert radii(scene, shot) == [pytest.approx(radius)] * 5
    curves_of(settings.id_data).remove(lens.keys_of(settings, "focus_distance"))
    assert lens.focus_of(settings).points == PICKED


def test_a_first_distance_is_dragged_with_the_blur_kept(scene, shot, settings) -> None:
    for distance in (0.1, 1.0, 5.0, 6.5):
        settings.focus_distance = distance
    assert settings.blur == pytest.approx(0.03)
    expected = radius_for_blur(shot.reconstruction, Focus(distance=6.5), 1, 0.03)
    assert settings.aperture_radius == pytest.approx(expected, rel=1e-5)
    # From then on the lens is what it is.
    settings.aperture_radius = 0.2
    settings.focus_distance = 9.0
    assert settings.aperture_radius == pytest.approx(0.2)
    expected = 0.2 / radius_for_blur(shot.reconstruction, Focus(distance=9.0), 1, 1.0)
    assert settings.blur == pytest.approx(expected, rel=1e-5)


def test_blur_sets_the_radius_and_the_radius_shows_its_blur(scene, shot, settings) -> None:
    set_focus(settings, Focus(points=PICKED), 1)
    scene.frame_set(3)
    settings.blur = 0.05
    # At the mark, whatever frame is shown.
    expected = radius_for_blur(shot.reconstruction, Focus(points=PICKED), 1, 0.05)
    assert settings.aperture_radius == pytest.approx(expected, rel=1e-5)
    assert settings.blur == pytest.approx(0.05)
    settings.aperture_radius = 0.1
    # What results at the frame that is shown.
    expected = 0.1 / radius_for_blur(shot.reconstruction, Focus(points=PICKED), 3, 1.0)
    assert settings.blur == pytest.approx(expected, rel=1e-5)
    assert settings.aperture_radius == pytest.approx(0.1)
    # Another pick looks through the same lens.
    set_focus(settings, Focus(points=(7, 8)), 2)
    assert settings.aperture_radius == pytest.approx(0.1)
    scene.frame_set(2)
    expected = 0.1 / radius_for_blur(shot.reconstruction, Focus(points=(7, 8)), 2, 1.0)
    assert settings.blur == pytest.approx(expected, rel=1e-5)


def pull(scene, settings) -> float:
    """Focus pulled from 6 to 12 units over the clip, chosen with a blur of 0.06 at its first frame; the
    aperture's radius."""
    settings.blur = 0.06
    for frame, distance in ((1, 6.0), (5, 12.0)):
        scene.frame_set(frame)
        settings.focus_distance = distance
        scene.keyframe_insert("virtual_aperture.focus_distance")
    return float(settings.aperture_radius)


def test_the_blur_that_an_aperture_gives_is_that_of_the_frame(scene, shot, settings) -> None:
    radius, shown = pull(scene, settings), []
    settings.aperture_radius = radius
    for frame in shot.footage.frames:
        scene.frame_set(frame)
        focus = Focus(distance=settings.focus_distance)
        expected = radius / radius_for_blur(shot.reconstruction, focus, frame, 1.0)
        assert settings.blur == pytest.approx(expected, rel=1e-5)
        shown.append(settings.blur)
    assert shown[0] == pytest.approx(0.06) and len({round(blur, 4) for blur in shown}) == len(shown)
    # Points in focus have another distance at every frame, too.
    scene.animation_data_clear()
    set_focus(settings, Focus(points=PICKED), 1)
    scene.frame_set(4)
    expected = radius / radius_for_blur(shot.reconstruction, Focus(points=PICKED), 4, 1.0)
    assert settings.blur == pytest.approx(expected, rel=1e-5)


def test_the_blur_that_is_typed_is_that_of_the_first_mark(scene, shot, settings) -> None:
    pull(scene, settings)
    scene.frame_set(4)
    settings.blur = 0.02
    expected = radius_for_blur(shot.reconstruction, Focus(distance=6.0), 1, 0.02)
    assert settings.blur == pytest.approx(0.02, rel=1e-5)
    assert radii(scene, shot) == [pytest.approx(expected, rel=1e-5)] * 5


def test_a_first_key_of_the_blur_is_the_blur_that_is_shown(scene, settings) -> None:
    pull(scene, settings)
    scene.frame_set(3)
    shown = settings.blur
    scene.keyframe_insert("virtual_aperture.blur")
    # It counts itself from now on, and is what its curve says.
    for frame in (3, 5):
        scene.frame_set(frame)
        assert settings.blur == pytest.approx(shown, rel=1e-6)


def test_files_without_a_radius_render_as_before(scene, shot, settings) -> None:
    settings.focus_distance = 6.0
    settings.blur = 0.04
    expected = radius_for_blur(shot.reconstruction, Focus(distance=6.0), 1, 0.04)
    assert radii(scene, shot) == [pytest.approx(expected, rel=1e-5)] * 5
    # Whatever was keyed there counts, too.
    scene.keyframe_insert("virtual_aperture.blur", frame=1)
    settings.blur = 0.08
    scene.keyframe_insert("virtual_aperture.blur", frame=5)
    found = radii(scene, shot)
    assert found[0] == pytest.approx(expected, rel=1e-5)
    assert found[4] == pytest.approx(2 * expected, rel=1e-5)


def test_clearing_leaves_the_focus_at_its_distance(scene, shot, settings) -> None:
    set_focus(settings, Focus(points=PICKED), 1)
    radius = settings.aperture_radius
    focus_marks.clear(settings)
    assert lens.focus_of(settings).distance == pytest.approx(depth(shot, 1))
    assert settings.aperture_radius == pytest.approx(radius)
    settings.focus_distance = 0.0
    assert not lens.is_in_focus(settings)
    with pytest.raises(UserError, match="nothing is in focus"):
        lens.focus_of(settings).inverse_depth(shot.reconstruction, 1)


def test_automatic_views_are_no_views(settings) -> None:
    assert settings.views == 0 and settings.use_auto_views
    settings.use_auto_views = False
    assert settings.views == 64
    settings.views = 30
    settings.use_auto_views = True
    assert settings.views == 0
    set_focus(settings, Focus(points=PICKED), 1)
    settings.blur = 0.1
    shown = len(settings.aperture.data.vertices)
    settings.use_auto_views = False
    # What they were until now.
    assert settings.views == shown > 16


def test_highlights_are_boosted_in_stops(settings: bpy.types.PropertyGroup, shot: Shot) -> None:
    def gain() -> float:
        return frame_options(settings, shot.reconstruction).highlights.gain

    set_focus(settings, Focus(distance=6.0), 1)
    assert settings.restore_highlights and settings.highlight_boost == 0 and gain() == 1
    settings.highlight_boost = 2
    assert gain() == pytest.approx(4) and settings.highlight_boost == pytest.approx(2)
    settings.restore_highlights = True
    assert gain() == pytest.approx(4)
    settings.restore_highlights = False
    assert gain() == 0 and settings.highlight_boost == 0
    settings.restore_highlights = True
    assert gain() == 1
