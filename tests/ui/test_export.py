"""Export in the panel: files for other programs, from a process of their own; and Blender's own exporters."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import bpy
import pytest

from addon.core.base.worker import tend
from addon.core.media.clip import open_footage
from addon.scene.build import build
from addon.ui.jobs import export

from ..recorder import Recorder
from ..scenes import LENS, slanted_plane, write_plane
from ..waiting import until

COUNT = 6


@pytest.fixture
def clip(scene: bpy.types.Scene, tmp_path: Path) -> Iterator[Path]:
    """A clip of six frames, solved in the scene; a folder for files."""
    plane = slanted_plane(LENS, tuple(range(1, COUNT + 1)))
    build(scene, open_footage(write_plane(tmp_path / "clip", plane)), plane)
    yield tmp_path
    export.ExportJob.stop()


def shown() -> Recorder:
    """What the panel draws."""
    layout = Recorder()
    export.draw(layout, bpy.context)  # type: ignore[arg-type]
    return layout


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []


def test_files_are_exported_in_the_background(scene: bpy.types.Scene, clip: Path) -> None:
    assert shown().operators == ["virtual_aperture.export"]
    out = clip / "out"
    assert bpy.ops.virtual_aperture.export(directory=str(out), what="stmap") == {"FINISHED"}
    assert names(out) == ["redistort.exr", "undistort.exr"]
    assert "Exported to out" in shown().texts
    with pytest.raises(RuntimeError, match=r"undistort\.exr already exists"):
        bpy.ops.virtual_aperture.export(directory=str(out), what="stmap")


def test_an_export_is_refused(scene: bpy.types.Scene, clip: Path) -> None:
    with pytest.raises(RuntimeError, match="nothing is in focus"):
        bpy.ops.virtual_aperture.export(directory=str(clip / "out"), what="layers")
    with pytest.raises(RuntimeError, match="no folder has been chosen"):
        bpy.ops.virtual_aperture.export(what="stmap")
    scene.frame_start = scene.frame_end = 50
    with pytest.raises(RuntimeError, match="none of the clip's frames"):
        bpy.ops.virtual_aperture.export(directory=str(clip / "out"), what="stmap")
    assert not (clip / "out").exists()


def test_an_export_is_cancelled(scene: bpy.types.Scene, clip: Path) -> None:
    with pytest.raises(RuntimeError, match="Nothing is being exported"):
        bpy.ops.virtual_aperture.cancel_export()
    scene.virtual_aperture.focus_distance, scene.virtual_aperture.blur = 8.0, 0.03
    scene.frame_start, out = 2, clip / "out"
    made = export.begin(scene, "layers", out, False)
    until(lambda: made.poll() and made.done > 0)
    assert shown().texts[0].startswith(f"Export: {made.done} of {COUNT - 1} files")
    with pytest.raises(RuntimeError, match="Files are being exported"):
        bpy.ops.virtual_aperture.export(directory=str(out), what="stmap")
    assert bpy.ops.virtual_aperture.cancel_export() == {"FINISHED"}
    until(lambda: tend() or not any(name.startswith(".") for name in names(out)))
    # What was whole stays, and nothing else.
    assert names(out) == [f"layers_{frame:04d}.exr" for frame in range(2, 2 + len(names(out)))] != []


@pytest.mark.parametrize("kind", ["usd", "alembic"])
def test_blender_exports_the_solved_camera(scene: bpy.types.Scene, clip: Path, kind: str) -> None:
    write = bpy.ops.wm.usd_export if kind == "usd" else bpy.ops.wm.alembic_export
    if write.idname_py() not in {f"wm.{name}" for name in dir(bpy.ops.wm)}:
        pytest.skip(f"this Blender module has no {kind} exporter")
    read = bpy.ops.wm.usd_import if kind == "usd" else bpy.ops.wm.alembic_import
    camera = scene.virtual_aperture.camera
    places = {}
    for frame in (1, COUNT):
        scene.frame_set(frame)
        places[frame] = camera.matrix_world.copy()
    assert (places[1].translation - places[COUNT].translation).length > 0.1
    lens, file = camera.data.lens, clip / ("camera.usdc" if kind == "usd" else "camera.abc")
    for each in bpy.context.selected_objects:
        each.select_set(False)
    camera.select_set(True)
    options = {"selected_objects_only": True, "export_animation": True} if kind == "usd" else {
        "selected": True, "start": 1, "end": COUNT
    }  # fmt: skip
    assert write(filepath=str(file), **options) == {"FINISHED"} and file.stat().st_size > 0
    before = set(bpy.data.objects)
    assert read(filepath=str(file)) == {"FINISHED"}
    (back,) = (each for each in set(bpy.data.objects) - before if each.type == "CAMERA")
    for frame, place in places.items():
        scene.frame_set(frame)
        for row, expected in zip(back.matrix_world, place, strict=True):
            assert tuple(row) == pytest.approx(tuple(expected), abs=1e-4)
    assert back.data.lens / back.data.sensor_width == pytest.approx(lens / camera.data.sensor_width, rel=1e-4)
