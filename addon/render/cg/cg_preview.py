"""CG objects in the live preview: drawn by a process of their own, and kept while only the lens changes."""

from __future__ import annotations

from collections import OrderedDict
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import bpy

from ...core.base.atomic import temporary_folder
from ...core.camera.canvas import Canvas
from ...core.camera.reconstruction import Intrinsics
from ...core.depth.source import PixelDepth
from ...core.frame.cg_layers import NO_CG, CGObjects, DrawCG
from ...scene.base.events import at
from ...scene.base.timeline import clip_frame
from ...scene.cg_objects import cg_objects, stays_sharp
from ..processes.launcher import write_blend
from .cg_process import CGProcess

KEPT = 8
"""Frames whose CG objects are remembered."""


@dataclass(frozen=True)
class CGWanted:
    """The CG objects of a viewport."""

    scene: str
    layer: str
    frame: int
    """Frame of the scene's animation."""
    objects: tuple[tuple[int, bool], ...]
    """Session IDs of the objects. A hidden one that is shown again joins them unchanged."""
    version: int
    """Counted up whenever the objects change."""


@dataclass
class _Objects:
    """The objects as they are."""

    version: int = 0
    written: tuple[tuple[object, ...], Path] | None = None
    """The objects as they were written last, and the .blend with them, in the folder of `_held`."""


_drawing = CGProcess()
_objects = _Objects()
_held = ExitStack()
_kept: OrderedDict[CGWanted, tuple[Intrinsics, CGObjects]] = OrderedDict()
"""As they were drawn last, and for which canvas."""


def wanted(scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> CGWanted | None:
    """Return the CG objects of a scene at its present frame; None where it has none."""
    objects = tuple((thing.session_uid, stays_sharp(thing)) for thing in cg_objects(scene, layer))
    return CGWanted(scene.name, layer.name, clip_frame(scene), objects, _objects.version) if objects else None


def file_of(wanted: CGWanted) -> Path:
    """Return a .blend with the CG objects as they are now, for the process that draws them.

    Raises:
        UserError: It cannot be written.
    """
    of = wanted.scene, wanted.objects, wanted.version
    if _objects.written is None or _objects.written[0] != of:
        _forget_file()
        file = _held.enter_context(temporary_folder()) / "scene.blend"
        write_blend(file)
        _objects.written = of, file
    return _objects.written[1]


def _forget_file() -> None:
    _objects.written = None
    _held.close()


def draw_preview(asked: CGWanted | None, file: Path | None) -> DrawCG | None:
    """Return the function that draws the CG objects of a preview; None without objects.

    Args:
        asked: The objects.
        file: The .blend of `file_of` to wait for Cycles; without it the last drawing of this frame is
            returned, of any size.
    """
    if asked is None:
        return None

    def draw(_: int, canvas: Canvas, depth: PixelDepth | None) -> CGObjects:
        pinhole = canvas.pinhole
        kept = _kept.get(asked)
        if kept is not None and (kept[0] == pinhole or file is None):
            return kept[1].scaled(kept[0], pinhole)
        if file is None:
            return NO_CG
        drawn = _drawing.draw(asked.scene, (asked.layer, asked.frame), pinhole, depth, file)
        _kept[asked] = pinhole, drawn
        _kept.move_to_end(asked)
        while len(_kept) > KEPT:
            _kept.popitem(last=False)
        return drawn

    return draw


@at("depsgraph_update_post")
def _on_update(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """Something was changed: is it anything that CG objects are made of?"""
    if bpy.app.background:
        # There is no window to preview in.
        return
    ours = scene.virtual_aperture
    own = [each for each in (ours.camera, ours.points, ours.aperture) if each is not None]
    own += [each.data for each in own]
    changed = [update.id.original for update in depsgraph.updates]
    # The clip's sound is updated whenever the file is written, as it is for the process that draws them.
    others = bpy.types.Scene, bpy.types.Sound
    if any(not isinstance(each, others) and each not in own for each in changed):
        _objects.version += 1


def forget() -> None:
    """Draw the objects anew, as of another file."""
    _objects.version += 1
    _forget_file()
