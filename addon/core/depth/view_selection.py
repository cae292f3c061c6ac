"""Choice of source views for a frame's depth, by the parallax of the scene's depths."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Floats
from ..camera.reconstruction import Image, Intrinsics, Reconstruction

SOURCE_STEP, SOURCE_SPAN, FEWEST_SOURCES = 8, 32, 8
"""Step between the frames that show what a frame hides, in registered frames, so that neighbours share them;
their largest distance; and their least number in a short clip. With every fourth, bars have 32.28 instead of
32.32 dB; the least number gains 0.9 dB in the shop at 5 m."""
SPREAD = 16
"""Photos from which one takes the colours that it does not show, at most. Chosen by inspection."""
LEAST_DEPTH_RATIO = 0.1
"""Least share of its depth that a place keeps on the way to a frame that sees it. Chosen by inspection."""
FRAME_PENALTY = 0.005
"""Penalty for each frame of distance in time, in logarithms of parallax. Chosen by inspection."""
LEAST_OVERLAP = 0.5
"""Share of the picture that a source view has to see. Chosen by inspection."""


@dataclass(frozen=True)
class Neighbour:
    """A source view: one frame that a frame is compared with."""

    image: Image
    parallax: float
    """Median distance in its pixels between the nearest and the farthest place of a ray."""
    side: int
    """-1 or 1: of the frame's camera, along the direction in which the source views lie apart most."""


def relative_pose(image: Image, other: Image) -> tuple[Floats, Floats]:
    """Return rotation (3, 3) and translation (3,) from an image's camera space to another's."""
    rotation = other.rotation @ image.rotation.T
    return rotation, np.asarray(other.translation - rotation @ image.translation)


def stride(reconstruction: Reconstruction, most: int, fewest: int) -> int:
    """Return a step of registered frames: `most`, or less in a short clip, for at least `fewest`."""
    return max(1, min(most, len(reconstruction.images) // fewest))


def every_nth(reconstruction: Reconstruction, frame: int, step: int, span: int) -> list[Image]:
    """Return every `step`-th registered frame, up to `span` frames before and after a frame, without it.

    They are counted from the first frame, so that neighbours get the same ones. Photos are chosen from the
    nearest to the farthest with a common view, up to `SPREAD`: both show hidden pixels.
    """
    if not reconstruction.is_ordered:
        ranked = nearest_views(reconstruction, reconstruction.image_at(frame)[0])
        spread = np.linspace(0, len(ranked) - 1, min(SPREAD, len(ranked))).round().astype(int)
        return [ranked[i] for i in spread]
    images, at = reconstruction.images, int(np.searchsorted(reconstruction.frames, frame))
    places = range(-(-max(at - span, 0) // step) * step, min(at + span + 1, len(images)), step)
    return [images[i] for i in places if images[i].frame != frame]


def source_frames(reconstruction: Reconstruction, frame: int) -> list[Image]:
    """Return the registered frames that show what a frame hides, as `every_nth`."""
    return every_nth(reconstruction, frame, stride(reconstruction, SOURCE_STEP, FEWEST_SOURCES), SOURCE_SPAN)


def nearest_views(reconstruction: Reconstruction, image: Image, count: int | None = None) -> list[Image]:
    """Return at most `count` photos that share points with one, the nearest first, without it.

    Distance is the median angle between the rays to shared points, times the missing share of the picture: a
    photo from beside with the same view is better than one that looks elsewhere. Without points it is the
    distance of the cameras.
    """
    ranked = []
    for other in reconstruction.images:
        if other.frame == image.frame:
            continue
        if not len(image.points):
            ranked.append((float(np.linalg.norm(other.centre - image.centre)), other.frame, other))
            continue
        shared = np.intersect1d(image.points, other.points)
        if not len(shared):
            continue
        rays = [reconstruction.points.xyz[shared] - each.centre for each in (image, other)]
        one, two = (ray / np.linalg.norm(ray, axis=1, keepdims=True) for ray in rays)
        angle = float(np.median(np.linalg.norm(one - two, axis=1)))
        ranked.append((angle * len(image.points) / len(shared), other.frame, other))
    return [other for _, _, other in sorted(ranked, key=lambda each: each[:2])[:count]]


def parallaxes(
    image: Image, camera: Intrinsics, others: Iterable[tuple[Image, Intrinsics]], span: tuple[float, float]
) -> list[tuple[Image, float]]:
    """Find the frames that can be source views of a frame with a pinhole, among others with theirs.

    Returns:
        The frames with enough overlap, each with the median distance in pixels between the places of both
            ends of `span`, a least and a largest inverse depth in 1 / scene units.
    """
    share = np.linspace(0.1, 0.9, 5)
    grid = np.stack(np.meshgrid(share * camera.width, share * camera.height), axis=-1).reshape(-1, 2)
    rays = camera.rays(grid)
    return [
        (other, parallax)
        for other, pinhole in others
        if other.frame != image.frame
        and (parallax := _parallax(image, other, pinhole, rays, span)) is not None
    ]


def select_source_views(
    image: Image, found: Sequence[tuple[Image, float]], wanted: Sequence[float], is_ordered: bool = True
) -> list[Neighbour]:
    """Return the best frame of `parallaxes` on either side for each wanted parallax in pixels.

    Nearer frames are preferred if they are `is_ordered` in time.
    """
    if not found:
        return []
    baselines = np.array([image.rotation @ (other.centre - image.centre) for other, _ in found])
    main_axis = np.linalg.svd(baselines, full_matrices=False)[2][0]
    side = np.where(baselines @ main_axis < 0, -1, 1)
    away = np.array([abs(other.frame - image.frame) for other, _ in found])
    penalty = is_ordered * FRAME_PENALTY * away
    size = np.log(np.maximum([parallax for _, parallax in found], 1e-9))
    chosen = []
    for own in (-1, 1):
        free = side == own
        for parallax in wanted[: int(free.sum())]:
            best = int(np.where(free, np.abs(size - np.log(parallax)) + penalty, np.inf).argmin())
            free[best] = False
            chosen.append(Neighbour(*found[best], own))
    return chosen


def _parallax(
    image: Image, other: Image, camera: Intrinsics, rays: Floats, span: tuple[float, float]
) -> float | None:
    """Median parallax (px) of rays (n, 3) over a span of inverse depths; None for too small an overlap."""
    rotation, translation = relative_pose(image, other)
    far, near, middle = (rays @ rotation.T + inverse * translation for inverse in (*span, sum(span) / 2))
    nearest = min(places[:, 2].min() for places in (far, near, middle))
    if not np.isfinite(nearest) or nearest < LEAST_DEPTH_RATIO:
        return None
    inside = np.all(
        (camera.project(middle) >= 0) & (camera.project(middle) <= [camera.width, camera.height]), axis=1
    )
    if inside.mean() < LEAST_OVERLAP:
        return None
    return float(np.median(np.linalg.norm(camera.project(far) - camera.project(near), axis=1)))
