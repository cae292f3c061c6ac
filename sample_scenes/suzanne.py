"""Suzanne on the sample clip's desk, half behind the globe: the picture of the page on compositing.

    python -m sample_scenes.suzanne --out docs/suzanne.jpg

The clip is solved, she stands on the plane of the points around, and the product renders a frame.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import bpy
import cv2
import numpy as np
from mathutils import Matrix

from addon.core.base.arrays import Floats
from addon.core.camera.reconstruction import Reconstruction
from addon.scene.sources.shot import shot_of

from .desk_scene import opened_desk, rendered

FRAME = 20
PLACE = np.array([428.0, 240.0])
"""Pixel of the clip at which she stands."""
AROUND = np.array([[30.0, 400.0], [215.0, 350.0]])
"""Columns and rows between which most points lie on the desk."""
HEIGHT = 84.0
"""Pixels of the clip that she is tall."""
FLAT = 0.01
"""Of their distance, within which points are on a plane."""
LENS = ("--focus-at", "0.55,0.4@20", "--blur", "0.03")
COLOUR = (0.8, 0.42, 0.16, 1.0)
"""Of copper that was not polished for long."""


def desk_plane(solve: Reconstruction, frame: int) -> tuple[Floats, float]:
    """Normal (3,) towards the camera, and distance along it, of the plane with most points in `AROUND`."""
    image, _ = solve.image_at(frame)
    local = solve.points.xyz @ image.rotation.T + image.translation
    place = solve.intrinsics(image).project(local)
    inside = ((place > AROUND[:, 0]) & (place < AROUND[:, 1])).all(axis=1) & (local[:, 2] > 0)
    points, rng = solve.points.xyz[inside], np.random.default_rng(0)
    limit = FLAT * float(np.median(local[inside, 2]))
    best = np.zeros(len(points), bool)
    for _ in range(500):
        a, b, c = points[rng.choice(len(points), 3, replace=False)]
        normal = np.cross(b - a, c - a)
        normal /= max(np.linalg.norm(normal), 1e-12)
        near = np.abs((points - a) @ normal) < limit
        if near.sum() > best.sum():
            best = near
    middle = points[best].mean(axis=0)
    normal = np.linalg.svd(points[best] - middle)[2][2]
    normal *= np.sign((image.centre - middle) @ normal)
    return normal, float(normal @ middle)


def stand(scene: bpy.types.Scene, frame: int) -> None:
    """Suzanne on the desk, and a lamp above her."""
    solve = shot_of(scene).reconstruction
    up, height = desk_plane(solve, frame)
    image, _ = solve.image_at(frame)
    camera = solve.intrinsics(image)
    ray = image.rotation.T @ np.array([*(PLACE - camera.principal_point) / camera.focal, 1.0])
    foot = image.centre + ray * (height - up @ image.centre) / (up @ ray)
    depth = float((image.rotation @ foot + image.translation)[2])
    tall = HEIGHT * depth / camera.fy
    away = ray - up * (ray @ up)
    away /= np.linalg.norm(away)
    axes = np.column_stack([np.cross(away, up), away, up])
    turn = Matrix.Rotation(np.radians(20), 4, "Z")
    bpy.ops.mesh.primitive_monkey_add(size=tall)
    suzanne = bpy.context.object
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = axes, foot + 0.49 * tall * up
    suzanne.matrix_world = Matrix(pose.tolist()) @ turn
    suzanne.modifiers.new("Smooth", "SUBSURF").render_levels = 2
    bpy.ops.object.shade_smooth()
    material = bpy.data.materials.new("Copper")
    surface = material.node_tree.nodes["Principled BSDF"]
    surface.inputs["Base Color"].default_value = COLOUR
    surface.inputs["Roughness"].default_value = 0.45
    suzanne.data.materials.append(material)
    light = bpy.data.lights.new("Lamp", "SUN")
    light.energy, light.angle = 3.5, np.radians(12)
    lamp = bpy.data.objects.new("Lamp", light)
    down = -up + 0.7 * away + 0.5 * axes[:, 0]
    lamp.rotation_mode = "QUATERNION"
    lamp.rotation_quaternion = Matrix.Identity(3).col[2].rotation_difference((-down).tolist())
    scene.collection.objects.link(lamp)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.jpg")
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--work", type=Path, help="folder of the solve, kept for the next time")
    arguments = parser.parse_args()
    with opened_desk(arguments.work, LENS, FRAME) as (scene, folder):
        stand(scene, FRAME)
        scene.cycles.samples = arguments.samples
        picture = rendered(scene, folder / "suzanne.png")
    arguments.out.write_bytes(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 92])[1].tobytes())


if __name__ == "__main__":
    main()
