"""Clips of a camera that stays in its place, with their true depth: somebody walks before walls."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from addon.core.media.light import to_linear
from addon.core.optics.aperture_sampling import vogel_disc

from . import planes

WALKER = 3.0
"""Depth of who walks, a card; behind are the planes of `planes`."""
CARD = (0.9, 1.6)
"""Width and height of the card in scene units."""


@dataclass(frozen=True)
class StayingClip:
    """What the camera saw."""

    pictures: list[np.ndarray]
    """(h, w, 3) RGB of each frame."""
    without: list[np.ndarray]
    """(h, w, 3) the same without who walks."""
    depth: np.ndarray
    """(n, h, w)"""
    walker: np.ndarray
    """(n, h, w) where the card is seen."""
    turns: np.ndarray
    """(n,) radians to the right."""
    shares: np.ndarray
    """(n,) how far who walks has come, 0 to 1."""

    def write(self, folder: Path) -> tuple[Path, Path]:
        """The clip and its depth maps, in metres, as an .npz."""
        bgr = [np.ascontiguousarray(each[..., ::-1]) for each in self.pictures]
        clip = planes.write_clip(folder / "clip", bgr)
        maps = folder / "depth.npz"
        np.savez(maps, depth=self.depth.astype(np.float32))
        return clip, maps

    def through_lens(self, frame: int, radius: float, focus: float, views: int = 300) -> np.ndarray:
        """(h, w, 3) linear light: a frame, from 1, through a thin lens of a radius in scene units, sharp at a
        depth, as the mean of so many views from all over the lens."""
        offsets = radius * vogel_disc(views)
        shown = [_frame(self.turns[frame - 1], self.shares[frame - 1], each, focus)[0] for each in offsets]
        return np.asarray(np.mean([to_linear(each)[..., :3] for each in shown], axis=0), np.float32)


def staying_clip(count: int, pan: float) -> StayingClip:
    """A camera that turns by `pan` radians to the right over the clip, or stands still."""
    turns, shares = pan * np.linspace(-0.5, 0.5, count), np.linspace(0, 1, count)
    made = [_frame(turn, at) for turn, at in zip(turns, shares, strict=True)]
    return StayingClip(
        [each[0] for each in made], [each[1] for each in made],
        np.stack([each[2] for each in made]), np.stack([each[3] for each in made]), turns, shares,
    )  # fmt: skip


MIDDLE = np.zeros(2)
"""Of the lens."""
Frame = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def _frame(turn: float, at: float, offset: np.ndarray = MIDDLE, focus: float = np.inf) -> Frame:
    """A picture, the same without the card, its depth and where the card is; from a place in the lens, an
    `offset` (2,) to the right and down, in register at a depth of `focus`."""
    vector = np.array([0.0, turn, 0.0])
    rotation = cv2.Rodrigues(vector)[0]
    centre = rotation.T @ [*offset, 0.0]
    shift = planes.FOCAL * offset / focus
    behind = planes.view(centre, vector, shift=(shift[0], shift[1]))
    depth = np.full(behind.shape[:2], np.inf)
    for z, (left, right) in planes.PLANES.items():
        corners = np.array([[left, -12, z], [right, -12, z], [right, 12, z], [left, 12, z]])
        inside, seen = _plane(corners - centre, rotation, shift)
        depth = np.where(inside & (seen < depth), seen, depth)
    corner, (across, down) = np.array([-1.6 + 2.3 * at, -0.6, WALKER]) - centre, CARD
    corners = corner + np.array([[0, 0, 0], [across, 0, 0], [across, down, 0], [0, down, 0]])
    inside, seen = _plane(corners, rotation, shift)
    paint = np.repeat(planes.pattern(200, 200, 9)[..., None], 3, axis=2)
    square = np.array([[0, 0], [200, 0], [200, 200], [0, 200]], np.float32)
    local = corners @ rotation.T
    xy = planes.FOCAL * local[:, :2] / local[:, 2:] + np.array(planes.SIZE) / 2 + shift
    matrix = cv2.getPerspectiveTransform(square, xy.astype(np.float32) - 0.5)
    card = cv2.warpPerspective(255 - paint // 2, matrix, planes.SIZE, borderMode=cv2.BORDER_REPLICATE)
    card[..., 2] //= 2
    whole = np.where(inside[..., None], card, behind)
    return whole, behind, np.where(inside, seen, depth), inside


def _plane(corners: np.ndarray, rotation: np.ndarray, shift: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(h, w) where a rectangle that faces the world's z axis is seen, and the depth of its plane."""
    width, height = planes.SIZE
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    across, down = (x - width / 2 - shift[0]) / planes.FOCAL, (y - height / 2 - shift[1]) / planes.FOCAL
    world = np.stack([across, down, np.ones_like(x)], axis=-1) @ rotation
    scale = corners[0, 2] / world[..., 2]
    at = world * scale[..., None]
    low, high = corners.min(axis=0), corners.max(axis=0)
    inside = np.all((at[..., :2] >= low[:2]) & (at[..., :2] <= high[:2]), axis=-1)
    return inside, scale
