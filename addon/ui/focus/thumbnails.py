"""Thumbnails of focus marks: the part of the picture around each place, cut out once in a timer."""

import contextlib
from typing import Any

import bpy
import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.base.errors import UserError
from ...core.media.light import encode_srgb, to_linear
from ...render.views.gpu_views import upload
from ...scene.base import redraw
from ...scene.base.events import watch
from ...scene.sources.shot import shot_of
from ..base.icons import Icons

SIDE = 64
"""Pixels of a thumbnail."""
PART = 0.12
"""Share of the picture's width in a thumbnail. Chosen by inspection."""
SOON = 0.05
"""Seconds until the thumbnails that panels want are cut out: not while they are drawn."""
ICONS = Icons(SIDE)
_pictures: dict[str, NDArray[np.float32]] = {}
"""(SIDE, SIDE, 4) display values, opaque, top row first, by key."""
_textures: dict[str, Any] = {}
"""The same on the GPU, of those that were drawn in a viewport."""
_wanted: dict[str, tuple[str, int, float, float]] = {}
"""Scene, frame, x, y, by key."""
_seen: set[str] = set()
"""Keys of those that were looked for."""


def icon(settings: bpy.types.PropertyGroup, mark: bpy.types.PropertyGroup) -> int:
    """Return the icon of a mark's first place, for panels; 0 where it has none, or not yet."""
    key = _cut(settings, mark)
    return ICONS.icon(key, lambda: _pictures[key]) if key in _pictures else 0


def texture(settings: bpy.types.PropertyGroup, mark: bpy.types.PropertyGroup) -> Any:
    """Return the thumbnail as a texture of display values, top row first; None without one."""
    key = _cut(settings, mark)
    if key not in _pictures:
        return None
    if key not in _textures:
        _textures[key] = upload(_pictures[key])
        _textures[key].filter_mode(True)
    return _textures[key]


def _cut(settings: bpy.types.PropertyGroup, mark: bpy.types.PropertyGroup) -> str:
    """The key of a mark's thumbnail, which is cut out soon if it was not; empty without a place."""
    place = mark.places[0]
    if bpy.app.background or place.xy is None:
        return ""
    key = f"{settings.clip_identity} {place.frame} {place.xy[0]:.3f} {place.xy[1]:.3f}"
    if key not in _seen:
        _wanted[key] = (settings.id_data.name, place.frame, *place.xy)
        watch(_cut_out, SOON)
    return key


def _cut_out() -> float | None:
    """A timer's turn: one of those that are wanted."""
    if not _wanted:
        return None
    key, (name, frame, x, y) = _wanted.popitem()
    _seen.add(key)
    scene = bpy.data.scenes.get(name)
    # Where the clip is gone, or its scene, there is none.
    with contextlib.suppress(UserError):
        if scene is not None:
            _pictures[key] = _part(scene, frame, x, y)
    redraw.viewports()
    return SOON if _wanted else None


def _part(scene: bpy.types.Scene, frame: int, x: float, y: float) -> NDArray[np.float32]:
    """(SIDE, SIDE, 4) display values, opaque, top row first; UserError where the frame cannot be read."""
    picture: Any = shot_of(scene).clip.read(frame)
    height, width = picture.shape[:2]
    side = max(min(round(PART * width), height), 1)
    left, top = (
        int(np.clip(round(share * length - side / 2), 0, length - side))
        for share, length in ((x, width), (y, height))
    )
    part = to_linear(np.ascontiguousarray(picture[top : top + side, left : left + side]))
    small = cv2.resize(part, (SIDE, SIDE), interpolation=cv2.INTER_AREA)
    pixels = np.ones((SIDE, SIDE, 4), np.float32)
    pixels[..., :3] = np.clip(encode_srgb(small[..., :3]), 0, 1)
    return pixels


def forget() -> None:
    """Forget all thumbnails."""
    for held in (_wanted, _pictures, _textures, _seen):
        held.clear()
    ICONS.forget()
