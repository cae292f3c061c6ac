"""The nearest person in focus after a solve."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.core.camera.reconstruction import Image, Points
from addon.core.focus.focus import Focus
from addon.core.focus.place import Place
from addon.core.media.clip import open_footage
from addon.core.subjects.networks import Networks
from addon.scene.build import build
from addon.scene.focus import focus_marks
from addon.scene.lens import depth_of_field
from addon.ui import panels
from addon.ui.footage import solve
from addon.ui.jobs import first_person

from .. import planes
from ..recorder import draw
from ..subjects import walls

FEW = tuple(range(11, 22))


def test_the_aperture_is_chosen_again_for_a_person_before_a_camera_that_stays(
    scene: bpy.types.Scene, tmp_path: Path
) -> None:
    """All points of such a solve are at one distance, which the first focus is at."""
    footage = open_footage(planes.write_clip(tmp_path / "still", [walls.still(each) for each in FEW], FEW[0]))
    moving = walls.filmed(walls.still, FEW).reconstruction
    camera = moving.cameras[0]
    x, y = np.meshgrid(np.linspace(5, camera.width - 5, 12), np.linspace(5, camera.height - 5, 8))
    xy = np.column_stack([x.ravel(), y.ravel()])
    rays = np.column_stack([(xy - camera.principal_point) / camera.focal, np.ones(len(xy))])
    xyz = 10 * rays / np.linalg.norm(rays, axis=1, keepdims=True)
    seen = np.arange(len(xy), dtype=np.int32)
    images = tuple(Image(each, np.eye(3), np.zeros(3), xy, seen) for each in FEW)
    points = Points(xyz, np.zeros((len(xy), 3), np.uint8), np.zeros(len(xy)))
    still = replace(moving, images=images, points=points)
    assert still.stays
    settings = build(scene, footage, still)
    wished = settings.blur
    focus_marks.set_first(settings, still)
    assert settings.marks.is_first and settings.aperture_radius > 0
    followed = dict.fromkeys(FEW, 2.5)
    focus_marks.put_first(settings, Place(Focus(distance=2.5), FEW[0], 2.5, "somebody", followed=followed))
    assert settings.blur == pytest.approx(wished, rel=0.05)


def test_the_nearest_person_takes_the_place_of_the_first_focus(
    scene: bpy.types.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not Networks().exist:
        pytest.skip("the networks are not in addon/networks: run tools/networks.py")
    pictures = [walls.with_person(frame)[..., ::-1] for frame in FEW]
    footage = open_footage(planes.write_clip(tmp_path / "walls", pictures, FEW[0]))
    reconstruction = walls.filmed(walls.with_person, FEW).reconstruction
    settings = build(scene, footage, reconstruction)
    focus_marks.set_first(settings, reconstruction)
    assert settings.marks.is_first and not settings.marks.items[0].places[0].followed
    focus_marks.put_first(settings, Place(Focus(distance=walls.FAR), FEW[0], walls.FAR, "the far wall"))
    blur = settings.blur
    first_person.focus(scene)
    (mark,) = settings.marks.items
    assert settings.marks.is_first and mark.name == "Subject" and mark.frame in FEW
    assert list(mark.places[0].followed) == list(FEW)
    assert settings.focus_distance == pytest.approx(walls.NEAR, rel=0.02)
    assert settings.blur == pytest.approx(blur, rel=1e-5)
    assert "In focus: the nearest person" in " ".join(draw(panels.main.VIRTUAL_APERTURE_PT_main).texts)
    missing = "People are not recognized: this build of the extension has no networks"
    details = panels.notices.VIRTUAL_APERTURE_PT_details
    assert missing not in " ".join(draw(details).texts)
    monkeypatch.setattr(Networks, "exist", False)
    assert missing in " ".join(draw(details).texts)
    # Another focus that somebody has picked stays.
    focus_marks.put(settings, FEW[2], [Place(Focus(distance=5.0), FEW[2], 5.0, "a distance")])
    first_person.focus(scene)
    assert not settings.marks.is_first and settings.marks.items[0].distance == 5.0
    assert missing not in " ".join(draw(panels.main.VIRTUAL_APERTURE_PT_main).texts)


def test_people_give_a_scale_that_is_marked_as_a_guess(
    scene: bpy.types.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    footage = open_footage(planes.write_clip(tmp_path / "still", [walls.still(each) for each in FEW], FEW[0]))
    settings = build(scene, footage, walls.filmed(walls.still, FEW).reconstruction)
    place = Place(Focus(distance=4.0), FEW[0], 4.0, "an object")
    focus_marks.put_first(settings, place)
    blur = settings.blur
    assert not {"f_stop"} & set(draw(panels.main.VIRTUAL_APERTURE_PT_main).props)
    monkeypatch.setattr(first_person, "nearest_subject", lambda clip: place)
    monkeypatch.setattr(first_person, "scale_by_people", lambda clip: 0.5)
    first_person.focus(scene)
    assert settings.guessed_scale == 0.5 and settings.metres_per_unit == 0
    assert settings.subject_metres == pytest.approx(2.0) and settings.blur == pytest.approx(blur, rel=1e-5)
    shown = draw(panels.main.VIRTUAL_APERTURE_PT_main)
    assert any(text.startswith("Gives f/") and "(guess)" in text for text in shown.texts)
    assert {"virtual_aperture.set_amount_by", "virtual_aperture.set_scale"} <= set(shown.operators)
    # A given scale counts before the guess, and another solve forgets both.
    settings.metres_per_unit = 2.0
    assert settings.subject_metres == pytest.approx(8.0)
    depth_of_field.forget_scale(settings)
    assert settings.guessed_scale == settings.metres_per_unit == 0


@pytest.mark.long
def test_the_nearest_person_is_suggested(scene: bpy.types.Scene, tmp_path: Path) -> None:
    if not Networks().exist:
        pytest.skip("the networks are not in addon/networks: run tools/networks.py")
    pictures = [walls.with_person(frame)[..., ::-1] for frame in FEW]
    footage = open_footage(planes.write_clip(tmp_path / "walls", pictures, FEW[0]))
    settings = build(scene, footage, walls.filmed(walls.with_person, FEW).reconstruction)
    assert bpy.ops.virtual_aperture.suggest_marks() == {"FINISHED"}
    (suggested,) = settings.marks.suggested
    assert suggested.name == "Nearest person" and not len(settings.marks.items)
    assert bpy.ops.virtual_aperture.take_suggestion(frame=FEW[0]) == {"FINISHED"}
    (mark,) = settings.marks.items
    assert mark.name == "Subject" and mark.frame == FEW[0] and list(mark.places[0].followed) == list(FEW)
    assert settings.focus_distance == pytest.approx(walls.NEAR, rel=0.02)


def test_a_first_focus_without_a_place_is_a_distance(scene: bpy.types.Scene, tmp_path: Path) -> None:
    """As where the camera turns away from the first place, or passes it."""
    footage = open_footage(planes.write_clip(tmp_path / "still", [walls.still(each) for each in FEW], FEW[0]))
    settings = build(scene, footage, walls.filmed(walls.still, FEW).reconstruction)
    focus_marks.put_first(settings, Place(Focus(distance=6.0), FEW[0], 6.0, "a fixed distance"))
    assert solve.solved_words(scene).startswith("Solved, and focused on a fixed distance")
    assert "In focus: a fixed distance" in " ".join(draw(panels.main.VIRTUAL_APERTURE_PT_main).texts)
