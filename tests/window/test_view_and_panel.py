"""What the viewport and the panels tell is so: the blur of a pull, messages, buttons, a new clip's frame."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.camera.reconstruction import Intrinsics
from addon.core.media.clip import open_footage
from addon.core.readers.matching import Imported
from addon.core.sfm.workspace import default_work_dir, keep_import

from ..scenes import slanted_plane
from .clips import FRAMES, write_scene
from .program import EXTENSION, Program
from .screen import Screen
from .steps import press_in_details, running

SETTINGS = "bpy.context.scene.virtual_aperture"
MODULES = f"__import__('sys').modules['{EXTENSION}.addon"
DEPTH = f"{MODULES}.ui.jobs.depth_ahead']._ahead"
VIEWPORT = f"{MODULES}.render.viewport.viewport']"
PREVIEW = f"{VIEWPORT}.PREVIEW"
SIZE = "[bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y]"
FRAME = (
    "(lambda v: list("
    f"{VIEWPORT}.frame_in_region(v['region'], v['area'].spaces.active.region_3d, bpy.context.scene)"
    ") + [v['region'].width, v['region'].height])(view('VIEW_3D'))"
)
"""Left, bottom, width and height of the camera's frame in the viewport, and the viewport's size."""

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module")
def blend(folder: Path, registered: None) -> Path:
    """A scene of a landscape clip; beside it a portrait clip, `tall`, whose solve is kept."""
    made = write_scene(folder / "wide", (640, 360))
    other = write_scene(folder / "tall", (360, 640))
    footage = open_footage(Path(shutil.copytree(other.parent / "clip", made.parent / "tall")))
    camera = Intrinsics(360, 640, 342.0, 342.0, 180.0, 320.0)
    solve = Imported(slanted_plane(camera, FRAMES), "true cameras", ())
    keep_import(solve, footage, default_work_dir(footage.path, made.parent))
    return made


@pytest.fixture(scope="module")
def program(screen: Screen, resources: Path, blend: Path) -> Iterator[Program]:
    with running(screen, resources, "view_and_panel", blend) as made:
        made.ask(f"{SETTINGS}.views = 4")
        yield made


def call(program: Program, name: str) -> None:
    """As its button does it."""
    program.ask(
        "with bpy.context.temp_override(**view('VIEW_3D')):\n"
        f"    bpy.ops.virtual_aperture.{name}('INVOKE_DEFAULT')\n"
    )
    program.settle()


AMOUNT = f"[{SETTINGS}.blur_percent, {SETTINGS}.aperture_radius, {SETTINGS}.f_stop]"


def undo(program: Program, how: str = "undo") -> None:
    program.screen.move(*program.middle("VIEW_3D"))
    program.screen.key({"undo": "ctrl+z", "redo": "ctrl+shift+z"}[how])
    program.settle()


def test_undo_and_redo_keep_the_stored_amount(program: Program) -> None:
    """A set amount, then picks: undo leads back through the picks, and the stored number is the same."""
    settings = f"s = {SETTINGS}\n"
    program.ask(
        f"{settings}s.metres_per_unit = 0.25\ns.f_stop = 2.0\nbpy.ops.ed.undo_push(message='F-Stop')\nNone"
    )
    program.settle()
    program.shot("amount_f_stop")
    stored = program.ask(AMOUNT)
    assert stored[2] == pytest.approx(2.0, rel=1e-5)
    for away in (5.5, 7.0, 9.5):
        program.ask(f"{settings}s.focus_distance = {away}\nbpy.ops.ed.undo_push(message='Focus')\nNone")
        program.settle()
        assert program.ask(AMOUNT)[1:] == pytest.approx(stored[1:], rel=1e-5)
    for how in ("undo", "undo", "undo", "redo", "redo", "redo", "undo"):
        undo(program, how)
        assert program.ask(AMOUNT)[1:] == pytest.approx(stored[1:], rel=1e-5)
    call_kind = "with bpy.context.temp_override(**view('VIEW_3D')):\n    bpy.ops.virtual_aperture"
    program.ask(f"{call_kind}.set_amount_by('EXEC_DEFAULT', True, kind='BLUR')\n")
    program.settle()
    program.shot("amount_blur")
    by_blur = program.ask(AMOUNT)
    assert by_blur[1] == pytest.approx(stored[1], rel=1e-5)
    program.ask(f"{settings}s.focus_distance = 5.2\nbpy.ops.ed.undo_push(message='Focus')\nNone")
    program.settle()
    assert program.ask(AMOUNT)[0] == pytest.approx(by_blur[0], rel=1e-5)
    undo(program)
    assert program.ask(AMOUNT) == pytest.approx(by_blur, rel=1e-5)
    undo(program)
    assert program.ask(f"{SETTINGS}.by_f_stop") and program.ask(AMOUNT)[1:] == pytest.approx(
        stored[1:], rel=1e-5
    )
    program.ask(f"{settings}s.metres_per_unit = 0\ns.blur = 0.03")


def message(program: Program, name: str) -> tuple[str, int, np.ndarray]:
    """The message over the viewport, in how many lines it stands, and what the screen shows of its ground."""
    program.settle()
    said = program.ask(f"[s.said for s in {VIEWPORT}._in_regions.values() if s.said]")
    shot = program.shot(name)
    assert len(said) == 1
    lines, (left, bottom, right, top) = program.ask(
        f"m, v = {MODULES}.render.viewport.overlay'], view('VIEW_3D')\n"
        f"list(m.ground({said[0]!r}, m.free_part(v['area'], v['region']),"
        " bpy.context.preferences.system.ui_scale))"
    )
    x, y, width, height = program.rectangle("VIEW_3D")
    assert 0 <= left < right <= width and 0 <= bottom < top <= height
    ground = shot[
        round(y + height - top) + 1 : round(y + height - bottom) - 1, round(x + left) : round(x + right)
    ]
    return said[0], len(lines), ground


def test_a_message_of_the_preview_has_a_dark_ground(program: Program) -> None:
    call(program, "preview")
    program.wait(f"not {PREVIEW}.is_busy()", 200)
    program.settle()
    program.shot("no_message")
    for overlays in (True, False):
        program.ask(
            "space = view('VIEW_3D')['area'].spaces.active\n"
            f"space.overlay.show_overlays, space.region_3d.view_perspective = {overlays}, 'PERSP'\n"
        )
        said, lines, ground = message(program, f"message_{overlays}")
        assert said.startswith("Look through the solved camera") and lines == 1
        assert np.percentile(ground, 60) < 40 and ground.max() > 240
    # A long one is in lines, and dark over the clip, which Blender shows meanwhile.
    program.ask(
        "space.overlay.show_overlays, space.region_3d.view_perspective = True, 'CAMERA'\n"
        f"{SETTINGS}.depth_maps = '//' + 12 * 'nowhere/' + 'maps'\n"
    )
    said, lines, ground = message(program, "long_message")
    assert "maps" in said and lines > 1
    assert np.percentile(ground, 60) < 80 and ground.max() > 240
    program.ask(f"{SETTINGS}.depth_maps = ''")
    program.wait(f"not {PREVIEW}.is_busy()", 200)


def middle_rows(program: Program, name: str) -> np.ndarray:
    """The picture in the viewport, (90, 160, 3), without what the toolbar and the sidebar cover."""
    program.screen.move(*program.middle("VIEW_3D", "HEADER"))
    program.wait(f"not {PREVIEW}.is_busy()", 200)
    program.settle()
    left, bottom, width, height, _, tall = program.ask(FRAME)
    x, y = program.rectangle("VIEW_3D")[:2]
    top = y + tall - bottom - height
    shot = program.shot(name)[round(top) : round(top + height), round(x + left) : round(x + left + width)]
    return np.asarray(cv2.resize(shot, (160, 90), interpolation=cv2.INTER_AREA)[30:60, 40:120]).astype(float)


def above_the_picture(program: Program, name: str) -> np.ndarray:
    """Pixels of the viewport just above the clip's picture, beside the toolbar and the sidebar."""
    left, bottom, width, height, _, tall = program.ask(FRAME)
    x, y = program.rectangle("VIEW_3D")[:2]
    top, middle = round(y + tall - bottom - height), round(x + left + width / 2)
    return np.asarray(program.shot(name)[top - 60 : top - 10, middle - 100 : middle + 100]).astype(float)


def test_a_picture_keeps_its_shape_in_an_output_of_another_shape(program: Program) -> None:
    clip = middle_rows(program, "clip_shape")
    for width, height in ((360, 640), (640, 240)):
        program.ask(f"r = bpy.context.scene.render; r.resolution_x, r.resolution_y = {width}, {height}; None")
        seen = middle_rows(program, f"shape_{width}x{height}")
        across, up = program.ask(FRAME)[2:4]
        assert across / up == pytest.approx(640 / 360, rel=0.01)
        assert np.corrcoef(seen.ravel(), clip.ravel())[0, 1] > 0.97
        (said,) = program.ask(f"[s.said for s in {VIEWPORT}._in_regions.values() if s.said]")
        assert said.startswith(f"The render size {width}x{height} has another shape than the clip's 640x360")
        if width < height:
            # Blender stretches the camera's background image to the frame.
            assert above_the_picture(program, f"shape_{width}x{height}").std() < 2
    press_in_details(program, "render_clip", f"{SIZE} == [640, 360]")
    assert program.ask(f"[s.said for s in {VIEWPORT}._in_regions.values() if s.said]") == []
    assert np.abs(middle_rows(program, "clip_shape_again") - clip).mean() < 1


def test_a_portrait_clip_after_a_landscape_one_is_seen_whole(program: Program, blend: Path) -> None:
    # Somebody has looked at a corner of the first clip.
    program.ask(
        "v = view('VIEW_3D')['area'].spaces.active.region_3d\n"
        "v.view_perspective, v.view_camera_zoom, v.view_camera_offset = 'CAMERA', 20.0, (0.2, 0.1)\n"
    )
    clip = blend.parent / "tall"
    # As the end of a solve and of an import does it.
    program.ask(
        "from pathlib import Path\n"
        f"{SETTINGS}.footage = {str(clip)!r}\n"
        f"footage = {MODULES}.core.media.clip'].open_footage(Path({str(clip)!r}))\n"
        f"work = Path({str(default_work_dir(clip, blend.parent))!r})\n"
        f"{MODULES}.ui.footage.solve'].build_scene(bpy.context.scene, footage, work)\n"
        "None"
    )
    program.settle()
    program.shot("portrait")
    left, bottom, width, height, across, up = program.ask(FRAME)
    assert left >= 0 and bottom >= 0 and left + width <= across and bottom + height <= up
    assert height > 0.5 * up


def test_depth_goes_on_when_a_file_is_opened_again(program: Program) -> None:
    call(program, "find_depth")
    program.wait(f"{DEPTH} is not None and {DEPTH}.is_running")
    program.ask("bpy.ops.wm.save_mainfile()")
    program.ask("bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath); None")
    program.wait(f"{DEPTH} is not None and {DEPTH}.is_running")
    program.settle()
    program.shot("depth_goes_on")
    program.wait(f"not {DEPTH}.is_running", 300)
    assert program.ask(f"[{DEPTH}.problem, {DEPTH}.done, {SETTINGS}.finds_depth]") == ["", 5, False]
    # What was found is not looked for again.
    program.ask("bpy.ops.wm.save_mainfile()")
    program.ask("bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath); None")
    program.settle()
    assert program.ask(f"{DEPTH} is None")
