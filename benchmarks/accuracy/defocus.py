"""Blender's own answer to the task: the compositor's Defocus node, fed with a picture and its depth."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from addon.render.views.quiet import quiet
from sample_scenes.cycles_views import SENSOR, render_to_array

Picture = NDArray[np.float32]
Floats = NDArray[np.float64]

FARTHEST = 1e9
"""Depth, in focus distances, that stands for infinitely far: the node would make NaN of inf."""


def defocus(
    picture: Picture, depth: Floats, focal: float, radius: float, focus: float, blur_max: float
) -> Picture:
    """Depth of field by the Defocus node.

    `picture` is (H, W, 3) float32 linear light; `depth` (H, W) along the optical axis in scene units, inf
    infinitely far; `focal` in pixels; `radius` of the aperture and `focus`, the depth in focus, in scene
    units; `blur_max` the largest *radius* of a blur disc in pixels, past which the node cuts discs short.
    Returns (H, W, 3) float32. Leaves nothing behind in Blender's data. Raises ValueError if the sizes differ
    or `focal`, `radius` or `focus` is not positive and finite.

    The node takes the disc from Potmesil and Chakravarty 1981, equations 7 and 8, with F = lens / 1000 in
    the units of the depth and aperture diameter F / f_stop:

        D = F^2 / f_stop * |1/Z - 1/Zf| / (1 - F/Zf) * W / 0.036.

    With F = focal * 0.036 / W that is our thin lens but for 1 - F/Zf, there because the paper's film stands
    where the lens makes its image and not at F. The scale of the depths is free, so we choose the one at
    which both lenses are the same at f/1: 2 R (1 - F/Zf) = F.

    `blur_max` should be the largest radius there is and no more: the node searches a square of that radius
    around every pixel, and over about that distance from something sharp it makes the discs smaller.
    """
    if picture.shape[:2] != depth.shape:
        raise ValueError(f"the picture is {picture.shape[:2]}, its depth {depth.shape}")
    if not all(0 < value < np.inf for value in (focal, radius, focus)):
        raise ValueError(f"focal {focal}, radius {radius} and focus {focus} must be positive and finite")
    width = picture.shape[1]
    length = focal * SENSOR / 1000 / width
    scale = length * (1 / (2 * radius) + 1 / focus)
    scaled = np.minimum(depth, FARTHEST * focus) * scale
    with _scratch_scene(picture, scaled) as (scene, node):
        camera = scene.camera.data
        camera.lens = length * 1000
        camera.dof.focus_distance = focus * scale
        node.f_stop = 1.0
        node.blur_max = blur_max
        with tempfile.TemporaryDirectory() as folder, quiet(1):
            return render_to_array(scene, Path(folder) / "defocus.exr")[..., :3].copy()


@contextmanager
def _scratch_scene(
    picture: Picture, depth: Floats
) -> Iterator[tuple[bpy.types.Scene, bpy.types.CompositorNodeDefocus]]:
    """A scene that renders nothing and composites picture and depth; removed with all it needed."""
    scene = bpy.data.scenes.new("Defocus")
    camera = bpy.data.objects.new("Defocus", bpy.data.cameras.new("Defocus"))
    tree = bpy.data.node_groups.new("Defocus", "CompositorNodeTree")
    images = [_image(picture), _image(np.repeat(depth[..., None], 3, axis=2))]
    made = [scene, camera, camera.data, tree, *images]
    try:
        scene.collection.objects.link(camera)
        scene.camera = camera
        camera.data.sensor_fit = "HORIZONTAL"
        camera.data.sensor_width = SENSOR
        scene.compositing_node_group = tree
        _set_up(scene.render, picture.shape[1], picture.shape[0])
        yield scene, _connect(tree, images, scene)
    finally:
        bpy.data.batch_remove(made)


def _set_up(render: bpy.types.RenderSettings, width: int, height: int) -> None:
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y = width, height
    render.resolution_percentage = 100
    render.use_sequencer = False
    render.compositor_device = "CPU"
    render.compositor_precision = "FULL"
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_mode = "RGBA"
    render.image_settings.color_depth = "32"


def _connect(
    tree: bpy.types.NodeTree, images: list[bpy.types.Image], scene: bpy.types.Scene
) -> bpy.types.CompositorNodeDefocus:
    nodes, link = tree.nodes, tree.links.new
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    sources = [nodes.new("CompositorNodeImage") for _ in images]
    for source, image in zip(sources, images, strict=True):
        source.image = image
    red = nodes.new("CompositorNodeSeparateColor")
    node = nodes.new("CompositorNodeDefocus")
    node.scene = scene
    node.use_zbuffer = True
    node.bokeh = "CIRCLE"
    link(sources[0].outputs["Image"], node.inputs["Image"])
    # A colour becomes a value by its luminance, whose weights do not sum to one in float32.
    link(sources[1].outputs["Image"], red.inputs[0])
    link(red.outputs[0], node.inputs["Z"])
    link(node.outputs["Image"], nodes.new("NodeGroupOutput").inputs[0])
    return node


def _image(pixels: NDArray[np.floating]) -> bpy.types.Image:
    """(H, W, 3) floats as they are: no colour space is applied to them."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new("Defocus", width, height, alpha=True, float_buffer=True, is_data=True)
    rgba = np.ones((height, width, 4), dtype=np.float32)
    rgba[..., :3] = pixels[::-1]
    image.pixels.foreach_set(rgba.ravel())
    image.update()
    return image
