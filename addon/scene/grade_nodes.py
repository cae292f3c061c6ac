"""Compositor nodes that grade a range of distances by its matte: exposure, saturation, haze."""

import bpy

from .passes import RANGE_MATTE

NAME = "Range Grade"
"""Name of the node group."""
NUMBERS = (
    ("Matte", 0.0, 0.0, 1.0), ("Exposure", 0.0, -10.0, 10.0), ("Saturation", 1.0, 0.0, 2.0),
    ("Haze", 0.0, 0.0, 1.0),
)  # fmt: skip
"""Inputs of the group with their default, least and largest value; exposure in stops."""
SIDE = 300.0
"""Distance between nodes, in the units of the node editor."""


def add_grade_nodes(scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> bpy.types.Node:
    """Add a node that grades the range of a view layer, and return it.

    A scene without a compositor gets one with this node between render and output. In another one, a Render
    Layers node and the grade stand beside the user's nodes, whose links stay as they are.
    """
    layer.virtual_aperture_passes.use_range_matte = True
    tree = scene.compositing_node_group
    is_new = tree is None
    if is_new:
        tree = scene.compositing_node_group = bpy.data.node_groups.new("Compositing", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    x = max((node.location.x + node.width for node in tree.nodes), default=0.0) + SIDE
    source, grade = tree.nodes.new("CompositorNodeRLayers"), tree.nodes.new("CompositorNodeGroup")
    source.scene, source.layer, grade.node_tree = scene, layer.name, _group()
    source.location.x, grade.location.x = x, x + SIDE
    tree.links.new(source.outputs["Image"], grade.inputs["Image"])
    tree.links.new(source.outputs[RANGE_MATTE], grade.inputs["Matte"])
    if is_new:
        out = tree.nodes.new("NodeGroupOutput")
        out.location.x = x + 2 * SIDE
        tree.links.new(grade.outputs["Image"], out.inputs["Image"])
    return grade


def _group() -> bpy.types.NodeTree:
    """The node group, made once in a file."""
    if (found := bpy.data.node_groups.get(NAME)) is not None:
        return found
    tree = bpy.data.node_groups.new(NAME, "CompositorNodeTree")
    add, link = tree.nodes.new, tree.links.new
    tree.interface.new_socket("Image", socket_type="NodeSocketColor")
    for name, value, least, most in NUMBERS:
        made = tree.interface.new_socket(name, socket_type="NodeSocketFloat")
        made.default_value, made.min_value, made.max_value = value, least, most
    tree.interface.new_socket("Haze Color", socket_type="NodeSocketColor").default_value = (0.6, 0.7, 0.8, 1)
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    given, out = add("NodeGroupInput"), add("NodeGroupOutput")
    exposure, saturation = add("CompositorNodeExposure"), add("CompositorNodeHueSat")
    graded, haze, product = add("ShaderNodeMix"), add("ShaderNodeMix"), add("ShaderNodeMath")
    graded.data_type = haze.data_type = "RGBA"
    product.operation = "MULTIPLY"
    for number, node in enumerate((given, exposure, saturation, graded, product, haze, out)):
        node.location.x = number * SIDE
    link(given.outputs["Image"], exposure.inputs["Image"])
    link(given.outputs["Exposure"], exposure.inputs["Exposure"])
    link(exposure.outputs["Image"], saturation.inputs["Image"])
    link(given.outputs["Saturation"], saturation.inputs["Saturation"])
    _mix(tree, graded, given.outputs["Matte"], given.outputs["Image"], saturation.outputs["Image"])
    link(given.outputs["Matte"], product.inputs[0])
    link(given.outputs["Haze"], product.inputs[1])
    _mix(tree, haze, product.outputs[0], _result(graded), given.outputs["Haze Color"])
    link(_result(haze), out.inputs["Image"])
    return tree


def _mix(
    tree: bpy.types.NodeTree, node: bpy.types.Node, share: bpy.types.NodeSocket, first: bpy.types.NodeSocket,
    second: bpy.types.NodeSocket,
) -> None:  # fmt: skip
    """Link the inputs of a node that mixes colours."""
    inputs = [each for each in node.inputs if each.enabled]
    for source, target in zip((share, first, second), inputs, strict=True):
        tree.links.new(source, target)


def _result(node: bpy.types.Node) -> bpy.types.NodeSocket:
    """The active output of a node that mixes colours."""
    return next(each for each in node.outputs if each.enabled)
