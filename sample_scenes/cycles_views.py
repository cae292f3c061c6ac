"""The views of a frame drawn by Cycles: an independent reference for `addon.render.views.gpu_views`.

A render cannot start inside a render, so a second Blender, without a window, does the work. This file is
also that Blender's script: it then imports nothing of ours.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Sequence

    from addon.core.base.arrays import Floats, LinearRGBA
    from addon.core.frame.views import Views
    from addon.core.warp.layer import Layer

SENSOR = 36.0
SCRIPT_MARK = "virtual-aperture-views"


def mean_of_views(views: Views, layers: Sequence[Layer]) -> LinearRGBA:
    """As `gpu_views.mean_of_views`, drawn by Cycles in a child process; RuntimeError where that fails."""
    with tempfile.TemporaryDirectory() as path:
        folder = Path(path)
        _write_job(folder, views, layers)
        command = [*_blender(), __file__, "--", SCRIPT_MARK, str(folder)]
        child = subprocess.run(command, capture_output=True, text=True, check=False)
        if not (folder / "mean.npy").exists():
            last = (child.stderr.strip().splitlines() or ["no message"])[-1]
            raise RuntimeError(f"drawing the views with Cycles failed: {last}")
        mean: LinearRGBA = np.load(folder / "mean.npy")
        return mean


def _blender() -> list[str]:
    """How to run a script in another Blender: the program's own way, or the bpy module's Python."""
    if bpy.app.binary_path:
        return [
            bpy.app.binary_path,
            "--background",
            "--factory-startup",
            "--python-exit-code",
            "1",
            "--python",
        ]
    return [sys.executable]


def _write_job(folder: Path, views: Views, layers: Sequence[Layer]) -> None:
    from addon.core.frame.vignetting import barrel_rows, view_shares
    from addon.core.warp.layer import atlas, joined

    pinhole, mesh = views.canvas.pinhole, joined(layers)
    np.save(folder / "picture.npy", atlas(layers))
    # Corners pinned to themselves lie infinitely far away, which float32 rays do not reach: a hundredth of a
    # pixel of displacement is near enough.
    # Nor do they reach as far in any unit: depths are told in that of the nearest one.
    unit = float(mesh.inverse_depth.max(initial=0.0)) or 1.0
    offsets = unit * views.offsets
    reach = float(np.abs(offsets).max()) * max(pinhole.fx, pinhole.fy)
    inverse = np.maximum(mesh.inverse_depth / unit, 1e-2 / reach if reach > 0 else 1.0)
    np.savez(
        folder / "job.npz",
        size=[pinhole.width, pinhole.height], focal=pinhole.focal, principal_point=pinhole.principal_point,
        xy=mesh.xy, texture_xy=mesh.texture_xy, inverse_depth=inverse, triangles=mesh.triangles,
        offsets=offsets, registration=views.registration, shares=view_shares(views),
        barrels=barrel_rows(views),
    )  # fmt: skip


def warp_object(
    xy: Floats, texture_xy: Floats, inverse_depth: Floats, triangles: NDArray[np.int32],
    focal: Floats, principal_point: Floats, picture: LinearRGBA,
) -> bpy.types.Object:  # fmt: skip
    """A warp mesh in the camera space of the actual camera (Blender axes), glowing with the frame's picture.

    The picture is painted on by projection: texture coordinates are kept times depth, with the depth
    beside them, and divided in the shader, so that they are right in the middle of a triangle too.
    """
    depth = 1 / inverse_depth
    local = np.column_stack([(xy - principal_point) / focal * depth[:, None], depth]) * [1, -1, -1]
    mesh = bpy.data.meshes.new("Warp Mesh")
    mesh.from_pydata([], [], [])
    mesh.vertices.add(len(local))
    mesh.attributes["position"].data.foreach_set("vector", local.astype(np.float32).ravel())
    mesh.loops.add(triangles.size)
    mesh.loops.foreach_set("vertex_index", triangles.astype(np.int32).ravel())
    mesh.polygons.add(len(triangles))
    mesh.polygons.foreach_set("loop_start", np.arange(0, triangles.size, 3, dtype=np.int32))
    height, width = picture.shape[:2]
    share = texture_xy / [width, height]
    coordinates = np.column_stack([share[:, 0], 1 - share[:, 1], np.ones(len(share))]) * depth[:, None]
    attribute = mesh.attributes.new("projected", "FLOAT_VECTOR", "POINT")
    attribute.data.foreach_set("vector", coordinates.astype(np.float32).ravel())
    mesh.update()
    mesh.materials.append(_projecting_material(picture))
    return bpy.data.objects.new("Warp Mesh", mesh)


def _projecting_material(picture: LinearRGBA) -> bpy.types.Material:
    height, width = picture.shape[:2]
    image = bpy.data.images.new("Frame", width, height, alpha=True, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    image.alpha_mode = "PREMUL"
    image.pixels.foreach_set(np.ascontiguousarray(picture[::-1], dtype=np.float32).ravel())
    image.pack()
    material = bpy.data.materials.new("Frame")
    nodes, link = material.node_tree.nodes, material.node_tree.links.new
    nodes.clear()
    projected = nodes.new("ShaderNodeAttribute")
    projected.attribute_name = "projected"
    parts = nodes.new("ShaderNodeSeparateXYZ")
    link(projected.outputs["Vector"], parts.inputs[0])
    place = nodes.new("ShaderNodeCombineXYZ")
    for axis in (0, 1):
        divide = nodes.new("ShaderNodeMath")
        divide.operation = "DIVIDE"
        link(parts.outputs[axis], divide.inputs[0])
        link(parts.outputs[2], divide.inputs[1])
        link(divide.outputs[0], place.inputs[axis])
    texture = nodes.new("ShaderNodeTexImage")
    texture.image = image
    texture.interpolation = "Linear"
    texture.extension = "MIRROR"
    link(place.outputs[0], texture.inputs["Vector"])
    glow, out = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    link(texture.outputs["Color"], glow.inputs["Color"])
    link(glow.outputs[0], out.inputs["Surface"])
    if picture[..., 3].min() < 1:
        # Premultiplied: what a pixel leaves uncovered of what is behind it is added to its colour.
        through, both = nodes.new("ShaderNodeBsdfTransparent"), nodes.new("ShaderNodeAddShader")
        rest = nodes.new("ShaderNodeMath")
        rest.operation = "SUBTRACT"
        rest.inputs[0].default_value = 1.0
        link(texture.outputs["Alpha"], rest.inputs[1])
        link(rest.outputs[0], through.inputs["Color"])
        link(glow.outputs[0], both.inputs[0])
        link(through.outputs[0], both.inputs[1])
        link(both.outputs[0], out.inputs["Surface"])
    return material


def set_up(
    scene: bpy.types.Scene, warp: bpy.types.Object, size: tuple[int, int], samples: int
) -> bpy.types.Camera:
    """A scene with the warp mesh alone, seen by a camera at the origin; returns the camera's data."""
    scene.collection.objects.link(warp)
    scene.world = None
    camera = bpy.data.objects.new("View", bpy.data.cameras.new("View"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    nearest = float(np.abs(np.array([v.co.z for v in warp.data.vertices])).min())
    camera.data.clip_start, camera.data.clip_end = nearest * 1e-3, nearest * 1e9
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y = size
    render.resolution_percentage = 100
    render.film_transparent = True
    render.use_compositing = render.use_sequencer = False
    render.use_persistent_data = True
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_mode = "RGBA"
    render.image_settings.color_depth = "32"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples = samples
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.max_bounces = 0
    # A view is sampled at pixel centres, as the GPU does.
    cycles.pixel_filter_type = "BOX"
    cycles.filter_width = 0.01
    return camera.data


def point_camera(
    scene: bpy.types.Scene, focal: Floats, principal_point: Floats, offset: Floats, registration: Floats
) -> None:
    """Move the camera to a position on the aperture, with lens and shift that do the registration."""
    width, height = scene.render.resolution_x, scene.render.resolution_y
    zoom = registration[0, 0]
    (fx, fy), (cx, cy) = focal * zoom, principal_point * zoom + registration[:, 2]
    camera = scene.camera
    camera.location = (offset[0], -offset[1], 0.0)
    camera.data.sensor_fit = "HORIZONTAL"
    camera.data.sensor_width = SENSOR
    camera.data.lens = fx * SENSOR / width
    camera.data.shift_x = -(cx - width / 2) / width
    camera.data.shift_y = (cy - height / 2) / width * (fx / fy)
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = max(fy / fx, 1.0), max(fx / fy, 1.0)


def render_to_array(scene: bpy.types.Scene, path: Path) -> LinearRGBA:
    """Render the scene and read it back from an EXR: a render result has no pixels without a window."""
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True, scene=scene.name)
    image = bpy.data.images.load(str(path), check_existing=False)
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    pixels = np.empty(width * height * 4, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels.reshape(height, width, 4)[::-1].copy()


def _barrel_light(barrel: Floats, middle: Floats, size: tuple[int, int]) -> NDArray[np.float64]:
    """(h, w, 1) light that each pixel of a view has, by a row of `core.frame.vignetting.barrel_rows`."""
    a, b, c, d, e = barrel
    if not c:
        return np.ones((1, 1, 1))
    y, x = (np.arange(n) + 0.5 - place for n, place in zip(size, middle[::-1], strict=True))
    away = np.hypot(a + c * x[None, :], b + c * y[:, None])
    return np.asarray(np.clip(e * (1 + d - away), 0, 1)[..., None])


def _work(folder: Path) -> None:
    job = np.load(folder / "job.npz")
    names = ("xy", "texture_xy", "inverse_depth", "triangles", "focal", "principal_point")
    # The nearest vertex comes to distance 1, so that float32 serves any scene scale.
    unit = float(job["inverse_depth"].max())
    parts = {name: job[name] for name in names} | {"inverse_depth": job["inverse_depth"] / unit}
    scene = bpy.data.scenes.new("Views")
    warp = warp_object(**parts, picture=np.load(folder / "picture.npy"))
    set_up(scene, warp, (int(job["size"][0]), int(job["size"][1])), samples=1)
    total = np.zeros((scene.render.resolution_y, scene.render.resolution_x, 4), dtype=np.float64)
    lights = [
        share * _barrel_light(barrel, job["principal_point"], total.shape[:2])
        for share, barrel in zip(job["shares"], job["barrels"], strict=True)
    ]
    views = list(zip(job["offsets"] * unit, job["registration"], lights, strict=True))
    for offset, registration, light in views:
        point_camera(scene, job["focal"], job["principal_point"], offset, registration)
        total += light * render_to_array(scene, folder / "view.exr")
    np.save(folder / "mean.part.npy", (total / len(views)).astype(np.float32))
    (folder / "mean.part.npy").rename(folder / "mean.npy")


if __name__ == "__main__" and SCRIPT_MARK in sys.argv:
    _work(Path(sys.argv[sys.argv.index(SCRIPT_MARK) + 1]))
