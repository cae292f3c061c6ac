"""A shaggy four-legged beast that walks past, seen from the side: its legs are thin, its body is long."""

from __future__ import annotations

import numpy as np

from . import textures
from .figure import Walk, capsule, footsteps, hanging, knee, pitched, scaled, striding, tufts
from .park import AIR, SUN, park
from .shapes import Shape, join, sphere, tube
from .stage import Floats, Prop, Stage, handheld
from .stroller import beside
from .textures import Generator, Picture

SEED = 151
FOCAL = 1.0
FRAMES = 60
STRIDE = 0.80
"""Metres from where a paw is set down to where it is set down again."""
JOINT = 0.66
"""Height of hips and shoulders, in metres."""
LENGTH = 0.92
"""From hips to shoulders, in metres."""
UPPER, LOWER, PAW = 0.345, 0.345, 0.06
"""The legs' bones, and the height of the lower one's end over the ground, in metres."""
FLANK = np.array([0.45, -0.2, 0.75])
"""The point in focus from the ground under the hips, in metres."""


def stage() -> Stage:
    """A beast of 1.6 m at 3.9 m walks to the right before the hedge."""
    cameras = handheld(
        (-0.40, 0, 1.25), (0.40, 0.04, 1.28), (-0.45, 3.9, 0.66), (0.75, 3.9, 0.66), FOCAL, SEED, FRAMES
    )
    surroundings, body = np.random.default_rng(SEED).spawn(2)
    walk = Walk((-1.45, 3.9), 0.0, striding(FRAMES, 2.1, 0.1))
    things = (*park(surroundings), *beast(body, "beast", walk, layer=2))
    return Stage(
        "beast", "a shaggy beast that walks past", cameras, things,
        focus=beside(walk, FLANK), air=AIR, sun=SUN,
    )  # fmt: skip


def _fur(rng: Generator, shape: tuple[int, int]) -> Picture:
    """Browns of timber and gravel in strands."""
    strands = textures.noise(rng, shape, (shape[0] / 24, shape[1] / 3), 3)
    patches = textures.noise(rng, shape, (4, 4), 4)
    dark = textures.ramp(strands, (0.20, 0.13, 0.08), (0.46, 0.33, 0.21))
    pale = textures.ramp(strands, (0.44, 0.38, 0.30), (0.70, 0.62, 0.50))
    return textures.mix(dark, pale, np.clip(4 * patches - 2, 0, 1))


def beast(rng: Generator, subject: str, walk: Walk, layer: int) -> list[Prop]:
    """Body, neck and head, ears, tail, four legs; all parts belong to the subject."""
    turns = 2 * np.pi * walk.way / STRIDE
    frames = len(turns)
    hide, short = _fur(rng, (256, 256)), _fur(rng, (96, 96))
    props = []

    def add(
        name: str, shape: Shape, picture: Picture, place: Floats, turn: Floats, left: float = 0.0
    ) -> None:
        joint = np.stack([place[:, 0], np.full(frames, left), place[:, 1]], axis=1)
        props.append(walk.part(subject, name, shape, picture, joint, turn, layer))

    hips = np.stack([walk.way, JOINT + 0.012 * np.cos(2 * turns)], axis=1)
    shoulders = hips + np.array([LENGTH, 0.02])
    # Hind paw before fore paw of a side, then the other side: a walk.
    for name, start, left, offset, bend in (
        ("left hind leg", hips, 0.13, 0.0, 1), ("left fore leg", shoulders, 0.12, 0.75, -1),
        ("right hind leg", hips, -0.13, 0.5, 1), ("right fore leg", shoulders, -0.12, 0.25, -1),
    ):  # fmt: skip
        foot, pitch = footsteps(walk.way, STRIDE, offset, 0.10)
        end = foot + np.array([start[0, 0] - hips[0, 0], PAW])
        joint = knee(start, end, UPPER, LOWER, bend)
        add(f"{name}, upper", capsule(UPPER, 0.12, 0.065), short, start, hanging(joint - start), left)
        add(f"{name}, lower", capsule(LOWER - 0.02, 0.062, 0.045), short, joint, hanging(end - joint), left)
        paw = scaled(sphere(1.0, 16), 0.085, 0.055, PAW).moved(0.03, 0, 0)
        add(f"{name}, paw", paw, short * np.float32(0.6), end, pitched(pitch), left)
    size = (0.5 * LENGTH + 0.20, 0.23, 0.26)
    barrel = scaled(sphere(1.0, 48), *size)
    coat = tufts(rng, size, 600, 0.075, -0.75, face=False)
    still = pitched(np.full(frames, -0.02))
    add("body", join([barrel, coat]).moved(LENGTH / 2, 0, 0.08), hide, hips, still)
    nod = 0.10 * np.sin(turns * 2 + 0.5)
    neck = shoulders + np.array([0.12, 0.16])
    head = [
        capsule(0.34, 0.15, 0.11).turned(-118, "y"),
        scaled(sphere(1.0, 28), 0.17, 0.12, 0.13).moved(0.36, 0, 0.17),
        scaled(sphere(1.0, 20), 0.11, 0.07, 0.07).moved(0.50, 0, 0.12),
        *(scaled(sphere(1.0, 12), 0.03, 0.04, 0.07).moved(0.28, side, 0.30) for side in (-0.08, 0.08)),
        tufts(rng, (0.22, 0.16, 0.20), 150, 0.07, -0.6, face=False).moved(0.14, 0, 0.08),
    ]
    add("head", join(head), short, neck, pitched(nod))
    black = np.full((8, 8, 3), 0.06, np.float32)
    eyes = [sphere(0.018, 10).moved(0.44, side, 0.20) for side in (-0.095, 0.095)]
    add("nose and eyes", join([sphere(0.035, 12).moved(0.60, 0, 0.14), *eyes]), black, neck, pitched(nod))
    along = np.linspace(0, 1, 10)
    bow = np.stack([-0.30 * along, 0.03 * np.sin(3 * along), -0.40 * along**2], axis=1)
    tip = tufts(rng, (0.05, 0.05, 0.09), 60, 0.08, -0.9, face=False).moved(-0.30, 0, -0.40)
    swish = 0.25 * np.sin(turns * 1.5)
    add("tail", join([tube(bow, 0.025, 10), tip]), short, hips + np.array([-0.18, 0.16]), pitched(swish))
    return props
