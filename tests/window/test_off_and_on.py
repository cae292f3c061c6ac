"""The extension disabled, enabled and updated while the preview is on, and the preview's process killed:
Blender goes on, the preview can."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from .clips import write_scene
from .program import BACKEND, EXTENSION, Program
from .screen import Screen
from .steps import SETTINGS, first_window, running, show_preferences

PREVIEW = f"__import__('sys').modules['{EXTENSION}.addon.render.viewport.viewport'].PREVIEW"
PROCESS = (
    f"__import__('sys').modules['{EXTENSION}.addon.render.processes.clip_process'].CLIP.worker.process.pid"
)
SHADING = "view('VIEW_3D')['area'].spaces.active.shading.type"
OFF = f"bpy.ops.preferences.addon_disable(module={EXTENSION!r}); None"
ON = f"bpy.ops.preferences.addon_enable(module={EXTENSION!r}); None"


@pytest.fixture(scope="module")
def program(small_screen: Screen, resources: Path, folder: Path, registered: None) -> Iterator[Program]:
    """A solved scene in the camera's view."""
    blend = write_scene(folder / "off_and_on", views=16)
    with running(small_screen, resources, "off_and_on", blend, tab=False) as made:
        yield made


def preview(program: Program, name: str) -> None:
    """Have the preview on, as Preview does, and wait for a picture."""
    if program.ask(SHADING) != "RENDERED":
        in_view = "with bpy.context.temp_override(**view('VIEW_3D'))"
        program.ask(f"{in_view}: bpy.ops.virtual_aperture.preview()\nNone")
    program.wait(f"len({PREVIEW}._kept)", 300)
    program.settle()
    program.shot(name)
    assert program.ask(SHADING) == "RENDERED"


def test_the_previews_process_has_this_gpu_backend(program: Program) -> None:
    preview(program, "backend")
    modules = f"__import__('sys').modules['{EXTENSION}.addon.render"
    launcher, process = f"{modules}.processes.launcher']", f"{modules}.viewport.viewport'].CLIP"
    program.ask(f"bpy.call = {process}.call({launcher}._backend); None")
    program.wait(f"{process}.poll() or bpy.call.ended")
    said = program.ask(f"[bpy.call.result(), {launcher}._backend()]")
    assert said[0] == said[1] == ["--gpu-backend", BACKEND or "opengl"]


def test_the_preview_goes_on_when_its_process_is_killed(program: Program) -> None:
    preview(program, "before_it_is_killed")
    program.wait(f"not {PREVIEW}.is_busy()", 300)
    killed = program.ask(PROCESS)
    # So many that the picture is not finished before the process is killed.
    program.ask(f"{SETTINGS}.views = 2000; None")
    kill = f"(os.kill({PROCESS}, signal.SIGKILL), True)[1]"
    program.wait(f"import os, signal\n{PREVIEW}._step is not None and {kill}")
    program.wait(f"{PREVIEW}.note", 60)
    note = program.ask(f"{PREVIEW}.note")
    assert note.startswith("The preview is begun again") and "SIGKILL" in note
    program.shot("killed")
    program.ask(f"{SETTINGS}.views = 16; None")
    program.settle()
    program.wait(f"not {PREVIEW}.note and not {PREVIEW}.is_busy()", 300)
    assert program.ask(f"[{PREVIEW}.note, list({PREVIEW}._problems.values())]") == ["", []]
    assert program.ask(PROCESS) != killed
    assert [line for line in program.said().splitlines() if "begun again" in line] == [f"note: {note}"]


def test_disabled_the_preview_ends_and_enabled_it_is_there_again(program: Program) -> None:
    for n in range(2):
        preview(program, f"preview_{n}")
        process = program.ask(PROCESS)
        program.ask(OFF)
        assert program.ask(SHADING) == "SOLID"
        program.settle()
        assert not Path(f"/proc/{process}").exists()
        program.shot(f"off_{n}")
        program.ask(ON)
        program.settle()
    preview(program, "on_again")


def test_clicked_off_and_on_in_the_preferences(program: Program) -> None:
    """Their window has a GPU context of its own, in which the extension ends."""
    preview(program, "before_preferences")
    is_on = f"{EXTENSION!r} in bpy.context.preferences.addons"
    show_preferences(program, "ADDONS")
    box = program.find(f'addon_disable(module="{EXTENSION}")', "PREFERENCES", "WINDOW", 0.07, 1)
    for n in range(2):
        program.screen.click(box.x, box.y)
        program.wait(f"not ({is_on})")
        program.settle()
        program.shot(f"clicked_off_{n}")
        assert program.ask(SHADING) == "SOLID"
        program.screen.click(box.x, box.y)
        program.wait(is_on)
        program.settle()
        preview(program, f"clicked_on_{n}")
    first_window(program)


def test_updated_while_the_preview_is_on(program: Program, zip_file: Path) -> None:
    preview(program, "before_update")
    program.ask(
        f"bpy.ops.extensions.package_install_files(filepath={str(zip_file)!r}, repo='user_default',"
        " enable_on_install=True, overwrite=True); None",
        300,
    )
    program.settle()
    program.shot("updated")
    assert program.ask(SHADING) == "SOLID"
    preview(program, "updated_preview")
