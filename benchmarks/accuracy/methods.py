"""The methods that are compared, each a function from what is given to a picture."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from addon.core.base.errors import UserError
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Points, Reconstruction
from addon.core.lens.aperture_sampling import vogel_disc
from addon.core.lens.focus import Focus, exact_registration
from addon.core.lens.frame import WarpedFrame
from addon.core.lens.plan import FramePlan, LensSettings, edged_plan, layered_plan, plan_frame
from addon.core.warp.disocclusion_fill import HiddenColours
from addon.core.warp.mesh import WarpMesh
from addon.render import cycles_views
from addon.render.average import draw_mean
from addon.render.quiet import quiet

from . import oracle
from .cases import Given
from .defocus import defocus
from .scatter import scatter

Picture = NDArray[np.float32]
Floats = NDArray[np.float64]

CLOSE = 0.25
"""Share of an inverse depth by which a true surface may be off and still be meant."""


@dataclass(frozen=True)
class Answer:
    picture: Picture
    """(H, W, 3) linear."""
    views: int
    """How many were averaged; for Cycles, samples a pixel; 0 where there are none."""
    triangles: int = 0


@dataclass(frozen=True)
class Method:
    run: Callable[[Given, int], Answer]
    views: tuple[int, ...]
    quick: tuple[int, ...]
    sources: tuple[str, ...]
    """Files that it is made of: its figures are stale when one changes."""
    tracks: tuple[str, ...] = ("T1", "T2")
    prepare: Callable[[Given], Given] = lambda given: given
    """Done before the clock starts; raises UserError where the method cannot be used."""


def no_blur(given: Given, views: int) -> Answer:
    """The frame as it is."""
    return Answer(given.picture[..., :3], 0)


def thesis(given: Given, views: int) -> Answer:
    """The thesis's method: features, pinned corners, random positions, fitted registration."""
    rec, focus = _with_picks(given)
    return _drawn(
        given, plan_frame(rec, given.frame, LensSettings(focus, given.radius, views, "thesis"), _size(given))
    )


def layers(given: Given, views: int) -> Answer:
    """Our method, with the depth that it finds itself (or is given); 0 views leaves the number to it."""
    return _layers(given, views)


def told(given: Given, views: int) -> Answer:
    """Ours, told the colours of all that the frame hides: what it lacks then is not what nobody saw."""
    surfaces = given.layers(0)
    assert surfaces is not None
    return _layers(given, views, partial(_colours, surfaces))


def _layers(given: Given, views: int, hidden_colours: HiddenColours | None = None) -> Answer:
    lens = LensSettings(given.focus, given.radius, views)
    plan = plan_frame(given.reconstruction, given.frame, lens, _size(given))
    picture, inverse = plan.canvas.from_source(given.picture), 1 / given.depth
    if hidden_colours is None and given.disocclusion is not None:
        hidden_colours = given.disocclusion.reprojected(given.frame, plan.canvas, picture, inverse).colours
    made, texture, _ = layered_plan(plan, given.radius, picture, inverse, hidden_colours)
    return _drawn(given, made, texture)


def _colours(
    surfaces: oracle.LayeredDepthImage, places: Floats, inverse: Floats
) -> tuple[Picture, NDArray[np.bool_]]:
    """What is `HiddenColours`, of the layer that is there at about the inverse depth, if any."""
    limit = np.array(surfaces.layers[0].inverse_depth.shape[::-1]) - 1
    column, row = np.clip(np.floor(places).astype(int) + surfaces.margin, 0, limit).T
    colours, known = np.zeros((len(places), 3), np.float32), np.zeros(len(places), bool)
    least = CLOSE * np.abs(inverse)
    for layer in surfaces.layers:
        seen = layer.picture[row, column]
        off = np.abs(layer.inverse_depth[row, column] - inverse)
        best = (seen[:, 3] > 0.5) & (off < least)
        colours[best] = seen[best, :3] / seen[best, 3:]
        least, known = np.where(best, off, least), known | best
    return colours, known


def features(given: Given, views: int) -> Answer:
    """One mesh over the feature points; 0 views leaves the number to it."""
    lens = LensSettings(given.focus, given.radius, views, "features")
    return _drawn(given, plan_frame(given.reconstruction, given.frame, lens, _size(given)))


def grid(given: Given, views: int) -> Answer:
    """A regular grid that follows the feature points (content-preserving warp)."""
    lens = LensSettings(given.focus, given.radius, views, "grid")
    return _drawn(given, plan_frame(given.reconstruction, given.frame, lens, _size(given)))


def edges(given: Given, views: int) -> Answer:
    """Triangles along the picture's edges, with the feature points' depth."""
    lens = LensSettings(given.focus, given.radius, views, "edges")
    plan = plan_frame(given.reconstruction, given.frame, lens, _size(given))
    picture = plan.canvas.from_source(given.picture)
    return _drawn(given, edged_plan(plan, given.reconstruction, given.radius, picture))


def dense(given: Given, views: int) -> Answer:
    """One connected mesh with a vertex in the middle of every pixel, drawn as our own."""
    return _drawn(given, _dense_plan(given, views))


def cycles(given: Given, views: int) -> Answer:
    """Cycles' thin lens on the mesh over the feature points; `views` are its samples."""
    plan = plan_frame(
        given.reconstruction, given.frame, LensSettings(given.focus, given.radius, 16), _size(given)
    )
    return Answer(_thin_lens(given, plan, views), views, len(plan.mesh.triangles))


def defocus_node(given: Given, views: int) -> Answer:
    """Blender's compositor node."""
    largest = float(np.abs(given.disc).max()) / 2
    return Answer(
        defocus(given.picture[..., :3], given.depth, given.focal, given.radius, given.focus_depth, largest), 0
    )


def scattered(given: Given, views: int) -> Answer:
    """Classical scatter."""
    return Answer(scatter(given.picture[..., :3], given.disc), 0)


def knowing(given: Given, views: int) -> Answer:
    """The oracle."""
    layers = given.layers(0)
    assert layers is not None
    return Answer(oracle.render(layers, given.focal, given.radius, given.focus_depth, views), views)


def with_layers(given: Given) -> Given:
    """The hidden surfaces, as far past the border as a view can see; UserError where nobody knows them."""
    layers = given.layers(int(np.ceil(np.abs(given.disc).max() / 2)) + 2)
    if layers is None:
        raise UserError("nobody knows what this scene hides")
    return replace(given, layers=lambda margin: layers)


PRODUCT = ("addon/core", "addon/render")
METHODS = {
    "no blur": Method(no_blur, (0,), (0,), ()),
    "thesis": Method(thesis, (16, 64, 256), (16, 64, 256), PRODUCT),
    "layers": Method(layers, (4, 16, 64, 256), (16, 64), PRODUCT),
    "told": Method(told, (256,), (64,), (*PRODUCT, "benchmarks/accuracy/oracle.py"), ("T1",), with_layers),
    "features": Method(features, (16, 64), (64,), PRODUCT),
    "grid": Method(grid, (64,), (64,), PRODUCT),
    "edges": Method(edges, (64,), (64,), PRODUCT),
    "dense mesh": Method(dense, (64,), (64,), PRODUCT, ("T1",)),
    "Cycles": Method(cycles, (16,), (16,), PRODUCT),
    "Defocus": Method(defocus_node, (0,), (0,), ("benchmarks/accuracy/defocus.py",)),
    "scatter": Method(scattered, (0,), (0,), ("benchmarks/accuracy/scatter.py",)),
    "oracle": Method(knowing, (64,), (64,), ("benchmarks/accuracy/oracle.py",), ("T1",), with_layers),
}


def _size(given: Given) -> tuple[int, int]:
    return given.picture.shape[1], given.picture.shape[0]


def _drawn(given: Given, plan: FramePlan, texture: Picture | None = None) -> Answer:
    """As the product draws it; a texture of its own belongs to a mesh that leaves no gaps."""
    is_whole = texture is not None
    texture = plan.canvas.from_source(given.picture) if texture is None else texture
    warped = WarpedFrame(plan, texture, "", "", is_whole)
    mean = draw_mean(warped, lambda note: None)
    return Answer(plan.canvas.to_source(mean)[..., :3], len(plan.offsets), len(plan.mesh.triangles))


def _with_picks(given: Given) -> tuple[Reconstruction, Focus]:
    """Focus points: the thesis's method registers views by points: a mere distance gets four."""
    rec = given.reconstruction
    if given.focus.points:
        return rec, given.focus
    image, _ = rec.image_at(given.frame)
    lens, z = rec.intrinsics(image), given.focus_depth
    corners = np.array([[0.35, 0.35], [0.65, 0.35], [0.35, 0.65], [0.65, 0.65]]) * [lens.width, lens.height]
    local = np.column_stack([(corners - lens.principal_point) / lens.focal, np.ones(4)]) * z
    points = Points(
        np.concatenate([rec.points.xyz, (local - image.translation) @ image.rotation]),
        np.concatenate([rec.points.rgb, np.zeros((4, 3), np.uint8)]),
        np.concatenate([rec.points.error, np.zeros(4)]),
    )
    first = len(rec.points)
    return replace(rec, points=points), Focus(points=(first, first + 1, first + 2, first + 3))


def _dense_plan(given: Given, views: int) -> FramePlan:
    image, _ = given.reconstruction.image_at(given.frame)
    canvas = Canvas(given.reconstruction.intrinsics(image))
    height, width = given.depth.shape
    # Past the border the outermost pixel's depth goes on, as far as any view can see.
    margin = float(np.abs(given.disc).max()) / 2 + 2
    across = np.concatenate([[-margin], np.arange(width) + 0.5, [width + margin]])
    down = np.concatenate([[-margin], np.arange(height) + 0.5, [height + margin]])
    xy = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    inverse = np.pad(1 / given.depth, 1, mode="edge").ravel()
    index = np.arange(len(xy), dtype=np.int32).reshape(height + 2, width + 2)
    a, b, c, d = (
        index[i, j].ravel() for i in (slice(-1), slice(1, None)) for j in (slice(-1), slice(1, None))
    )
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([b, d, c], axis=1)])
    offsets = given.radius * vogel_disc(views)
    focus = 1 / given.focus_depth
    return FramePlan(
        given.frame, canvas, WarpMesh(xy, xy, inverse, triangles), offsets,
        exact_registration(canvas, offsets, focus), focus, float(np.abs(given.disc).max()), False,
    )  # fmt: skip


def _thin_lens(given: Given, plan: FramePlan, samples: int) -> Picture:
    """Cycles' own lens, with the units chosen so that its f-stop stays in Blender's range."""
    lens, mesh, unit = plan.canvas.pinhole, plan.mesh, given.radius / 0.01
    inverse = np.maximum(mesh.inverse_depth, 1e-6 * mesh.inverse_depth.max()) * unit
    picture = plan.canvas.from_source(given.picture)
    scene = bpy.data.scenes.new("lens")
    warp = cycles_views.warp_object(
        mesh.xy, mesh.texture_xy, inverse, mesh.triangles, lens.focal, lens.principal_point, picture
    )
    try:
        camera = cycles_views.set_up(scene, warp, (lens.width, lens.height), samples)
        cycles_views.point_camera(scene, lens.focal, lens.principal_point, np.zeros(2), np.eye(2, 3))
        camera.dof.use_dof = True
        camera.dof.focus_distance = 1 / (plan.focus_inverse_depth * unit)
        camera.dof.aperture_fstop = camera.lens * 1e-3 / (2 * 0.01)
        with tempfile.TemporaryDirectory() as folder, quiet(1):
            drawn = cycles_views.render_to_array(scene, Path(folder) / "lens.exr")
        return plan.canvas.to_source(drawn)[..., :3]
    finally:
        _remove(scene, warp)


def _remove(scene: bpy.types.Scene, warp: bpy.types.Object) -> None:
    mesh = warp.data
    material = mesh.materials[0]
    image = next(node.image for node in material.node_tree.nodes if node.type == "TEX_IMAGE")
    data = [thing.data for thing in scene.objects]
    for thing in list(scene.objects):
        bpy.data.objects.remove(thing)
    bpy.data.scenes.remove(scene)
    bpy.data.batch_remove([*data, material, image])
