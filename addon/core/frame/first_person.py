"""The nearest subject of a clip, which is the default focus, and the scale by the height of people."""

from dataclasses import replace

import numpy as np

from ..base.arrays import Mask
from ..depth.flat_scene import ADULT
from ..focus.place import Place
from ..subjects.networks import Networks
from ..subjects.people import SMALLEST, face_of, sampled
from ..subjects.pictures import displayed
from .clip_context import ClipContext

SMALLEST_OBJECT = 0.02
"""Smallest share of the picture of a moving object in focus: subjects of the gallery have 0.05 to 0.42."""
LEAST_HEIGHT = 0.15
"""Share of the picture's height of a person whose height is measured: outlines are off by two pixels."""
UPRIGHT = 2.0
"""Height over width from which on a person stands or walks."""
LEAST_FRAMES = 2
"""Frames that must agree."""
LARGEST_SPREAD = 0.25
"""Relative standard deviation of the scales by frames and people with which the guess means nothing."""


def nearest_subject(clip: ClipContext, networks: Networks | None = None) -> Place | None:
    """Find the nearest person in the first frame with one, or otherwise the nearest moving object.

    One that is seen in less than half as many frames as another is passed by, and does not count.

    Its frame is one in which it is at the median of its distances, as blur is measured there. Measured in the
    first frame, a car that comes nearer has 3 % of blur behind it there and 11 % in the middle of the clip.

    Returns:
        The whole subject, followed through the clip, with the position of a visible face; None without
        subjects.

    Raises:
        UserError: A frame cannot be read.
    """
    if not clip.may_focus_on_subjects:
        return None
    kind, least, subjects = "person", SMALLEST, clip.parts.people
    if not subjects:
        kind, least, subjects = "moving object", SMALLEST_OBJECT, clip.parts.every_subject
    frames = [int(frame) for frame in clip.reconstruction.frames] if subjects else []
    often = [sum(each.mask(frame).mean() >= least for frame in sampled(frames)) for each in subjects]
    subjects = [each for each, count in zip(subjects, often, strict=True) if 2 * count >= max(often)]
    for frame in frames:
        shown = [subject for subject in subjects if subject.mask(frame).mean() >= least]
        if not shown:
            continue
        places = [clip.subject_place(subject.name, frame) for subject in shown]
        nearest = int(np.argmin([place.distance for place in places]))
        subject, followed = shown[nearest], places[nearest].followed
        keys = dict.fromkeys((frame, *clip.parts.subjects.pictures.keys))
        seen = [each for each in keys if subject.mask(each).mean() >= least]
        middle = sorted(seen, key=lambda each: followed[each])[len(seen) // 2]
        mask, face = subject.mask(middle), None
        if kind == "person":
            face = face_of(networks or Networks(), displayed(clip.scene(middle)), mask)
        found = replace(clip.subject_place(subject.name, middle), source=f"the nearest {kind}")
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


def scale_by_people(clip: ClipContext) -> float | None:
    """Guess the metres of a scene unit by the whole figures of people that stand or walk; passes checkpoints.

    None without such people, or where they disagree. Raises UserError if a frame cannot be read.
    """
    found = []
    frames = sampled([int(frame) for frame in clip.reconstruction.frames])
    for person in clip.parts.people if clip.may_focus_on_subjects else ():
        followed = clip.subject_place(person.name, frames[0]).followed
        for frame in frames:
            if (share := height_of(person.mask(frame))) is not None:
                camera = clip.canvas(frame).camera
                # Children are taken to be farther away than they are.
                found.append(ADULT / (share * camera.height / camera.fy * followed[frame]))
    if len(found) < LEAST_FRAMES or np.std(found) > LARGEST_SPREAD * np.mean(found):
        return None
    return float(np.median(found))


def height_of(mask: Mask) -> float | None:
    """Return the height of an upright person (h, w), a share of the picture's; None if it is cut or bends."""
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    if not len(rows) or rows[0] <= 1 or rows[-1] >= len(mask) - 2:
        return None
    height, width = len(range(rows[0], rows[-1] + 1)), len(range(columns[0], columns[-1] + 1))
    is_measured = height >= max(UPRIGHT * width, LEAST_HEIGHT * len(mask))
    return height / len(mask) if is_measured else None
