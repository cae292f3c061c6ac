"""The nearest subject of a clip, which is the default focus."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..base.arrays import Mask
from ..focus.place import Place
from ..subjects.faces import face_of
from ..subjects.networks import Networks
from ..subjects.people import SMALLEST
from ..subjects.pictures import displayed
from .clip_context import ClipContext

SMALLEST_OBJECT = 0.02
"""Smallest share of the picture of a moving object in focus: subjects of the gallery have 0.05 to 0.42."""


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
        found = replace(places[nearest], source=f"the nearest {kind}")
        if face is None:
            return replace(found, xy=middle_of(mask))
        x, y = (face[:2] + face[2:]) / 2
        return replace(found, subject="face", xy=(float(x), float(y)))
    return None


def middle_of(mask: Mask) -> tuple[float, float]:
    """Return the pixel of a mask (h, w), not empty, nearest to its centroid, as fractions of the picture."""
    at = np.argwhere(mask)
    y, x = at[np.linalg.norm(at - at.mean(axis=0), axis=1).argmin()] + 0.5
    return float(x / mask.shape[1]), float(y / mask.shape[0])
