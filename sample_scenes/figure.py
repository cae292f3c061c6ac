"""Bodies that walk: people and a four-legged beast, of rigid parts that turn about their joints.

A body's own axes: x ahead, y to its left, z up, the origin on the ground where its walk begins. Feet are set
down on the ground and stay there while the body passes over them; knees and elbows follow from where hips,
feet, shoulders and hands are. Nothing is random but what `Generator` paints.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike

from . import textures
from .fence import lengthwise
from .shapes import Shape, box, join, leaf, sphere, turned_body
from .stage import Floats, Prop
from .textures import Generator, Picture

STANCE = 0.6
"""Share of a stride that a walking foot is on the ground."""
LIFT = 0.05
"""Height in metres that the toes are lifted to."""
STRIDE = 1.10
"""Metres from where a person's foot is set down to where it is set down again."""
THIGH, SHANK, ANKLE = 0.45, 0.44, 0.08
"""A person's bones, and the height of the ankle over the sole, in metres."""
HIPS, SHOULDERS, NECK = 0.93, 1.45, 1.53
"""Heights of a person's joints, in metres."""
UPPER_ARM, FOREARM = 0.29, 0.25


@dataclass(frozen=True)
class Walk:
    """A way straight over the ground."""

    start: tuple[float, float]
    """Where it begins, x and y in the world, in metres."""
    heading: float
    """Its direction: degrees from the world's +x towards +y."""
    way: Floats
    """(N,) metres that have been walked in each frame."""

    @property
    def pace(self) -> Floats:
        """(N,) 0 where the body stands to 1 where it is fastest: how far arms swing."""
        steps = np.pad(np.diff(self.way), 1, mode="edge")
        speed = np.minimum(steps[:-1], steps[1:])
        return np.asarray(speed / speed.max())

    def part(
        self, subject: str, name: str, shape: Shape, picture: Picture, joint: Floats, turn: Floats, layer: int
    ) -> Prop:
        """A part whose shape stands about its `joint` (N, 3) with a `turn` (N, 3, 3), in body axes."""
        angle = np.radians(self.heading)
        cos, sin = np.cos(angle), np.sin(angle)
        heading = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        travel = joint @ heading.T + (*self.start, 0.0)
        return Prop(
            f"{subject}'s {name}", shape, np.asarray(picture, np.float32), smooth=True, layer=layer,
            travel=travel, turn=heading @ turn, subject=subject,
        )  # fmt: skip


def striding(frames: int, metres: float, begin: float = 0.0, pause: tuple[int, int] | None = None) -> Floats:
    """(N,) metres of way in each frame, `metres` in all from `begin` on, at an even speed.

    It stands from the first frame of `pause` to the last, counted from 0, and slows down before and starts
    after over three frames.
    """
    speed = np.ones(frames)
    if pause:
        speed[pause[0] - 3 : pause[1] + 3] = 0.0
        speed = np.convolve(np.pad(speed, 3, mode="edge"), np.ones(7) / 7, mode="valid")
    way = np.concatenate([[0.0], np.cumsum(speed[:-1])])
    return np.asarray(begin + metres * way / way[-1])


# Motion


def footsteps(way: Floats, stride: float, offset: float, toes: float) -> tuple[Floats, Floats]:
    """(N, 2) where a foot's joint is, ahead and up from where it is on the ground, and (N,) its toes' pitch.

    `offset` is the share of a stride by which it goes before others, `toes` how far they are before the
    joint, in metres; they are lifted last, pitched down by so many radians. A foot is on the ground for
    `STANCE` of a stride, where it does not slide, and the hips are over it in the middle of that.
    """
    cycle, part = np.divmod(way / stride + offset, 1.0)
    swing = np.clip((part - STANCE) / (1 - STANCE), 0.0, 1.0)
    pitch = 0.9 * np.sin(np.pi * swing) * (1 - swing)
    ahead = stride * (cycle - offset + swing * swing * (3 - 2 * swing) + 0.5 * STANCE)
    up = LIFT * np.sin(np.pi * swing) ** 2 + toes * np.sin(pitch)
    return np.stack([ahead, up], axis=1), pitch


def knee(above: Floats, below: Floats, upper: float, lower: float, ahead: float) -> Floats:
    """(N, 2) the joint between two bones from `above` to `below`, (N, 2) each; `ahead` is 1 or -1: its side.

    ValueError where the bones are too short.
    """
    gap = below - above
    far = np.linalg.norm(gap, axis=1)
    if (far >= upper + lower).any():
        raise ValueError(f"bones of {upper} m and {lower} m do not reach over {far.max():.3f} m")
    along = (upper**2 - lower**2 + far**2) / (2 * far)
    out = np.sqrt(upper**2 - along**2)
    unit = gap / far[:, None]
    return np.asarray(
        above + along[:, None] * unit + ahead * out[:, None] * np.stack([-unit[:, 1], unit[:, 0]], 1)
    )


def hanging(direction: Floats) -> Floats:
    """(N, 3, 3) the turn about y that leads from downwards to the directions (N, 2), ahead and up."""
    ahead, up = (direction / np.linalg.norm(direction, axis=1, keepdims=True)).T
    zero, one = np.zeros_like(up), np.ones_like(up)
    return np.stack([-up, zero, -ahead, zero, one, zero, ahead, zero, -up], axis=1).reshape(-1, 3, 3)


def pitched(angle: ArrayLike) -> Floats:
    """(N, 3, 3) turned about y by (N,) radians: what points ahead goes down."""
    angle = np.asarray(angle, np.float64)
    return hanging(np.stack([-np.sin(angle), -np.cos(angle)], axis=1))


def _at(place: Floats, left: float) -> Floats:
    """(N, 3) of places (N, 2), ahead and up, and how far left of the middle."""
    return np.stack([place[:, 0], np.full(len(place), left), place[:, 1]], axis=1)


# Shapes


def capsule(length: float, top: float, bottom: float) -> Shape:
    """A round limb that hangs from the origin: metres to the lower joint, the radii at both; facing +x."""
    round_ = np.linspace(0, np.pi / 2, 6)
    lower = np.stack([bottom * np.sin(round_), -length - bottom * np.cos(round_)], axis=1)
    upper = np.stack([top * np.cos(round_), top * np.sin(round_)], axis=1)
    return turned_body(np.concatenate([lower, upper]), 20).turned(90)


def scaled(shape: Shape, x: float, y: float, z: float) -> Shape:
    return Shape(shape.vertices * (x, y, z), shape.faces, shape.uv)


def tufts(
    rng: Generator,
    size: tuple[float, float, float],
    count: int,
    length: float,
    low: float,
    face: bool = True,
) -> Shape:
    """Tapering locks all over an ellipsoid of these half axes, down to the share `low` of its half height.

    They stand out and droop, so that the outline is one of tips. A `face` (+x) is left free.
    """
    locks: list[Shape] = []
    while len(locks) < count:
        x, y, z = (ends := rng.normal(size=3)) / np.linalg.norm(ends)
        if z < low or (face and x > 0.45 and z < 0.75):
            continue
        lock = lengthwise(
            leaf(length * rng.uniform(0.6, 1.3), 0.16 * length, 0.3 * length, length * rng.uniform(0.2, 0.7))
        )
        lock = lock.turned(rng.uniform(-30, 30), "x").turned(-0.6 * np.degrees(np.arcsin(z)), "y")
        turned = lock.turned(np.degrees(np.arctan2(y, x)) + rng.uniform(-25, 25))
        locks.append(turned.moved(*(np.array([x, y, z]) * size)))
    return join(locks)


# People


@dataclass(frozen=True)
class Clothes:
    """What a person wears, in sRGB."""

    jacket: Picture
    trousers: Picture
    shoes: tuple[float, float, float]
    hair: tuple[tuple[float, float, float], tuple[float, float, float]]
    """Its dark and its light colour."""


def _face(rng: Generator) -> Picture:
    """Skin, eyes, brows and a mouth in the middle of the picture."""
    picture = np.ascontiguousarray(textures.speckled(rng, (96, 192), (0.66, 0.44, 0.34), (0.88, 0.66, 0.54)))
    for x in (83, 109):
        cv2.ellipse(picture, (x, 44), (6, 3), 0, 0, 360, (0.92, 0.90, 0.88), -1, cv2.LINE_AA)
        cv2.circle(picture, (x, 44), 3, (0.14, 0.10, 0.08), -1, cv2.LINE_AA)
        cv2.line(picture, (x - 7, 37), (x + 7, 36), (0.26, 0.17, 0.11), 2, cv2.LINE_AA)
    cv2.ellipse(picture, (96, 68), (10, 3), 0, 0, 360, (0.62, 0.24, 0.22), -1, cv2.LINE_AA)
    return picture


def person(rng: Generator, subject: str, walk: Walk, clothes: Clothes, layer: int) -> list[Prop]:
    """A person of 1.75 m who walks with swinging arms; all parts belong to the subject."""
    turns = 2 * np.pi * walk.way / STRIDE
    # Lowest with both feet on the ground, in the middle of that tenth of a stride.
    bob = -0.02 - 0.02 * np.cos(2 * turns - 2 * np.pi * (STANCE - 0.5))
    hips = np.stack([walk.way, HIPS + bob], axis=1)
    still = pitched(np.full(len(walk.way), 0.04))
    skin = textures.speckled(rng, (64, 64), (0.66, 0.44, 0.34), (0.86, 0.64, 0.52))
    leather = textures.speckled(rng, (64, 64), np.array(clothes.shoes) * 0.5, clothes.shoes)
    props = []

    def add(
        name: str, shape: Shape, picture: Picture, place: Floats, turn: Floats, left: float = 0.0
    ) -> None:
        props.append(walk.part(subject, name, shape, picture, _at(place, left), turn, layer))

    for side, name, offset in ((1, "left", 0.0), (-1, "right", 0.5)):
        foot, pitch = footsteps(walk.way, STRIDE, offset, 0.18)
        ankle = foot + np.array([0.0, ANKLE])
        joint = knee(hips, ankle, THIGH, SHANK, 1)
        add(
            f"{name} thigh",
            capsule(THIGH, 0.088, 0.064),
            clothes.trousers,
            hips,
            hanging(joint - hips),
            0.085 * side,
        )
        add(
            f"{name} shank",
            capsule(SHANK - 0.03, 0.062, 0.050),
            clothes.trousers,
            joint,
            hanging(ankle - joint),
            0.085 * side,
        )
        shoe = join(
            [
                scaled(sphere(1.0, 20), 0.145, 0.048, 0.045).moved(0.055, 0, -0.035),
                box((0.25, 0.085, 0.03)).moved(0.05, 0, -ANKLE),
            ]
        )
        add(f"{name} shoe", shoe, leather, ankle, pitched(pitch), 0.09 * side)
        swing = -0.55 * walk.pace * np.cos(turns + 2 * np.pi * offset - 0.3)
        shoulder = np.stack([walk.way - 0.01, SHOULDERS + bob], axis=1)
        upper = np.stack([np.sin(swing), -np.cos(swing)], axis=1)
        bent = swing + 0.25 + 0.3 * np.maximum(swing, 0)
        lower = np.stack([np.sin(bent), -np.cos(bent)], axis=1)
        elbow, wide = shoulder + UPPER_ARM * upper, 0.21 * side
        add(
            f"{name} sleeve", capsule(UPPER_ARM, 0.062, 0.050), clothes.jacket, shoulder, hanging(upper), wide
        )
        add(
            f"{name} cuff", capsule(FOREARM - 0.06, 0.050, 0.042), clothes.jacket, elbow, hanging(lower), wide
        )
        hand = scaled(sphere(1.0, 16), 0.038, 0.026, 0.075).moved(0, 0, -0.045)
        add(f"{name} hand", hand, skin, elbow + FOREARM * lower, hanging(lower), wide)  # fmt: skip
    chest = [
        (0.0, -0.06),
        (0.15, -0.06),
        (0.165, 0.02),
        (0.15, 0.18),
        (0.175, 0.36),
        (0.19, 0.48),
        (0.16, 0.55),
        (0.07, 0.585),
        (0.0, 0.59),
    ]
    seat = scaled(sphere(1.0, 24), 0.115, 0.17, 0.13).moved(0, 0, 0.02)
    add("jacket", scaled(turned_body(chest, 32).turned(90), 0.68, 1.0, 1.0), clothes.jacket, hips, still)
    add("trousers", seat, clothes.trousers, hips, still)
    neck = np.stack([walk.way + 0.02, NECK + bob], axis=1)
    head = (0.098, 0.080, 0.122)
    skull = scaled(sphere(1.0, 32).turned(90), *head).moved(0.02, 0, 0.13)
    nose = scaled(sphere(1.0, 12), 0.022, 0.014, 0.022).moved(0.118, 0, 0.115)
    add("neck", capsule(0.10, 0.05, 0.05).moved(0, 0, 0.06), skin, neck, still)
    add("head", skull, _face(rng), neck, still)
    add("nose", nose, skin, neck, still)
    cap = scaled(sphere(1.0, 32), 0.100, 0.087, 0.120).moved(-0.004, 0, 0.152)
    locks = tufts(rng, (0.096, 0.084, 0.116), 300, 0.085, -0.55).moved(-0.004, 0, 0.152)
    add("hair", join([cap, locks]), textures.wood(rng, (128, 128), 9, *clothes.hair), neck, still)
    return props
