"""A stage becomes a Blender scene, ready to render with its animated camera."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix

from addon.core.base.limits import chosen_threads

from .stage import FPS, Cameras, Prop, Stage

AMBIENT, SUNLIGHT = 0.45, 0.75
"""Light from everywhere and from the sun, as radiance of white that faces it."""


def build(stage: Stage, samples: int = 64) -> bpy.types.Scene:
    """Make the stage a scene of the current file, which may hold others: they are left alone.

    The light is one sun without size and an even glow, so that a picture has no noise but that of its own
    sampling, and truth is affordable. For a lens with depth of field set `scene.camera.data.dof` as usual.
    """
    scene = bpy.data.scenes.new(stage.name)
    for number, prop in enumerate(stage.things, start=1):
        thing = add(scene, prop, _lit_material(prop))
        thing.pass_index = number
        if prop.travel is not None or prop.turn is not None:
            _move(thing, prop, len(stage.cameras))
    _add_sun(scene, stage)
    add_camera(scene, stage.cameras)
    scene.frame_start, scene.frame_end = 1, len(stage.cameras)
    set_output(scene, stage.cameras.width, stage.cameras.height)
    cycles = scene.cycles
    cycles.samples = samples
    cycles.use_denoising = False
    cycles.max_bounces = 0
    # Only the window's scene has its animation evaluated when it renders.
    bpy.context.window.scene = scene
    return scene


def set_output(scene: bpy.types.Scene, width: int, height: int) -> None:
    """Cycles on the processor, PNG as a camera would write it."""
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
    render.fps, render.fps_base = FPS, 1.0
    render.image_settings.file_format = "PNG"
    render.image_settings.color_mode = "RGB"
    render.use_persistent_data = True
    scene.view_settings.view_transform = "Standard"
    scene.display_settings.display_device = "sRGB"
    scene.cycles.device = "CPU"
    scene.cycles.use_adaptive_sampling = False
    limit_threads(scene)


def limit_threads(scene: bpy.types.Scene) -> None:
    """Have Cycles use no more threads than the environment allows."""
    if most := chosen_threads():
        scene.render.threads_mode, scene.render.threads = "FIXED", most


def add(scene: bpy.types.Scene, prop: Prop, material: bpy.types.Material) -> bpy.types.Object:
    """Make the prop an object of the scene."""
    mesh = bpy.data.meshes.new(prop.name)
    mesh.from_pydata(prop.shape.vertices.tolist(), [], prop.shape.faces.tolist())
    mesh.uv_layers.new(name="UV").uv.foreach_set("vector", prop.shape.uv.astype(np.float32).ravel())
    mesh.polygons.foreach_set("use_smooth", np.full(len(prop.shape.faces), prop.smooth))
    mesh.materials.append(material)
    thing = bpy.data.objects.new(prop.name, mesh)
    scene.collection.objects.link(thing)
    return thing


def texture_node(material: bpy.types.Material, prop: Prop) -> bpy.types.Node:
    """The prop's picture as an image texture of the material."""
    height, width = prop.picture.shape[:2]
    image = bpy.data.images.new(prop.name, width, height)
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = np.clip(prop.picture[::-1], 0, 1)  # Blender's first row is the lowest
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    texture = material.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    return texture


def _lit_material(prop: Prop) -> bpy.types.Material:
    """Matt paint that also glows with the ambient light, or a lamp."""
    material = bpy.data.materials.new(prop.name)
    nodes, link = material.node_tree.nodes, material.node_tree.links.new
    nodes.clear()
    texture = texture_node(material, prop)
    glow, out = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    link(texture.outputs["Color"], glow.inputs["Color"])
    glow.inputs["Strength"].default_value = prop.glow or AMBIENT
    # Lamps are seen, they do not light: sampling them would be noise.
    material.cycles.emission_sampling = "NONE"
    if prop.glow:
        link(glow.outputs[0], out.inputs["Surface"])
        return material
    paint, both = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeAddShader")
    link(texture.outputs["Color"], paint.inputs["Color"])
    link(paint.outputs[0], both.inputs[0])
    link(glow.outputs[0], both.inputs[1])
    link(both.outputs[0], out.inputs["Surface"])
    return material


def _move(thing: bpy.types.Object, prop: Prop, frames: int) -> None:
    # A shadow would move over things that stand still, which no motion field tells.
    thing.visible_shadow = False
    thing.rotation_mode = "QUATERNION"
    for index in range(frames):
        turn, thing.location = prop.pose(index)
        thing.rotation_quaternion = Matrix(turn.tolist()).to_quaternion()
        thing.keyframe_insert("location", frame=index + 1)
        thing.keyframe_insert("rotation_quaternion", frame=index + 1)


def _add_sun(scene: bpy.types.Scene, stage: Stage) -> None:
    world = bpy.data.worlds.new("air")
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (*stage.air, 1.0)
    scene.world = world
    light = bpy.data.lights.new("sun", "SUN")
    light.angle = 0.0
    light.energy = SUNLIGHT * np.pi
    holder = bpy.data.objects.new("sun", light)
    back = np.array(stage.sun) / np.linalg.norm(stage.sun)
    side = np.cross((0.0, 1.0, 0.0), back)
    side /= np.linalg.norm(side)
    axes = np.stack([side, np.cross(back, side), back], axis=1)
    holder.matrix_world = Matrix(axes.tolist()).to_4x4()
    scene.collection.objects.link(holder)


def add_camera(scene: bpy.types.Scene, cameras: Cameras) -> None:
    """A pinhole that stands at the cameras' poses, a key on every frame."""
    data = bpy.data.cameras.new("camera")
    data.sensor_fit, data.sensor_width = "HORIZONTAL", 36.0
    data.lens = cameras.focal * 36.0 / cameras.width
    data.clip_start = 0.01
    camera = bpy.data.objects.new("camera", data)
    camera.rotation_mode = "QUATERNION"
    scene.collection.objects.link(camera)
    scene.camera = camera
    # Blender's cameras look along -z with y up.
    turned = np.swapaxes(cameras.rotation, 1, 2) * (1.0, -1.0, -1.0)
    for frame, (axes, centre) in enumerate(zip(turned, cameras.centres, strict=True), start=1):
        camera.location = centre
        camera.rotation_quaternion = Matrix(axes.tolist()).to_quaternion()
        camera.keyframe_insert("location", frame=frame)
        camera.keyframe_insert("rotation_quaternion", frame=frame)
