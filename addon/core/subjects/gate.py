"""Decide whether a clip certainly has moving objects, from the tracks of corners in sampled frames.

In a still scene one 3D point explains each track. Single tracks contradict that in any clip: the corner
between a pole and the wall behind it slides, and so does a reflection. On a moving object most neighbouring
tracks contradict it.
"""

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ..base.arrays import Bytes, Floats, Map, Mask
from ..base.progress import checkpoint
from ..camera.intrinsics import Intrinsics
from ..camera.reconstruction import Image, Reconstruction
from ..depth.view_selection import relative_pose
from ..media.light import to_gray8
from ..media.picture_file import Pixels

LONG_SIDE = 480
"""Longer side of the pictures in which corners are followed, in pixels, at most."""
SAMPLES = (8, 32)
"""Least and largest number of sampled frames, evenly spaced; between them as many as cover the clip."""
REACH = 8
"""Registered frames before and after a sampled frame through which its corners are followed."""
CORNERS, QUALITY, APART = 1500, 0.002, 7 / 480
"""Largest number of corners in a frame, least strength as a share of the strongest corner's, and least
distance between two as a share of the long side."""
ROUND = 0.1
"""Least ratio of the eigenvalues of a corner's structure tensor: tracks slide along straight edges. Without
it a still clip of a potted plant has 9 tracks of moving objects, with it none."""
WINDOW = 9
"""Width of the window of optical flow, in pixels."""
ROUND_TRIP = 0.5
"""Largest error of flow there and back, in pixels."""
RESIDUAL = 1 / 240
"""Root mean square residual above which a track contradicts a still scene, as a share of the long side."""
AROUND = 0.06
"""Distance within which tracks are neighbours, as a share of the long side. With 0.09 a person on a street at
night has no tracks of moving objects."""
AGREEING = 0.75
"""Least share of a track's neighbours, itself included, that contradict a still scene on a moving object.
Without it a still garden has 32 such tracks, with it none."""
APART_ALIKE, ALIKE = 0.18, 1 / 480
"""Distance within which tracks that move alike are of one object, parts of which something hides, and
difference of their motion in a frame, as shares of the long side. Without them a tram behind pickets, in 36
frames of 320x180 pixels, has `TRACKS` neighbouring tracks in a single sampled frame, with them in seven of
eight."""
TRACKS = 8
"""Tracks of moving objects that two sampled frames in a row must both have, measured by
`benchmarks.special automatic_subjects` at 010ab4e6."""


@dataclass(frozen=True)
class MovingTracks:
    """Tracks of moving objects in one sampled frame."""

    frame: int
    """Number of the source frame."""
    tracks: Floats
    """(n, 3, 2) places in the frame before, in it, and in the frame after, over the long side of the picture,
    (0, 0) top left; NaN where lost."""
    shape: tuple[int, ...]
    """(h, w) of the picture."""

    def groups(self) -> list[Floats]:
        """Return the places (m, 2), shares of the picture, of each group of at least `TRACKS` tracks.

        A track is in the group of another one that is nearer than `AROUND`, or nearer than `APART_ALIKE` and
        moves alike.
        """
        count, here = len(self.tracks), self.tracks[:, 1]
        away = np.linalg.norm(here[:, None] - here[None], axis=2)
        steps = np.diff(self.tracks, axis=1)
        off = np.linalg.norm(steps[:, None] - steps[None], axis=3)
        known = np.isfinite(off)
        alike = known.any(axis=2) & (np.where(known, off, 0).max(axis=2, initial=0) < ALIKE)
        near = (away < AROUND) | ((away < APART_ALIKE) & alike)
        labels, before = np.arange(count), None
        while before is None or (labels != before).any():
            # Each takes the least label of its neighbours.
            before, labels = labels, np.where(near, labels, count).min(axis=1, initial=count)
        places = here * (max(self.shape) / np.array(self.shape[::-1]))
        return [places[labels == label] for label in np.flatnonzero(np.bincount(labels) >= TRACKS)]


def moving_tracks(
    reconstruction: Reconstruction, read: Callable[[int], Pixels], fixed: Mask | None = None
) -> Iterator[MovingTracks]:
    """Yield the tracks of moving objects in each sampled frame; nothing for photos.

    Args:
        reconstruction: The registered frames of a clip.
        read: Returns a frame's picture (H, W, 3 or 4), as `Footage.read`.
        fixed: Pixels (H, W) of all frames that do not show the scene: nothing there is a track.

    Raises:
        UserError: A frame cannot be read.
    """
    images = reconstruction.images
    if not reconstruction.is_ordered or len(images) < 2:
        return
    edge = min(REACH, len(images) // 4)
    samples = int(np.clip(len(images) // (2 * REACH), *SAMPLES))
    for number in np.unique(np.linspace(edge, len(images) - 1 - edge, samples).round().astype(int)):
        first = max(number - REACH, 0)
        window, here = images[first : number + REACH + 1], number - first
        pictures, cameras = zip(*(_small(reconstruction, image, read) for image in window), strict=True)
        tracks = followed(pictures, here)
        residual = still_residuals(tracks, window, cameras, here)
        shape = pictures[here].shape
        if fixed is not None:
            small = cv2.resize(fixed.astype(np.uint8), shape[::-1], interpolation=cv2.INTER_NEAREST)
            column, row = np.rint(tracks[:, here]).astype(int).T
            residual[small[row.clip(0, shape[0] - 1), column.clip(0, shape[1] - 1)] > 0] = np.nan
        moving = tracks[on_moving_objects(tracks[:, here], residual, shape)].astype(float)
        padded = np.pad(moving, ((0, 0), (1, 1), (0, 0)), constant_values=np.nan)
        yield MovingTracks(images[number].frame, (padded[:, here : here + 3] + 0.5) / max(shape), shape)


def moves(tracks: Sequence[MovingTracks]) -> bool:
    """Return whether a clip with these moving tracks certainly has moving objects."""
    return any(min(len(each.tracks) for each in pair) >= TRACKS for pair in itertools.pairwise(tracks))


def _small(
    reconstruction: Reconstruction, image: Image, read: Callable[[int], Pixels]
) -> tuple[Bytes, Intrinsics]:
    """A reduced, still distorted frame in grey levels (h, w), with the camera of this size."""
    checkpoint()
    camera = reconstruction.intrinsics(image)
    grey = to_gray8(read(image.frame), LONG_SIDE)
    return grey, camera.scaled(grey.shape[1], grey.shape[0])


def followed(pictures: Sequence[Bytes], here: int) -> Map:
    """Follow the corners of one of several consecutive pictures both ways.

    Args:
        pictures: Grey levels (h, w) of each frame.
        here: Index of the picture whose corners are followed.

    Returns:
        Tracks (n, frames, 2) in OpenCV's pixels; NaN where a corner is lost.
    """
    apart = APART * max(pictures[here].shape)
    corners = cv2.goodFeaturesToTrack(pictures[here], CORNERS, QUALITY, apart, blockSize=5)
    start = np.zeros((0, 2), np.float32) if corners is None else corners[:, 0]
    if len(start):
        values = cv2.cornerEigenValsAndVecs(pictures[here], 5, 3)[..., :2]
        one, other = np.moveaxis(values[tuple(start.round().astype(int)[:, ::-1].T)], -1, 0)
        start = start[np.minimum(one, other) >= ROUND * np.maximum(one, other)]
    tracks = np.full((len(start), len(pictures), 2), np.nan, np.float32)
    tracks[:, here] = start
    for way in (-1, 1):
        alive = np.arange(len(start))
        last = len(pictures) - 1 if way > 0 else 0
        for at in range(here, last, way):
            if not len(alive):
                break
            places, kept = _flow(pictures[at], pictures[at + way], tracks[alive, at])
            alive = alive[kept]
            tracks[alive, at + way] = places[kept]
    return tracks


def _flow(picture: Bytes, other: Bytes, places: Map) -> tuple[Map, Mask]:
    """Find places (n, 2) of a picture (h, w) in another one, with a mask (n,) of the reliable ones."""
    size = {"winSize": (WINDOW, WINDOW), "maxLevel": 3}
    there, seen, _ = cv2.calcOpticalFlowPyrLK(picture, other, places, None, **size)  # type: ignore[call-overload]
    back, returned, _ = cv2.calcOpticalFlowPyrLK(other, picture, there, None, **size)  # type: ignore[call-overload]
    inside = np.all((there >= 0) & (there <= np.array(picture.shape[::-1]) - 1), axis=1)
    kept = (seen[:, 0] > 0) & (returned[:, 0] > 0) & inside
    return there, kept & (np.linalg.norm(places - back, axis=1) < ROUND_TRIP)


def still_residuals(tracks: Map, images: Sequence[Image], cameras: Sequence[Intrinsics], here: int) -> Floats:
    """Measure how far each track is from that of a still point.

    The point is the best one on the track's ray of frame `here`, at a positive or infinite distance.

    Args:
        tracks: (n, frames, 2) in OpenCV's pixels, NaN where lost.
        images: The poses of these frames.
        cameras: Their intrinsics, at the size of the pixels.
        here: Index of the frame in which every track is known.

    Returns:
        Root mean square residuals (n,) in pixels; NaN for a track in a single frame.
    """
    lens = cameras[here]
    pixels = [camera.pinhole_pixels(tracks[:, n].astype(float) + 0.5) for n, camera in enumerate(cameras)]
    rays = _rays(pixels[here], lens)
    seen = [n for n in range(len(images)) if n != here]
    # In another camera the point at inverse depth d is at turned + d * shift.
    poses = [relative_pose(images[here], images[n]) for n in seen]
    turned = np.stack([rays @ rotation.T for rotation, _ in poses], axis=1)
    shift = np.stack([translation for _, translation in poses])[None]
    at = np.stack([_rays(pixels[n], cameras[n]) for n in seen], axis=1)[..., :2]
    known = np.isfinite(at).all(axis=2)
    constant = turned[..., :2] - at * turned[..., 2:]
    slope = shift[..., :2] - at * shift[..., 2:]
    inverse, weight = np.zeros(len(tracks)), np.ones(at.shape[:2])
    for _ in range(3):
        # Least squares in the picture, with the perspective division of the previous solution.
        above = np.where(known, weight * (constant * slope).sum(axis=2), 0).sum(axis=1)
        below = np.where(known, weight * (slope * slope).sum(axis=2), 0).sum(axis=1)
        inverse = np.maximum(np.divide(-above, below, out=np.zeros_like(above), where=below > 0), 0)
        depth = turned[..., 2] + inverse[:, None] * shift[..., 2]
        weight = 1 / np.maximum(depth, 0.05) ** 2
    squares = weight * ((constant + inverse[:, None, None] * slope) ** 2).sum(axis=2)
    count = known.sum(axis=1)
    mean = np.where(known, squares, 0).sum(axis=1) / np.maximum(count, 1)
    return np.where(count > 0, lens.fx * np.sqrt(mean), np.nan)


def _rays(pixels: Floats, camera: Intrinsics) -> Floats:
    """Return rays (n, 3) with z = 1 through pixels (n, 2) of a camera without distortion."""
    return np.column_stack([(pixels - camera.principal_point) / camera.focal, np.ones(len(pixels))])


def on_moving_objects(places: Map, residual: Floats, shape: tuple[int, ...]) -> Mask:
    """Return the tracks (n,) that, with most of their neighbours, contradict a still scene.

    `places` (n, 2) and `residual` (n,), NaN for tracks to be ignored, are in pixels of a picture (h, w).
    """
    contradicts = residual > RESIDUAL * max(shape)
    near = np.linalg.norm(places[:, None] - places[None], axis=2) < AROUND * max(shape)
    around = (near & np.isfinite(residual)).sum(axis=1)
    agreeing = (near & contradicts).sum(axis=1)
    return np.asarray(contradicts & (agreeing >= AGREEING * around))
