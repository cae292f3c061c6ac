"""What is true of a stage: pictures through a pinhole and through a lens, depth, motion, hidden surfaces.

Everything is rendered by Cycles from the scene that `staging.build` made. Pictures are linear light, float32,
(H, W, 3) or premultiplied (H, W, 4), the first row on top.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from addon.core.media.light import encode_srgb
from sample_scenes.cycles_views import render_to_array

from .stage import Floats, Stage

Picture = NDArray[np.float32]

NOISE = 1.0
"""Standard deviation of a small camera's noise in daylight, of 255."""
MIN_SAMPLES, MAX_SAMPLES = 32, 2048


@dataclass(frozen=True)
class Geometry:
    """What the centre of every pixel sees."""

    depth: Floats
    """(H, W) depth along the optical axis in metres, inf where there is only air."""
    thing: NDArray[np.int32]
    """(H, W) index into `Stage.things`, -1 where there is only air."""


def pinhole(scene: bpy.types.Scene, frame: int, samples: int, seed: int = 0) -> Picture:
    """(H, W, 3) the frame as the clip's camera sees it, before a camera's 8 bits."""
    with _settings(scene, samples, seed):
        return _render(scene, frame)[..., :3]


def recorded(picture: Picture, frame: int, noise: float = NOISE) -> NDArray[np.uint8]:
    """A linear picture (H, W, 3) as a camera records it: clipped, sRGB, 8 bits, a little noise."""
    rng = np.random.default_rng(frame)
    encoded = 255 * encode_srgb(np.clip(picture, 0, 1)) + noise * rng.standard_normal(picture.shape)
    return np.clip(np.rint(encoded), 0, 255).astype(np.uint8)


def lens(scene: bpy.types.Scene, frame: int, radius: float, focus: float, noise: float, seed: int) -> Picture:
    """(H, W, 3) the frame through a thin lens of `radius` metres focused at depth `focus` metres.

    Each pixel is sampled until its error is about `noise`: small lamps need many samples, the rest few.
    """
    data, cycles = scene.camera.data, scene.cycles
    with _settings(scene, MAX_SAMPLES, seed):
        cycles.use_adaptive_sampling = True
        cycles.adaptive_threshold, cycles.adaptive_min_samples = noise, MIN_SAMPLES
        data.dof.use_dof = True
        data.dof.focus_distance = focus
        # Blender's aperture diameter is the focal length over the f-stop, millimetres being 1/1000 of a unit.
        data.dof.aperture_fstop = data.lens / 1000 / (2 * radius)
        try:
            return _render(scene, frame)[..., :3]
        finally:
            data.dof.use_dof = cycles.use_adaptive_sampling = False


@contextmanager
def rolling_shutter(scene: bpy.types.Scene, readout: float) -> Iterator[None]:
    """A camera that reads its rows one after the other, from the top, without motion blur: Cycles' own.

    `readout` is the time from the first row to the last, of the time from a frame to the next; the middle
    row is read at the frame.
    """
    render, cycles = scene.render, scene.cycles
    before = render.use_motion_blur, render.motion_blur_shutter, render.motion_blur_position
    rolled = cycles.rolling_shutter_type, cycles.rolling_shutter_duration
    render.use_motion_blur, render.motion_blur_shutter, render.motion_blur_position = True, readout, "CENTER"
    cycles.rolling_shutter_type, cycles.rolling_shutter_duration = "TOP", 0.0
    try:
        yield
    finally:
        render.use_motion_blur, render.motion_blur_shutter, render.motion_blur_position = before
        cycles.rolling_shutter_type, cycles.rolling_shutter_duration = rolled


def virtual_pinhole(
    scene: bpy.types.Scene, frame: int, offset: tuple[float, float], focus: float, samples: int, seed: int
) -> Picture:
    """(H, W, 3) from a position (dx right, dy down) on the lens, in register at depth `focus`, in metres.

    The mean over the lens is the thin lens: the judge's own geometry is checked with it.
    """
    camera, data = scene.camera, scene.camera.data
    with _settings(scene, samples, seed):
        scene.frame_set(frame)
        pose = camera.matrix_world.copy()
        right, up = pose.col[0].to_3d(), pose.col[1].to_3d()
        action, camera.animation_data.action = camera.animation_data.action, None
        try:
            camera.location = pose.translation + right * offset[0] - up * offset[1]
            # A shift is a fraction of the sensor's width.
            share = data.lens / data.sensor_width / focus
            data.shift_x, data.shift_y = -offset[0] * share, offset[1] * share
            return _render(scene, None)[..., :3]
        finally:
            data.shift_x = data.shift_y = 0.0
            camera.animation_data.action = action
            scene.frame_set(frame)


def geometry(scene: bpy.types.Scene, frame: int) -> Geometry:
    """Depth and thing at every pixel's centre."""
    with _depth_material(scene):
        seen = _render(scene, frame)
    hit = seen[..., 3] > 0.5
    depth = np.where(hit, seen[..., 0].astype(np.float64), np.inf)
    return Geometry(depth, np.where(hit, np.rint(seen[..., 1]) - 1, -1).astype(np.int32))


def matte(scene: bpy.types.Scene, stage: Stage, frame: int, subject: str, samples: int) -> Picture:
    """(H, W) how much of every pixel a subject covers, 0 to 1, less what hides it; all subjects if empty.

    Sampled as the pictures are, so that it is also their mix of subject and background.
    """
    wanted = (subject,) if subject else stage.subjects
    owners = ("", *(thing.subject for thing in stage.things))
    others = [thing for thing in scene.objects if thing.pass_index and owners[thing.pass_index] not in wanted]
    for thing in others:
        thing.is_holdout = True
    try:
        with _settings(scene, samples, 0):
            scene.render.film_transparent = True
            return _render(scene, frame)[..., 3]
    finally:
        scene.render.film_transparent = False
        for thing in others:
            thing.is_holdout = False


def layer(
    scene: bpy.types.Scene, stage: Stage, frame: int, number: int, margin: int, samples: int
) -> tuple[Picture, Floats]:
    """One layer with all others out of sight: premultiplied picture (h, w, 4) and depth (h, w).

    Both reach past the frame's border by `margin` pixels a side. The other layers still throw their shadows.
    The depth is inf where the layer has nothing.
    """
    layers = (None, *(thing.layer for thing in stage.things))
    hidden = [thing for thing in scene.objects if thing.pass_index and layers[thing.pass_index] != number]
    for thing in hidden:
        thing.visible_camera = False
    try:
        with _overscan(scene, margin):
            depth = geometry(scene, frame).depth
            with _settings(scene, samples, 0):
                scene.render.film_transparent = True
                return _render(scene, frame), depth
    finally:
        scene.render.film_transparent = False
        for thing in hidden:
            thing.visible_camera = True


def motion(
    stage: Stage, frame: int, here: Geometry, after: Geometry
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Where every pixel's surface point goes: displacement (H, W, 2) in pixels from a frame to the next one.

    Beside it, (H, W) bool, whether the point is still seen there: inside the picture and not hidden.
    """
    cameras, index = stage.cameras, frame - 1
    height, width = here.depth.shape
    sized = cameras.resized(width, height)
    across, down = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    rays = np.stack(
        [(across - width / 2) / sized.focal, (down - height / 2) / sized.focal, np.ones_like(across)], -1
    )
    far = ~np.isfinite(here.depth)
    local = rays * np.where(far, 1.0, here.depth)[..., None]
    # A direction has no place: only the turn of the camera moves it.
    world = (local - np.where(far[..., None], 0.0, sized.translation[index])) @ sized.rotation[index]
    world = _moved(stage, here.thing, world, index)
    seen = world @ sized.rotation[index + 1].T + np.where(far[..., None], 0.0, sized.translation[index + 1])
    place = sized.focal * seen[..., :2] / seen[..., 2:] + np.array([width, height]) / 2
    column, row = np.floor(place).astype(int).transpose(2, 0, 1)
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height) & (seen[..., 2] > 0)
    found = after.depth[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
    with np.errstate(invalid="ignore"):
        same = np.where(far, ~np.isfinite(found), np.abs(found - seen[..., 2]) < 0.02 * seen[..., 2])
    return place - np.stack([across, down], axis=-1), inside & same


def _moved(stage: Stage, thing: NDArray[np.int32], world: Floats, index: int) -> Floats:
    """(H, W, 3) where each pixel's world point, on its thing, is in the next frame."""
    turns, shifts = [], []
    for prop in stage.things:
        (turn, place), (next_turn, next_place) = prop.pose(index), prop.pose(index + 1)
        turns.append(next_turn @ turn.T)
        shifts.append(next_place - turns[-1] @ place)
    # The last is the air's, whose index is -1.
    turned = np.einsum("hwij,hwj->hwi", np.array([*turns, np.eye(3)])[thing], world)
    return np.asarray(turned + np.array([*shifts, np.zeros(3)])[thing])


@contextmanager
def _overscan(scene: bpy.types.Scene, margin: int) -> Iterator[None]:
    """The same camera on a larger sensor."""
    render, data = scene.render, scene.camera.data
    before = (render.resolution_x, render.resolution_y, data.lens)
    render.resolution_x, render.resolution_y = before[0] + 2 * margin, before[1] + 2 * margin
    data.lens = before[2] * before[0] / render.resolution_x
    try:
        yield
    finally:
        render.resolution_x, render.resolution_y, data.lens = before


@contextmanager
def _settings(scene: bpy.types.Scene, samples: int, seed: int) -> Iterator[None]:
    """32-bit EXR and a number of samples, and the scene's own settings back afterwards."""
    cycles, image = scene.cycles, scene.render.image_settings
    before = (cycles.samples, cycles.seed, image.file_format, image.color_mode, image.color_depth)
    cycles.samples, cycles.seed = samples, seed
    image.file_format, image.color_mode, image.color_depth = "OPEN_EXR", "RGBA", "32"
    try:
        yield
    finally:
        cycles.samples, cycles.seed, image.file_format, image.color_mode, image.color_depth = before


@contextmanager
def _depth_material(scene: bpy.types.Scene) -> Iterator[None]:
    """Every surface glows with its depth and its number, one sample at the centre of each pixel."""
    material = bpy.data.materials.new("depth")
    material.cycles.emission_sampling = "NONE"
    nodes, link = material.node_tree.nodes, material.node_tree.links.new
    nodes.clear()
    view, thing = nodes.new("ShaderNodeCameraData"), nodes.new("ShaderNodeObjectInfo")
    both, glow = nodes.new("ShaderNodeCombineColor"), nodes.new("ShaderNodeEmission")
    out = nodes.new("ShaderNodeOutputMaterial")
    link(view.outputs["View Z Depth"], both.inputs[0])
    link(thing.outputs["Object Index"], both.inputs[1])
    link(both.outputs[0], glow.inputs["Color"])
    link(glow.outputs[0], out.inputs["Surface"])
    cycles, view_layer = scene.cycles, scene.view_layers[0]
    before = (cycles.pixel_filter_type, cycles.filter_width)
    with _settings(scene, 1, 0):
        cycles.pixel_filter_type, cycles.filter_width = "BOX", 0.01
        scene.render.film_transparent = True
        view_layer.material_override = material
        try:
            yield
        finally:
            view_layer.material_override = None
            scene.render.film_transparent = False
            cycles.pixel_filter_type, cycles.filter_width = before
            bpy.data.materials.remove(material)


def _render(scene: bpy.types.Scene, frame: int | None) -> Picture:
    if frame is not None:
        scene.frame_set(frame)
    with tempfile.TemporaryDirectory() as scratch:
        return render_to_array(scene, Path(scratch) / "render.exr")
