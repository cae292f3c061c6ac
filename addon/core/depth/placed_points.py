"""Points of a camera that stays in its place, at the distances of depth maps.

Such a clip has no parallax, so the kind of the maps follows from the maps alone: a plane is linear over the
picture in inverse depth only.
"""

from dataclasses import replace

import numpy as np

from ..base.arrays import Floats, Indices, Ints, Mask
from ..base.errors import UserError
from ..base.progress import checkpoint
from ..camera.reconstruction import MEDIAN_DEPTH, Reconstruction
from ..media.clip import describe
from .user_maps import DepthMaps

FRAMES = 40
"""Frames whose maps place the points. Chosen by inspection."""
JUDGED = 5
"""Frames by which it is judged what the maps hold. Chosen by inspection."""
REACH = 32
"""Distance of the three pixels that should lie on a line, as a share of the long side: more than a map's
noise."""
STRAIGHTEST = 10.0
"""Percentile of all such triples by which a map is judged. Among distances of 16, 32 and 64 with 10, 20 and
30, these recognise most of 27 maps, 26: of the bench's scenes, true and from a network, and from a sensor in
a room."""
ROUNDS = 4
"""Times that points and the maps' scales are found from each other."""
FARTHEST = 0.01
"""Least inverse distance of a point, relative to the median. Chosen by inspection."""


def placed(reconstruction: Reconstruction, maps: DepthMaps) -> Reconstruction:
    """Return a reconstruction with cameras in one place and points at the distances of maps.

    Maps of depth have their own unit, such as metres. Maps of inverse depth have an unknown factor: the
    median distance becomes `MEDIAN_DEPTH`, as does that of points without a map. Raises UserError if no point
    has a distance, or a map cannot be read.
    """
    frames = sorted(set(maps.frames) & {image.frame for image in reconstruction.images})
    if not frames:
        raise UserError(
            f"no frame with a camera has a depth map in {maps.pictures.path.name}; there are maps for"
            f" {describe(maps.frames)}"
        )
    chosen = _evenly(frames, FRAMES)
    images = [image for image in reconstruction.images if image.frame in chosen]
    is_depth = _hold_depth(maps, _evenly(frames, JUDGED))
    point, frame, inverse, slant = list[Ints](), list[Indices](), list[Floats](), list[Floats]()
    for number, image in enumerate(images):
        checkpoint(1.0)
        stored = maps.read(image.frame).at(image.xy)
        with np.errstate(divide="ignore", invalid="ignore"):
            value = 1 / stored if is_depth else stored
        known = np.isfinite(value) & (value > 0)
        point.append(image.points[known])
        frame.append(np.full(np.count_nonzero(known), number))
        inverse.append(value[known])
        local = image.to_camera(reconstruction.points.xyz[image.points])
        slant.append((np.linalg.norm(local, axis=1) / local[:, 2])[known])
    points, at = np.concatenate(point), np.concatenate(frame)
    values, slants = np.concatenate(inverse), np.concatenate(slant)
    if not len(points):
        raise UserError(
            f"the depth maps in {maps.pictures.path.name} know none of the feature points; check that they"
            " belong to this clip and are not empty"
        )
    count = len(reconstruction.points)
    near, known_points = _near(points, at, values / slants, 1 / slants, count, not is_depth)
    middle = float(np.median(near[known_points]))
    if not is_depth:
        near *= 1 / (MEDIAN_DEPTH * middle)
        middle = 1 / MEDIAN_DEPTH
    near = np.where(known_points, np.maximum(near, FARTHEST * middle), middle)
    xyz = reconstruction.points.xyz
    towards = xyz / np.linalg.norm(xyz, axis=1, keepdims=True)
    return replace(reconstruction, points=replace(reconstruction.points, xyz=towards / near[:, None]))


def _evenly(frames: list[int], count: int) -> list[int]:
    return [frames[i] for i in np.linspace(0, len(frames) - 1, min(count, len(frames))).round().astype(int)]


def _near(
    point: Ints, frame: Indices, inverse: Floats, one: Floats, count: int, drifts: bool
) -> tuple[Floats, Mask]:
    """(count,) inverse distances of points, and the known ones, from observations (m,) in maps.

    Scale and shift of the maps drift from frame to frame or not; `one` (m,) is the effect of a shift by 1.
    """
    views = np.bincount(point, minlength=count)
    frames = int(frame.max()) + 1
    scale, shift = np.ones(frames), np.zeros(frames)
    near = np.zeros(count)
    for _ in range(ROUNDS if drifts else 1):
        adjusted = scale[frame] * inverse + shift[frame] * one
        near = np.bincount(point, adjusted, minlength=count) / np.maximum(views, 1)
        if not drifts:
            break
        off = np.abs(adjusted - near[point])
        weight = 1 / (1 + (off / max(float(np.median(off)), 1e-12)) ** 2)
        sums = [
            np.bincount(frame, weight * a * b, minlength=frames)
            for a, b in (
                (inverse, inverse), (inverse, one), (one, one), (inverse, near[point]), (one, near[point]),
            )
        ]  # fmt: skip
        determinant = sums[0] * sums[2] - sums[1] ** 2
        good = determinant > 1e-9 * sums[0] * sums[2]
        safe = np.where(good, determinant, 1.0)
        scale = np.where(good, (sums[2] * sums[3] - sums[1] * sums[4]) / safe, scale)
        shift = np.where(good, (sums[0] * sums[4] - sums[1] * sums[3]) / safe, shift)
        # Scale and shift of all maps together are undetermined.
        scale, shift = scale / np.median(scale), shift - np.median(shift)
    return near, views > 0


def _hold_depth(maps: DepthMaps, frames: list[int]) -> bool:
    """Return whether maps hold depth: whether depth is linear over the picture more often."""
    every = [maps.read(each).values for each in frames]
    known = [np.where(values > 0, values, np.nan) for values in every]
    bent = np.array([[_bend(values), _bend(1 / values)] for values in known])
    return bool(np.median(bent[:, 1]) <= np.median(bent[:, 0]))


def _bend(values: Floats) -> float:
    """The second difference over the first one of values (h, w) far enough apart, where that is least."""
    step = max(max(values.shape) // REACH, 1)
    bends = []
    for each in (values, values.T):
        before, middle, after = each[:, : -2 * step], each[:, step:-step], each[:, 2 * step :]
        first, second = np.abs(after - before), np.abs(after - 2 * middle + before)
        slopes = first > 1e-3 * np.abs(middle)
        bends.append((second / np.where(slopes, first, np.nan)).ravel())
    both = np.concatenate(bends)
    both = both[np.isfinite(both)]
    return float(np.percentile(both, STRAIGHTEST)) if len(both) else 0.0
