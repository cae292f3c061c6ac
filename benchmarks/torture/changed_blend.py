"""Open a .blend, change one setting of its scene that has no part in the clip's frames, and save it.

python changed_blend.py FILE.blend SETTING
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import bpy


def _stereo(scene: bpy.types.Scene) -> None:
    scene.render.use_multiview = True


def _side_by_side(scene: bpy.types.Scene) -> None:
    scene.render.use_multiview = True
    scene.render.image_settings.views_format = "STEREO_3D"


def _remapped(scene: bpy.types.Scene) -> None:
    scene.render.frame_map_new = 270


def _subframe(scene: bpy.types.Scene) -> None:
    scene.frame_set(7, subframe=0.6)


def _step(scene: bpy.types.Scene) -> None:
    scene.frame_step, scene.frame_end = 5, 9


def _border(scene: bpy.types.Scene) -> None:
    scene.render.use_border, scene.render.border_max_x = True, 0.4


def _colours(scene: bpy.types.Scene) -> None:
    scene.view_settings.use_white_balance = True
    scene.display_settings.display_device = "Display P3"
    scene.render.dither_intensity = 2.0


def _override(scene: bpy.types.Scene) -> None:
    scene.render.image_settings.color_management = "OVERRIDE"
    scene.render.image_settings.view_settings.exposure = 2.0


def _hidden(scene: bpy.types.Scene) -> None:
    """A cube around the camera that a solve has hidden, as the one of a new file."""
    mesh = bpy.data.meshes.new("Cube")
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    mesh.from_pydata(corners, [], [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4)])
    cube = bpy.data.objects.new("Cube", mesh)
    scene.collection.objects.link(cube)
    cube.hide_set(True, view_layer=scene.view_layers[0])
    scene.virtual_aperture.hidden.add().thing = cube


SETTINGS: dict[str, Callable[[bpy.types.Scene], None]] = {
    "stereo": _stereo, "side by side": _side_by_side, "remapped": _remapped, "subframe": _subframe,
    "step": _step, "border": _border, "colours": _colours, "override": _override, "hidden": _hidden,
}  # fmt: skip

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
    import addon

    addon.register()
    bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
    SETTINGS[sys.argv[2]](bpy.context.scene)
    bpy.ops.wm.save_as_mainfile(filepath=sys.argv[1])
