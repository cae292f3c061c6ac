"""Open a .blend, damage a property, save it, open it again and render as Blender's command line does.

    python damaged_blend.py FILE.blend PROPERTY SEED

Status 0 where a frame was rendered, 1 where it was refused.
"""

from __future__ import annotations

import random
import sys
from pathlib import Path

import bpy

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
    import addon
    from addon.core.base.errors import UserError
    from addon.render import engine

    addon.register()
    blend, name, seed = sys.argv[1], sys.argv[2], int(sys.argv[3])
    dice = random.Random(seed)
    bpy.ops.wm.open_mainfile(filepath=blend)
    scene = bpy.context.scene
    settings = scene.virtual_aperture
    if name == "render":
        scene.render.resolution_x = dice.choice([4, 5, 96, 97, 5000])
        scene.render.resolution_percentage = dice.choice([1, 50, 100, 300])
        scene.frame_current = dice.choice([-100, 0, 1, 24, 25, 10000])
    elif name == "mesh":
        mesh = settings.points.data
        attribute = dice.choice(list(mesh.attributes))
        if attribute.is_required:
            mesh.vertices.add(3)
        else:
            mesh.attributes.remove(attribute)
    else:
        value: object
        kind = settings.bl_rna.properties[name].type
        if kind == "STRING":
            value = dice.choice(["", "//", "nowhere", "//../../x", "\n", "é" * 200, "//clip", "/dev/null"])
        elif kind == "FLOAT":
            value = dice.choice([float("nan"), float("inf"), 0.0, -1.0, 1e-30, 1e30])
        elif kind == "INT":
            value = dice.choice([-(2**31), -1, 0, 1, 3, 4096])
        elif kind == "BOOLEAN":
            value = dice.random() < 0.5
        elif kind == "ENUM":
            value = dice.choice([item.identifier for item in settings.bl_rna.properties[name].enum_items])
        else:
            value = dice.choice([None, scene.camera, settings.root])
        setattr(settings, name, value)
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    bpy.ops.wm.open_mainfile(filepath=blend)
    scene = bpy.context.scene
    scene.frame_start = scene.frame_end = scene.frame_current if name == "render" else 5
    scene.render.filepath = str(Path(blend).parent / "render") + "/"
    try:
        with engine.watched() as watch:
            bpy.ops.render.render(animation=True)
        watch.raise_error()
    except (RuntimeError, UserError) as error:
        print(f"error: {error}".splitlines()[0])
        sys.exit(1)
