"""CG objects drawn by Cycles, in a process of our own: their layers, and their shadows on the clip.

A render cannot start inside a render: see `cg_process`, whose process this runs in. The scene is a copy,
which is changed as it takes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from ...core.base import limits
from ...core.base.arrays import Floats, Ints, LinearRGB, LinearRGBA, Map
from ...core.base.errors import UserError
from ...core.camera.reconstruction import Intrinsics
from ...core.frame.cg_layers import CGObjects
from ...core.warp.cg_layer import CGLayer
from ...scene.base.timeline import go_to
from ...scene.cg_objects import cg_objects, has_shadows, split_by_depth, stays_sharp
from ...scene.solve.camera import set_intrinsics, set_pixel_aspect
from ..views.quiet import quiet

EMPTY = 1e9
"""Scene units from which on Cycles' depth is that of nothing: it writes 1e10."""
MOST_VERTICES = 200_000
"""Vertices of the clip's mesh that catches shadows; their edges are blurred over a few pixels anyway. Chosen
by inspection."""
TORN = 0.05
"""Relative difference of depth between neighbouring vertices of this mesh that tears it: a shadow falls on
one of two surfaces, and not between."""
FARTHEST = 1000.0
"""Times the median distance, up to which the clip catches shadows."""
PREVIEW_SAMPLES = 32
"""Samples of a preview's CG objects at most, which is denoised. Chosen by inspection."""
PASSES = {"Image": "RGBA", "Depth": "FLOAT", "Shadow Catcher": "RGBA"}
"""Outputs of a render, with the types of their sockets."""


@dataclass(frozen=True)
class Wanted:
    """A request for a drawing of a frame."""

    layer: str
    """Name of the view layer."""
    frame: int
    """Frame of the scene's animation."""
    pinhole: Intrinsics
    """Pinhole of the canvas."""
    margin: int
    """Pixels around the canvas that are drawn, too."""
    plate: Map
    """(h, w) inverse depth of the clip on the canvas, in the reconstruction's unit; empty without shadows."""


def begin(scene: bpy.types.Scene, folder: Path, is_preview: bool) -> None:
    """Have this process `draw` a scene; errors as of `CyclesScene`."""
    global _cycles
    _cycles = CyclesScene(scene, folder, is_preview)


def draw(wanted: Wanted) -> CGObjects:
    """Draw CG objects in this process; UserError where Cycles fails."""
    assert _cycles is not None
    return _cycles.draw(wanted)


class CyclesScene:
    """A scene set up for Cycles to draw its CG objects."""

    def __init__(self, scene: bpy.types.Scene, folder: Path, is_preview: bool) -> None:
        """Pictures pass through the folder. UserError without Cycles."""
        if not hasattr(scene, "cycles"):
            raise UserError("CG objects are rendered by Cycles; enable the add-on Cycles Render Engine")
        self._scene, self._folder = scene, folder
        # Animation follows the frame in the window's scene only.
        bpy.context.window.scene = scene
        settings, render = scene.virtual_aperture, scene.render
        render.engine, render.film_transparent = "CYCLES", True
        render.resolution_percentage = 100
        render.use_border = render.use_sequencer = render.use_multiview = False
        render.use_compositing, render.use_persistent_data = True, True
        if limits.chosen_threads():
            render.threads_mode, render.threads = "FIXED", limits.threads()
        for thing in (settings.points, settings.aperture):
            if thing is not None:
                thing.hide_render = True
        if is_preview:
            cycles = scene.cycles
            cycles.samples = min(cycles.preview_samples, PREVIEW_SAMPLES) or PREVIEW_SAMPLES
            cycles.use_denoising = True
        camera = settings.camera
        camera.data = camera.data.copy()
        camera.data.animation_data_clear()
        camera.data.dof.use_dof = False
        scene.camera = camera

    def draw(self, wanted: Wanted) -> CGObjects:
        """Draw a frame's layers, near ones first, and shadows; UserError where Cycles fails."""
        scene, margin = self._scene, wanted.margin
        layer = scene.view_layers[wanted.layer]
        for each in scene.view_layers:
            each.use = each == layer
        go_to(scene, wanted.frame)
        self._look(wanted.pinhole, margin)
        things = cg_objects(scene, layer)
        depsgraph = layer.depsgraph
        world = np.array(scene.camera.evaluated_get(depsgraph).matrix_world)
        # A view through a camera leaves its scale aside: depth is in the world's unit.
        unit = float(np.linalg.norm(world[:3, 0]))
        to_camera = np.linalg.inv(world / np.array([unit, unit, unit, 1.0]))
        layers, shadow = list[CGLayer | None](), None
        for members, middle in _parts(things, depsgraph, to_camera):
            self._show(things, members)
            drawn = self._render(layer, shadows=False)
            far = drawn["Depth"][..., 0]
            inverse = np.where(far < EMPTY, unit / np.maximum(far, 1e-9), 0).astype(np.float32)
            typical = unit * middle if np.isfinite(middle) else 0.0
            layers.append(CGLayer.of(drawn["Image"], inverse, margin, typical, stays_sharp(members[0])))
        if wanted.plate.size and has_shadows(scene, layer) and any(thing.visible_shadow for thing in things):
            self._show(things, [])
            shadow = self._shadow(layer, wanted, world)
        self._show(things, things)
        return CGObjects(tuple(each for each in layers if each is not None), shadow)

    def _look(self, pinhole: Intrinsics, margin: int) -> None:
        """The canvas's own pinhole, with pixels around it."""
        wide = Intrinsics(
            pinhole.width + 2 * margin, pinhole.height + 2 * margin, pinhole.fx, pinhole.fy,
            pinhole.cx + margin, pinhole.cy + margin,
        )  # fmt: skip
        render = self._scene.render
        render.resolution_x, render.resolution_y = wide.width, wide.height
        set_intrinsics(self._scene.camera.data, wide)
        set_pixel_aspect(render, wide)

    @staticmethod
    def _show(things: Sequence[bpy.types.Object], members: Sequence[bpy.types.Object]) -> None:
        """Have the camera see some of the objects alone; the others are in their light and mirrors still."""
        for thing in things:
            thing.visible_camera = thing in members

    def _shadow(self, layer: bpy.types.ViewLayer, wanted: Wanted, world: Floats) -> LinearRGB:
        """(h, w, 3) share of the light on the clip that its objects leave."""
        plate = _plate(wanted.plate, wanted.pinhole)
        plate.matrix_world = world.T
        plate.is_shadow_catcher, plate.visible_shadow = True, False
        self._scene.collection.objects.link(plate)
        try:
            shadow = self._render(layer, shadows=True)["Shadow Catcher"][..., :3]
        finally:
            mesh = plate.data
            bpy.data.objects.remove(plate)
            bpy.data.meshes.remove(mesh)
        inner = slice(wanted.margin, -wanted.margin or None)
        return np.maximum(shadow[inner, inner], 0)

    def _render(self, layer: bpy.types.ViewLayer, shadows: bool) -> dict[str, LinearRGBA]:
        """The passes (H, W, 4) of a render, by name."""
        layer.use_pass_z, layer.cycles.use_pass_shadow_catcher = not shadows, shadows
        names = ["Shadow Catcher"] if shadows else ["Image", "Depth"]
        self._scene.compositing_node_group = tree = self._written(layer, names)
        try:
            with quiet(1):
                bpy.ops.render.render(scene=self._scene.name)
            return {name: self._read(name) for name in names}
        except (RuntimeError, OSError) as error:
            raise UserError(f"Cycles failed: {str(error).strip()}") from None
        finally:
            self._scene.compositing_node_group = None
            bpy.data.node_groups.remove(tree)

    def _written(self, layer: bpy.types.ViewLayer, names: Sequence[str]) -> bpy.types.NodeTree:
        """A compositor that writes passes into the folder, as they are."""
        tree = bpy.data.node_groups.new("Layers", "CompositorNodeTree")
        source, out = tree.nodes.new("CompositorNodeRLayers"), tree.nodes.new("CompositorNodeOutputFile")
        source.scene, source.layer = self._scene, layer.name
        out.directory, out.file_name = str(self._folder), ""
        out.format.media_type, out.format.file_format = "IMAGE", "OPEN_EXR"
        out.format.color_depth, out.format.color_mode, out.format.exr_codec = "32", "RGBA", "NONE"
        for name in names:
            out.file_output_items.new(PASSES[name], name)
            tree.links.new(source.outputs[name], out.inputs[name])
        return tree

    def _read(self, name: str) -> LinearRGBA:
        """A picture (H, W, 4) that was written. Not by `imbuf`, which loses light where alpha is 0."""
        path = self._folder / f"{name}.exr"
        image = bpy.data.images.load(str(path), check_existing=False)
        try:
            image.colorspace_settings.name, image.alpha_mode = "Non-Color", "PREMUL"
            pixels = np.empty(4 * image.size[0] * image.size[1], np.float32)
            image.pixels.foreach_get(pixels)
            return np.ascontiguousarray(pixels.reshape(image.size[1], image.size[0], 4)[::-1])
        finally:
            bpy.data.images.remove(image)
            path.unlink()


_cycles: CyclesScene | None = None
"""The scene that this process draws."""


def _parts(
    things: Sequence[bpy.types.Object], depsgraph: bpy.types.Depsgraph, to_camera: Floats
) -> list[tuple[list[bpy.types.Object], float]]:
    """Split objects as `split_by_depth` does, those that stay sharp apart from the others."""
    blurred = [each for each in things if not stays_sharp(each)]
    sharp = [each for each in things if stays_sharp(each)]
    return [group for some in (blurred, sharp) for group in split_by_depth(some, depsgraph, to_camera)]


def _plate(inverse: Map, pinhole: Intrinsics) -> bpy.types.Object:
    """The clip's surfaces of inverse depths (h, w) as a mesh before Blender's camera, torn at silhouettes."""
    step = max(1, int(np.ceil(np.sqrt(inverse.size / MOST_VERTICES))))
    rows, columns = (np.arange(0, n, step) for n in inverse.shape)
    near = inverse[np.ix_(rows, columns)].astype(np.float64)
    near = np.maximum(near, max(float(np.median(near)) / FARTHEST, 1e-12))
    place = np.stack(np.meshgrid(columns, rows), axis=-1) + 0.5
    rays = (place - pinhole.principal_point) / pinhole.focal
    local = np.concatenate([rays, np.ones((*near.shape, 1))], axis=2) / near[..., None] * [1, -1, -1]
    mesh = bpy.data.meshes.new("Clip")
    fill(mesh, local.reshape(-1, 3), _cells(near))
    return bpy.data.objects.new("Clip", mesh)


def _cells(inverse: Floats) -> Ints:
    """(n, 4) rows of the vertices of the cells of a raster (h, w) that are whole surfaces."""
    corners = np.stack([inverse[:-1, :-1], inverse[1:, :-1], inverse[1:, 1:], inverse[:-1, 1:]])
    is_whole = corners.max(axis=0) < (1 + TORN) * corners.min(axis=0)
    row, column = np.nonzero(is_whole)
    first = row * inverse.shape[1] + column
    below = first + inverse.shape[1]
    return np.stack([first, below, below + 1, first + 1], axis=1).astype(np.int32)


def fill(mesh: bpy.types.Mesh, local: Floats, cells: Ints) -> None:
    """Vertices (n, 3) and quadrilaterals (k, 4) into an empty mesh."""
    mesh.vertices.add(len(local))
    mesh.attributes["position"].data.foreach_set("vector", local.astype(np.float32).ravel())
    mesh.loops.add(cells.size)
    mesh.loops.foreach_set("vertex_index", cells.ravel())
    mesh.polygons.add(len(cells))
    mesh.polygons.foreach_set("loop_start", np.arange(0, cells.size, 4, dtype=np.int32))
    mesh.update()
