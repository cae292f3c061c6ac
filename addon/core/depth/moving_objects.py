"""Depth of what moves by itself: upright where it stands, and in front of what it hides."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from ..base.arrays import Floats, Map, Mask
from ..camera.intrinsics import Intrinsics
from .completion import CompletionOptions, interpolate
from .ground_contact import GAP, TOLERANCE, Contact, Plane, contact, ground_below, rays_of, upright
from .object_tracks import MovingObject, Sighting


@dataclass(frozen=True)
class MovingObjectOptions:
    """The placing of moving objects. Set by eye, then judged on the scenes with true depth by
    `python -m benchmarks.accuracy.dense_depth` and `python -m benchmarks.accuracy.subjects`."""

    sides: int = 2
    """Frames before and after, `STEP` apart, whose contact tells the depth, too: half a second of a walk, a
    jump. Errors of figures that walk are half of those of single frames, over steps of 1 to 4 frames the
    same."""
    searched: int = 12
    """The same where the contact is not seen in those: until `enough` are found."""
    enough: int = 3
    """Frames that tell a depth by an object's size."""
    alike: float = 0.8
    """Intersection over union of an object's upper parts, in two frames, from which on they tell how much
    nearer it is: someone who walks towards the camera has 0.85 and more, one seen from the side 0.6 and less,
    for the legs."""
    upper: float = 0.35
    """Share of an object's height that must be seen in both. By eye."""
    scales: tuple[float, float, int] = (0.4, 3.0, 61)
    """Least and largest ratio of those sizes, and how many between are tried: 3 % apart."""
    wide: tuple[float, float] = (0.7, 1.0)
    """Width over height up to which an object faces the camera, and from which on it stands as its contact
    does: the two feet of a person, one of them lifted or lost, tell nothing of that. By eye."""
    lean: float = 1.5
    """Times the depth of the contact that anything of an object is nearer or farther, at most: seen from
    above, an upright plane leads to the camera. By eye."""
    foot_offset: int = 4
    """Pixels below a moving object at which what it stands on is seen. By eye."""
    foot_share: float = 0.1
    """Share of a moving object's height, from its lowest pixel, that is its foot. By eye."""
    ground_percentile: float = 10.0
    """Percentile of the inverse depths seen below a moving object's foot that it stands on, where they are no
    plane: what is nearer stands before it. With 50 the bench's fence has 30.9 instead of 33.6 dB at 32 px,
    from the video alone."""
    ring_inner: int = 5
    """Pixels around a moving object that may be the object itself. By eye."""
    ring_outer: int = 12
    """Pixels around a moving object within which things are beside it. By eye."""
    ring_bins: int = 24
    """Classes of inverse depth in the ring around a moving object. By eye."""
    class_pixels: int = 20
    """Pixels that a class in the ring must have to count. By eye."""
    class_share: float = 0.05
    """Share of the ring that a class must have to count. By eye."""
    occluded_share: float = 0.3
    """Share of a class's pixels that the object hides in some neighbour, if it stands before them; of what
    stands before the object it is less, by errors of its depth. By eye."""
    moving_confidence: float = 0.25
    """Confidence, 0 to 1, in the depth of a moving object, which is only that of where it stands. By eye."""
    hovering_confidence: float = 0.15
    """Confidence in that of one which neither touches nor hides anything, whatever is around. By eye."""


@dataclass(frozen=True)
class Surroundings:
    """What is known around moving objects."""

    inverse: Map
    """(h, w) inverse depth, found without regard to them."""
    sure: Mask
    """(h, w) where that is known, of what stands still."""
    apart: Mask
    """(h, w) the same, a little away from what moves: its depth there is no mixture."""
    occluding: Mask
    """(h, w) where a neighbour shows something else than the frame."""
    pinhole: Intrinsics
    """The pinhole of the picture."""

    @cached_property
    def rays(self) -> Floats:
        """(h, w, 3) the rays through the pixels' centres."""
        across, down = np.arange(self.pinhole.width) + 0.5, np.arange(self.pinhole.height) + 0.5
        return rays_of(self.pinhole, np.stack(np.meshgrid(across, down), axis=-1))


def place_moving_objects(
    guide: Map,
    inverse: Map,
    confidence: Map,
    objects: Sequence[MovingObject],
    occluding: Mask,
    pinhole: Intrinsics,
    completion: CompletionOptions,
    options: MovingObjectOptions,
) -> tuple[Map, Map, Mask]:
    """Inverse depth and confidence (h, w) with each moving object upright where it stands; and what moves (h,
    w).

    Where ground is seen around its foot, an object is an upright plane on the line along which it touches
    that, or the frames around say that it does; one in front of everything beside it that it hides from a
    neighbour, which `occluding` (h, w) tells. Else it gets one depth, that of what is seen at its lowest
    pixels, or of what it hides. One that neither touches nor hides anything has the depth of what is around
    it, interpolated along `guide` (h, w), the picture in grey levels. Holes in a moving object that seem
    nearer than itself are parts of it. All of it is as sure as where it stands, whatever was matched within;
    where nothing around is sure, not at all.
    """
    inverse, confidence = inverse.copy(), confidence.copy()
    moving = np.logical_or.reduce([np.zeros(inverse.shape, bool), *(each.mask for each in objects)])
    weight = np.where(moving, 0, confidence + np.float32(completion.least_weight)).astype(np.float32)
    around = interpolate(guide, inverse, weight, float(np.median(inverse)), completion)
    sure = ~moving & (confidence > options.moving_confidence)
    gap = np.ones((2 * GAP + 1,) * 2, np.uint8)
    apart = sure & (cv2.dilate(moving.astype(np.uint8), gap) == 0)
    surroundings = Surroundings(inverse.copy(), sure, apart, occluding, pinhole)
    for each in objects:
        if not each.mask.any():
            continue
        depth = _placed(each, surroundings, options)
        sureness = (
            options.moving_confidence if depth is not None else options.hovering_confidence * sure.any()
        )
        if depth is None:
            depth = np.full(inverse.shape, np.median(around[each.mask]))
        nearer = (surroundings.inverse >= depth) | ~sure
        mask = each.mask | (_without_holes(each.mask) & nearer & ~moving)
        inverse[mask], confidence[mask] = depth[mask], sureness
        moving |= mask
    return inverse, confidence, moving


def _placed(moving_object: MovingObject, around: Surroundings, options: MovingObjectOptions) -> Floats | None:
    """(h, w) the inverse depth of an object, wherever its pixels are; None where nothing tells it."""
    mask, part = moving_object.mask, _part(moving_object.mask, options.ring_outer)
    ground = ground_below(mask, around.inverse, around.apart, around.pinhole)
    beside = around.sure[part]
    if ground is not None:
        # Ground is no more hidden by what stands on it than it is touched.
        beside = beside & ~_on(ground, around, options)[part]
    hidden = _occluded(mask[part], beside, around.occluding[part], around.inverse[part], options)
    standing = None if ground is None else _standing(moving_object, ground, around, options)
    if (known := moving_object.inverse_depth) is not None:
        # Followed over more frames than these, and what is in focus.
        return (
            np.full(mask.shape, known) if standing is None else standing * (known / np.median(standing[mask]))
        )
    if standing is not None:
        middle = float(np.median(standing[mask]))
        return standing * max((hidden or 0.0) / middle, 1.0)
    bounds = (hidden, _ground(mask[part], around.sure[part], around.inverse[part], options))
    told = [one for one in bounds if one is not None]
    return np.full(mask.shape, max(told)) if told else None


def _part(mask: Mask, beside: int) -> tuple[slice, slice]:
    """Where an object (h, w) is, and so many pixels beside: nothing farther plays a part."""
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    top, left = max(rows[0] - beside, 0), max(columns[0] - beside, 0)
    return np.s_[top : rows[-1] + 1 + beside, left : columns[-1] + 1 + beside]


def _on(ground: Plane, around: Surroundings, options: MovingObjectOptions) -> Mask:
    """(h, w) what lies on the ground."""
    plane = ground.inverse_depth(around.rays)
    return np.asarray(np.abs(around.inverse - plane) <= 2 * TOLERANCE * np.abs(plane))


def _standing(
    moving_object: MovingObject, ground: Plane, around: Surroundings, options: MovingObjectOptions
) -> Floats | None:
    """(h, w) inverse depth of the upright plane in which an object stands on the ground; None where no frame
    shows that it does."""
    own = Sighting(0, moving_object.mask, around.pinhole, np.eye(3), np.zeros(3))
    near = [moving_object.around(steps) for steps in range(-options.sides, options.sides + 1) if steps]
    found = _contacts([own, *(each for each in near if each is not None)], ground, options)
    column = _column(own)
    if found:
        slope = _wide(own.mask, options) * float(np.median([touch.slope for _, _, touch in found]))
        bases = [touch.inverse_depth(slope, plane) for _, plane, touch in found]
        base = _at_zero(np.array([sighting.after for sighting, _, _ in found], float), np.array(bases))
    else:
        slope, by_size = 0.0, _by_size(moving_object, own, ground, options)
        if by_size is None:
            return None
        base = by_size
    if base <= 0:
        return None
    return np.clip(
        upright(base, column, slope, ground, around.rays), base / options.lean, base * options.lean
    )


def _contacts(
    sightings: Iterable[Sighting], ground: Plane, options: MovingObjectOptions
) -> list[tuple[Sighting, Plane, Contact]]:
    """Those in which an object is seen to touch the ground, with the ground and the contact in their camera's
    space."""
    found = []
    for each in sightings:
        plane = ground.seen_from(each.rotation, each.translation)
        touch = None if plane is None else contact(each.mask, plane, each.pinhole)
        if plane is not None and touch is not None:
            found.append((each, plane, touch))
    return found


def _wide(mask: Mask, options: MovingObjectOptions) -> float:
    """How far an object (h, w) has sides at different depths, in [0, 1]."""
    tall, wide = (np.count_nonzero(mask.any(axis=axis)) for axis in (1, 0))
    low, high = options.wide
    return float(np.clip((wide / tall - low) / (high - low), 0, 1))


def _column(sighting: Sighting) -> float:
    """x / z of the middle of an object."""
    columns = np.flatnonzero(sighting.mask.any(axis=0))
    return float((columns.mean() + 0.5 - sighting.pinhole.cx) / sighting.pinhole.fx)


def _at_zero(times: Floats, values: Floats) -> float:
    """The value at time 0 of a line through most of the values (n,) at times (n,): Theil, "A rank-invariant
    method of linear and polynomial regression analysis", 1950."""
    if len(times) < 3:
        return float(values[np.abs(times).argmin()])
    one, other = np.triu_indices(len(times), 1)
    slope = np.median((values[other] - values[one]) / (times[other] - times[one]))
    return float(np.median(values - slope * times))


def _by_size(
    moving_object: MovingObject, own: Sighting, ground: Plane, options: MovingObjectOptions
) -> float | None:
    """The inverse depth of an object whose contact with the ground is out of the picture, or hidden: that of
    frames in which it is seen, times as much as it looks larger."""
    found = list[float]()
    for steps in (way * far for far in range(options.sides + 1, options.searched + 1) for way in (-1, 1)):
        seen = moving_object.around(steps)
        for each, plane, touch in _contacts([] if seen is None else [seen], ground, options):
            alike, scale = _relative_size(own.mask, each.mask, options)
            if alike >= options.alike:
                found.append(scale * touch.inverse_depth(0.0, plane))
        if len(found) >= options.enough:
            return float(np.median(found))
    return None


def _relative_size(mask: Mask, other: Mask, options: MovingObjectOptions) -> tuple[float, float]:
    """Times that an object (h, w) looks larger than in another frame (h, w), after the intersection over
    union that it has so, of the upper part that is seen in both."""
    (top, middle, end), (other_top, other_middle, other_end) = _head(mask), _head(other)
    best = 0.0, 1.0
    for scale in np.geomspace(*options.scales):
        last = int(min(end, top + scale * (other_end - other_top)))
        if last - top < options.upper * (end - top):
            continue
        moved = np.array([[scale, 0, middle - scale * other_middle], [0, scale, top - scale * other_top]])
        size = (mask.shape[1], last)
        shown = cv2.warpAffine(other.astype(np.uint8), moved, size)[top:] > 0
        mine = mask[top:last]
        either = np.count_nonzero(mine | shown)
        overlap = np.count_nonzero(mine & shown) / either if either else 0.0
        best = max(best, (overlap, float(scale)))
    return best


def _head(mask: Mask) -> tuple[int, float, int]:
    """First row of an object (h, w), mean column of its uppermost quarter, and the row after its last."""
    rows = np.flatnonzero(mask.any(axis=1))
    upper = mask[rows[0] : rows[0] + max(len(rows) // 4, 1)]
    return int(rows[0]), float(np.nonzero(upper)[1].mean()), int(rows[-1]) + 1


def _ground(moving_object: Mask, sure: Mask, inverse: Map, options: MovingObjectOptions) -> float | None:
    """The inverse depth that is seen below the lowest pixels of a moving object (h, w), None if too little
    is."""
    rows = np.nonzero(moving_object.any(axis=1))[0]
    foot = rows[-1] - round(options.foot_share * len(rows))
    below = np.zeros_like(moving_object)
    below[options.foot_offset :] = moving_object[: -options.foot_offset]
    below[:foot] = False
    found = inverse[below & ~moving_object & sure]
    enough = len(found) >= options.foot_offset
    return float(np.percentile(found, options.ground_percentile)) if enough else None


def _occluded(
    moving_object: Mask, sure: Mask, occluding: Mask, inverse: Map, options: MovingObjectOptions
) -> float | None:
    """The inverse depth of the nearest of what is beside a moving object (h, w) and hidden by it in a
    neighbour, or None."""
    away = cv2.distanceTransform((~_without_holes(moving_object)).astype(np.uint8), cv2.DIST_L2, 5)
    beside = (away > options.ring_inner) & (away <= options.ring_outer) & sure
    if np.count_nonzero(beside) < options.class_pixels:
        return None
    values, is_hidden = inverse[beside], occluding[beside]
    least, most = np.percentile(values, [1, 99])
    edges = np.linspace(least, most, options.ring_bins + 1)
    binned = (np.histogram(some, edges)[0] for some in (values, values[is_hidden]))
    count, hidden = (np.convolve(some, [1, 1, 1], "same") for some in binned)
    enough = count >= max(options.class_pixels, options.class_share * len(values))
    classes = np.nonzero(enough & (hidden > options.occluded_share * count))[0]
    if not len(classes):
        return None
    nearest = int(classes[-1])
    low, high = edges[max(nearest - 1, 0)], edges[min(nearest + 2, options.ring_bins)]
    return float(np.median(values[(values >= low) & (values <= high)]))


def _without_holes(moving_object: Mask) -> Mask:
    """A moving object (h, w) with its holes filled."""
    outside = np.pad((~moving_object).astype(np.uint8), 1, constant_values=1)
    cv2.floodFill(outside, None, (0, 0), 2)  # type: ignore[call-overload]
    return np.asarray(outside[1:-1, 1:-1] != 2)
