"""A signal that is heard in what Blender calls is told after it, in one line."""

from __future__ import annotations

import sys
from types import FrameType

from addon.cli import main
from addon.scene import focus_sync, paths, properties


def frame_in(file: str) -> FrameType:
    """A frame of code that says it is in a file."""
    names: dict[str, FrameType] = {}
    exec(compile("import sys\nframe = sys._getframe()", file, "exec"), names)
    return names["frame"]


def test_exceptions_that_blender_would_print_are_not_raised(registered: None) -> None:
    for module in (focus_sync, paths, properties):
        assert main._is_called_by_blender(frame_in(str(module.__file__)))
    assert not main._is_called_by_blender(sys._getframe())
