"""The subjects of a clip: its people and other moving objects, and those that the user marks."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import cv2
import numpy as np

from ..base.arrays import Bytes, Floats, Map, Mask
from ..base.lru_cache import LRUCache
from ..base.store import NOT_KEPT, Arrays, Entry, Store
from ..camera.reconstruction import Reconstruction
from ..media.fixed_area import Fixed, nothing_fixed
from ..media.picture_file import Pixels
from .carried import CarriedSubject
from .cut import Cut, neighbours
from .found_subjects import SAME, Candidate, distinct, found_objects, found_people
from .gate import moving_tracks
from .networks import Networks
from .people import bodies, face_of, overlap_of, sampled
from .pictures import ClipPictures, displayed
from .strokes import MarkedSubject, Stroke

PEOPLE, OBJECTS = "moving-people", "moving-objects"
"""Names of the kept files of the dots that mark people and other moving objects."""
KEPT_SUBJECTS = 12
"""Marked subjects that are remembered: a clip's, and those before the last strokes."""


@dataclass(frozen=True)
class ClipSubject:
    """One subject in all frames of a clip. Errors as of `ClipPictures.picture`."""

    name: str
    """For people."""
    key: str
    """Digest of its source; part of the names of kept files."""
    cut: Callable[[int], Cut]
    """The subject in a frame, carried there."""
    store: Store = NOT_KEPT
    """Storage of its mattes."""
    kind: str = ""
    """"person" or "object"; empty of marked subjects, which users name."""

    def share(self, frame: int) -> Bytes:
        """Return its probability (h, w) in 255ths over a source frame."""
        entry = Entry[Bytes](
            f"moving-{self.key}-{frame:06d}", ("share",), lambda share: {"share": share},
            lambda parts: parts["share"] if parts["share"].ndim == 2 else None,
        )  # fmt: skip
        return self.store.get(entry, lambda: np.rint(255 * self.cut(frame).share).astype(np.uint8))

    def mask(self, frame: int) -> Mask:
        """Return the subject (h, w) over a source frame."""
        return np.asarray(self.share(frame) > 127)


@dataclass(frozen=True)
class ClipSubjects:
    """The subjects of a clip, whatever is marked."""

    reconstruction: Reconstruction
    read: Callable[[int], Pixels]
    """A frame's picture (H, W, 3 or 4) as `Footage.read` gives it."""
    store: Store = NOT_KEPT
    """Storage of subjects."""
    networks: Networks = field(default_factory=Networks)
    fixed: Fixed = nothing_fixed
    """The pixels that do not show the scene."""
    _carried: LRUCache[CarriedSubject] = field(
        default_factory=lambda: LRUCache[CarriedSubject](KEPT_SUBJECTS), repr=False, compare=False
    )

    @cached_property
    def pictures(self) -> ClipPictures:
        """Small pictures of the registered frames."""
        return ClipPictures(tuple(int(frame) for frame in self.reconstruction.frames), self.read)

    def carried(self, marked: MarkedSubject) -> CarriedSubject:
        """Return a marked subject, carried through the clip; the last `KEPT_SUBJECTS` are remembered."""
        new = CarriedSubject(self.pictures, self.networks, marked.strokes, self._by_strokes)
        return self._carried.get(marked.key, lambda: new)

    def _by_strokes(self, strokes: tuple[Stroke, ...]) -> CarriedSubject:
        return self.carried(MarkedSubject("", strokes))

    def prepare(self, frame: int) -> None:
        """Read and load the inputs of a cut in a frame ahead of time. Errors as of `ClipPictures.picture`."""
        neighbours(self.pictures, frame)
        self.networks.load()

    def face(self, subject: ClipSubject, frame: int) -> Floats | None:
        """Return left, top, right and bottom of a person's face in a frame, as `boxes`; None without one."""
        if subject.kind != "person":
            return None
        return face_of(self.networks, displayed(self.read(frame)), subject.mask(frame))

    def boxes(self, subjects: Sequence[ClipSubject], frame: int) -> list[Floats]:
        """Return left, top, right and bottom of subjects and faces in a frame, as shares of the picture."""
        shown = [each for each in subjects if each.mask(frame).any()]
        found = [face for each in shown if (face := self.face(each, frame)) is not None]
        for mask in (each.mask(frame) for each in shown):
            left, top, wide, high = cv2.boundingRect(mask.view(np.uint8))
            found.append(np.array([left, top, left + wide, top + high]) / (2 * mask.shape[::-1]))
        return found

    def body_at(self, frame: int, x: float, y: float) -> Mask | None:
        """Return the body (h, w) that one network sees at shares x, y of a frame's picture, or None."""
        shares = bodies(self.networks, self.pictures.picture(frame)) if self.networks.exist else []
        return next((share > 0.5 for share in shares if pixel_at(share, x, y) > 0.5), None)

    def marked(self, marked: MarkedSubject) -> ClipSubject:
        """Return a marked subject in all frames."""
        return ClipSubject(marked.name, marked.key, self.carried(marked).cut, self.store)

    @property
    def knows_people(self) -> bool:
        """Return whether `people` is known without a search."""
        return "people" in self.__dict__ or self.store.is_kept(PEOPLE)

    @cached_property
    def people(self) -> list[ClipSubject]:
        """The people that are subjects of the clip.

        There are none without networks, and in photos, whose order is not known.
        """
        if not self.reconstruction.is_ordered or not self.networks.exist:
            return []
        return self._found("person", PEOPLE, lambda: found_people(self.pictures, self.networks))

    @cached_property
    def objects(self) -> list[ClipSubject]:
        """The other moving objects of the clip.

        There are none in photos and in clips without certain motion.
        """

        def find() -> list[Candidate]:
            tracks = list(moving_tracks(self.reconstruction, self.read, self.fixed()))
            return found_objects(tracks, self._people_in)

        return self._found("object", OBJECTS, find)

    def _found(self, kind: str, name: str, find: Callable[[], list[Candidate]]) -> list[ClipSubject]:
        """Subjects of a kind, kept under a name as the dots that mark them."""
        entry = Entry(name, ("frames", "counts", "places"), _encoded, self._decoded)
        kept = self.store.once(entry, lambda: distinct(find(), self._by_strokes))
        return self._called(kind, kept)

    def _called(self, kind: str, carried: Sequence[CarriedSubject]) -> list[ClipSubject]:
        return [
            ClipSubject(f"{kind} {number}", f"{kind}{number}", each.cut, self.store, kind)
            for number, each in enumerate(carried, 1)
        ]

    def _decoded(self, kept: Arrays) -> list[CarriedSubject] | None:
        """Subjects as they are kept, not yet carried; None where they are damaged."""
        if kept["places"].shape != (len(kept["frames"]), 2):
            return None
        rows = zip(kept["frames"].tolist(), kept["places"].tolist(), strict=True)
        strokes = [Stroke(int(frame), ((float(x), float(y)),)) for frame, (x, y) in rows]
        ends = np.cumsum(kept["counts"].astype(int)).tolist()
        return [self._by_strokes(tuple(strokes[start:end])) for start, end in itertools.pairwise([0, *ends])]

    def _people_in(self, frame: int) -> Mask:
        """(h, w) all people in a frame."""
        nobody = np.zeros(self.pictures.picture(frame).shape[:2], bool)
        return united([nobody, *(each.mask(frame) for each in self.people)])

    def others(self, marked: Sequence[ClipSubject], found: Sequence[ClipSubject]) -> list[ClipSubject]:
        """Return the found subjects that no marked one covers in the frames that people are looked for in."""
        return [each for each in found if not any(self._is_same(each, other) for other in marked)]

    def _is_same(self, found: ClipSubject, marked: ClipSubject) -> bool:
        frames = sampled(self.pictures.frames)
        shown = [(mask, marked.mask(frame)) for frame in frames if (mask := found.mask(frame)).any()]
        return bool(shown) and float(np.median([overlap_of(*pair) for pair in shown])) >= SAME


def _encoded(subjects: list[CarriedSubject]) -> Arrays:
    dots = [dot for each in subjects for dot in each.strokes]
    return {
        "frames": np.array([dot.frame for dot in dots], int),
        "counts": np.array([len(each.strokes) for each in subjects], int),
        "places": np.array([dot.places[0] for dot in dots], float).reshape(-1, 2),
    }


def pixel_at(values: Map | Mask, x: float, y: float) -> float:
    """Return the value of a map (h, w) at shares x, y of the picture, (0, 0) top left."""
    rows, columns = values.shape
    return float(values[min(int(y * rows), rows - 1), min(int(x * columns), columns - 1)])


def united(masks: Sequence[Mask]) -> Mask:
    """Return the union (H, W) of masks over one frame, at the size of the largest; at least one mask."""
    largest = max(masks, key=lambda mask: mask.size)
    if all(mask.shape == largest.shape for mask in masks):
        return np.asarray(np.logical_or.reduce(masks))
    size = largest.shape[::-1]
    larger = (cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0 for mask in masks)
    return np.asarray(np.logical_or.reduce(list(larger)))
