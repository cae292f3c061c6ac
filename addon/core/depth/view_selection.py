"""Which frames tell most about a frame's depth: chosen by how far the scene's depths move apart in them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ..camera.reconstruction import Floats, Image, Intrinsics, Reconstruction

SHRINKS = 0.1
"""A place whose depth shrinks below this share on the way to a neighbour is out of its sight."""
OVERLAP = 0.5
"""Share of the picture that a neighbour has to see."""
LATER = 0.005
"""How much worse, as a logarithm of the parallax, a frame is for each frame of distance in time."""

FEWEST = 8
"""Frames of a short clip that are asked, if every frame of a long one need not be."""


@dataclass(frozen=True)
class Neighbour:
    """One frame that is compared with."""

    image: Image
    parallax: float
    """Median distance in its pixels between the nearest and the farthest place of a ray."""
    side: int
    """-1 or 1: of the frame's camera, along the direction in which the neighbours' cameras lie apart most."""


def relative_pose(image: Image, other: Image) -> tuple[Floats, Floats]:
    """Rotation (3, 3) and translation (3,) from an image's camera space to another's."""
    turn = other.rotation @ image.rotation.T
    return turn, np.asarray(other.translation - turn @ image.translation)


def stride(reconstruction: Reconstruction, most: int) -> int:
    """Every how many registered frames to ask: at most `most`, of a short clip so that some are left."""
    return max(1, min(most, len(reconstruction.images) // FEWEST))


def regular(reconstruction: Reconstruction, frame: int, step: int, span: int) -> list[Image]:
    """Every `step`-th registered frame, up to `span` of them before and after a frame, without it.

    They are counted from the first, so that frames that follow each other get the same ones.
    """
    images, at = reconstruction.images, int(np.searchsorted(reconstruction.frames, frame))
    places = range(-(-max(at - span, 0) // step) * step, min(at + span + 1, len(images)), step)
    return [images[i] for i in places if images[i].frame != frame]


def choose(
    image: Image,
    lens: Intrinsics,
    others: Iterable[tuple[Image, Intrinsics]],
    span: tuple[float, float],
    wanted: Sequence[float],
) -> list[Neighbour]:
    """For each wanted parallax in pixels the best frame on either side, if there is one.

    `lens` and those beside the others are pinholes; `span` is the least and the largest inverse depth.
    """
    share = np.linspace(0.1, 0.9, 5)
    grid = np.stack(np.meshgrid(share * lens.width, share * lens.height), axis=-1).reshape(-1, 2)
    rays = np.column_stack([(grid - lens.principal_point) / lens.focal, np.ones(len(grid))])
    found = [
        (other, parallax)
        for other, pinhole in others
        if other.frame != image.frame
        and (parallax := _parallax(image, other, pinhole, rays, span)) is not None
    ]
    if not found:
        return []
    away = np.array([image.rotation @ (other.centre - image.centre) for other, _ in found])
    side = np.where(away @ np.linalg.svd(away, full_matrices=False)[2][0] < 0, -1, 1)
    later = np.array([LATER * abs(other.frame - image.frame) for other, _ in found])
    size = np.log(np.maximum([parallax for _, parallax in found], 1e-9))
    chosen = []
    for own in (-1, 1):
        free = side == own
        for parallax in wanted[: int(free.sum())]:
            best = int(np.where(free, np.abs(size - np.log(parallax)) + later, np.inf).argmin())
            free[best] = False
            chosen.append(Neighbour(*found[best], own))
    return chosen


def _parallax(
    image: Image, other: Image, lens: Intrinsics, rays: Floats, span: tuple[float, float]
) -> float | None:
    """In pixels; None where the other frame sees too little of the same."""
    turn, move = relative_pose(image, other)
    far, near, middle = (rays @ turn.T + inverse * move for inverse in (*span, sum(span) / 2))
    nearest = min(places[:, 2].min() for places in (far, near, middle))
    if not np.isfinite(nearest) or nearest < SHRINKS:
        return None
    inside = np.all((lens.project(middle) >= 0) & (lens.project(middle) <= [lens.width, lens.height]), axis=1)
    if inside.mean() < OVERLAP:
        return None
    return float(np.median(np.linalg.norm(lens.project(far) - lens.project(near), axis=1)))
