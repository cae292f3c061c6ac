"""The shot that a scene holds: its reconstruction and its footage, read once and kept while it lasts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import bpy

from ..core.borrow import Lender
from ..core.dense_depth import ClipDepth
from ..core.depth import MappedDepth
from ..core.depth_maps import open_depth
from ..core.errors import UserError
from ..core.footage import Footage, open_footage
from ..core.reconstruction import Reconstruction
from . import exr, store
from .properties import VirtualApertureSettings

IDENTITY = "virtual_aperture_identity"


exr.lend()


@dataclass(frozen=True)
class Shot:
    """A clip and what structure from motion found in it."""

    footage: Footage
    reconstruction: Reconstruction
    depth: MappedDepth | None = None
    """The user's depth maps."""

    @cached_property
    def dense(self) -> ClipDepth:
        """Depth of every pixel, from the clip itself."""
        return ClipDepth(self.reconstruction, self.footage.read)

    @cached_property
    def lender(self) -> Lender:
        """Other frames' colours for what a frame does not show."""
        return Lender(self.reconstruction, self.footage.read)


_last: tuple[tuple[str, str, str], Shot] | None = None
"""One shot is kept, because every frame of an animation asks for the same one."""


def shot_of(scene: bpy.types.Scene) -> Shot:
    """The scene's shot; UserError naming what is missing."""
    global _last
    settings = scene.virtual_aperture
    mesh = points_mesh(settings)
    path = footage_path(settings)
    key = (str(mesh.get(IDENTITY)), str(path), bpy.path.abspath(settings.depth_maps))
    if _last is None or _last[0] != key:
        reconstruction, footage = store.read(mesh), open_footage(path)
        depth = MappedDepth.of(open_depth(Path(key[2]), footage), reconstruction) if key[2] else None
        _last = (key, Shot(footage, reconstruction, depth))
    return _last[1]


def reconstruction_of(settings: VirtualApertureSettings) -> Reconstruction:
    """The reconstruction alone, for which the footage need not be there."""
    mesh = points_mesh(settings)
    if _last is not None and _last[0][0] == str(mesh.get(IDENTITY)):
        return _last[1].reconstruction
    return store.read(mesh)


def points_mesh(settings: VirtualApertureSettings) -> bpy.types.Mesh:
    """The mesh of the point cloud; UserError where the scene has none."""
    if settings.points is None or settings.points.type != "MESH":
        raise UserError("the scene has no solved clip; choose a clip and solve it first")
    return settings.points.data


def footage_path(settings: VirtualApertureSettings) -> Path:
    """The clip's path, with Blender's // resolved."""
    if not settings.footage:
        raise UserError("no clip is chosen")
    return Path(bpy.path.abspath(settings.footage)).resolve()


def forget() -> None:
    """Drop the kept shot and its open video file."""
    global _last
    _last = None
