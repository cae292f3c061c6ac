"""A place on something that moves by itself, followed through the clip by optical flow, and its depth."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.progress import checkpoint
from ..camera.reconstruction import Reconstruction
from ..depth.source import NO_PICTURE, DepthSource
from ..media.light import to_gray8
from ..media.picture_file import Pixels

# Chosen by inspection of the tram behind the fence of the sample scene `fence` and of the moving card of
# tests/focus/test_focus_follow.py.
LONG_SIDE = 640
"""Pixels of the longer side of the pictures in which it is followed."""
RADIUS = 0.02
"""Share of this size around the place; pixels of the moving object within it are followed, too, and vote."""
STEP = 4
"""Pixels between those."""
AGREE = 1.0
"""Pixels by which flow there and back may miss where it began."""
LEAST = 0.3
"""Share of those pixels that must be left, or the place is lost."""
JERK, JERK_SHARE = 2.0, 0.4
"""Pixels, and share of the last step, by which a step may differ from it and still be the object's own."""
LONGEST_HIDDEN = 12
"""Frames that it may be hidden, going on as it went, before it is lost."""
ALIKE = 0.15
"""Relative difference of inverse depths of the same moving object, `EVERY` frames apart."""
EVERY = 3
"""Frames between two whose depth is asked for: those between are interpolated, in inverse depth."""


@dataclass(frozen=True)
class _Clip:
    """The inputs of following."""

    reconstruction: Reconstruction
    depth: DepthSource
    read: Callable[[int], Pixels]


def follow(
    reconstruction: Reconstruction,
    depth: DepthSource,
    read: Callable[[int], Pixels],
    frame: int,
    place: Floats,
    inverse_depth: float,
) -> dict[int, float]:
    """Return the distances of a moving object through the clip, by registered frame.

    From frame to frame, optical flow moves the object's pixels around the place, and the depth of moving
    pixels is read there. The result ends where the object is lost; it has one frame if it cannot be followed.

    Args:
        reconstruction: Solve of the clip.
        depth: Source of the depth of pixels.
        read: Returns a frame's picture (H, W, 3 or 4).
        frame: Frame of the place.
        place: (2,) in pixels of the source frame.
        inverse_depth: Inverse depth of the object there.

    Raises:
        UserError: As of `DepthSource.at`.
        Cancelled: The user cancels.
    """
    clip = _Clip(reconstruction, depth, read)
    frames = [int(each) for each in reconstruction.frames]
    at = frames.index(frame)
    start = _pixels_around(clip, frame, place, inverse_depth)
    found = {frame: inverse_depth}
    for way in (frames[at:], frames[at::-1]):
        found |= _one_way(clip, way, start, inverse_depth)
    known = sorted(found)
    inverse = smoothed([found[each] for each in known])
    between = [each for each in frames if known[0] <= each <= known[-1]]
    return dict(zip(between, (1 / np.interp(between, known, inverse)).tolist(), strict=True))


def _one_way(clip: _Clip, way: Sequence[int], start: Floats, start_depth: float) -> dict[int, float]:
    """Inverse depths by frame of pixels (n, 2) in a way's first frame, as far as they are followed."""
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    points, before, seen_at = start, to_gray8(clip.read(way[0]), LONG_SIDE), list[tuple[int, int, float]]()
    step: Floats | None = None
    hidden = 0
    for number, frame in enumerate(way[1:], 1):
        checkpoint()
        now = to_gray8(clip.read(frame), LONG_SIDE)
        there, back = flow.calc(before, now, None), flow.calc(now, before, None)
        seen = _step(there, back, points)
        if seen is not None and _goes_on(seen, step):
            step, hidden = seen, 0
        else:
            # Something passes before it: it goes on as it went.
            hidden += 1
        if step is None or hidden > LONGEST_HIDDEN:
            break
        points = points + step
        if not ((points[0] >= 0) & (points[0] < now.shape[::-1])).all():
            break
        if not hidden and (number % EVERY == 0 or frame == way[-1]):
            depth = _depth_of_object(clip, frame, points)
            if depth is not None:
                seen_at.append((number, frame, depth))
        before = now
    return _of_one_object(seen_at, start_depth)


def _step(there: Floats, back: Floats, points: Floats) -> Floats | None:
    """Motion (2,) in pixels of most points (n, 2) whose flow returns to its place; None if few agree."""
    steps = _at(there, points)
    after = points + steps
    inside = ((after >= 0) & (after < there.shape[1::-1])).all(axis=1)
    right = inside & (np.linalg.norm(steps + _at(back, after), axis=1) < AGREE)
    if not inside[0] or right.sum() < max(LEAST * len(points), 1):
        return None
    return np.asarray(np.median(steps[right], axis=0))


def _at(flow: Floats, points: Floats) -> Floats:
    """(n, 2) of a flow (h, w, 2) at points (n, 2), pixels."""
    found = cv2.remap(flow, (points[:, None] - 0.5).astype(np.float32), None, cv2.INTER_LINEAR)  # type: ignore[call-overload]
    return np.asarray(found[:, 0], np.float64)


def _pixels_around(clip: _Clip, frame: int, place: Floats, inverse_depth: float) -> Floats:
    """(n, 2) small pixels of the moving object around a place (2,) in source pixels, that one first."""
    image, _ = clip.reconstruction.image_at(frame)
    camera = clip.reconstruction.intrinsics(image)
    zoom = _zoom(camera.width, camera.height)
    reach = RADIUS * LONG_SIDE
    steps = np.arange(-reach, reach + 1, STEP)
    around = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    around = np.vstack([np.zeros((1, 2)), around[np.linalg.norm(around, axis=1) <= reach]]) + place * zoom
    inverse, moving = _seen(clip, frame, around)
    same = moving & (np.abs(inverse - inverse_depth) < ALIKE * inverse_depth)
    same[0] = True
    return np.asarray(around[same])


def _depth_of_object(clip: _Clip, frame: int, points: Floats) -> float | None:
    """Median inverse depth of the moving object at small pixels (n, 2) of a frame; None of too few pixels."""
    inverse, moving = _seen(clip, frame, points)
    enough = moving.sum() >= max(LEAST * len(points), 1)
    return float(np.median(inverse[moving])) if enough else None


def _of_one_object(seen_at: Sequence[tuple[int, int, float]], start_depth: float) -> dict[int, float]:
    """By frame the inverse depths, each with how many frames it is away, that are the same object's.

    They are like the last one. After a while without any the object may have come nearer: one that two next
    to each other agree about counts, too.
    """
    found, last, accepted = dict[int, float](), start_depth, 0
    unsure: tuple[int, float] | None = None
    for number, frame, depth in seen_at:
        if abs(depth - last) < ALIKE * last:
            found[frame] = last = depth
            accepted, unsure = number, None
        elif number - accepted > EVERY:
            alike = ALIKE * (number - accepted) / EVERY
            if unsure is not None and abs(depth - unsure[1]) < ALIKE * unsure[1]:
                found[unsure[0]], found[frame] = unsure[1], depth
                last, accepted, unsure = depth, number, None
            elif abs(depth - last) < alike * last:
                unsure = frame, depth
    return found


def _goes_on(step: Floats, before: Floats | None) -> bool:
    """Return whether a step (2,) in pixels is like the one before, as of something with a mass."""
    if before is None:
        return True
    most = max(JERK, JERK_SHARE * float(np.linalg.norm(before)))
    return bool(np.linalg.norm(step - before) < most)


def _seen(clip: _Clip, frame: int, points: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Inverse depth (n,) at small pixels (n, 2) of a frame, and whether it moves by itself."""
    canvas = clip.reconstruction.canvas(frame)
    camera = canvas.camera
    depth = clip.depth.at(frame, canvas, NO_PICTURE)
    if depth is None:
        return np.zeros(len(points)), np.zeros(len(points), bool)
    places = canvas.features_from_source(points / _zoom(camera.width, camera.height))
    inverse, _, moving = depth.at_places(places, canvas)
    return inverse, moving & (inverse > 0)


def _zoom(width: int, height: int) -> float:
    return min(1.0, LONG_SIDE / max(width, height))


def smoothed(values: Sequence[float]) -> Floats:
    """Return running medians (n,) of three values (n,); the first and the last stay as they are."""
    wide = np.pad(np.asarray(values, np.float64), 1, mode="edge")
    return np.median(np.lib.stride_tricks.sliding_window_view(wide, 3), axis=1)
