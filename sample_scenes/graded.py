"""A title behind the globe of the sample clip, sharp, before a background that is graded by its distance.

    python -m sample_scenes.graded --out docs/graded.jpg

Left the frame through the lens, right the same with a title that stays sharp, and the range behind the title
darker and paler by *Add Grade Nodes*.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import bpy
import cv2
import numpy as np
from mathutils import Matrix

from addon.scene.cg_objects import STAYS_SHARP
from addon.scene.passes import add_grade_nodes

from .desk_scene import opened_desk, rendered

FRAME = 20
LENS = ("--focus-at", "0.55,0.4@20", "--blur", "0.04")
BEHIND = 1.25
"""Distance of the title over that of the globe, which is in focus."""
PLACE, SIZE = (-0.42, 0.02), 0.16
"""Left end and base line of the title from the picture's middle, and its size, in shares of the width."""
GRADE = {"Exposure": -1.3, "Saturation": 0.25}


def add_title(scene: bpy.types.Scene, distance: float) -> None:
    """A line of text that faces the camera, at a distance."""
    camera = scene.virtual_aperture.camera
    curve = bpy.data.curves.new("Title", "FONT")
    curve.body = "THE GLOBE"
    title = bpy.data.objects.new("Title", curve)
    wide = distance * camera.data.sensor_width / camera.data.lens
    place = Matrix.Translation((PLACE[0] * wide, PLACE[1] * wide, -distance))
    title.matrix_world = camera.matrix_world.normalized() @ place @ Matrix.Scale(SIZE * wide, 4)
    material = bpy.data.materials.new("Title")
    nodes = material.node_tree.nodes
    nodes.clear()
    glow, out = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    glow.inputs["Color"].default_value = (0.95, 0.75, 0.2, 1)
    material.node_tree.links.new(glow.outputs[0], out.inputs["Surface"])
    curve.materials.append(material)
    setattr(title, STAYS_SHARP, True)
    scene.collection.objects.link(title)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.jpg")
    parser.add_argument("--work", type=Path, help="folder of the solve, kept for the next time")
    arguments = parser.parse_args()
    with opened_desk(arguments.work, LENS, FRAME) as (scene, folder):
        plain = rendered(scene, folder / "plain.png")
        distance = BEHIND * scene.virtual_aperture.focus_distance
        add_title(scene, distance)
        scene.cycles.samples = 64
        grade = add_grade_nodes(scene, bpy.context.view_layer)
        bpy.context.view_layer.virtual_aperture_passes.range_near = 1.05 * distance
        for name, value in GRADE.items():
            grade.inputs[name].default_value = value
        both = np.hstack([plain, rendered(scene, folder / "graded.png")])
    arguments.out.write_bytes(cv2.imencode(".jpg", both, [cv2.IMWRITE_JPEG_QUALITY, 88])[1].tobytes())


if __name__ == "__main__":
    main()
