"""Refocusing in Blender's compositor from a two-layer EXR: `python -m benchmarks.special exported_layers`.

With true depth (T1), against the real lens: our own frame, the compositor's Defocus of the sharp frame and
its depth, and the compositor's recipe of docs/compositing.md from the exported file: what is nearer than the
focus and what is farther, with the hidden layer behind, each through Defocus, put over each other.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import bpy
import numpy as np

from addon.core.frame.highlights import HighlightSettings
from addon.core.frame.plan import FrameOptions
from addon.core.frame.two_layers import two_layers
from addon.core.media.exr_file import write_exr
from addon.render.views.quiet import quiet
from sample_scenes.cycles_views import SENSOR, render_to_array

from . import metrics
from .cases import BenchmarkCase, GroundTruth
from .judge import save_picture
from .methods import METHODS
from .scenes import Picture, Staged

NOISE = 0.02
VIEWS = 64
NEAREST = 0.02
"""Of the focus distance: depth around what is near, so that its blur reaches beyond its own pixels."""


def in_compositor(file: Path, case: BenchmarkCase) -> Picture:
    """(H, W, 3) a two-layer EXR through Defocus, at the focus and aperture of a case."""
    height, width = case.picture.shape[:2]
    length = case.focal * SENSOR / 1000 / width
    # As `defocus` has it: the scale at which the node's lens is ours at f/1.
    scale = length * (1 / (2 * case.radius) + 1 / case.focus_depth)
    scene = bpy.data.scenes.new("Refocus")
    camera = bpy.data.objects.new("Refocus", bpy.data.cameras.new("Refocus"))
    scene.collection.objects.link(camera)
    scene.camera, camera.data.sensor_width, camera.data.lens = camera, SENSOR, 1000 * length
    camera.data.sensor_fit, camera.data.dof.focus_distance = "HORIZONTAL", case.focus_depth * scale
    render, settings = scene.render, scene.render.image_settings
    render.engine, render.resolution_x, render.resolution_y = "CYCLES", width, height
    render.use_sequencer, render.resolution_percentage = False, 100
    render.compositor_device, render.compositor_precision = "CPU", "FULL"
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGBA", "32"
    tree = scene.compositing_node_group = bpy.data.node_groups.new("Refocus", "CompositorNodeTree")
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    nodes, link = tree.nodes, tree.links.new

    def layer(name: str) -> bpy.types.Node:
        node = nodes.new("CompositorNodeImage")
        node.image, node.layer = bpy.data.images.load(str(file), check_existing=True), name
        return node

    def math(operation: str, *values: object) -> bpy.types.NodeSocket:
        node = nodes.new("ShaderNodeMath")
        node.operation = operation
        for socket, value in zip(node.inputs, values, strict=False):
            if isinstance(value, bpy.types.NodeSocket):
                link(value, socket)
            else:
                socket.default_value = value
        return node.outputs[0]

    def masked(image: bpy.types.NodeSocket, mask: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        node = nodes.new("CompositorNodeSetAlpha")
        node.inputs["Type"].default_value = "Apply Mask"
        link(image, node.inputs["Image"])
        link(mask, node.inputs["Alpha"])
        return node.outputs[0]

    def over(below: bpy.types.NodeSocket, above: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        node = nodes.new("CompositorNodeAlphaOver")
        link(below, node.inputs["Background"])
        link(above, node.inputs["Foreground"])
        return node.outputs[0]

    def blurred(image: bpy.types.NodeSocket, depth: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        node = nodes.new("CompositorNodeDefocus")
        node.scene, node.use_zbuffer, node.bokeh, node.f_stop = scene, True, "CIRCLE", 1.0
        node.blur_max = float(np.abs(case.disc).max()) / 2
        link(image, node.inputs["Image"])
        link(math("MULTIPLY", depth, scale), node.inputs["Z"])
        return node.outputs[0]

    front, hidden = layer("Front"), layer("Hidden")
    seen, behind = front.outputs["Depth"], hidden.outputs["Depth"]
    nearer = math("LESS_THAN", seen, case.focus_depth)
    farther = math("SUBTRACT", 1.0, nearer)
    around = NEAREST * case.focus_depth
    near_depth = math("ADD", math("MULTIPLY", nearer, seen), math("MULTIPLY", farther, around))
    far_depth = math("ADD", math("MULTIPLY", farther, seen), math("MULTIPLY", nearer, behind))
    near = blurred(masked(front.outputs["Combined"], nearer), near_depth)
    whole = over(hidden.outputs["Combined"], masked(front.outputs["Combined"], farther))
    link(over(blurred(whole, far_depth), near), nodes.new("NodeGroupOutput").inputs[0])
    with tempfile.TemporaryDirectory() as folder, quiet(1):
        picture = render_to_array(scene, Path(folder) / "refocused.exr")
    return np.asarray(picture[..., :3] / np.maximum(picture[..., 3:], 0.05), np.float32)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", default="bars")
    parser.add_argument("--blur", type=int, default=32)
    options = parser.parse_args()
    scene = Staged(options.scene, NOISE)
    frame = scene.judged(options.blur)[0]
    case, truth = GroundTruth(scene).case(frame, options.blur), scene.truth(frame, options.blur).picture
    lens = FrameOptions(case.focus, case.radius, highlights=HighlightSettings(gain=0.0))
    size = case.picture.shape[1], case.picture.shape[0]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "layers.exr"
        write_exr(file, two_layers(case.clip, frame, lens, size).channels())
        pictures = {
            "ours": METHODS["layers"].run(case, VIEWS).picture,
            "Defocus": METHODS["Defocus"].run(case, VIEWS).picture,
            "two layers": in_compositor(file, case),
        }
    edges = metrics.edge_band(1 / scene.depth(frame))
    for name, picture in pictures.items():
        values = [metrics.psnr(picture, truth, where) for where in (None, edges)]
        save_picture(options.scene, "export", options.blur, name, VIEWS, picture)
        print(f"{options.scene}, frame {frame}, {name}: {values[0]:.2f} dB, at edges {values[1]:.2f} dB")
    apart = metrics.psnr(pictures["two layers"], pictures["ours"], None)
    print(f"two layers in the compositor against ours: {apart:.2f} dB")


if __name__ == "__main__":
    main()
