"""Depth that another process finds while the user goes on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import bpy
import pytest

from addon.core.camera.reconstruction import Intrinsics, Reconstruction
from addon.core.readers.matching import Imported
from addon.core.sfm.workspace import keep_import
from addon.core.subjects.strokes import MarkedSubject, Stroke
from addon.scene.sources.clip import footage_path, work_dir
from addon.scene.sources.shot import shot_of
from addon.scene.sources.subjects import set_marked
from addon.ui import panels
from addon.ui.footage.solve import build_scene
from addon.ui.jobs import depth_ahead

from .. import waiting
from ..recorder import draw
from ..scenes import slanted_shot

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)


@pytest.fixture
def work(scene: bpy.types.Scene, tmp_path: Path) -> Iterator[Path]:
    """The working folder of a clip whose solve is in the scene."""
    shot, folder = slanted_shot(tmp_path / "clip", LENS), tmp_path / "work"
    keep_import(Imported(shot.reconstruction, "true cameras", ()), shot.footage, folder)
    settings = scene.virtual_aperture
    settings.footage, settings.work_dir = str(shot.footage.path), str(folder)
    build_scene(scene, shot.footage, folder)
    yield folder
    depth_ahead.stop()


def until(is_so: Callable[[], bool]) -> None:
    """Let timers have their turns."""

    def ticked() -> bool:
        depth_ahead._tick()
        return is_so()

    waiting.until(lambda: is_so() or ticked(), every=0.05)


def kept(work: Path) -> dict[str, int]:
    """Names of the files of kept depth, and when each was written."""
    return {path.name: path.stat().st_mtime_ns for path in work.glob("depth/*/depth-*.npz")}


def test_what_is_found_in_the_background_is_what_the_scene_reads(scene: bpy.types.Scene, work: Path) -> None:
    assert bpy.ops.virtual_aperture.find_depth() == {"FINISHED"}
    found = depth_ahead.of(scene.virtual_aperture)
    assert found is not None and found.is_running and found.process is not None
    assert "virtual_aperture.pause_depth" in draw(panels.solve.VIRTUAL_APERTURE_PT_solve).operators
    with pytest.raises(RuntimeError, match="Depth is being found"):
        bpy.ops.virtual_aperture.find_depth()
    until(lambda: not found.is_running)
    assert (found.problem, found.done, found.total) == ("", 3, 3)
    assert "Depth is found" in draw(panels.solve.VIRTUAL_APERTURE_PT_solve).texts
    before = kept(work)
    assert len(before) == 3
    shot_of(scene).context.stereo.at(2)
    assert kept(work) == before


def test_a_camera_that_stays_has_no_depth_to_find(
    scene: bpy.types.Scene, work: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert work.exists() and not depth_ahead._stays()
    monkeypatch.setattr(Reconstruction, "stays", property(lambda _: True))
    assert depth_ahead._stays()
    scene.virtual_aperture.depth_maps = "maps"
    assert not depth_ahead._stays()


def test_it_knows_what_is_marked(scene: bpy.types.Scene, work: Path) -> None:
    stroke = Stroke(2, ((0.3, 0.3), (0.4, 0.6)))
    set_marked(scene.virtual_aperture, (MarkedSubject("cat", (stroke,)),))
    bpy.ops.virtual_aperture.find_depth()
    found = depth_ahead.of(scene.virtual_aperture)
    assert found is not None
    until(lambda: not found.is_running)
    assert not found.problem
    stereo = shot_of(scene).context.stereo
    assert all(stereo.kept(frame) is not None for frame in (1, 2, 3))


def test_it_knows_the_color_space_that_the_user_says(scene: bpy.types.Scene, work: Path) -> None:
    scene.virtual_aperture.colour_space = "Display P3"
    bpy.ops.virtual_aperture.find_depth()
    found = depth_ahead.of(scene.virtual_aperture)
    assert found is not None
    until(lambda: not found.is_running)
    assert not found.problem
    before = kept(work)
    assert len(before) == 3
    stereo = shot_of(scene).context.stereo
    assert all(stereo.kept(frame) is not None for frame in (1, 2, 3))
    stereo.at(2)
    assert kept(work) == before


def test_pausing_ends_the_process_and_finding_goes_on_later(scene: bpy.types.Scene, work: Path) -> None:
    bpy.ops.virtual_aperture.find_depth()
    found = depth_ahead.of(scene.virtual_aperture)
    assert found is not None and found.is_running and found.process is not None
    process = found.process
    bpy.ops.virtual_aperture.pause_depth()
    assert process.wait(waiting.PATIENCE) != 0
    assert depth_ahead.of(scene.virtual_aperture) is None
    assert "virtual_aperture.find_depth" in draw(panels.solve.VIRTUAL_APERTURE_PT_solve).operators
    bpy.ops.virtual_aperture.find_depth()
    again = depth_ahead.of(scene.virtual_aperture)
    assert again is not None
    until(lambda: not again.is_running)
    assert len(kept(work)) == 3


def test_a_file_knows_that_its_depth_was_being_found(scene: bpy.types.Scene, work: Path) -> None:
    def reopened() -> bool:
        file = str(work.parent / "scene.blend")
        bpy.ops.wm.save_as_mainfile(filepath=file)
        bpy.ops.wm.open_mainfile(filepath=file)
        return bool(bpy.context.scene.virtual_aperture.finds_depth)

    assert not reopened()
    bpy.ops.virtual_aperture.find_depth()
    assert reopened()
    # Without a window nothing begins by itself.
    assert depth_ahead.of(bpy.context.scene.virtual_aperture) is None
    bpy.ops.virtual_aperture.find_depth()
    bpy.ops.virtual_aperture.pause_depth()
    assert not reopened()
    bpy.ops.virtual_aperture.find_depth()
    found = depth_ahead.of(bpy.context.scene.virtual_aperture)
    assert found is not None
    until(lambda: not found.is_running)
    assert not reopened()


def test_a_file_saved_elsewhere_keeps_its_working_folder(scene: bpy.types.Scene, work: Path) -> None:
    scene.virtual_aperture.work_dir = ""
    bpy.ops.wm.save_as_mainfile(filepath=str(work.parent / "scene.blend"))
    bpy.ops.virtual_aperture.find_depth()
    elsewhere = work.parent / "other" / "scene.blend"
    elsewhere.parent.mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(elsewhere))
    settings = bpy.context.scene.virtual_aperture
    found = depth_ahead.of(settings)
    assert found is not None and found.is_running and settings.work_dir == ""
    bpy.ops.wm.open_mainfile(filepath=str(elsewhere))
    settings = bpy.context.scene.virtual_aperture
    assert settings.finds_depth and work_dir(settings, footage_path(settings)) == work.resolve()
    # Another clip may have the same name.
    settings.clip_identity = "another"
    assert work_dir(settings, footage_path(settings)).parent == elsewhere.parent.resolve()


def test_a_process_that_dies_is_told(scene: bpy.types.Scene, work: Path) -> None:
    bpy.ops.virtual_aperture.find_depth()
    found = depth_ahead.of(scene.virtual_aperture)
    assert found is not None and found.is_running and found.process is not None
    found.process.kill()
    until(lambda: not found.is_running)
    assert "SIGKILL" in found.problem
    texts = " ".join(draw(panels.notices.VIRTUAL_APERTURE_PT_details).texts)
    assert "Depth was not found: the process was ended by" in texts


def test_a_solve_that_is_damaged_is_told_by_its_file(scene: bpy.types.Scene, work: Path) -> None:
    (work / "solve.json").write_text("{}")
    bpy.ops.virtual_aperture.find_depth()
    found = depth_ahead.of(scene.virtual_aperture)
    assert found is not None
    until(lambda: not found.is_running)
    assert "solve.json" in found.problem
    # In the words of the panel, not of the command that found it.
    assert "Solve Again" in found.problem and "--" not in found.problem


def test_another_file_ends_it(scene: bpy.types.Scene, work: Path) -> None:
    bpy.ops.virtual_aperture.find_depth()
    found = depth_ahead.of(scene.virtual_aperture)
    assert found is not None and found.is_running and found.process is not None
    process = found.process
    bpy.ops.wm.read_homefile(app_template="", use_empty=True, use_factory_startup=True)
    assert process.wait(waiting.PATIENCE) != 0


def test_another_clip_has_no_part_in_it(scene: bpy.types.Scene, work: Path) -> None:
    bpy.ops.virtual_aperture.find_depth()
    scene.virtual_aperture.work_dir = str(work.parent / "other")
    assert depth_ahead.of(scene.virtual_aperture) is None
    with pytest.raises(RuntimeError, match="holds no solve to keep depth with"):
        bpy.ops.virtual_aperture.find_depth()
