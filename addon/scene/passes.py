"""Passes that a view layer asks for besides Blender's own, and compositor nodes that grade by their matte."""

import bpy
from bpy.props import BoolProperty

from ..core.base.options import options_of
from ..core.frame.range_matte import Range
from .base.option_properties import values_of, with_options

DEPTH = "Depth"
"""Blender's own name of the pass, and its switch is `ViewLayer.use_pass_z`."""
CIRCLE_OF_CONFUSION, IN_FOCUS = "Circle of Confusion", "In Focus"
RANGE_MATTE = "Range Matte"
RANGE = {each.name: each for each in options_of(Range).values()}
"""Options of the range by their names in .blend files."""
NAME = "Range Grade"
"""Name of the node group."""
NUMBERS = (
    ("Matte", 0.0, 0.0, 1.0), ("Exposure", 0.0, -10.0, 10.0), ("Saturation", 1.0, 0.0, 2.0),
    ("Haze", 0.0, 0.0, 1.0),
)  # fmt: skip
"""Inputs of the group with their default, least and largest value; exposure in stops."""
SIDE = 300.0
"""Distance between nodes, in the units of the node editor."""


@with_options(RANGE)
class VirtualAperturePasses(bpy.types.PropertyGroup):
    """Passes of a view layer that only our engine renders."""

    use_circle_of_confusion: BoolProperty(
        name=CIRCLE_OF_CONFUSION,
        description="Signed diameter of each pixel's blur disc in pixels: positive where nearer than the"
        " focus, negative where farther",
        options=set(),
    )
    use_in_focus: BoolProperty(
        name=IN_FOCUS,
        description="Matte of what is sharp: 1 where no blur is visible, 0 where it is",
        options=set(),
    )
    use_range_matte: BoolProperty(
        name=RANGE_MATTE,
        description="Matte of a range of distances, as blurred as the picture: the share of each pixel's"
        " light that comes from there",
        options=set(),
    )


def wanted(layer: bpy.types.ViewLayer) -> tuple[str, ...]:
    """Return the names of our passes besides Combined that a view layer has enabled."""
    ours = layer.virtual_aperture_passes
    switches = {
        DEPTH: layer.use_pass_z,
        CIRCLE_OF_CONFUSION: ours.use_circle_of_confusion,
        IN_FOCUS: ours.use_in_focus,
        RANGE_MATTE: ours.use_range_matte,
    }
    return tuple(name for name, is_on in switches.items() if is_on)


def range_of(layer: bpy.types.ViewLayer) -> Range:
    """Return the range of a view layer's matte."""
    return Range(*values_of(layer.virtual_aperture_passes, RANGE).values())


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
