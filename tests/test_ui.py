"""Operators and panels with the real module."""

from __future__ import annotations

from pathlib import Path

import bpy
import pytest

import addon
from addon.core.reconstruction import Intrinsics
from addon.scene.build import build
from addon.ui import panels

from . import planes
from .scenes import slanted_shot

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)


def select(points: bpy.types.Object, ids: tuple[int, ...]) -> None:
    import bmesh  # the module's own, there only after bpy

    bpy.context.view_layer.objects.active = points
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="DESELECT")
    mesh = bmesh.from_edit_mesh(points.data)
    mesh.verts.ensure_lookup_table()
    for index in ids:
        mesh.verts[index].select_set(True)
    bmesh.update_edit_mesh(points.data)


def test_buttons_say_why_they_are_disabled(scene: bpy.types.Scene, tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="Choose a clip first"):
        bpy.ops.virtual_aperture.solve()
    for operator in (bpy.ops.virtual_aperture.set_focus, bpy.ops.virtual_aperture.render_frame):
        with pytest.raises(RuntimeError, match="Solve the clip first"):
            operator()
    shot = slanted_shot(tmp_path, LENS)
    build(scene, shot.footage, shot.reconstruction)
    with pytest.raises(RuntimeError, match="press Tab for Edit Mode"):
        bpy.ops.virtual_aperture.set_focus()
    with pytest.raises(RuntimeError, match="set the focus first"):
        bpy.ops.virtual_aperture.render_clip()


def test_focus_from_selected_vertices(scene: bpy.types.Scene, tmp_path: Path) -> None:
    shot = slanted_shot(tmp_path, LENS)
    settings = build(scene, shot.footage, shot.reconstruction)
    scene.frame_set(2)
    select(settings.points, (7,))
    with pytest.raises(RuntimeError, match="1 vertices are selected; select at least two"):
        bpy.ops.virtual_aperture.set_focus()
    select(settings.points, (7, 11, 30))
    assert bpy.ops.virtual_aperture.set_focus() == {"FINISHED"}
    assert [entry.point for entry in settings.focus_points] == [7, 11, 30]
    assert settings.focus_frame == 2
    assert settings.points.mode == "OBJECT"
    # IDs stay when vertices before them are deleted.
    select(settings.points, (0, 1, 2))
    bpy.ops.mesh.delete(type="VERT")
    select(settings.points, (4, 8))
    assert bpy.ops.virtual_aperture.set_focus() == {"FINISHED"}
    assert [entry.point for entry in settings.focus_points] == [7, 11]
    assert len(settings.aperture.data.vertices) > 0


def test_render_frame_and_clip_write_pictures(scene: bpy.types.Scene, tmp_path: Path) -> None:
    shot = slanted_shot(tmp_path / "clip", LENS)
    settings = build(scene, shot.footage, shot.reconstruction)
    settings.focus_distance = 8.0
    settings.views = 4
    settings.blur = -1
    assert settings.blur > 0
    scene.render.filepath = str(tmp_path / "out" / "####.png")
    scene.render.engine = "CYCLES"
    assert bpy.ops.virtual_aperture.render_frame() == {"FINISHED"}
    assert scene.render.engine == "VIRTUAL_APERTURE"
    assert bpy.ops.virtual_aperture.render_clip() == {"FINISHED"}
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["0001.png", "0002.png", "0003.png"]


def test_scene_changes_can_be_undone() -> None:
    for name in ("VIRTUAL_APERTURE_OT_solve", "VIRTUAL_APERTURE_OT_set_focus"):
        assert "UNDO" in getattr(bpy.types, name).bl_options


class Recorder:
    """A layout that remembers what was drawn."""

    def __init__(self) -> None:
        self.drawn: list[str] = []

    def __getattr__(self, name: str) -> object:
        return lambda *args, **_: self.drawn.append(str(args[-1] if args else name)) or self


@pytest.mark.parametrize("solved", [False, True])
def test_panels_draw(scene: bpy.types.Scene, tmp_path: Path, solved: bool) -> None:
    if solved:
        shot = slanted_shot(tmp_path, LENS)
        build(scene, shot.footage, shot.reconstruction)
    drawn: list[str] = []
    for panel in panels.CLASSES:
        assert panel.bl_category == "Virtual Aperture"
        layout = Recorder()
        panel.draw(type("Self", (), {"layout": layout})(), bpy.context)
        drawn += layout.drawn
    for wanted in ("footage", "virtual_aperture.solve", "virtual_aperture.set_focus", "blur", "views"):
        assert wanted in drawn
    assert {"virtual_aperture.render_frame", "virtual_aperture.render_clip"} <= set(drawn)


def test_register_again(registered: None) -> None:
    addon.unregister()
    assert not hasattr(bpy.types.Scene, "virtual_aperture")
    addon.register()
    assert hasattr(bpy.types.Scene, "virtual_aperture")


def test_solving_brings_the_clip_into_its_scene(scene: bpy.types.Scene, tmp_path: Path) -> None:
    clip = planes.write_clip(tmp_path / "walk", planes.sideways(12))
    settings = scene.virtual_aperture
    settings.footage, settings.work_dir = str(clip), str(tmp_path / "work")
    assert bpy.ops.virtual_aperture.solve() == {"FINISHED"}
    assert len(settings.points.data.vertices) > 50 and scene.camera == settings.camera
    before = (tmp_path / "work" / "solve.json").stat().st_mtime_ns
    assert bpy.ops.virtual_aperture.solve() == {"FINISHED"}
    assert (tmp_path / "work" / "solve.json").stat().st_mtime_ns == before
    assert bpy.ops.virtual_aperture.solve(again=True) == {"FINISHED"}
    assert (tmp_path / "work" / "solve.json").stat().st_mtime_ns > before
    settings.lens, settings.equivalent = "GIVEN", 36.0
    assert bpy.ops.virtual_aperture.solve() == {"FINISHED"}
    # 320x240 pixels lie on 34.6x26.0 mm of the 35 mm film's diagonal.
    assert settings.camera.data.lens == pytest.approx(36.0 * 36.0 / 34.61, rel=1e-3)
    settings.footage = str(tmp_path / "gone")
    with pytest.raises(RuntimeError, match="does not exist"):
        bpy.ops.virtual_aperture.solve()
    assert settings.points is not None
