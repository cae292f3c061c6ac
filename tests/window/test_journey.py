"""What a first-time user does, in one Blender and in this order: from the zip to a project that was moved.

Mouse and keys do it. The driver only reads state, finds places, and sets what is no part of the test (the
output's file format, the frame range). A step that fails leaves those after it skipped.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from .clips import read_exr
from .program import EXTENSION, Program, headless
from .screen import Screen
from .steps import (
    CLIP,
    DEPTH,
    MODAL,
    PICTURES,
    RIGHT,
    SETTINGS,
    SOLVING,
    first_window,
    opened,
    show_preferences,
)

LAYER = "bpy.context.window_manager.windows[0].view_layer"
SCENE = "sorted([o.name for o in bpy.data.objects] + [m.name for m in bpy.data.meshes])"

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module")
def own(folder: Path) -> Path:
    """Blender's user folder, as it is before anything was installed."""
    made = folder / "journey"
    made.mkdir()
    return made


@pytest.fixture(scope="module")
def program(screen: Screen, own: Path) -> Iterator[Program]:
    made = Program(screen, own, PICTURES / "journey")
    yield made
    made.close()


@pytest.fixture(scope="module")
def project(folder: Path) -> Path:
    """The folder of the clip."""
    made = folder / "project"
    made.mkdir()
    shutil.copy(CLIP, made)
    return made


def rendered(program: Program, name: str) -> np.ndarray:
    """The Render Result, (H, W, 4) linear light."""
    file = program.pictures / f"{name}.exr"
    problem = program.ask(f"save_result({str(file)!r})")
    assert not problem, problem
    return read_exr(file)


@pytest.mark.smoke
def test_default_start_file(program: Program) -> None:
    program.screen.move(*program.middle("VIEW_3D"))
    program.screen.key("Escape")  # the splash screen
    program.settle()
    program.shot("start")
    assert program.ask("sorted(bpy.data.objects.keys())") == ["Camera", "Cube", "Light"]
    assert program.ask("bpy.context.preferences.view.render_display_type") == "WINDOW"


@pytest.mark.smoke
def test_install_from_disk(program: Program, zip_file: Path) -> None:
    show_preferences(program, "EXTENSIONS")
    left, top, width, _ = program.rectangle("PREFERENCES", "WINDOW", 1)
    # The menu in the upper right corner; Install from Disk is its last entry.
    program.screen.click(left + width - 18, top + 18)
    program.settle()
    program.screen.key("Up", "Return")
    program.choose_file(zip_file)
    program.wait(f"{EXTENSION!r} in bpy.context.preferences.addons", 60)
    program.settle()
    program.shot("installed")
    first_window(program)


@pytest.mark.smoke
def test_sidebar(program: Program) -> None:
    program.show_sidebar("Virtual Aperture")
    program.shot("sidebar")
    found = [button.does for button in program.buttons("VIEW_3D", "UI")]
    assert any("choose_clip" in does for does in found)


def test_choose_the_clip(program: Program, project: Path) -> None:
    program.press("virtual_aperture.choose_clip")
    program.choose_file(project / CLIP.name)
    program.settle()
    program.shot("clip_chosen")
    assert Path(program.ask(f"bpy.path.abspath({SETTINGS}.footage)")) == project / CLIP.name


@pytest.mark.parametrize("after", [1, 5])
def test_esc_cancels_a_solve(program: Program, project: Path, after: float) -> None:
    before = program.ask(SCENE)

    program.press("virtual_aperture.solve(again=False)")
    program.wait(SOLVING)
    time.sleep(after)
    program.shot(f"solving_{after}")
    assert program.ask(SOLVING), "over before ESC"
    sent = program.screen.key("Escape")
    ended: float = program.wait(f"not {SOLVING} and time.time()", every=0.0)
    program.settle()
    program.shot(f"solve_cancelled_{after}")
    assert program.ask(SCENE) == before
    assert [file.name for file in project.iterdir()] == [CLIP.name]
    program.tell_time(ended - sent, f"ESC {after} s after Solve")


def test_solve(program: Program, project: Path) -> None:
    button = program.find("virtual_aperture.solve(again=False)", "VIEW_3D", "UI")
    program.screen.click(button.x, button.y)
    program.wait(SOLVING)
    # A second press, as of a nervous finger, starts nothing beside it: how far it is stands there now.
    program.screen.click(button.x, button.y)
    program.settle()
    assert len(program.ask(MODAL)) == 1
    program.wait(f"not {SOLVING}", 180)
    program.settle()
    program.shot("solved")
    assert program.ask(f"{SETTINGS}.points is not None")
    assert (project / "desk.aperture" / "solve.json").exists()
    # The camera's view, the clip behind the points, the cube out of the way.
    assert program.ask("view('VIEW_3D')['area'].spaces.active.region_3d.view_perspective") == "CAMERA"
    assert program.ask(f"{LAYER}.objects.active == {SETTINGS}.points")
    assert program.ask(f"bpy.data.objects['Cube'].hide_get(view_layer={LAYER})")
    assert program.ask(f"[o.name for o in {LAYER}.objects if o.select_get(view_layer={LAYER})]") == []


def test_the_clip_is_seen(program: Program) -> None:
    left, top, width, height = program.rectangle("VIEW_3D")
    seen = program.shot("viewport")[top + height // 3 : top + 2 * height // 3, left + 200 : left + width // 2]
    # An empty viewport is grey all over.
    assert (np.ptp(seen.astype(int), axis=2) > 40).mean() > 0.01
    assert seen.std() > 20


def test_depth_is_found_while_the_user_goes_on(program: Program, project: Path) -> None:
    program.wait(f"{DEPTH} and {DEPTH}.done", 60)
    program.shot("depth_under_way")
    program.press("virtual_aperture.pause_depth", across=RIGHT)
    program.wait(f"{DEPTH} is None")
    with opened(program, "Solve"):
        program.press("virtual_aperture.find_depth")
    program.wait(f"not {DEPTH}.is_running", 180)
    program.settle()
    program.shot("depth_found")
    assert program.ask(f"{DEPTH}.problem") == ""
    frames = program.ask("bpy.context.scene.frame_end - bpy.context.scene.frame_start + 1")
    assert len(list(project.rglob("depth-*.npz"))) == frames


def test_solve_is_undone_and_redone(program: Program) -> None:
    first_window(program)
    program.screen.key("ctrl+z")
    program.wait(f"{SETTINGS}.points is None")
    program.settle()
    program.shot("solve_undone")
    assert not program.ask(f"bpy.data.objects['Cube'].hide_get(view_layer={LAYER})")
    program.screen.key("ctrl+shift+z")
    program.wait(f"{SETTINGS}.points is not None")
    program.settle()
    program.shot("solve_redone")


VERTICES = f"bmesh.from_edit_mesh({SETTINGS}.points.data).verts"
SELECTED = f"[vertex.index for vertex in {VERTICES} if vertex.select]"


def test_pick_points(program: Program) -> None:
    first_window(program)
    program.screen.key("Tab")
    program.wait(f"{SETTINGS}.points.mode == 'EDIT'")
    program.settle()
    program.shot("edit_mode")
    assert program.ask(SELECTED) == []
    world = f"[{SETTINGS}.points.matrix_world @ vertex.co for vertex in {VERTICES}]"
    places = np.array(program.ask(f"project({world})"))
    left, top, width, height = program.rectangle("VIEW_3D")
    x, y = places[:, 0], program.screen.size[1] - places[:, 1]
    # Not under the toolbar or the sidebar, and near the middle of the picture.
    sidebar = program.rectangle("VIEW_3D", "UI")[2]
    usable = (x > left + 120) & (x < left + width - sidebar - 20) & (y > top + 80) & (y < top + height - 20)
    chosen: list[int] = []
    for n in np.argsort(np.hypot(x - np.median(x[usable]), y - np.median(y[usable]))):
        away = np.hypot(x - x[n], y - y[n])
        # A click takes the nearest: one with nothing close, and not next to one that is taken.
        if usable[n] and np.sort(away)[1] > 5 and all(away[taken] > 30 for taken in chosen):
            chosen.append(n)
    chosen = chosen[:4]
    for count, n in enumerate(chosen):
        program.screen.click(x[n], y[n], 1, "shift" if count else "")
        program.settle()
    picked = program.ask(SELECTED)
    assert len(picked) == 4
    program.shot("picked")
    program.press("virtual_aperture.set_focus()")
    program.wait(f"{SETTINGS}.points.mode == 'OBJECT'")
    program.shot("focus_set")
    assert program.ask(f"len({SETTINGS}.marks.points)") == len(picked)


def test_focus_is_undone_and_redone(program: Program) -> None:
    first_window(program)
    points = f"list({SETTINGS}.marks.points)"
    picked = program.ask(points)
    program.screen.key("ctrl+z")
    # What was in focus after the solve, which nobody had picked.
    program.wait(f"{SETTINGS}.marks.is_first")
    assert program.ask(points) != picked
    program.screen.key("ctrl+shift+z")
    program.wait(f"{points} == {picked}")


def test_save(program: Program, project: Path) -> None:
    program.ask(
        "s = bpy.context.scene.render.image_settings\n"
        "s.file_format, s.color_mode, s.color_depth = 'OPEN_EXR', 'RGBA', '32'"
    )
    first_window(program)
    program.screen.key("ctrl+s")
    program.choose_file(project / "desk.blend", new=True)
    program.wait("bpy.data.filepath")
    assert (project / "desk.blend").exists()
    assert program.ask(f"{SETTINGS}.footage") == "//desk.mp4"


def test_f12_with_default_preferences(program: Program, project: Path, resources: Path) -> None:
    first_window(program)
    report = program.render(seconds=180)
    program.shot("f12")
    assert "complete" in report
    picture = rendered(program, "f12")
    frame = program.ask("bpy.context.scene.frame_current")
    headless(resources, "-b", str(project / "desk.blend"), "-o", f"{project}/alone/####", "-f", str(frame))
    alone = read_exr(project / "alone" / f"{frame:04d}.exr")
    assert alone[..., :3].std() > 0.02
    assert np.array_equal(picture, alone), f"differs by up to {np.abs(picture - alone).max():g}"
    first_window(program)


def test_moved_project(program: Program, project: Path) -> None:
    first_window(program)
    program.screen.key("ctrl+s")
    program.wait("not bpy.data.is_dirty")
    frame = program.ask("bpy.context.scene.frame_current")
    kept = read_exr(project / "alone" / f"{frame:04d}.exr")
    moved = project.rename(project.with_name("elsewhere"))
    program.screen.key("ctrl+o")
    program.choose_file(moved / "desk.blend")
    program.wait(f"bpy.data.filepath == {str(moved / 'desk.blend')!r}")
    program.settle()
    program.shot("moved")
    first_window(program)
    assert program.ask("bpy.context.scene.frame_current") == frame
    assert "complete" in program.render(seconds=180)
    program.shot("moved_f12")
    assert np.array_equal(rendered(program, "moved"), kept)
    first_window(program)


def test_disable(program: Program) -> None:
    show_preferences(program, "ADDONS")
    off = f'addon_disable(module="{EXTENSION}")'
    button = program.find(off, "PREFERENCES", "WINDOW", across=0.035, window=1)
    program.screen.click(button.x, button.y)
    program.wait(f"{EXTENSION!r} not in bpy.context.preferences.addons")
    program.shot("disabled")
    first_window(program)
    assert not program.ask("hasattr(bpy.types.Scene, 'virtual_aperture')")
    ours = "'VIRTUAL_APERTURE' in getattr(panel, 'COMPAT_ENGINES', ())"
    assert program.ask(f"[panel.__name__ for panel in bpy.types.Panel.__subclasses__() if {ours}]") == []
