"""Closing Blender during a movie or an export.

Blender asks about unsaved changes only, and add-ons cannot add to its question. The key that quits therefore
has a separate question, and the status bar and the File menu announce the work that would end. Finished
frames are kept.
"""

import sys
from typing import Any

import bpy

from ..base.operators import Named, Result, asked, polls, requires
from ..base.text import left_words
from . import export, movie

_keys: list[tuple[Any, Any]] = []
"""Key maps, and our items in them."""


def work() -> movie.MovieJob | None:
    """Return the movie or the export that is being made, if any."""
    return movie.MovieJob.under_way() or export.ExportJob.under_way()


class VIRTUAL_APERTURE_OT_close_blender(Named, bpy.types.Operator):  # noqa: N801
    """Close Blender, which ends the movie or the export that is being made"""

    bl_options = {"INTERNAL"}  # noqa: RUF012

    poll = polls(requires(lambda _: work(), "Nothing is being rendered or exported"))

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        made = work()
        assert made is not None
        words = filter(None, (made.words, left_words(made.left), "Finished files are kept"))
        return asked(
            self, context, event, title=f"Close Blender and end {made.name}?", message=". ".join(words),
            confirm_text="Close Blender", icon="WARNING",
        )  # fmt: skip

    def execute(self, _context: bpy.types.Context) -> Result:
        bpy.ops.wm.quit_blender("INVOKE_DEFAULT")
        return {"FINISHED"}


def draw(shown: Any, _context: bpy.types.Context) -> None:
    """Name in a header or menu what ends when Blender does."""
    made = work()
    if made is not None:
        shown.layout.label(text=f"Closing Blender ends {made.name}", icon="RENDER_ANIMATION")


def register() -> None:
    """Add the key, where there is a window."""
    if bpy.app.background:
        return
    keymap = bpy.context.window_manager.keyconfigs.addon.keymaps.new("Window")
    command = {"oskey": True} if sys.platform == "darwin" else {"ctrl": True}
    item = keymap.keymap_items.new(VIRTUAL_APERTURE_OT_close_blender.bl_idname, "Q", "PRESS", **command)
    _keys.append((keymap, item))


def unregister() -> None:
    """Undo `register`."""
    while _keys:
        keymap, item = _keys.pop()
        keymap.keymap_items.remove(item)
