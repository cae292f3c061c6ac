"""What a render said of its frames, in the panel."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy

from addon.core.camera.reconstruction import Intrinsics
from addon.render.views import frame_notes
from addon.scene.build import build
from addon.ui import panels
from addon.ui.jobs.report_list import next_of

from ..recorder import draw
from ..scenes import slanted_plane, slanted_shot

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)


def test_frames_without_a_camera_are_listed(scene: bpy.types.Scene, tmp_path: Path) -> None:
    frames = (1, 2, 3, 4, 5, 6)
    shot = slanted_shot(tmp_path / "clip", LENS, frames)
    whole = slanted_plane(LENS, frames)
    some = replace(whole, images=tuple(image for image in whole.images if image.frame in (1, 3, 6)))
    settings = build(scene, shot.footage, some)
    settings.focus_distance, settings.views, settings.method = 8.0, 4, "features"
    panel = panels.notices.VIRTUAL_APERTURE_PT_details
    assert "The Last Render" not in draw(panel).texts
    scene.render.filepath = str(tmp_path / "out" / "####.png")
    bpy.ops.render.render(animation=True)
    notes = frame_notes.of(scene)
    assert [note.frames for note in notes] == [(2, 4, 5)]
    texts = " ".join(draw(panel).texts)
    assert "Frames 2, 4-5: was not solved" in texts
    assert "virtual_aperture.jump_to_frame" in draw(panel).operators
    scene.frame_set(1)
    assert bpy.ops.virtual_aperture.jump_to_frame(frame=4) == {"FINISHED"}
    assert scene.frame_current == 4
    # The next render begins anew.
    scene.frame_set(1)
    bpy.ops.render.render()
    assert frame_notes.of(scene) == []
    assert "The Last Render" not in draw(panel).texts


def test_a_jump_goes_on() -> None:
    assert [next_of((2, 4, 5), now) for now in (1, 2, 4, 5, 9)] == [2, 4, 5, 2, 2]
