"""The methods that are compared, each a function from what is case to a picture."""

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
from addon.core.camera.reconstruction import Points, Reconstruction
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.frame import Frame
from addon.core.frame.frame_path import mesh_frame
from addon.core.frame.highlights import HighlightSettings
from addon.core.frame.plan import FrameOptions
from addon.core.frame.quality import DRAFT, FINAL, NORMAL, Quality
from addon.core.frame.views import Views
from addon.core.frame.vignetting import LEAST_LEFT
from addon.core.optics.aperture import ApertureSamples
from addon.core.optics.aperture_sampling import vogel_disc
from addon.core.optics.thin_lens import ThinLens
from addon.core.warp.layer import Layer, atlas
from addon.core.warp.mesh import WarpMesh
from addon.render.views import gpu_views
from addon.render.views.average import draw_mean, render_frame
from addon.render.views.quiet import quiet
from sample_scenes import cycles_views, staging

from . import oracle
from .cases import BenchmarkCase, ClipWithFill
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
    run: Callable[[BenchmarkCase, int], Answer]
    views: tuple[int, ...]
    sources: tuple[str, ...]
    """Files that it is made of: its figures are stale when one changes."""
    tracks: tuple[str, ...] = ("T1", "T2")
    prepare: Callable[[BenchmarkCase], BenchmarkCase] = lambda case: case
    """Done before the clock starts; raises UserError where the method cannot be used."""
    depth: Quality | None = None
    """Of the depth of every pixel that it needs; None where it needs none."""


def no_blur(case: BenchmarkCase, views: int) -> Answer:
    """The frame as it is."""
    return Answer(case.picture[..., :3], 0)


def thesis(case: BenchmarkCase, views: int) -> Answer:
    """The thesis's method: features, pinned corners, random positions, fitted registration."""
    rec, focus = _with_picks(case)
    return through(
        case,
        replace(case.clip, reconstruction=rec),
        FrameOptions(focus, case.radius, views, "thesis", highlights=HighlightSettings(gain=0)),
    )


def by_mesher(name: str, case: BenchmarkCase, views: int) -> Answer:
    """A mesher of the product, as the product calls it; 0 views leaves the number to it."""
    return through(case, case.clip, FrameOptions(case.focus, case.radius, views, name))


def of_quality(quality: Quality, case: BenchmarkCase, views: int) -> Answer:
    """A preset of the product, as the product renders it."""
    drawn: list[Frame] = []
    # The truth, of Cycles, has no noise that a camera records.
    lens = FrameOptions(case.focus, case.radius, views, grain=0.0, quality=quality)
    picture = render_frame(case.clip, case.frame, lens, _size(case), lambda note: None, drawn.append)
    return _answer(picture, drawn[0])


def known_fill(case: BenchmarkCase, views: int) -> Answer:
    """Ours, told the colours of all that the frame hides: what it lacks then is not what nobody saw."""
    clip, surfaces = case.clip, case.layers(0)
    assert surfaces is not None
    filled = ClipWithFill(
        clip.reconstruction, clip.read, clip.given_depth, clip.masks,
        fill=lambda *frame: partial(_colours, surfaces),
    )  # fmt: skip
    return through(case, filled, FrameOptions(case.focus, case.radius, views))


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


def dense(case: BenchmarkCase, views: int) -> Answer:
    """One connected mesh with a vertex in the middle of every pixel, drawn as our own."""
    plan, mesh = _dense(case, views)
    mean = gpu_views.mean_of_views(plan, [Layer(mesh, plan.canvas.from_source(case.picture))])
    return Answer(plan.canvas.to_source(mean)[..., :3], views, len(mesh.triangles))


def cycles(case: BenchmarkCase, views: int) -> Answer:
    """Cycles' thin lens on the mesh over the feature points, painted as ours is; `views` are its samples."""
    lens = FrameOptions(case.focus, case.radius, 16, "features")
    seen = case.clip.picture(case.frame, lens.highlights)
    frame = mesh_frame(case.clip, case.frame, lens, _size(case), seen)
    return Answer(thin_lens(frame, views), views, len(frame.mesh.triangles))


def cycles_layers(case: BenchmarkCase, views: int) -> Answer:
    """Cycles' thin lens on our layered mesh; `views` are its samples."""
    lens = FrameOptions(case.focus, case.radius)
    seen = case.clip.picture(case.frame, lens.highlights)
    frame = mesh_frame(case.clip, case.frame, lens, _size(case), seen)
    return Answer(thin_lens(frame, views), views, len(frame.mesh.triangles))


def defocus_node(case: BenchmarkCase, views: int) -> Answer:
    """Blender's compositor node."""
    largest = float(np.abs(case.disc).max()) / 2
    return Answer(
        defocus(case.picture[..., :3], case.depth, case.focal, case.radius, case.focus_depth, largest), 0
    )


def scattered(case: BenchmarkCase, views: int) -> Answer:
    """Classical scatter."""
    return Answer(scatter(case.picture[..., :3], case.disc), 0)


def knowing(case: BenchmarkCase, views: int) -> Answer:
    """The oracle."""
    layers = case.layers(0)
    assert layers is not None
    return Answer(oracle.render(layers, case.focal, case.radius, case.focus_depth, views), views)


def with_layers(case: BenchmarkCase) -> BenchmarkCase:
    """The hidden surfaces, as far past the border as a view can see; UserError where nobody knows them."""
    layers = case.layers(int(np.ceil(np.abs(case.disc).max() / 2)) + 2)
    if layers is None:
        raise UserError("nobody knows what this scene hides")
    return replace(case, layers=lambda margin: layers)


PRODUCT = ("addon/core", "addon/render")
METHODS = {
    "no blur": Method(no_blur, (0,), ()),
    "thesis": Method(thesis, (16, 256), PRODUCT),
    "layers": Method(
        partial(by_mesher, "layers"), (8, 24, 256), PRODUCT, ("T1", "T2", "T3", "T4"), depth=NORMAL
    ),
    "draft": Method(partial(of_quality, DRAFT), (0,), PRODUCT, depth=DRAFT),
    "normal": Method(partial(of_quality, NORMAL), (0,), PRODUCT, depth=NORMAL),
    "final": Method(partial(of_quality, FINAL), (0,), PRODUCT, depth=FINAL),
    "known fill": Method(
        known_fill, (256,), (*PRODUCT, "benchmarks/accuracy/oracle.py"), ("T1",), with_layers
    ),
    "features": Method(partial(by_mesher, "features"), (16, 64), PRODUCT),
    "dense mesh": Method(dense, (64,), PRODUCT, ("T1",), depth=NORMAL),
    "Cycles": Method(cycles, (16,), PRODUCT),
    "Cycles, our mesh": Method(cycles_layers, (16,), PRODUCT, depth=NORMAL),
    "Defocus": Method(defocus_node, (0,), ("benchmarks/accuracy/defocus.py",), depth=NORMAL),
    "scatter": Method(scattered, (0,), ("benchmarks/accuracy/scatter.py",), depth=NORMAL),
    "oracle": Method(knowing, (64,), ("benchmarks/accuracy/oracle.py",), ("T1",), with_layers),
}


def _size(case: BenchmarkCase) -> tuple[int, int]:
    return case.picture.shape[1], case.picture.shape[0]


def through(case: BenchmarkCase, clip: ClipContext, lens: FrameOptions) -> Answer:
    """The frame as the product draws it."""
    picture = clip.picture(case.frame, lens.highlights)
    frame = mesh_frame(clip, case.frame, lens, _size(case), picture).through()
    return _answer(frame.views.canvas.to_source(draw_mean(frame)), frame)


def _answer(picture: Picture, frame: Frame) -> Answer:
    return Answer(picture[..., :3], len(frame.views.offsets), len(frame.mesh.triangles))


def _with_picks(case: BenchmarkCase) -> tuple[Reconstruction, Focus]:
    """Focus points: the thesis's method registers views by points: a mere distance gets four."""
    rec = case.reconstruction
    if case.focus.points:
        return rec, case.focus
    image, _ = rec.image_at(case.frame)
    camera, z = rec.intrinsics(image), case.focus_depth
    corners = np.array([[0.35, 0.35], [0.65, 0.35], [0.35, 0.65], [0.65, 0.65]]) * [
        camera.width,
        camera.height,
    ]
    local = np.column_stack([(corners - camera.principal_point) / camera.focal, np.ones(4)]) * z
    points = Points(
        np.concatenate([rec.points.xyz, (local - image.translation) @ image.rotation]),
        np.concatenate([rec.points.rgb, np.zeros((4, 3), np.uint8)]),
        np.concatenate([rec.points.error, np.zeros(4)]),
    )
    first = len(rec.points)
    return replace(rec, points=points), Focus(points=(first, first + 1, first + 2, first + 3))


def _dense(case: BenchmarkCase, views: int) -> tuple[Views, WarpMesh]:
    image, _ = case.reconstruction.image_at(case.frame)
    canvas = case.reconstruction.canvas(image)
    height, width = case.depth.shape
    # Past the border the outermost pixel's depth goes on, as far as any view can see.
    margin = float(np.abs(case.disc).max()) / 2 + 2
    across = np.concatenate([[-margin], np.arange(width) + 0.5, [width + margin]])
    down = np.concatenate([[-margin], np.arange(height) + 0.5, [height + margin]])
    xy = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    inverse = np.pad(1 / case.depth, 1, mode="edge").ravel()
    index = np.arange(len(xy), dtype=np.int32).reshape(height + 2, width + 2)
    a, b, c, d = (
        index[i, j].ravel() for i in (slice(-1), slice(1, None)) for j in (slice(-1), slice(1, None))
    )
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([b, d, c], axis=1)])
    lens = ThinLens(canvas.pinhole, case.radius, 1 / case.focus_depth)
    placed = Views(canvas, lens).placed(ApertureSamples(vogel_disc(views)))
    return placed, WarpMesh(xy, xy, inverse, triangles)


def thin_lens(frame: Frame, samples: int, seed: int = 0) -> Picture:
    """(H, W, 3) Cycles' own lens on a frame's layers, with the units chosen so that its f-stop stays in
    Blender's range. What no sample of a pixel hit does not count."""
    pinhole, mesh, unit = frame.canvas.pinhole, frame.mesh, frame.lens.radius / 0.01
    inverse = np.maximum(mesh.inverse_depth, 1e-6 * mesh.inverse_depth.max()) * unit
    scene = bpy.data.scenes.new("lens")
    warp = cycles_views.warp_object(
        mesh.xy,
        mesh.texture_xy,
        inverse,
        mesh.triangles,
        pinhole.focal,
        pinhole.principal_point,
        atlas(frame.layers),
    )
    try:
        camera = cycles_views.set_up(scene, warp, (pinhole.width, pinhole.height), samples)
        cycles_views.point_camera(scene, pinhole.focal, pinhole.principal_point, np.zeros(2), np.eye(2, 3))
        staging.limit_threads(scene)
        scene.cycles.seed = seed
        camera.dof.use_dof = True
        camera.dof.focus_distance = 1 / (frame.lens.focus * unit)
        camera.dof.aperture_fstop = camera.lens * 1e-3 / (2 * 0.01)
        with tempfile.TemporaryDirectory() as folder, quiet(1):
            drawn = cycles_views.render_to_array(scene, Path(folder) / "lens.exr")
        drawn /= np.maximum(drawn[..., 3:], np.float32(LEAST_LEFT))
        return frame.canvas.to_source(drawn)[..., :3]
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
