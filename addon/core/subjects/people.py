"""Automatic detection of the people in a clip, and of their faces."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ..base.arrays import Bytes, Floats, Map, Mask
from .networks import Networks, Region
from .odds import BODY_OVERLAP, CROP, PERSON, PRESENCE, Box, body, overlap, silhouette

AGREEMENT = 0.6
"""Intersection over union of two independent networks, one that segments a detected person and one that
segments the largest figure in a crop, from which on both see the same person. An earlier study with these
networks and this limit: on 20 clips of DAVIS all of 38 detections were people; on seven clips without people
there was none; a wooden mannequin was taken for a person."""
SAMPLED = 6
"""Frames of a clip in which people are looked for."""
SEEN_IN = 2
"""Sampled frames that must show a person."""
SMALLEST = 0.002
"""Share of the picture of the smallest person that is a subject."""
HEAD = 1 / 3
"""Share of a person's height, from the top, that holds the face."""
LEAST = 0.5
"""Least probability of a face."""


@dataclass(frozen=True)
class Person:
    """A person in one frame."""

    agreement: float
    """Intersection over union of both networks."""
    share: Map
    """(h, w) float32 probability of the person's pixels."""

    @property
    def mask(self) -> Mask:
        """(h, w) the person."""
        return np.asarray(self.share > 0.5)


def people(networks: Networks, picture: Bytes) -> list[Person]:
    """Find the people in a picture whom two independent networks see alike.

    Args:
        networks: The networks.
        picture: (h, w, 3) uint8 RGB.

    Returns:
        The people, the surest first.
    """
    found = list[Person]()
    for share in bodies(networks, picture):
        mask = share > 0.5
        figure = touching(silhouette(networks, picture, Box.around(mask, CROP)) > 0, mask)
        agreement = overlap(figure, mask)
        if agreement >= AGREEMENT and all(overlap(mask, each.mask) < 0.5 for each in found):
            found.append(Person(agreement, share))
    return sorted(found, key=lambda person: -person.agreement)


def bodies(networks: Networks, picture: Bytes) -> list[Map]:
    """Return the probability (h, w) of each detected body, of one network alone; arguments as of `people`."""
    found = (networks.body(picture, Region.of(each)) for each in networks.poses(picture, PERSON))
    return [share for share, there, _ in found if there >= PRESENCE and (share > 0.5).mean() >= SMALLEST]


def sampled(frames: Sequence[int], count: int = SAMPLED) -> list[int]:
    """Return `count` frames of a clip at most, at even steps, in which people are looked for."""
    return sorted({frames[round(at)] for at in np.linspace(0, len(frames) - 1, count)})


def overlap_of(person: Mask, subject: Mask) -> float:
    """Return the share of a person (h, w) that a subject (h, w) covers."""
    return float(np.count_nonzero(person & subject) / max(int(np.count_nonzero(person)), 1))


def touching(mask: Mask, those: Mask) -> Mask:
    """Return the connected parts of a mask (h, w) that share a pixel with another one (h, w)."""
    number, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    kept = np.zeros(number, bool)
    kept[labels[those & mask]] = True
    kept[0] = False
    return np.asarray(kept[labels])


def face_of(networks: Networks, picture: Bytes, person: Mask) -> Floats | None:
    """Find a person's face.

    Args:
        networks: Face detector.
        picture: (H, W, 3) uint8 RGB, display-encoded.
        person: (h, w) mask of the person, at any size; not empty.

    Returns:
        (4,) left, top, right, bottom in shares of the picture, (0, 0) top left; None without a face on the
        person.
    """
    mask = cv2.resize(person.astype(np.uint8), picture.shape[1::-1], interpolation=cv2.INTER_NEAREST) > 0
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    bottom = rows[0] + max(round(HEAD * len(range(rows[0], rows[-1] + 1))), 1)
    upper = np.s_[rows[0] : bottom, columns[0] : columns[-1] + 1]
    height, width = mask.shape
    for face in networks.faces(np.ascontiguousarray(picture[upper]), LEAST) if networks.exist else ():
        box = face.box + np.tile([columns[0], rows[0]], 2)
        x, y = (box[:2] + box[2:]) / 2
        if 0 <= x < width and 0 <= y < bottom and mask[int(y), int(x)]:
            return np.asarray(box / [width, height, width, height])
    return None


def feet_of(networks: Networks, picture: Bytes, person: Mask) -> Floats | None:
    """Estimate where a person stands whom the lower border cuts off, by the proportions of a body.

    With six clips cut at the waist, the feet are at 0.91 to 1.02 of the height (medians; standard deviation
    within a clip 0.03 to 0.11).

    Args:
        networks: The networks.
        picture: (h, w, 3) uint8 RGB, display-encoded.
        person: (h, w) mask of the person.

    Returns:
        (2,) shares of the picture, (0, 0) top left; None of others than people.
    """
    if not person.any():
        return None
    _, region = body(networks, picture, Box.around(person, CROP), person, BODY_OVERLAP)
    return None if region is None else region.feet / person.shape[::-1]
