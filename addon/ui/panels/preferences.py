"""The extension's preferences, and the button that deletes a clip's kept depth."""

from __future__ import annotations

import time
from pathlib import Path

import bpy

from ...core.base import limits
from ...core.base.errors import UserError
from ...core.base.store import delete_kept, kept_size
from ...core.subjects.segmenter import Segmenter
from ...scene.base import preferences
from ...scene.sources.clip import footage_path, work_dir
from ...scene.sources.shot import KEPT_DEPTH
from ..base.operators import Acts, Result, asked, has_clip, polls, requires
from ..base.text import wrapped
from ..jobs import depth_ahead

LOOK_AGAIN = 3.0
"""Seconds until the size of the kept depth is looked up again: panels ask with every redraw."""


def _changed(_preferences: bpy.types.AddonPreferences, _context: bpy.types.Context) -> None:
    preferences.apply()


KNOWN = (
    "IS-Net (isnet-general-use.onnx) and U2-Net (u2net.onnx) are known. They are not part of the extension:"
    " check that their terms allow your use"
)
_refused: dict[str, str] = {}
"""The reasons why segmenters cannot be used, by their paths."""


def _segmenter_chosen(_preferences: bpy.types.AddonPreferences, _context: bpy.types.Context) -> None:
    """Try the segmenter on a test picture, and have the scenes use it that have none."""
    segmenter = preferences.preferred_segmenter()
    _refused.clear()
    if not segmenter:
        return
    try:
        Segmenter(Path(segmenter)).check()
    except UserError as error:
        _refused[segmenter] = str(error)
        return
    for scene in bpy.data.scenes:
        settings = scene.virtual_aperture
        settings.segmenter = settings.segmenter or segmenter


class VIRTUAL_APERTURE_preferences(bpy.types.AddonPreferences):  # noqa: N801
    bl_idname = preferences.PACKAGE

    cache_folder: bpy.props.StringProperty(
        name="Cache Folder",
        description="Folder for solves and depth of clips without a working folder. Leave empty to keep"
        " them next to the .blend, or next to the clip until the .blend is saved. Existing solves stay in"
        " use",
        subtype="DIR_PATH",
    )
    kept_depth: bpy.props.FloatProperty(
        name="Kept Depth (GB)",
        description="Maximum disk space for the kept depth of one clip. Depth that was not used for longest"
        " is deleted first",
        min=0.1,
        soft_max=100.0,
        default=limits.MOST_KEPT_DEPTH / preferences.GB,
        precision=1,
        step=100,
        update=_changed,
    )
    threads: bpy.props.IntProperty(
        name="Threads",
        description="Number of threads for solving, finding depth and rendering; 0 uses all processors."
        " Blender's own renders follow the scene's setting",
        min=0,
        soft_max=64,
        default=0,
        update=_changed,
    )

    segmenter: bpy.props.StringProperty(
        name="Segmenter",
        description="Salient-object network of your own (.onnx) that cuts any object out of a clip from a"
        " click or a stroke. Scenes use it from now on, unless they name another one",
        subtype="FILE_PATH",
        update=_segmenter_chosen,
    )

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "cache_folder")
        layout.prop(self, "kept_depth")
        layout.prop(self, "threads")
        layout.prop(self, "segmenter")
        trial = _refused.get(preferences.preferred_segmenter(), "")
        wrapped(layout, context, trial or KNOWN, icon="ERROR" if trial else "INFO")


class VIRTUAL_APERTURE_OT_delete_depth(Acts, bpy.types.Operator):  # noqa: N801
    """Delete the kept depth of this clip. Renders find what they need again. This cannot be undone"""

    bl_label = "Delete Kept Depth"

    poll = polls(
        has_clip,
        requires(lambda c: shown_size(c.scene.virtual_aperture), "No depth is kept for this clip"),
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        folder = depth_folder(context.scene.virtual_aperture)
        size = size_words(kept_size(folder))
        message = f"{size} in {folder}; finding it again takes as long as the first time"
        return asked(self, context, event, title="Delete kept depth?", message=message, confirm_text="Delete")

    def act(self, context: bpy.types.Context) -> str:
        folder = depth_folder(context.scene.virtual_aperture)
        # It would go on writing there.
        depth_ahead.pause()
        try:
            freed = delete_kept(folder)
        except OSError as error:
            raise UserError(f"the depth in {folder} cannot be deleted: {error.strerror}") from None
        _sizes.clear()
        return f"{size_words(freed)} of kept depth deleted"


def depth_folder(settings: bpy.types.PropertyGroup) -> Path:
    """Return the folder of the chosen clip's depth; UserError if no clip is chosen."""
    return work_dir(settings, footage_path(settings)) / KEPT_DEPTH


_sizes: dict[Path, tuple[float, int]] = {}


def shown_size(settings: bpy.types.PropertyGroup) -> int:
    """Return the bytes of the chosen clip's kept depth, updated every few seconds."""
    folder = depth_folder(settings)
    when, size = _sizes.get(folder, (-LOOK_AGAIN, 0))
    if time.monotonic() - when >= LOOK_AGAIN:
        size = kept_size(folder)
        _sizes[folder] = time.monotonic(), size
    return size


def size_words(size: int) -> str:
    """Return a number of bytes in words."""
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.1f} MB"
