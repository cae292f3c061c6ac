"""The nearest subject of a clip, which is the default focus."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from ..base.arrays import Bytes, Mask
from ..focus.place import Place
from ..subjects.networks import Networks
from ..subjects.people import SMALLEST
from ..subjects.pictures import displayed
from .clip_context import ClipContext

HEAD = 1 / 3
"""Share of a person's height, from the top, that holds the face."""
SMALLEST_OBJECT = 0.02
"""Smallest share of the picture of a moving object in focus: subjects of the gallery have 0.05 to 0.42."""
FACE = 0.5
"""Least probability of a face."""


def nearest_subject(clip: ClipContext, networks: Networks | None = None) -> Place | None:
    """Find the nearest person in the first frame with one, or otherwise the nearest moving object.

    Returns:
        The whole subject, followed through the clip, with the position of a visible face; None without
        subjects.

    Raises:
        UserError: A frame cannot be read.
    """
    if not clip.may_focus_on_subjects:
        return None
    kind, least, subjects = "person", SMALLEST, clip.people
    if not subjects:
        kind, least, subjects = "moving object", SMALLEST_OBJECT, clip.every_subject
    for frame in map(int, clip.reconstruction.frames if subjects else ()):
        shown = [subject for subject in subjects if subject.mask(frame).mean() >= least]
        if not shown:
            continue
        places = [clip.subject_place(subject.name, frame) for subject in shown]
        nearest = int(np.argmin([place.distance for place in places]))
        mask = shown[nearest].mask(frame)
        face = None
        if kind == "person":
            face = face_of(networks or Networks(), displayed(clip.read(frame)), mask)
        found = replace(places[nearest], source=f"the nearest {kind}", xy=face or middle_of(mask))
        return found if face is None else replace(found, subject="face")
    return None


def face_of(networks: Networks, picture: Bytes, person: Mask) -> tuple[float, float] | None:
    """Find a person's face.

    Args:
        networks: Face detector.
        picture: (H, W, 3) uint8 RGB, display-encoded.
        person: (h, w) mask of the person, at any size; not empty.

    Returns:
        Its centre in shares of the picture, (0, 0) top left; None without a face on the person.
    """
    mask = cv2.resize(person.astype(np.uint8), picture.shape[1::-1], interpolation=cv2.INTER_NEAREST) > 0
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    bottom = rows[0] + max(round(HEAD * len(range(rows[0], rows[-1] + 1))), 1)
    upper = np.s_[rows[0] : bottom, columns[0] : columns[-1] + 1]
    height, width = mask.shape
    for face in networks.faces(np.ascontiguousarray(picture[upper]), FACE) if networks.exist else ():
        x, y = (face.box[:2] + face.box[2:]) / 2 + [columns[0], rows[0]]
        if 0 <= x < width and 0 <= y < bottom and mask[int(y), int(x)]:
            return float(x / width), float(y / height)
    return None


def middle_of(mask: Mask) -> tuple[float, float]:
    """Return the pixel of a mask (h, w), not empty, nearest to its centroid, as fractions of the picture."""
    at = np.argwhere(mask)
    y, x = at[np.linalg.norm(at - at.mean(axis=0), axis=1).argmin()] + 0.5
    return float(x / mask.shape[1]), float(y / mask.shape[0])
