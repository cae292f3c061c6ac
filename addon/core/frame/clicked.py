"""Focus by a click on a known subject or on one that the click marks."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from ..base.arrays import Mask
from ..base.progress import part
from ..depth.source import FAINTEST
from ..focus.place import Place, PlaceFinder
from ..subjects.clip_subjects import ClipSubject, pixel_at
from ..subjects.cut import LEAST
from ..subjects.found_subjects import SAME
from ..subjects.people import overlap_of
from ..subjects.strokes import MarkedSubject, Stroke
from .clip_context import ClipContext

LARGEST = 0.5
"""Largest share of the picture of a marked subject; a larger one is background."""
INSIDE = 0.75
"""Share of the segmenter's cut inside a found subject, from which on it is a part of it. Of a kitten's head
it is 0.79, of a bag in a man's hand 0.95, of a goat with which half a slope was found 0.55."""


def clicked(
    clip: ClipContext,
    finder: PlaceFinder,
    x: float,
    y: float,
    name: str,
    marking: Callable[[MarkedSubject], ClipContext],
    seen: Callable[[Mask], object] = lambda mask: None,
) -> Place:
    """Find the focus of a click at shares x, y of the picture, (0, 0) top left.

    If the depth is unknown or the pixel moves, and there is no known subject, the click marks a new subject.
    It also marks one where a found object covers less than half of the new subject, and where the user's own
    segmenter cuts out an object, or a found person without a body, such as a cow.

    Args:
        clip: The clip.
        finder: Finder for the clip and the frame.
        x: Share of the width.
        y: Share of the height.
        name: Name of a new subject.
        marking: Returns the clip with one more subject.
        seen: Called with the subject (h, w) in the frame, before it is tracked through the others.

    Returns:
        The place in focus. Its `marks` is the new subject, which the caller adds to those of the clip.

    Raises:
        UserError: See `PlaceFinder.find`.
    """
    subjects, is_repaired = clip.parts.subjects, finder.is_repaired(x, y)
    may_search = clip.reconstruction.is_ordered and clip.may_focus_on_subjects and not subjects.knows_people
    if may_search and not is_repaired:
        # The search for people takes a while.
        body = subjects.body_at(finder.frame, x, y)
        if body is not None:
            seen(body)
    known = None if is_repaired else clip.subject_at(finder.frame, x, y)
    new_subject = partial(_new_subject, clip, finder.frame, x, y, name, marking, seen)
    is_object = known is not None and known.kind == "object"
    if known is not None and known.kind == "person" and subjects.networks.segmenter is not None:
        is_object = subjects.body_at(finder.frame, x, y) is None
    # Tracks can be on a part of an object only.
    if is_object and (place := new_subject(known)) is not None:
        return place
    if known is not None:
        seen(known.mask(finder.frame))
    return finder.find(x, y, new_subject)


def _new_subject(
    clip: ClipContext,
    frame: int,
    x: float,
    y: float,
    name: str,
    marking: Callable[[MarkedSubject], ClipContext],
    seen: Callable[[Mask], object],
    found: ClipSubject | None = None,
) -> Place | None:
    """Cut a subject out of a frame by a click, and focus on it; None without a subject.

    The cut of the user's own segmenter replaces a subject that was `found` there, unless it is a part of it.
    """
    if not clip.may_focus_on_subjects or not clip.reconstruction.is_ordered or _is_masked(clip, frame, x, y):
        return None
    # Rounded like the strokes in a .blend, as their key identifies results.
    at = float(np.float32(x)), float(np.float32(y))
    new = MarkedSubject(name, (Stroke(frame, (at,)),))
    carried = clip.parts.subjects.carried(new)
    mask, click = carried.mask(frame), carried.strokes_in(frame)[0]
    # It has to be larger than the click, and smaller than a background.
    if np.count_nonzero(mask & ~click) < LEAST or mask.mean() > LARGEST:
        return None
    seen(mask)
    whole = mask if found is None else found.mask(frame)
    is_part = overlap_of(mask, whole) >= INSIDE and overlap_of(whole, mask) < SAME
    replaced = found if carried.cut(frame).is_salient and not is_part else None
    for known in clip.parts.every_subject:
        if known is not replaced and overlap_of(mask, known.mask(frame)) >= SAME:
            # The click was beside its outline.
            return replace(clip.subject_place(known.name, frame), xy=(x, y))
    marked = marking(new)
    frames = sorted(map(int, clip.reconstruction.frames), key=lambda other: abs(other - frame))
    for number, other in enumerate(frames):
        with part(number, len(frames)):
            marked.parts.named(name).mask(other)
    return replace(marked.subject_place(name, frame), xy=(x, y), marks=new)


def _is_masked(clip: ClipContext, frame: int, x: float, y: float) -> bool:
    """Return whether the user's masks show a subject at a position; its outline is known already."""
    mask = clip.masks(frame) if clip.masks else None
    if mask is None:
        return False
    return pixel_at(mask, x, y) > FAINTEST
