"""Distance of a clip's subjects: by their contact with the ground, and through the clip by their size."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from ..base.arrays import Floats, Map, Mask
from ..base.progress import checkpoint
from ..base.store import NOT_KEPT, Store, numbers
from ..depth.ground_contact import (
    BORDER,
    HIDDEN,
    NEARER,
    Contact,
    Plane,
    beside,
    contact,
    ground_below,
    upright,
)  # fmt: skip
from ..depth.view_selection import relative_pose
from .cut import LEAST
from .flow import change_of_size
from .people import sampled
from .pictures import ClipPictures
from .static_depth import StaticDepth

GROWN = 7
"""Pixels across the dilation of moving pixels, whose outline is no static scene."""
STILL = 0.2
"""Density of feature points on a subject, relative to its surroundings, from which the subject stands still.
In 13 clips moving people and animals have at most 0.05, a waiting man 0.37 and a sitting cat 0.68."""
INSET, AROUND = 5, 61
"""Pixels across a subject's erosion, whose points count, and its dilation, for the surroundings."""
LEAST_POINTS = 8
"""Feature points within a subject from which on they give its distance."""
FEET = 0.1
"""Share of a subject's height, at its lower end, beneath which the ground is at its distance."""
BELOW = 4
"""Pixels of ground beneath a subject."""
LOWEST, HIGHEST = -0.1, 0.5
"""Camera heights over the ground between which the lower end of a subject lies at the distance of its feature
points: more than a table has. A subject that walks along the camera's path has the feature points of a static
one elsewhere: in the scene oncoming at -0.24 in 60 frames, and at 0.70 in 16 of them."""
SEEN, STEADY = 1 / 3, 0.1
"""Share of the frames with feature points on a subject that must show its contact with the ground, and
interquartile range of those heights, so that the contact counts instead of the points. In the scene oncoming
0.44 of 60 frames and 0.9 of 16 show it, with 0.01; planes of a sofa below a cat 0.25, with 0.18, and stairs
behind a man all, with 0.4: there the points are right."""
CONTACTS = 12
"""Frames of a clip in which the place where a subject stands is looked for."""
LONG = 16
"""Key frames of a clip from which on contacts of subjects, and sizes of recognised ones, are measured there
alone: twice as many as the drift of sizes takes."""
HEIGHTS, SURE_DRIFT = 60, 8
"""Frames by whose outlines the drift of sizes is estimated, at most and at least."""


def nowhere(frame: int, subject: Mask) -> None:
    """Return None: the place of the feet is unknown."""


@dataclass(frozen=True)
class Standing:
    """The depth of subjects by their contact with the ground, or by feature points on them.

    The ground is known from a coarse depth of the static scene, in a tenth of the time of all pixels' depth.
    Errors as of `PlaneSweepStereo.at`.
    """

    static: StaticDepth
    moving: Callable[[int], Mask]
    """All moving pixels (h, w) of a source frame, at any size."""
    feet: Callable[[int, Mask], Floats | None] = nowhere
    """Returns the feet (2,), in shares of the picture, of a person (h, w) cut off by the lower border."""

    def inverse_depths(self, subject: Callable[[int], Mask], frames: Sequence[int]) -> dict[int, float]:
        """Estimate the median inverse depth of a subject.

        1. A subject that stands still has feature points, which count unless they are off the ground.
        2. Another one stands upright where it touches the ground, below the picture too if it is a person; a
           frame in which the ground around it is not a plane takes the plane of the nearest frame.
        3. Without a plane in any frame, the subject is as far as the static scene beneath its feet.

        Frames that place it behind the background that it hides are left out.

        Args:
            subject: Returns its pixels (h, w) in a source frame, at any size.
            frames: Numbers of registered frames.

        Returns:
            Inverse depth in 1 / scene units by frame; frames without contact are left out.
        """
        points = self._by_points(subject, frames)
        masks = {frame: self._shown(subject, frame) for frame in frames}
        masks = {frame: mask for frame, mask in masks.items() if mask.any()}
        static = {frame: self.static.inverse_depth(frame, self._left_out) for frame in masks}
        found = self._by_ground(subject, masks, static)
        if points and not _is_off(points, found or {}):
            return points
        if found is None:
            beneath = {frame: self._beneath(frame, mask, static[frame]) for frame, mask in masks.items()}
            found = {frame: inverse for frame, inverse in beneath.items() if inverse is not None}
        hidden = {frame: float(np.median(static[frame][masks[frame]])) for frame in found}
        return {frame: inverse for frame, inverse in found.items() if inverse >= hidden[frame]}

    def bounds(self, subject: Callable[[int], Mask], frames: Sequence[int]) -> dict[int, float]:
        """Bound the inverse depth of a subject without contact, such as one that the lower border cuts off.

        It is nearer than the feature points that it hides, and than the ground at the border. Arguments as of
        `inverse_depths`.

        Returns:
            Least inverse depth in 1 / scene units by frame; frames that do not show the subject are left out.
        """
        found = dict[int, float]()
        own = [
            self.static.reconstruction.image_at(frame)[0].points[self._on(subject(frame), frame)]
            for frame in frames
        ]
        xyz = np.delete(self.static.reconstruction.points.xyz, np.unique(np.concatenate(own)), axis=0)
        for frame in frames:
            mask = self._shown(subject, frame)
            if mask.any():
                static = self.static.inverse_depth(frame, self._left_out)
                behind = self._hidden(frame, mask, xyz), beside(mask, static, ~self._left_out(frame))
                found[frame] = NEARER * max(behind)
        return found

    def _hidden(self, frame: int, mask: Mask, xyz: Floats) -> float:
        """The inverse depth that most points (n, 3) behind a subject (h, w) are below; 0 for too few."""
        image, _ = self.static.reconstruction.image_at(frame)
        pinhole = self.static.canvas(frame).pinhole
        there = xyz @ image.rotation.T + image.translation
        there = there[there[:, 2] > 0]
        column, row = np.floor(pinhole.project(there)).clip(-1, 1e6).astype(int).T
        inside = (row >= 0) & (row < mask.shape[0]) & (column >= 0) & (column < mask.shape[1])
        inside[inside] = mask[row[inside], column[inside]]
        few = np.count_nonzero(inside) < LEAST_POINTS
        return 0.0 if few else float(np.quantile(1 / there[inside, 2], HIDDEN))

    def _by_ground(
        self, subject: Callable[[int], Mask], masks: Mapping[int, Mask], static: Mapping[int, Map]
    ) -> dict[int, float] | None:
        """The median inverse depth of a subject by the ground that it stands on; None without a plane."""
        planes = dict[int, Plane]()
        for frame, mask in masks.items():
            checkpoint()
            canvas = self.static.canvas(frame)
            ground = ground_below(mask, static[frame], ~self._left_out(frame), canvas.pinhole)
            if ground is not None:
                planes[frame] = ground
        if not planes:
            return None
        found = dict[int, float]()
        for frame, mask in masks.items():
            nearest = min(planes, key=lambda other: abs(other - frame))
            there, here = (self.static.reconstruction.image_at(each)[0] for each in (nearest, frame))
            plane = planes.get(frame) or planes[nearest].seen_from(*relative_pose(there, here))
            pinhole = self.static.canvas(frame).pinhole
            touch = None if plane is None else contact(mask, plane, pinhole)
            if plane is not None and touch is None and _is_cut_off(mask):
                touch = self._below(frame, subject(frame), plane)
            if plane is not None and touch is not None and (base := touch.inverse_depth(0.0, plane)) > 0:
                rows, columns = np.nonzero(mask)
                rays = pinhole.rays(np.column_stack([columns, rows]).astype(float) + 0.5)
                found[frame] = float(np.median(upright(base, touch.column, 0.0, plane, rays)))
        return found

    def _below(self, frame: int, subject: Mask, plane: Plane) -> Contact | None:
        """The contact of a subject (h, w) with the ground below the picture; None of others than people."""
        feet, canvas = self.feet(frame, subject), self.static.canvas(frame)
        if feet is None:
            return None
        source = feet * (canvas.camera.width, canvas.camera.height)
        ray = canvas.pinhole.rays(canvas.features_from_source(source[None]))[0]
        inverse = float(plane.inverse_depth(ray))
        return Contact(ray / inverse, float(ray[0]), 0.0) if inverse > 0 else None

    def _by_points(self, subject: Callable[[int], Mask], frames: Sequence[int]) -> dict[int, float]:
        """The median inverse depth of the feature points on a subject that stands still; else nothing."""
        densities, found = list[float](), dict[int, float]()
        for frame in frames:
            mask = subject(frame).astype(np.uint8)
            inside = cv2.erode(mask, np.ones((INSET, INSET), np.uint8)) > 0
            around = cv2.dilate(mask, np.ones((AROUND, AROUND), np.uint8)) > 0
            around &= cv2.dilate(mask, np.ones((INSET, INSET), np.uint8)) == 0
            if not inside.any() or not around.any():
                continue
            image, _ = self.static.reconstruction.image_at(frame)
            own, others = self._on(inside, frame), self._on(around, frame)
            densities.append(own.sum() / inside.sum() * around.sum() / max(int(others.sum()), 1))
            if np.count_nonzero(own) >= LEAST_POINTS:
                points = self.static.reconstruction.points.xyz[image.points[own]]
                found[frame] = float(np.median(1 / (points @ image.rotation[2] + image.translation[2])))
        return found if densities and np.median(densities) >= STILL else {}

    def _on(self, mask: Mask, frame: int) -> Mask:
        """Which of the feature points that a frame shows (n,) are on a mask (h, w) over it."""
        image, _ = self.static.reconstruction.image_at(frame)
        width = self.static.reconstruction.intrinsics(image).width
        columns, rows = (image.xy * mask.shape[1] / width).astype(int).T
        return np.asarray(mask[np.clip(rows, 0, len(mask) - 1), np.clip(columns, 0, mask.shape[1] - 1)])

    def _beneath(self, frame: int, mask: Mask, static: Map) -> float | None:
        """The median inverse depth of the static scene just below a subject (h, w); None if it is cut off."""
        rows = np.flatnonzero(mask.any(axis=1))
        top = rows[-1] - int(FEET * len(rows))
        below = np.zeros_like(mask)
        grown = cv2.dilate(mask[top:].astype(np.uint8), np.ones((2 * (GROWN // 2 + BELOW) + 1, 1), np.uint8))
        below[top:] = (grown > 0) & ~self._left_out(frame)[top:]
        if rows[-1] >= len(mask) - BELOW or not below.any():
            return None
        return float(np.median(static[below]))

    def _shown(self, subject: Callable[[int], Mask], frame: int) -> Mask:
        image, _ = self.static.reconstruction.image_at(frame)
        return self.static.on_canvas(image, subject(frame))

    def _left_out(self, frame: int) -> Mask:
        mask = self._shown(self.moving, frame).astype(np.uint8)
        return np.asarray(cv2.dilate(mask, np.ones((GROWN, GROWN), np.uint8)) > 0)


def _is_cut_off(mask: Mask) -> bool:
    """Whether the picture's lower border cuts a subject (h, w) off."""
    return bool(mask[-BORDER:].any())


def _is_off(points: Mapping[int, float], ground: Mapping[int, float]) -> bool:
    """Whether inverse depths of a subject's points, by frame, contradict its contact with the ground."""
    heights = [1 - ground[frame] / points[frame] for frame in points.keys() & ground.keys()]
    if len(heights) <= SEEN * len(points):
        return False
    low, middle, high = np.quantile(heights, [0.25, 0.5, 0.75])
    return bool(high - low < STEADY and not LOWEST <= middle <= HIGHEST)


@dataclass(frozen=True)
class SubjectDistance:
    """Inverse depth of a subject in every frame.

    An object of constant size has an inverse depth proportional to its size in the picture. Sizes come from
    flow within the subject; their drift, linear in time, is corrected by the height of the subject's outline.
    One factor for the clip is the median over the frames in which the subject is seen to stand on the ground.
    """

    pictures: ClipPictures
    mask: Callable[[int], Mask]
    """The subject (h, w) in a frame, at the size of the pictures."""
    standing: Callable[[Sequence[int]], Mapping[int, float]]
    """Its inverse depth in 1 / scene units by its contact with the ground, for those frames that show it."""
    bounds: Callable[[Sequence[int]], Mapping[int, float]] = lambda frames: {}
    """Its least inverse depth by frame, for a subject that no frame shows to stand anywhere."""
    feet: Callable[[int, Mask], Floats | None] = nowhere
    """See `Standing.feet`."""
    store: Store = NOT_KEPT
    """Storage of its sizes."""
    name: str = ""
    """Name of its sizes in the storage."""
    is_recognised: Callable[[int], bool] = lambda frame: False
    """Returns whether networks recognise it in a frame; not asked where its sizes are kept."""

    def inverse_depth(self, frame: int) -> float | None:
        """Return the inverse depth in 1 / scene units; None where no frame shows where the subject stands."""
        factor = self._factor
        return None if factor is None else float(factor * self._sizes[self.pictures.frames.index(frame)])

    @property
    def _looked_at(self) -> tuple[int, ...]:
        """The frames in which a recognised subject is measured."""
        keys = self.pictures.keys
        return keys if len(keys) >= LONG else self.pictures.frames

    @cached_property
    def _sizes(self) -> Floats:
        """(n,) size in each frame, relative to the first."""
        return self.store.once(numbers(self.name, len(self.pictures.frames)), self._measured_sizes)

    def _measured_sizes(self) -> Floats:
        keys, flow = self._looked_at, self.pictures.flow
        if len(keys) < len(self.pictures.frames) and not self.is_recognised(keys[len(keys) // 2]):
            keys = self.pictures.frames
        at = np.array([self.pictures.frames.index(key) for key in keys])
        changes, heights, rarely = list[float](), list[float](), max(len(keys) // HEIGHTS, 1)
        for number, (key, after) in enumerate(zip(keys, (*keys[1:], None), strict=True)):
            checkpoint()
            mask, scale = self.mask(key), None
            heights.append(_height(mask))
            if number % rarely == 0 and _is_cut_off(mask) and not mask[0].any():
                feet = self.feet(key, mask)
                heights[-1] = np.nan if feet is None else feet[1] * len(mask) - mask.any(axis=1).argmax()
            if np.count_nonzero(mask) >= LEAST and after is not None:
                apart = int(at[number + 1] - at[number])
                scale = change_of_size(flow.motion(key, after), flow.there(key, after)[1], mask, apart)
            changes.append(np.log(scale) if scale else 0.0)
        sizes = np.concatenate([[0.0], np.cumsum(changes[:-1])])
        # Feet may be estimated above the head.
        known = np.flatnonzero(np.array(heights) > 0)
        known = known[:: max(len(known) // HEIGHTS, 1)]
        if len(known) >= SURE_DRIFT:
            one, other = np.triu_indices(len(known), 1)
            off = np.log(np.array(heights)[known]) - sizes[known]
            # Theil, "A rank-invariant method of linear and polynomial regression analysis", 1950.
            drift = np.median((off[other] - off[one]) / (at[known[other]] - at[known[one]]))
            sizes = sizes + drift * at.clip(at[known[0]], at[known[-1]])
        return np.asarray(np.exp(np.interp(np.arange(len(self.pictures.frames)), at, sizes)))

    @cached_property
    def _factor(self) -> float | None:
        """Inverse depth over size."""
        shown = [frame for frame in self._looked_at if np.count_nonzero(self.mask(frame)) >= LEAST]
        looked_at = sampled(shown, CONTACTS) if shown else []

        def factors(inverse: Mapping[int, float]) -> list[float]:
            at = map(self.pictures.frames.index, inverse)
            return [each / self._sizes[number] for each, number in zip(inverse.values(), at, strict=True)]

        if found := self.standing(looked_at):
            return float(np.median(factors(found)))
        bounds = factors(self.bounds(looked_at))
        return float(np.quantile(bounds, HIDDEN)) if bounds else None


def _height(mask: Mask) -> float:
    """Pixels; NaN of a subject that is cut by the picture's upper or lower border, or not seen."""
    rows = np.flatnonzero(mask.any(axis=1))
    if np.count_nonzero(mask) < LEAST or rows[0] == 0 or rows[-1] == len(mask) - 1:
        return np.nan
    return float(len(rows))
