"""A subject cut out of one frame, from where it is expected to be."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..base.arrays import Bytes, Map, Mask
from ..base.global_smoother import globally_smoothed
from ..base.progress import checkpoint
from .flow import INLIER, change_of_size
from .gate import APART_ALIKE
from .networks import Networks, Region, log_odds
from .odds import (
    CROP,
    OUTSIDE,
    Box,
    Colours,
    body,
    distance,
    motion,
    overlap,
    probability,
    recognised,
    silhouette,
    stroke_motion,
)  # fmt: skip
from .people import overlap_of, touching
from .pictures import ClipPictures

SMOOTH_LAMBDA, SMOOTH_SIGMA = 40.0, 12.0
"""Lambda and grey levels of the fast global smoother that brings log-odds to the picture's edges."""
LEAST = 20
"""Pixels of a subject that is seen."""
AGREES = (0.35, 0.65)
"""Intersection over union of the networks' silhouette with the subject, up to which they do not recognise it,
and from which on they do."""
CARRIED = (1.2, 0.4)
"""Weight of the mask that flow predicts, of a subject that networks do not recognise, and of one they do."""
COLOUR = (3.0, 2.0)
"""Log-odds that colours add at most: the same."""
LEAP, FARTHER = 0.06, 1.5
"""Distance from the carried place, over the subject's larger side, beyond which its log-odds are less by
`FARTHER`: a limb may reach so far in a frame."""
ITERATIONS, SETTLED = 6, 0.98
"""Most times that a subject under strokes is cut out again, and intersection over union of two results in a
row from which on it is done."""
LEARNED = 0.05
"""Share of the colours that is learned from each frame."""
LOST = 0.15
"""Share of the area that a subject had, with less of which it is hidden or has left the picture: the rest
would be carried as if it were the whole."""
LIKE = 0.5
"""Least mean log-odds of the colours of a subject's part that comes into view; 0 is undecided."""
CLICK = 0.1
"""Extent of a stroke, over the long side, below which it shows nothing of the subject's size."""
AROUND_CLICK = (0.2, 0.4, 0.6, 0.9)
"""Sides, over the long side, of the squares around such a stroke in which the networks look for its subject:
the clearest figure counts. 40 clicks at random places of each clip have, with 0.4 alone and with all four:
goat 0.45, 0.56; cow 0.79, 0.82; scooter 0.69, 0.70; dancer, car and paraglider the same."""
CARRIER = 0.4
"""Share of the pixels that move as a figure of the networks, with less of which the figure is only a part of
the subject: a rider without the scooter has 0.17 to 0.37, people and animals of ten other clips 0.47 to
0.97."""
SOLID = 0.6
"""Least share of the convex hull of the pixels that move with a stroke, of a vehicle that carries a figure: a
scooter has 0.65 to 0.92, a car 0.75 to 0.90, the slope behind a goat 0.43 to 0.53."""
TRUST_LEARNED = 0.2
"""Share of a frame in how far the networks are trusted."""
UNRECOGNISED, UNCOVERED = 0.5, 0.9
"""Trust in the networks below which motion and colours find the parts that come into view, and probability of
these. On fence IoU is 0.87 with them and 0.80 without; a tram has 0.0, people of two scenes 0.93 to 1."""


@dataclass(frozen=True)
class Cut:
    """A subject in one frame, and its model learned from the frames before."""

    share: Map
    """(h, w) float32 probability."""
    colours: Colours
    """Its colours."""
    trust: float
    """In [0, 1], how far the networks recognise it."""
    area: float
    """Pixels of it, the mean of the last frames."""
    sure: float = 1.0
    """In [0, 1], intersection over union with the place where it was expected."""
    region: Region | None = None
    """Area of a person, for the network that segments people in the next frame."""
    is_salient: bool = False
    """True if the user's own segmenter has cut it out."""

    @classmethod
    def known(cls, picture: Bytes, share: Map, trust: float) -> Cut:
        """Return a subject that is known in a picture by its probability (h, w)."""
        return cls(share, Colours.of(picture, share), trust, float(np.count_nonzero(share > 0.5)))

    def gone(self) -> Cut:
        """Return the subject where nothing of it is seen."""
        return replace(self, share=np.zeros_like(self.share), sure=0.0, region=None)

    @property
    def mask(self) -> Mask:
        """(h, w) the subject."""
        return np.asarray(self.share > 0.5)

    @property
    def is_seen(self) -> bool:
        """Return whether enough of the subject is in the picture."""
        return bool(np.count_nonzero(self.mask) >= LEAST)


@dataclass(frozen=True)
class Neighbour:
    """A frame near the one in which a subject is cut out."""

    flow: Map
    """(h, w, 2) pixels to it."""
    agrees: Map
    """(h, w) in [0, 1], how far flow back returns."""
    apart: int = 1
    """Frames between the two."""


def neighbours(pictures: ClipPictures, frame: int, step: int = 1) -> list[Neighbour]:
    """Return the frames so many before and after one; errors as of `ClipPictures.picture`."""
    frames, at, flow = pictures.frames, pictures.frames.index(frame), pictures.flow
    others = [frames[each] for each in (at - step, at + step) if 0 <= each < len(frames)]
    return [Neighbour(flow.motion(frame, other), flow.there(frame, other)[1], step) for other in others]


def first_cut(
    networks: Networks,
    picture: Bytes,
    strokes: tuple[Mask, Mask],
    neighbours: list[Neighbour],
    prior: Map | None = None,
) -> Cut:
    """Cut out what strokes mark.

    Args:
        networks: The networks.
        picture: (h, w, 3) uint8 RGB.
        strokes: (h, w) pixels that belong to the subject, at least one, and pixels that do not.
        neighbours: Frames beside it, whose motion counts.
        prior: (h, w) probability of the subject before these strokes, which correct it; None of a new one.

    Returns:
        The subject.
    """
    adds, takes = strokes
    marked = 4.0 * adds - 6.0 * takes
    expected = adds if prior is None else (prior > 0.5) | adds
    seen, trust = _recognised_first(networks, picture, expected, adds if prior is None else expected)
    if prior is not None:
        share = np.where(adds, 1, prior)
    else:
        moved = moved_with(adds, neighbours)
        if trust > 0.5 and not carries(moved, touching((seen > 0) | adds, adds)):
            share = probability(seen + marked)
        else:
            start = _grabbed(picture, adds, takes) if moved is None else moved
            share = 0.9 * start + 0.05
            seen, _ = _recognised_from(networks, picture, start, Box.around(start, CROP))
            trust = min(trust, _agreement(seen, start))
    share = np.asarray(np.where(takes, 0, share), np.float32)
    if (share > 0.5).any():
        # Or it would grow again in each iteration.
        box = Box.around(share > 0.5)
        reach = 2.5 * LEAP * max(box.right - box.left, box.bottom - box.top)
        marked = marked - FARTHER * (3 - 2 * trust) * (distance(share > 0.5) > reach)
    for _ in range(ITERATIONS):
        checkpoint()
        before = share > 0.5
        share = _solved(picture, share, seen, trust, neighbours, marked, CARRIED[1], 2.5 * LEAP)
        share = np.where(
            touching(share > 0.5, adds if prior is None else expected) & ~takes, share, np.minimum(share, 0.3)
        )
        if np.count_nonzero(share > 0.5) < LEAST:
            share = np.maximum(share, adds.astype(np.float32))
        if overlap(before, share > 0.5) > SETTLED:
            break
    return Cut.known(picture, np.asarray(share, np.float32), trust)


def next_cut(
    networks: Networks, picture: Bytes, before: Cut, carried: Map, neighbours: list[Neighbour]
) -> Cut:
    """Cut a subject out of the frame after one in which it is known.

    Args:
        networks: The networks.
        picture: (h, w, 3) uint8 RGB.
        before: The subject in the frame before.
        carried: (h, w) its probability there, where flow carries it.
        neighbours: The frame before, and one after, whose motion shows what comes into view.

    Returns:
        The subject; nothing of it where it is not seen any more.
    """
    checkpoint()
    if np.count_nonzero(carried > 0.5) < LEAST:
        return before.gone()
    if before.trust < UNRECOGNISED:
        carried = _with_uncovered(picture, before.colours, carried, neighbours)
    there = carried > 0.5
    seen, region = recognised(networks, picture, there, before.region)
    trust = (1 - TRUST_LEARNED) * before.trust + TRUST_LEARNED * _agreement(seen, there)
    weight = trust * CARRIED[1] + (1 - trust) * CARRIED[0]
    share = _solved(
        picture, carried, seen, trust, neighbours[:1], np.zeros_like(carried), weight, LEAP, before.colours
    )
    share = np.where(touching(share > 0.5, there), share, np.minimum(share, np.float32(0.3)))
    found = Cut.known(picture, share, trust) if (share > 0.5).any() else before.gone()
    beside = neighbours[0]
    nearer = change_of_size(beside.flow, beside.agrees, there, beside.apart) or 1.0
    area = before.area / nearer**2
    if not found.is_seen or found.area < LOST * area:
        return before.gone()
    return replace(
        found, sure=overlap(share > 0.5, there), region=region,
        colours=before.colours.mixed(found.colours, LEARNED),
        area=(1 - TRUST_LEARNED) * area + TRUST_LEARNED * found.area,
    )  # fmt: skip


def _with_uncovered(picture: Bytes, colours: Colours, carried: Map, neighbours: list[Neighbour]) -> Map:
    """A probability (h, w) with the parts that an occluder uncovers, by their place, motion and colours."""
    there = carried > 0.5
    moved = np.max([each.agrees * motion(each.flow, there) for each in neighbours], axis=0)
    alike = ((moved > INLIER) & (colours.odds(picture, COLOUR[0]) > LIKE)).astype(np.uint8)
    whole = cv2.morphologyEx(alike, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) > 0
    found = touching(whole, distance(there) < APART_ALIKE * max(there.shape))
    return np.where(found, np.float32(UNCOVERED), carried)


def _solved(
    picture: Bytes, share: Map, seen: Map, trust: float, neighbours: list[Neighbour], marked: Map,
    weight: float, leap: float, colours: Colours | None = None,
) -> Map:  # fmt: skip
    """(h, w) probability of a subject by all evidence, from the probability (h, w) that is expected."""
    there = share > 0.5
    if not there.any():
        return share
    box = Box.around(there)
    side = max(box.right - box.left, box.bottom - box.top)
    agrees = neighbours[0].agrees if neighbours else np.float32(1)
    odds = np.where(seen > OUTSIDE, np.float32(trust), 1) * seen + marked
    odds += weight * (0.3 + 0.7 * agrees) * log_odds(cv2.GaussianBlur(share, (0, 0), 1.5))
    odds -= FARTHER * (3 - 2 * trust) * (distance(there) > leap * side)
    most = trust * COLOUR[1] + (1 - trust) * COLOUR[0]
    own = Colours.of(picture, share) if colours is None else colours
    odds += np.where(seen > OUTSIDE, own.odds(picture, most), 0)
    for each in neighbours:
        odds += each.agrees * motion(each.flow, there) / len(neighbours)
    return probability(globally_smoothed(picture, np.asarray(odds, np.float32), SMOOTH_LAMBDA, SMOOTH_SIGMA))


def _recognised_first(networks: Networks, picture: Bytes, expected: Mask, marked: Mask) -> tuple[Map, float]:
    """Log-odds (h, w) of the networks around a mask, and their certainty in [0, 1] under a stroke (h, w)."""
    boxes, long_side = [Box.around(expected, 1.5)], max(expected.shape)
    extent = Box.around(expected)
    if max(extent.right - extent.left, extent.bottom - extent.top) < CLICK * long_side:
        middle = np.argwhere(expected).mean(axis=0)
        boxes = [Box.square(middle, side * long_side, expected.shape) for side in AROUND_CLICK]

    def look(box: Box) -> tuple[float, Map, float]:
        seen, settled = _recognised_from(networks, picture, expected, box)
        on, part = float((seen > 0)[marked].mean()), touching((seen > 0) | marked, marked)
        return float(seen[part].mean()) * settled * on, seen, _within(on) * settled

    return max(map(look, boxes), key=lambda each: each[0])[1:]


def _recognised_from(networks: Networks, picture: Bytes, expected: Mask, box: Box) -> tuple[Map, float]:
    """Log-odds (h, w) of the networks around a mask, and how stable they are in [0, 1] over two crops."""
    part = expected
    for _ in range(4):
        before = part
        found = silhouette(networks, picture, box)
        part = touching((found > 0) | expected, expected)
        box = Box.around(part, CROP)
    settled = _within(overlap(before, part))
    person, _ = body(networks, picture, box, part, 0.3)
    return (found if person is None else np.asarray((found + 2 * person) / 2, np.float32)), settled


def _agreement(seen: Map, there: Mask) -> float:
    """In [0, 1] how far the networks recognise a subject that is expected at a mask (h, w)."""
    return _within(overlap(seen > 0, there))


def _within(overlap: float) -> float:
    """In [0, 1] where an intersection over union is between both of `AGREES`."""
    low, high = AGREES
    return float(np.clip((overlap - low) / (high - low), 0, 1))


def moved_with(mask: Mask, neighbours: list[Neighbour]) -> Mask | None:
    """Return the pixels (h, w) that move as those of a mask (h, w) do, and are connected with them.

    None where those move as the background, or without a neighbour.
    """
    if not neighbours:
        return None
    odds = np.mean([each.agrees * stroke_motion(each.flow, mask) for each in neighbours], axis=0)
    return None if np.median(odds[mask]) < INLIER else touching((odds > INLIER) | mask, mask)


def carries(moved: Mask | None, figure: Mask) -> bool:
    """Return whether a figure (h, w) is only a part of the pixels that move with it, as a rider is."""
    if moved is None or overlap_of(moved, figure) >= CARRIER:
        return False
    hull = cv2.convexHull(np.argwhere(moved).astype(np.float32))
    return float(np.count_nonzero(moved)) > SOLID * cv2.contourArea(hull)


def _grabbed(picture: Bytes, adds: Mask, takes: Mask) -> Mask:
    """(h, w) what has the colours of a stroke, near it (Rother et al., "GrabCut", 2004)."""
    box = Box.around(adds, 1.8)
    trimap = np.full(adds.shape, cv2.GC_BGD, np.uint8)
    trimap[box.part] = cv2.GC_PR_BGD
    near = distance(adds) < 0.12 * (box.right - box.left)
    trimap[near & (trimap == cv2.GC_PR_BGD)] = cv2.GC_PR_FGD
    trimap[adds], trimap[takes] = cv2.GC_FGD, cv2.GC_BGD
    if np.isin(trimap, (cv2.GC_FGD, cv2.GC_PR_FGD)).all():
        return adds
    cv2.setRNGSeed(0)
    models = np.zeros((1, 65)), np.zeros((1, 65))
    bgr = np.ascontiguousarray(picture[..., ::-1])
    cv2.grabCut(bgr, trimap, None, *models, 5, cv2.GC_INIT_WITH_MASK)  # type: ignore[call-overload]
    return touching((trimap == cv2.GC_FGD) | (trimap == cv2.GC_PR_FGD), adds)
