"""A CG object in a sample scene: the scene with it, for the truth, and the scene that the product makes of
the clip without it, which gets it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property

import bpy
import numpy as np
from mathutils import Matrix, Vector
from numpy.typing import NDArray

from addon.core.camera.reconstruction import Points, Reconstruction
from addon.core.media.clip import open_footage
from addon.scene.build import build
from sample_scenes import filming, staging, textures, truth
from sample_scenes.shapes import box, sphere
from sample_scenes.stage import FRAMES, Prop, Stage

from .scenes import FILM_SAMPLES, Floats, Staged, Truth

PLACES = {
    # Half behind the vase, before the street.
    "bars": ((0.36, 5.0, 1.2), 0.36),
    # Half behind the chair's back, before desks and wall.
    "walk": ((0.55, 4.6, 0.5), 0.3),
    # Half behind the second block, before the third.
    "blocks": ((0.36, 3.3, 0.3), 0.17),
}
"""Middle and radius of the object in the world, by scene: between what is in focus and what is behind it."""
GLOW = 0.7
"""Radiance of the white of an object that shines, so that what hides the sky from it has no part."""
SAMPLES = 64
LACQUER, LAMP, LAMP_SIDE, LAMP_AWAY = 0.05, 16.0, 0.35, 3.0
"""Share of light that a lacquered object mirrors; radiance, least side in its radii and distance in metres of
the lamp that it mirrors. By eye: what is mirrored is about white, and a tenth to a fifth as wide as the
object."""
TRAVEL = 24.0
"""Pixels of 640 across that an object which moves goes in a frame."""


@dataclass(frozen=True)
class Thing:
    """What the object is like."""

    surface: str = "shines"
    """Or shines under a lacquer, of this roughness: then it mirrors a lamp, and nothing else."""
    is_board: bool = False
    """Whether it is flat, and mirrors like a pane, or else a ball."""
    moves: bool = False
    shutter: float = 0.0
    """Frames that the shutter is open, around each; with 0 there is no motion blur, of clip and object."""

    def prop(self, scene: str, stage: Stage) -> Prop:
        """The object in a scene, its print as fine as the clip's."""
        middle, radius = PLACES[scene]
        shape = sphere(radius, 48)
        if self.is_board:
            shape = box((2 * radius, 0.1 * radius, 2 * radius)).moved(0, 0, -radius).turned(20, "z")
        print_ = textures.speckled(np.random.default_rng(5), (512, 512), (0.5, 0.1, 0.05), (0.9, 0.6, 0.3))
        made = Prop(
            "object", shape.moved(*middle), print_, smooth=not self.is_board, layer=9,
            glow=GLOW,
        )  # fmt: skip
        if not self.moves:
            return made
        judged = len(stage.cameras) // 2
        away = float(stage.cameras.to_camera(np.array([middle]))[judged, 0, 2])
        step = TRAVEL / 640 * stage.cameras.width / stage.cameras.focal * away
        return replace(made, travel=np.outer(np.arange(FRAMES) - judged, [step, 0.0, 0.0]))


class Sized(Staged):
    """A staged scene at another size, with an object in it or none, and a shutter."""

    def __init__(self, name: str, width: int, thing: Thing | None = None, shutter: float = 0.0) -> None:
        super().__init__(name, 0.02)
        self._width, self._thing, self._shutter = width, thing, shutter
        self.lens_radius = 0.0
        """That of another scene, where it is not 0."""

    def radius(self, blur: int) -> float:
        return self.lens_radius or super().radius(blur)

    @cached_property
    def stage(self) -> Stage:
        plain = filming.load(self.name)
        more = () if self._thing is None else (self._thing.prop(self.name, plain),)
        height = self._width * plain.cameras.height // plain.cameras.width
        cameras = plain.cameras.resized(self._width, height)
        return replace(plain, cameras=cameras, things=(*plain.things, *more))

    @cached_property
    def folder(self) -> str:
        """Of the object's surface and the shutter, too, which a stage does not hold."""
        parts = [self._thing.surface] if self._thing is not None else []
        parts += [f"shutter{self._shutter:g}"] if self._shutter else []
        return "-".join([super().folder, *parts])

    @cached_property
    def _built(self) -> bpy.types.Scene:
        scene = staging.build(self.stage)
        if self._thing is not None:
            _finish(scene, len(self.stage.things), self._thing, self.camera_centre)
        return scene

    @property
    def scene(self) -> bpy.types.Scene:  # type: ignore[override]
        """What moves does so in the window's scene alone, and there are several."""
        bpy.context.window.scene = self._built
        return self._built

    @property
    def camera_centre(self) -> Floats:
        """(3,) at the frame that is judged."""
        return np.asarray(self.stage.cameras.centres[len(self.stage.cameras) // 2])

    def truth(self, frame: int, blur: int) -> Truth:
        with _open(self.scene, self._shutter):
            return super().truth(frame, blur)

    def blurred_frame(self, frame: int) -> NDArray[np.uint8]:
        """(H, W, 3) of the clip, as the shutter lets it through."""
        with _open(self.scene, self._shutter):
            # Of time, too, there must be enough samples.
            picture = truth.pinhole(self.scene, frame, 8 * FILM_SAMPLES, seed=frame)
        return truth.recorded(picture, frame)


@contextmanager
def _open(scene: bpy.types.Scene, shutter: float) -> Iterator[None]:
    """Motion blur of a scene's renders; depth is rendered without."""
    scene.render.use_motion_blur = shutter > 0
    scene.render.motion_blur_shutter = shutter or 0.5
    try:
        yield
    finally:
        scene.render.use_motion_blur = False


def product_scene(plain: Sized, thing: Thing) -> bpy.types.Scene:
    """The clip as the product builds it, with the object in the light that the clip was shot in."""
    made = staging.build(replace(plain.stage, things=(thing.prop(plain.name, plain.stage),)), SAMPLES)
    _finish(made, 1, thing, plain.camera_centre)
    build(made, open_footage(plain.clip()), with_points(plain, plain.judged(0)[1]))
    if thing.shutter:
        made.render.use_motion_blur, made.render.motion_blur_shutter = True, thing.shutter
    return made


def with_points(plain: Sized, frame: int) -> Reconstruction:
    """The true cameras, and points where every eighth pixel of a frame has its surface."""
    cameras, depth = plain.cameras, plain.depth(frame)[4::8, 4::8]
    image, _ = cameras.image_at(frame)
    lens = cameras.intrinsics(image)
    row, column = np.nonzero(np.isfinite(depth))
    place = 8.0 * np.stack([column, row], axis=1) + 4.5
    rays = np.column_stack([(place - lens.principal_point) / lens.focal, np.ones(len(row))])
    world = (rays * depth[row, column, None] - image.translation) @ image.rotation
    points = Points(world, np.full((len(row), 3), 128, np.uint8), np.full(len(row), 0.1))
    return replace(cameras, points=points)


def _finish(scene: bpy.types.Scene, number: int, thing: Thing, camera: Floats) -> None:
    """Give a thing of a scene, counted from 1, its surface, and no shadow: what it does to light is judged by
    itself. A lamp is put where the camera's place sees it mirrored."""
    found = next(each for each in scene.objects if each.pass_index == number)
    found.visible_shadow = False
    if thing.surface == "shines":
        return
    material = found.data.materials[0]
    nodes, link = material.node_tree.nodes, material.node_tree.links.new
    glow = next(node for node in nodes if node.type == "EMISSION")
    out = next(node for node in nodes if node.type == "OUTPUT_MATERIAL")
    lacquer, both = nodes.new("ShaderNodeBsdfAnisotropic"), nodes.new("ShaderNodeAddShader")
    lacquer.inputs["Color"].default_value = (LACQUER, LACQUER, LACQUER, 1.0)
    lacquer.inputs["Roughness"].default_value = float(thing.surface)
    link(glow.outputs[0], both.inputs[0])
    link(lacquer.outputs[0], both.inputs[1])
    link(both.outputs[0], out.inputs["Surface"])
    # What hides the sky or the sun from it in the clip has no part.
    scene.world.cycles_visibility.glossy = False
    others = bpy.data.collections.new("unlit")
    others.objects.link(found)
    others.collection_objects[0].light_linking.link_state = "EXCLUDE"
    for each in scene.objects:
        if each.type == "LIGHT":
            each.light_linking.receiver_collection = others
        elif each != found:
            # A ray that is mirrored towards the lamp would end at the room's walls.
            each.visible_glossy = False
    middle, radius = PLACES[scene.name.partition(".")[0]]
    _add_lamp(scene, found, np.array(middle), radius, thing, camera)


def _add_lamp(
    scene: bpy.types.Scene, found: bpy.types.Object, middle: Floats, radius: float, thing: Thing, eye: Floats
) -> None:
    """A square lamp for one object alone, mirrored in its right part, which nothing hides."""
    to_eye = (eye - middle) / np.linalg.norm(eye - middle)
    if thing.is_board:
        turn = np.radians(20)
        normal = np.array([np.sin(turn), -np.cos(turn), 0.0])
        place = middle + radius * np.array([0.72 * np.cos(turn), 0.72 * np.sin(turn), 0.2])
    else:
        normal = to_eye + np.array([0.9, 0.0, 0.2])
        normal /= np.linalg.norm(normal)
        place = middle + radius * normal
    ray = (place - eye) / np.linalg.norm(place - eye)
    mirrored = ray - 2 * (ray @ normal) * normal
    # A ball makes it small.
    side = LAMP_SIDE * radius * (2 if thing.is_board else 12)
    light = bpy.data.lights.new("lamp", "AREA")
    light.shape, light.size = "SQUARE", side
    light.energy = LAMP * np.pi * side**2
    lamp = bpy.data.objects.new("lamp", light)
    lamp.visible_camera = False
    turn_to = Vector((-mirrored).tolist()).to_track_quat("-Z", "Y").to_matrix().to_4x4()
    lamp.matrix_world = Matrix.Translation((place + LAMP_AWAY * mirrored).tolist()) @ turn_to
    alone = bpy.data.collections.new("lit")
    alone.objects.link(found)
    lamp.light_linking.receiver_collection = lamp.light_linking.blocker_collection = alone
    scene.collection.objects.link(lamp)
