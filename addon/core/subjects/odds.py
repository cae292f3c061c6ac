"""Log-odds that a pixel is a subject's: from networks, from motion, and from colours.

Each is a map (h, w) of one picture, (h, w, 3) uint8 RGB, whose long side has about 512 pixels. Their sum
decides. The constants here and in `cut.py` were chosen together, on six clips of DAVIS and by published
values of the networks, and were checked as a whole on five clips with hand-drawn masks. They were not
measured one by one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ..base.arrays import Bytes, Floats, Ints, Map, Mask
from .flow import INLIER, grid
from .networks import Networks, Region, log_odds

OUTSIDE = -4.0
"""Log-odds of a network outside of the crop that it saw: those of a probability of 0.02."""
CROP = 1.35
"""Side of the networks' crop, relative to the subject's."""
MISSED = 0.02
"""Least size of a missed part, as a share of the subject, to run the networks again in a crop around it."""
BODY_OVERLAP = 0.5
"""Intersection over union from which on a person that is detected is the subject."""
PRESENCE = 0.5
"""Probability from which on a detected person is one."""
PERSON = 0.3
"""Probability from which on a person is detected."""


@dataclass(frozen=True)
class Box:
    """A rectangle of whole pixels."""

    left: int
    top: int
    right: int
    bottom: int

    @classmethod
    def around(cls, mask: Mask, times: float = 1.0) -> Box:
        """Return the square around a mask (h, w), so many times as large as it, moved into the picture."""
        rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
        side = times * max(len(range(rows[0], rows[-1] + 1)), len(range(columns[0], columns[-1] + 1)), 16)
        middle = (rows[0] + rows[-1] + 1) / 2, (columns[0] + columns[-1] + 1) / 2
        return cls.square(middle, side, mask.shape)

    @classmethod
    def square(cls, middle: Sequence[float] | Floats, side: float, shape: Sequence[int]) -> Box:
        """Return a square around a row and a column, moved into a picture.

        Args:
            middle: Row and column of the centre, in pixels.
            side: In pixels.
            shape: (h, w, ...) of the picture.
        """
        height, width = shape[:2]
        across, down = min(side, width), min(side, height)
        left = float(np.clip(middle[1] - across / 2, 0, width - across))
        top = float(np.clip(middle[0] - down / 2, 0, height - down))
        return cls(round(left), round(top), round(left + across), round(top + down))

    @property
    def part(self) -> tuple[slice, slice]:
        """Index of its pixels."""
        return np.s_[self.top : self.bottom, self.left : self.right]

    @property
    def corner(self) -> Floats:
        """(2,) left and top."""
        return np.array([self.left, self.top], float)


def silhouette(networks: Networks, picture: Bytes, box: Box) -> Map:
    """Return the log-odds (h, w) of the largest figure in a box, by two segmentation networks.

    They are 0 without networks.
    """
    found = np.full(picture.shape[:2], OUTSIDE, np.float32)
    part = np.ascontiguousarray(picture[box.part])
    found[box.part] = networks.silhouette(part) if networks.exist else 0
    return found


def body(
    networks: Networks, picture: Bytes, box: Box, there: Mask, least: float, last: Region | None = None
) -> tuple[Map | None, Region | None]:
    """Segment the person in a box whose intersection over union with an expected subject is `least` or more.

    Args:
        networks: The networks.
        picture: (h, w, 3) uint8 RGB.
        box: Area in which people are detected.
        there: (h, w) where the subject is expected.
        least: Intersection over union from which on the person is the subject.
        last: Area of the person by the frame before: if it is there still, nobody is detected.

    Returns:
        Log-odds (h, w), None without such a person, and the area of the person for the next frame.
    """
    best, found, around = least, None, None
    if not networks.exist:
        return None, None
    if last is not None:
        mask, presence, after = networks.body(picture, last)
        if presence >= PRESENCE and overlap(mask > 0.5, there) >= least:
            return log_odds(mask), after
    for person in networks.poses(np.ascontiguousarray(picture[box.part]), PERSON):
        region = Region.of(person)
        mask, presence, after = networks.body(
            picture, Region(region.centre + box.corner, region.side, region.up)
        )
        if presence >= PRESENCE and (likeness := overlap(mask > 0.5, there)) >= best:
            best, found, around = likeness, log_odds(mask), after
    return found, around


def recognised(
    networks: Networks, picture: Bytes, there: Mask, last: Region | None = None
) -> tuple[Map, Region | None]:
    """Return what the networks see of a subject that is expected at a mask.

    Args:
        networks: The networks.
        picture: (h, w, 3) uint8 RGB.
        there: (h, w) where the subject is expected; not empty.
        last: As of `body`.

    Returns:
        (h, w) log-odds, and the area of a person for the next frame.
    """
    box = Box.around(there, CROP)
    person, around = body(networks, picture, box, there, BODY_OVERLAP, last)
    if person is not None:
        return person, around
    found = silhouette(networks, picture, box)
    missed = (there & (found < 0)).astype(np.uint8)
    number, labels, stats, _ = cv2.connectedComponentsWithStats(missed)
    for label in range(1, number):
        if stats[label, cv2.CC_STAT_AREA] >= MISSED * np.count_nonzero(there):
            part = labels == label
            again = silhouette(networks, picture, Box.around(part, 1.8))
            near = cv2.dilate(part.astype(np.uint8), np.ones((15, 15), np.uint8)) > 0
            found = np.where(near, np.maximum(found, again), found)
    return found, None


FAR = 4.0
"""Pixels of residual motion beyond which more makes no difference."""
MOTION = 2.5
"""Log-odds that motion adds at most."""


def motion(flow: Map, there: Mask) -> Map:
    """Compare each pixel's motion with the subject's and with its background's.

    The background moves by a homography, the subject by an affine map, both fitted by RANSAC (Fischler and
    Bolles, 1981) to flow around and within the expected place.

    Args:
        flow: (h, w, 2) pixels to a neighbour frame.
        there: (h, w) where the subject is expected; not empty.

    Returns:
        (h, w) log-odds, positive where flow agrees better with the subject; 0 where both move alike.
    """
    height, width = there.shape
    columns, rows = np.meshgrid(np.arange(2, width, 5), np.arange(2, height, 5))
    at = np.column_stack([columns.ravel(), rows.ravel()])
    away = distance(there)[at[:, 1], at[:, 0]]
    within = cv2.distanceTransform(there.astype(np.uint8), cv2.DIST_L2, 5)[at[:, 1], at[:, 0]]
    box = Box.around(there)
    outer, inner = at[away > 0.05 * (box.bottom - box.top)], at[within > 2]
    if len(outer) < 40 or len(inner) < 12:
        return np.zeros(there.shape, np.float32)
    cv2.setRNGSeed(0)
    ends = [each + flow[each[:, 1], each[:, 0]] for each in (outer, inner)]
    background, _ = cv2.findHomography(outer.astype(np.float32), ends[0], cv2.RANSAC, INLIER)
    own, _ = cv2.estimateAffine2D(
        inner.astype(np.float32), ends[1], method=cv2.RANSAC, ransacReprojThreshold=INLIER
    )
    if background is None or own is None:
        return np.zeros(there.shape, np.float32)
    off = _residual(flow, background) - _residual(flow, np.vstack([own, [0, 0, 1]]))
    return np.asarray(np.clip(off, -MOTION, MOTION), np.float32)


def stroke_motion(flow: Map, stroke: Mask) -> Map:
    """Compare each pixel's motion with that under a stroke and with the background's.

    The background moves by a homography, fitted by RANSAC to flow beside the stroke; the subject by the
    median translation under the stroke.

    Args:
        flow: (h, w, 2) pixels to a neighbour frame.
        stroke: (h, w) pixels that belong to the subject; not empty.

    Returns:
        (h, w) log-odds as of `motion`.
    """
    height, width = stroke.shape
    columns, rows = np.meshgrid(np.arange(2, width, 5), np.arange(2, height, 5))
    at = np.column_stack([columns.ravel(), rows.ravel()])
    at = at[~stroke[at[:, 1], at[:, 0]]]
    cv2.setRNGSeed(0)
    ends = (at + flow[at[:, 1], at[:, 0]]).astype(np.float32)
    background, _ = cv2.findHomography(at.astype(np.float32), ends, cv2.RANSAC, INLIER)
    if background is None:
        return np.zeros(stroke.shape, np.float32)
    own = np.eye(3)
    own[:2, 2] = np.median(flow[stroke], axis=0)
    off = _residual(flow, background) - _residual(flow, own)
    return np.asarray(np.clip(off, -MOTION, MOTION), np.float32)


def _residual(flow: Map, model: Floats) -> Map:
    """(h, w) pixels, at most `FAR`, by which flow leaves a homography (3, 3)."""
    own = grid(flow.shape)
    off = cv2.perspectiveTransform(own, model.astype(np.float32)) - own - flow
    return np.asarray(np.minimum(cv2.magnitude(off[..., 0], off[..., 1]), np.float32(FAR)))


BINS = (12, 16, 16)
"""Bins of lightness, a and b."""
FLOOR = 2e-4
"""Share of pixels that is added to each bin."""
RING = 0.35
"""Width of the surroundings whose colours are learned, over the subject's larger side."""


@dataclass(frozen=True)
class Colours:
    """Colours of a subject and of its surroundings, as histograms in Lab."""

    inside: Map
    """(bins,) share of the subject's pixels."""
    outside: Map
    """(bins,) share of its surroundings' pixels."""

    @classmethod
    def of(cls, picture: Bytes, probability: Map) -> Colours:
        """Learn them from a picture and the probability (h, w) of the subject."""
        bins, count = _bins(picture), int(np.prod(BINS))
        likely = probability > 0.5
        away, box = distance(likely), Box.around(likely)
        ring = (away > 3) & (away < RING * max(box.right - box.left, box.bottom - box.top))
        inside, outside = (
            np.bincount(bins[part], minlength=count).astype(np.float32) for part in (probability > 0.8, ring)
        )
        return cls(inside / max(float(inside.sum()), 1), outside / max(float(outside.sum()), 1))

    def mixed(self, new: Colours, rate: float) -> Colours:
        """Return them with a share of new ones."""
        return Colours(
            (1 - rate) * self.inside + rate * new.inside, (1 - rate) * self.outside + rate * new.outside
        )

    def odds(self, picture: Bytes, most: float) -> Map:
        """Return the log-odds (h, w) of a picture's pixels by their colours, `most` at most."""
        ratio = np.log((self.inside + FLOOR) / (self.outside + FLOOR))
        return np.asarray(np.clip(ratio, -most, most)[_bins(picture)], np.float32)


def _bins(picture: Bytes) -> Ints:
    """(h, w) the bin of each pixel."""
    lightness, a, b = cv2.split(cv2.cvtColor(picture, cv2.COLOR_RGB2Lab).astype(np.int32))
    return np.asarray(
        ((lightness * BINS[0] >> 8) * BINS[1] + (a * BINS[1] >> 8)) * BINS[2] + (b * BINS[2] >> 8), np.int32
    )


def probability(odds: Map) -> Map:
    """Return the probability (h, w) of log-odds."""
    return np.asarray(1 / (1 + np.exp(-odds)), np.float32)


def distance(mask: Mask) -> Map:
    """Return the distance (h, w) in pixels to a mask."""
    return np.asarray(cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5), np.float32)


def overlap(one: Mask, other: Mask) -> float:
    """Return the intersection over union of two masks (h, w); 1 of two that are empty."""
    union = np.count_nonzero(one | other)
    return np.count_nonzero(one & other) / union if union else 1.0
