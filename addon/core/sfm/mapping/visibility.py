"""Points visible in a frame in which they were not tracked.

Points of other frames are projected into the frame and checked. They make its mesh denser (the thesis's
figure 5-2). Many of them are occluded, which neither the point nor its projection shows. Each must lie at the
depth of observed points around it, and look as in the frame that saw it from the nearest place. It must also
be accurate: points with few or inaccurate observations are wrong four times as often as the others (`python
-m benchmarks.solving.density`).
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from ...base.arrays import Floats, Ints, Map, Mask
from ...camera.reconstruction import Image, Reconstruction, seen_by
from ...media.clip import Footage
from ...media.light import to_gray8
from ...media.picture_file import Pixels
from ..tracking.template_tracking import sample, square
from ..tracking.tracks import LONG_SIDE, Progress

FLAT = 0.5
"""Standard deviation in grey levels below which a patch shows nothing. Chosen by inspection."""
MIDGREY = 128.0
"""Grey level taken off before squares are added up in single precision."""
# Thresholds were found with `python -m benchmarks.solving.density`, which counts the points that are wrong in
# scenes with known depth: 0.3 to 1.5 % of them.
RADIUS = 4
"""Pixels from the middle to the border of the patches that are compared. Chosen by inspection."""
SOFTEN = 1.0
"""Standard deviation (px) of the blur of frames against noise and aliasing. Chosen by inspection."""
MIN_VIEWS = 5
"""Frames that must have observed a point."""
MAX_ERROR_RATIO = 2.0
"""Largest reprojection error of a point, as a multiple of the median one."""
NEIGHBOURHOOD = 1 / 16
"""Distance, as a share of the frame's long side, within which observed points tell a point's depth."""
MIN_NEIGHBOURS = 2
"""Observed points within `NEIGHBOURHOOD` that must lie at a point's depth."""
SAME_DEPTH = 0.06
"""Difference in inverse depth, as a share of the frame's largest, up to which depths are taken for equal:
they blur alike."""
MIN_CORRELATION = 0.85
"""Correlation with the patch that another frame saw, from which on a point looks the same."""
MIN_HALF_CORRELATION = 0.93
"""Correlation with a half of the patch that another frame saw, from which on a point looks the same."""
MAX_CONTRAST_RATIO = 2.0
"""Largest ratio of the contrasts of two patches that look the same, either way."""
REACH = 60
"""Frames within which a point must have been observed. Chosen by inspection."""


def visible_points(
    reconstruction: Reconstruction, footage: Footage, progress: Progress = lambda stage, done, total: None
) -> dict[int, Ints]:
    """Find the visible points of registered frames besides their observed ones.

    The clip is read once, in order; small patches around points are kept.

    Args:
        reconstruction: Solve of the clip.
        footage: The clip.
        progress: Called with the stage, done and all frames.

    Returns:
        (k,) rows of `Reconstruction.points` by frame, ascending.

    Raises:
        UserError: A frame cannot be read.
    """
    images = reconstruction.images
    search = _Search(reconstruction)
    for index, image in enumerate(images):
        progress("Looking for points", index, len(images))
        search.see(index, *_softened(footage.read(image.frame)))
        search.sights.passed(index)
    return {image.frame: search.found(index) for index, image in enumerate(images)}


@dataclass(frozen=True)
class _Waiting:
    """Candidates of an earlier frame that can be decided only when a later one is seen."""

    index: int
    points: Ints
    looks: Map


class _Search:
    """The state of the search while frames go by."""

    def __init__(self, reconstruction: Reconstruction) -> None:
        self.sights = _Sights(reconstruction)
        self._reconstruction = reconstruction
        self._patches = np.zeros((len(reconstruction.points), square(RADIUS).shape[1]), np.float16)
        self._waiting: dict[int, list[_Waiting]] = {}
        self._accepted: list[list[Ints]] = [[] for _ in reconstruction.images]

    def see(self, index: int, gray: Map, zoom: Floats) -> None:
        """Keep a frame's patches, find candidates in it, and decide earlier ones."""
        image = self._reconstruction.images[index]
        upright = np.tile(np.eye(2), (len(image.points), 1, 1))
        self._patches[image.points] = sample(gray, image.xy * zoom - 0.5, upright, square(RADIUS))
        rows, source = self.sights.candidates(index)
        near = _has_neighbours(self._reconstruction, image, rows)
        rows, source = rows[near], source[near]
        looks = _looks(self._reconstruction, index, rows, source, gray, zoom)
        before = source < index
        self._decide(_Waiting(index, rows[before], looks[before]))
        for later in np.unique(source[~before]):
            some = source == later
            self._waiting.setdefault(int(later), []).append(_Waiting(index, rows[some], looks[some]))
        for each in self._waiting.pop(index, []):
            self._decide(each)

    def _decide(self, waiting: _Waiting) -> None:
        good = _alike(self._patches[waiting.points], waiting.looks)
        self._accepted[waiting.index].append(waiting.points[good])

    def found(self, index: int) -> Ints:
        """Return the points (k,) of a frame, after all are seen."""
        return np.sort(np.concatenate(self._accepted[index]))


class _Sights:
    """When each point was last seen and will be seen next, as the frames go by."""

    def __init__(self, reconstruction: Reconstruction) -> None:
        self._reconstruction = reconstruction
        images, count = reconstruction.images, len(reconstruction.points)
        index = np.repeat(np.arange(len(images)), [len(image.points) for image in images])
        points = np.concatenate([np.zeros(0, np.int32), *(image.points for image in images)])
        order = np.lexsort([index, points])
        follows = np.full(len(order), len(images))
        same = points[order][1:] == points[order][:-1]
        follows[order[:-1][same]] = index[order[1:][same]]
        self._follows = np.split(follows, np.searchsorted(index, np.arange(1, len(images))))
        self._last, self._next = np.full(count, -1), np.full(count, len(images))
        error = reconstruction.points.error
        self._good = reconstruction.views_per_point >= MIN_VIEWS
        median = np.median(error[self._good]) if self._good.any() else 0.0
        self._good &= error <= MAX_ERROR_RATIO * median
        np.minimum.at(self._next, points, index)
        self._centres = np.array([image.centre for image in images])

    def candidates(self, index: int) -> tuple[Ints, Ints]:
        """Unobserved points (n,) that project into a frame, and the frame (n,) with the nearest view."""
        reconstruction = self._reconstruction
        image = reconstruction.images[index]
        close = (self._last >= 0) & (index - self._last <= REACH)
        close |= (self._next < len(self._centres)) & (self._next - index <= REACH)
        close &= self._good
        close[image.points] = False
        rows = np.nonzero(close)[0].astype(np.int32)
        local, ahead = seen_by(image, reconstruction, rows)
        camera = reconstruction.intrinsics(image)
        place = camera.project(local)
        with np.errstate(invalid="ignore"):
            inside = ahead & np.all((place >= 0) & (place < [camera.width, camera.height]), axis=1)
        rows = rows[inside]
        before, after = self._last[rows], self._next[rows]
        here = self._towards(np.full(len(rows), index), rows)
        angle = [np.einsum("ij,ij->i", here, self._towards(frame, rows)) for frame in (before, after)]
        angle[0][(before < 0) | (index - before > REACH)] = -np.inf
        angle[1][(after >= len(self._centres)) | (after - index > REACH)] = -np.inf
        return rows, np.where(angle[0] >= angle[1], before, after).astype(np.int32)

    def passed(self, index: int) -> None:
        """Go on to the next frame."""
        points = self._reconstruction.images[index].points
        self._last[points], self._next[points] = index, self._follows[index]

    def _towards(self, index: NDArray[np.integer], rows: Ints) -> Floats:
        """(n, 3) unit directions from frames' cameras to points; some frame's where there is none."""
        away = (
            self._reconstruction.points.xyz[rows] - self._centres[np.clip(index, 0, len(self._centres) - 1)]
        )
        return np.asarray(away / np.linalg.norm(away, axis=1, keepdims=True))


def _has_neighbours(reconstruction: Reconstruction, image: Image, rows: Ints) -> Mask:
    """(n,) whether a point has `MIN_NEIGHBOURS` observed ones around it at its depth, counted in cells."""
    camera = reconstruction.intrinsics(image)
    observed, ahead = seen_by(image, reconstruction, image.points)
    if not ahead.any():
        return np.zeros(len(rows), bool)
    local = image.to_camera(reconstruction.points.xyz[rows])
    nearest = float(np.percentile(1 / observed[ahead, 2], 98))
    long_side = max(camera.width, camera.height)
    # A point's cell and two more on each side are on average as far as the others may be.
    cell = np.array([NEIGHBOURHOOD * long_side] * 2 + [SAME_DEPTH * nearest]) / 2.5
    size = np.ceil(np.array([camera.width, camera.height, 1.25 * nearest]) / cell).astype(int)

    def number(place: Floats, depth: Floats) -> tuple[NDArray[np.intp], ...]:
        return tuple(np.clip(np.column_stack([place, 1 / depth]) / cell, 0, size - 1).astype(np.intp).T)

    count = np.zeros(size, int)
    np.add.at(count, number(image.xy[ahead], observed[ahead, 2]), 1)
    count = np.pad(count, 2)
    for axis in range(3):
        count = sliding_window_view(count, 5, axis).sum(axis=-1)
    return np.asarray(count[number(camera.project(local), local[:, 2])] >= MIN_NEIGHBOURS)


def _looks(
    reconstruction: Reconstruction, index: int, rows: Ints, source: Ints, gray: Map, zoom: Floats
) -> Map:
    """(n, q) what a frame shows around points, turned and scaled as their source frames (n,) see them.

    A pixel wider on each side than the patches that they are compared with. Each point is taken for a small
    patch that faces its source frame, which counts as read at once: its readout shears a patch by less than a
    hundredth.
    """
    image = reconstruction.images[index]
    camera = reconstruction.intrinsics(image)
    world = reconstruction.points.xyz[rows]
    frames, at = np.unique(source, return_inverse=True)
    others = [reconstruction.images[each] for each in frames]
    rotation = np.array([other.rotation for other in others]).reshape(-1, 3, 3)[at]
    translation = np.array([other.translation for other in others]).reshape(-1, 3)[at]
    lens = np.array([other.camera for other in others], np.intp)[at]
    local = (rotation @ world[..., None])[..., 0] + translation
    # One pixel of the source frame along each axis, at the point's depth.
    beside = np.empty((len(rows), 2, 3))
    for each in np.unique(lens):
        some, theirs = lens == each, reconstruction.cameras[each]
        pixels = theirs.project(local[some])[:, None] + np.eye(2)
        rays = theirs.undistort((pixels - theirs.principal_point) / theirs.focal)
        beside[some] = np.concatenate([rays, np.ones_like(rays[..., :1])], axis=-1) * local[some, None, 2:]
    place = camera.project(image.to_camera(world))
    seen = camera.project(image.to_camera((beside - translation[:, None]) @ rotation))
    return sample(gray, place * zoom - 0.5, np.swapaxes(seen - place[:, None], 1, 2), square(RADIUS + 1))


def _alike(patches: NDArray[np.floating], looks: Map) -> Mask:
    """(n,) whether patches (n, p), or one half of them very well, are found in looks (n, q) at a shift."""
    side = 2 * RADIUS + 1
    wide = looks.reshape(-1, side + 2, side + 2) - MIDGREY
    seen = sliding_window_view(wide, (side, side), (1, 2)).reshape(len(looks), 9, side * side)
    known = patches.astype(np.float32)[:, None] - MIDGREY
    parts = _parts()
    mean, expected = seen @ parts, known @ parts
    spread = np.sqrt(np.maximum(seen**2 @ parts - mean**2, FLAT**2))
    contrast = np.sqrt(np.maximum(known**2 @ parts - expected**2, FLAT**2))
    both = (seen * known) @ parts - mean * expected
    good = both / (spread * contrast) > np.array([MIN_CORRELATION] + [MIN_HALF_CORRELATION] * 4)
    good &= (spread < MAX_CONTRAST_RATIO * contrast) & (contrast < MAX_CONTRAST_RATIO * spread)
    return np.asarray(good.any(axis=(1, 2)))


def _parts() -> Map:
    """(p, 5) weights of a patch's pixels, of sum 1: the whole, and its four halves with the middle line."""
    _, u, v = square(RADIUS)
    inside = np.stack([np.ones_like(u), u <= 0, u >= 0, v <= 0, v >= 0], axis=1)
    return np.asarray(inside / inside.sum(axis=0), np.float32)


def _softened(picture: Pixels) -> tuple[Map, Floats]:
    """A frame in grey, at most `LONG_SIDE` long, blurred by `SOFTEN` pixels; its scale (2,)."""
    small = to_gray8(picture, LONG_SIDE)
    blurred = cv2.GaussianBlur(small.astype(np.float32), (0, 0), SOFTEN)
    return np.asarray(blurred, np.float32), np.array(small.shape[::-1]) / picture.shape[1::-1]
