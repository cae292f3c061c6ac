"""The workshop of the blocks with a polished floor and a lacquered door: what shines shows other things.

`build` makes it a scene in which those mirror. `staging.build` alone leaves them matt.
"""

from __future__ import annotations

from collections.abc import Mapping

import bpy
import numpy as np

from . import blocks, staging, textures
from .shapes import box
from .stage import Prop, Stage, handheld
from .textures import Generator

NAME = "gloss"
SEED = 163
FRAMES = 24
GLOSS = {"floor": (0.45, 0.0), "door": (0.30, 0.12), "panel": (0.30, 0.0)}
"""Of what shines: the share of light that is mirrored, and the roughness."""


def stage() -> Stage:
    """Blocks at 1.7 to 4 m on a floor that mirrors them and the wall; left of them a door, right a panel."""
    cameras = handheld(
        (-0.13, -0.05, 0.66), (0.13, 0.06, 0.65), (0.0, 2.65, 0.25), (0.08, 2.65, 0.26), blocks.FOCAL, SEED,
        FRAMES,
    )  # fmt: skip
    things = [thing for thing in blocks.stage().things if thing.name != "floor"]
    things += _shining(np.random.default_rng(SEED))
    return Stage(
        NAME, "what shines shows other things", cameras, tuple(things),
        focus=np.tile(blocks.focus_points()[1], (FRAMES, 1)), air=(0.2, 0.2, 0.2),
    )  # fmt: skip


def _shining(rng: Generator) -> list[Prop]:
    """Stone with faint clouds, and two boards of plain lacquer that stand turned towards the room."""
    shape = (768, 736)
    stone = textures.ramp(textures.noise(rng, shape, (5, 4), 4), (0.20, 0.19, 0.18), (0.26, 0.25, 0.23))
    red = np.broadcast_to(np.array((0.34, 0.08, 0.06), np.float32), (8, 8, 3)).copy()
    green = np.broadcast_to(np.array((0.07, 0.20, 0.15), np.float32), (8, 8, 3)).copy()
    return [
        Prop("floor", box((6.4, 6.6, 0.1)).moved(0, 3.8, -0.1), stone),
        Prop("door", box((0.75, 0.04, 1.3)).turned(28).moved(-0.95, 3.3, 0), red, layer=1),
        Prop("panel", box((0.6, 0.04, 1.1)).turned(-24).moved(1.25, 3.2, 0), green, layer=1),
    ]


def build(
    shining: Stage, samples: int = 64, gloss: Mapping[str, tuple[float, float]] = GLOSS
) -> bpy.types.Scene:
    """What `staging.build` makes, with the things named in `gloss` mirroring what is lit, as `GLOSS` says."""
    scene = staging.build(shining, samples)
    for number, prop in enumerate(shining.things, start=1):
        if prop.name in gloss:
            (thing,) = (each for each in scene.objects if each.pass_index == number)
            _polish(thing.data.materials[0], *gloss[prop.name])
    cycles = scene.cycles
    cycles.max_bounces = cycles.glossy_bounces = 1
    cycles.diffuse_bounces = 0
    return scene


def _polish(material: bpy.types.Material, share: float, roughness: float) -> None:
    """Let a share of what a matt material shows be a reflection."""
    nodes, link = material.node_tree.nodes, material.node_tree.links.new
    out = next(node for node in nodes if node.type == "OUTPUT_MATERIAL")
    matt = out.inputs["Surface"].links[0].from_socket
    mirror, both = nodes.new("ShaderNodeBsdfGlossy"), nodes.new("ShaderNodeMixShader")
    mirror.inputs["Roughness"].default_value = roughness
    mirror.inputs["Color"].default_value = (1, 1, 1, 1)
    both.inputs[0].default_value = share
    link(matt, both.inputs[1])
    link(mirror.outputs[0], both.inputs[2])
    link(both.outputs[0], out.inputs["Surface"])
