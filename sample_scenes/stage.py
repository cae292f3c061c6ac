"""A sample scene before Blender sees it: things, cameras, and what is in focus, as plain arrays.

World coordinates are Blender's: right-handed, z up, metres. Cameras are COLMAP's: x right, y down,
z forward, the centre of the first pixel at (0.5, 0.5).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .shapes import Shape

Floats = NDArray[np.float64]

FPS = 24
WIDTH, HEIGHT = 640, 360
FRAMES = 36


@dataclass(frozen=True)
class Prop:
    """A shape in world coordinates and its surface."""

    name: str
    shape: Shape
    picture: NDArray[np.float32]
    smooth: bool = False
    glow: float = 0.0
    """Radiance of the texture's white; things that glow reflect nothing."""
    roughness: float = 0.6
    layer: int = 0
    """Things of one layer hide each other little; a higher layer stands before a lower one."""
    travel: Floats | None = None
    """(N, 3) how far the thing has moved in each frame; None stands still."""
    turn: Floats | None = None
    """(N, 3, 3) rotation about the world's origin in each frame, before it travels; None does not turn.

    The shape of what turns stands about its joint, as if that were the origin.
    """
    subject: str = ""
    """Of which person, animal or vehicle it is a part; nobody's if empty."""

    @property
    def moves(self) -> bool:
        """Whether it has another pose in one frame than in another."""
        return any(path is not None and np.ptp(path, axis=0).any() for path in (self.travel, self.turn))

    def pose(self, index: int) -> tuple[Floats, Floats]:
        """Rotation (3, 3) and shift (3,) that place the shape in a frame, counted from 0."""
        turn = np.eye(3) if self.turn is None else self.turn[index]
        return turn, np.zeros(3) if self.travel is None else self.travel[index]

    def cut(self, part: slice) -> Prop:
        """The same thing in only some of the frames."""
        travel, turn = (None if path is None else path[part] for path in (self.travel, self.turn))
        return replace(self, travel=travel, turn=turn)


@dataclass(frozen=True)
class Cameras:
    """The pinhole cameras of a clip, one a frame: square pixels, principal point in the middle."""

    width: int
    height: int
    focal: float
    """Focal length in pixels."""
    rotation: Floats
    """(N, 3, 3) world-to-camera rotations."""
    translation: Floats
    """(N, 3) world-to-camera translations."""

    def __len__(self) -> int:
        return len(self.rotation)

    @property
    def centres(self) -> Floats:
        """(N, 3) camera centres in the world."""
        return np.asarray(-np.einsum("nji,nj->ni", self.rotation, self.translation), dtype=np.float64)

    def to_camera(self, points: Floats) -> Floats:
        """World points (P, 3) -> camera space of every frame (N, P, 3)."""
        seen = points @ np.swapaxes(self.rotation, 1, 2) + self.translation[:, None]
        return np.asarray(seen, dtype=np.float64)

    def project(self, points: Floats) -> Floats:
        """World points (P, 3) -> pixels (N, P, 2)."""
        seen = self.to_camera(points)
        middle = np.array([self.width, self.height]) / 2
        return np.asarray(self.focal * seen[..., :2] / seen[..., 2:] + middle, dtype=np.float64)

    def resized(self, width: int, height: int) -> Cameras:
        """The same cameras with pictures of another size and the same aspect."""
        return replace(self, width=width, height=height, focal=self.focal * width / self.width)

    def cut(self, part: slice) -> Cameras:
        """Only those of some frames."""
        return replace(self, rotation=self.rotation[part], translation=self.translation[part])


@dataclass(frozen=True)
class Edge:
    """A straight edge whose length the scene's maker has measured."""

    name: str
    ends: Floats
    """(2, 3) in the world."""

    @property
    def length(self) -> float:
        return float(np.linalg.norm(self.ends[1] - self.ends[0]))


@dataclass(frozen=True)
class Stage:
    """Everything that there is to film. The same seeds give the same stage to the bit."""

    name: str
    title: str
    """What is hard about it, in one line."""
    cameras: Cameras
    things: tuple[Prop, ...]
    focus: Floats
    """(N, 3) the point in focus in each frame: a subject on a surface, in the world."""
    air: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Radiance where there is nothing, infinitely far."""
    sun: tuple[float, float, float] = (-0.45, -0.6, 0.66)
    """Direction to the light."""
    edges: tuple[Edge, ...] = ()

    def cut(self, part: slice) -> Stage:
        """The same stage, of which only some frames are filmed."""
        things = tuple(thing.cut(part) for thing in self.things)
        return replace(self, cameras=self.cameras.cut(part), things=things, focus=self.focus[part])

    @property
    def subjects(self) -> tuple[str, ...]:
        """Their names, in the order of their first parts."""
        return tuple(dict.fromkeys(thing.subject for thing in self.things if thing.subject))

    @property
    def focus_depth(self) -> Floats:
        """(N,) depth of the focal plane in each frame."""
        cameras = self.cameras
        seen = np.einsum("nij,nj->ni", cameras.rotation, self.focus) + cameras.translation
        return np.asarray(seen[:, 2], dtype=np.float64)

    @property
    def focus_xy(self) -> Floats:
        """(N, 2) where the focus point is seen, in pixels."""
        cameras = self.cameras
        seen = np.einsum("nij,nj->ni", cameras.rotation, self.focus) + cameras.translation
        middle = np.array([cameras.width, cameras.height]) / 2
        return np.asarray(cameras.focal * seen[:, :2] / seen[:, 2:] + middle, dtype=np.float64)


def tremor(frames: int, rng: np.random.Generator) -> Floats:
    """(N, 6) a hand's shaking in three shifts and three turns, of about unit size.

    A few slow sines in each of the six freedoms, slower ones larger.
    """
    time = np.arange(frames) / FPS
    frequency = rng.uniform((0.5, 1.3, 3.0), (0.9, 2.2, 5.0), (6, 3))
    phase = rng.uniform(0, 2 * np.pi, (6, 3))
    waves = np.sin(2 * np.pi * frequency * time[:, None, None] + phase) * (1.0, 0.45, 0.15)
    return np.asarray(waves.sum(axis=-1))


def look(centre: Floats, gaze: Floats, sway: Floats) -> tuple[Floats, Floats]:
    """World-to-camera rotations (N, 3, 3) and translations (N, 3) of cameras at `centre` (N, 3).

    They look along `gaze` (N, 3), turned by a hand's `sway` (N, 3) in yaw, pitch and roll.
    """
    yaw = np.arctan2(gaze[:, 0], gaze[:, 1]) + np.radians(0.30) * sway[:, 0]
    pitch = np.arctan2(gaze[:, 2], np.hypot(gaze[:, 0], gaze[:, 1])) + np.radians(0.25) * sway[:, 1]
    roll = np.radians(0.35) * sway[:, 2]
    zero = np.zeros(len(centre))
    forward = np.stack([np.sin(yaw) * np.cos(pitch), np.cos(yaw) * np.cos(pitch), np.sin(pitch)], axis=1)
    right = np.stack([np.cos(yaw), -np.sin(yaw), zero], axis=1)
    down = np.cross(forward, right)
    cos, sin = np.cos(roll)[:, None], np.sin(roll)[:, None]
    rotation = np.stack([cos * right + sin * down, cos * down - sin * right, forward], axis=1)
    return rotation, -np.einsum("nij,nj->ni", rotation, centre)


def handheld(
    start: ArrayLike,
    end: ArrayLike,
    look_from: ArrayLike,
    look_to: ArrayLike,
    focal: float,
    seed: int,
    frames: int = FRAMES,
    shake: float = 0.004,
) -> Cameras:
    """A camera carried by hand from `start` to `end`, looking from one world point over to another.

    `focal` is a fraction of the picture's width, `shake` the hand's in metres.
    """
    sway = tremor(frames, np.random.default_rng(seed))
    share = np.linspace(0, 1, frames)[:, None]
    centre = (1 - share) * np.asarray(start, np.float64) + share * np.asarray(end, np.float64)
    centre = centre + shake * sway[:, :3]
    target = (1 - share) * np.asarray(look_from, np.float64) + share * np.asarray(look_to, np.float64)
    rotation, translation = look(centre, target - centre, sway[:, 3:])
    return Cameras(WIDTH, HEIGHT, focal * WIDTH, rotation, translation)
