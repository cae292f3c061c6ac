"""A signal that is heard in what Blender calls is told after it, in one line."""

from __future__ import annotations

import sys
from types import FrameType

import bpy

from addon.cli import main
from addon.render.cg import cg_process
from addon.render.processes import frames_ahead
from addon.scene import properties
from addon.scene.base import paths
from addon.scene.lens import blender_focus


def frame_in(file: str) -> FrameType:
    """A frame of code that says it is in a file."""
    names: dict[str, FrameType] = {}
    exec(compile("import sys\nframe = sys._getframe()", file, "exec"), names)
    return names["frame"]


def test_exceptions_that_blender_would_print_are_not_raised(scene: bpy.types.Scene) -> None:
    assert main._is_called_by_blender(frame_in(str(properties.__file__)))
    heard = list[bool]()

    def handler(*_: object) -> None:
        def within() -> bool:
            return main._is_called_by_blender(sys._getframe())

        heard.append(within())

    bpy.app.handlers.frame_change_post.append(handler)
    try:
        scene.frame_set(scene.frame_current + 1)
    finally:
        bpy.app.handlers.frame_change_post.remove(handler)
    assert heard == [True]
    # Nobody catches what is raised beside a handler of ours: loops end by it.
    for module in (blender_focus, paths, frames_ahead, cg_process):
        assert not main._is_called_by_blender(frame_in(str(module.__file__)))
    assert not main._is_called_by_blender(sys._getframe())


def test_handlers_of_ours_are_known_by_their_code(registered: None) -> None:
    lists = (getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers))
    ours = [each for held in lists if isinstance(held, list) for each in held
            if each.__module__.startswith("addon.")]  # fmt: skip
    assert {"blender_focus", "frames_ahead", "cg_process"} <= {
        each.__module__.split(".")[-1] for each in ours
    }
    assert all(hasattr(each, "__code__") for each in ours)
