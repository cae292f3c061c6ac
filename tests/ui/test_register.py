"""What registering adds goes again, as often as the extension is switched on and off."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import bpy
import pytest

import addon
from addon.core.camera.reconstruction import Intrinsics
from addon.core.media import picture_file
from addon.render.processes.clip_process import CLIP
from addon.render.viewport import viewport
from addon.render.viewport.pictures import Wanted
from addon.scene.base import events
from addon.scene.build import build
from addon.scene.lens import lens
from addon.scene.sources.shot import shot_of

from ..scenes import slanted_shot

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
OWNERS = ("Scene", "ViewLayer", "Object", "WindowManager", "Camera", "Mesh", "World", "Collection", "Image")


def state() -> dict[str, object]:
    """All of Blender that an extension may add to."""
    handlers = bpy.app.handlers
    lists = {name: getattr(handlers, name) for name in dir(handlers)}
    bpy_types = {name for name in dir(bpy.types) if not name.startswith("__")}
    menus = {name: getattr(bpy.types, name) for name in bpy_types if is_drawn(getattr(bpy.types, name))}
    keymaps = bpy.context.window_manager.keyconfigs
    return {
        "handlers": {name: list(each) for name, each in lists.items() if isinstance(each, list)},
        "classes": bpy_types,
        "operators": set(dir(bpy.ops.virtual_aperture)),
        "properties": {owner: properties_of(owner) for owner in OWNERS},
        "menus": {name: len(getattr(menu.draw, "_draw_funcs", ())) for name, menu in menus.items()},
        "engines": {
            name: frozenset(getattr(getattr(bpy.types, name), "COMPAT_ENGINES", ())) for name in bpy_types
        },
        "keys": sum(len(each.keymap_items) for config in keymaps for each in config.keymaps),
        "presets": bpy.utils.preset_paths("virtual_aperture/lens"),
        "threads": {thread.name for thread in threading.enumerate()},
        "decoder": picture_file.exr_decoder,
    }  # fmt: skip


def properties_of(owner: str) -> set[str]:
    return {each.identifier for each in getattr(bpy.types, owner).bl_rna.properties}


def is_drawn(cls: object) -> bool:
    kinds = bpy.types.Menu | bpy.types.Panel | bpy.types.Header
    return isinstance(cls, type) and issubclass(cls, kinds) and hasattr(cls, "draw")


@pytest.fixture
def off(registered: None) -> Iterator[None]:
    """The extension is switched off."""
    addon.unregister()
    yield
    addon.register()


def test_nothing_is_left(off: None) -> None:
    before = state()
    for _ in range(2):
        addon.register()
        during = state()
        assert all(during[name] != before[name] for name in ("handlers", "classes", "properties", "menus"))
        addon.unregister()
        after = state()
        assert {name for name in before if before[name] != after[name]} == set()


def test_timers_and_processes_end(scene: bpy.types.Scene, tmp_path: Path) -> None:
    from addon.ui.jobs import depth_ahead

    made = slanted_shot(tmp_path, LENS)
    settings = build(scene, made.footage, made.reconstruction)
    settings.focus_distance, settings.method = 8.0, "features"
    shot = shot_of(scene)
    wanted = Wanted(shot, 1, lens.frame_options(settings, shot.reconstruction), (160, 90))
    viewport.PREVIEW.want(wanted)
    viewport.PREVIEW.poll()
    events.watch(viewport._tick, 0)
    events.watch(depth_ahead._tick, 0)
    worker = CLIP.worker
    assert worker is not None and worker.is_running and worker.process is not None
    addon.unregister()
    try:
        assert CLIP.worker is None and worker.process.poll() is not None
        assert not bpy.app.timers.is_registered(CLIP._timer)
        assert not bpy.app.timers.is_registered(viewport._tick)
        assert not bpy.app.timers.is_registered(depth_ahead._tick)
    finally:
        addon.register()


def test_a_solve_under_way_ends(scene: bpy.types.Scene) -> None:
    from addon.ui.base.solving import Solving, running_solve

    def begin() -> None:
        raise AssertionError

    solving = Solving.running = Solving(begin)
    addon.unregister()
    addon.register()
    assert solving.ended and running_solve() is None
