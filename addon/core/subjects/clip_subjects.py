"""The subjects of a clip: its people and other moving objects, and those that the user marks."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import cv2
import numpy as np

from ..base.arrays import Bytes, Floats, Mask
from ..base.lru_cache import LRUCache
from ..base.store import NOT_KEPT, Arrays, Entry, Store
from ..camera.reconstruction import Reconstruction
from ..media.fixed_area import Fixed, nothing_fixed
from ..media.picture_file import Pixels
from .carried import SAME_PERSON, CarriedSubject, PeopleOfClip, Track
from .cut import Cut, neighbours
from .gate import MovingTracks, moves, moving_tracks
from .networks import Networks
from .people import face_of, overlap_of, sampled
from .pictures import ClipPictures, displayed
from .strokes import MarkedSubject, Stroke

PEOPLE = "moving-people"
"""Name of the kept file of the frames in which people are known, and their probability there."""
OBJECTS = "moving-objects"
"""Name of the kept file of the strokes that mark other moving objects."""
KEPT_SUBJECTS = 12
"""Marked subjects that are remembered: a clip's, and those before the last strokes."""
MOST_OBJECTS = 4
"""Objects that are followed, each at the cost of a person."""


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

    def shows_face(self, person: ClipSubject, frame: int, x: float, y: float) -> bool:
        """Return whether fractions x, y of a frame's picture are on a person's face."""
        face = face_of(self.networks, displayed(self.read(frame)), person.mask(frame))
        return face is not None and bool(face[0] <= x <= face[2] and face[1] <= y <= face[3])

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

        def find() -> list[Track]:
            tracks = PeopleOfClip(self.pictures, self.networks).tracks
            self._keep_shares("person", tracks)
            return tracks

        entry = Entry(PEOPLE, ("frames", "trusts", "shares"), _encoded_people, self._tracks)
        people = self.store.once(entry, find)
        return self._called("person", people)

    def _called(self, kind: str, carried: Sequence[Track | CarriedSubject]) -> list[ClipSubject]:
        return [
            ClipSubject(f"{kind} {number}", f"{kind}{number}", each.cut, self.store, kind)
            for number, each in enumerate(carried, 1)
        ]

    def _keep_shares(self, kind: str, carried: Sequence[Track | CarriedSubject]) -> None:
        """Keep the probability of subjects in all frames, as each process would carry them anew."""
        if self.store is not NOT_KEPT:
            for subject in self._called(kind, carried):
                for frame in self.pictures.frames:
                    subject.share(frame)

    def _tracks(self, kept: Arrays) -> list[Track] | None:
        """The people of the clip as they are kept, not yet carried; None where they are damaged."""
        tracks, shares = [], kept["shares"]
        for number, frame in enumerate(map(int, kept["frames"])):
            picture = self.pictures.picture(frame)
            rows = len(picture)
            share = shares[number * rows : (number + 1) * rows]
            if share.shape != picture.shape[:2]:
                return None
            share = np.asarray(share, np.float32) / np.float32(255)
            first = Cut.known(picture, np.asarray(share, np.float32), float(kept["trusts"][number]))
            tracks.append(Track(self.pictures, self.networks, frame, first))
        return tracks

    @cached_property
    def objects(self) -> list[ClipSubject]:
        """The other moving objects of the clip.

        There are none in photos and in clips without certain motion.
        """

        def find() -> list[CarriedSubject]:
            tracks = list(moving_tracks(self.reconstruction, self.read, self.fixed()))
            found = ObjectsOfClip(tracks, self._by_strokes, self._people_in).subjects()
            self._keep_shares("object", found)
            return found

        entry = Entry(OBJECTS, ("frames", "counts", "places"), _encoded_objects, self._objects)
        objects = self.store.once(entry, find)
        return self._called("object", objects)

    def _objects(self, kept: Arrays) -> list[CarriedSubject] | None:
        """The moving objects as they are kept, not yet carried; None where they are damaged."""
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
        return bool(shown) and float(np.median([overlap_of(*pair) for pair in shown])) >= SAME_PERSON


def _encoded_people(tracks: list[Track]) -> Arrays:
    # There is no PNG without pixels.
    shares = [np.rint(255 * track.first.share).astype(np.uint8) for track in tracks]
    return {
        "frames": np.array([track.start for track in tracks], int),
        "trusts": np.array([track.first.trust for track in tracks], float),
        "shares": np.vstack(shares or [np.zeros((1, 1), np.uint8)]),
    }


def _encoded_objects(objects: list[CarriedSubject]) -> Arrays:
    dots = [dot for each in objects for dot in each.strokes]
    return {
        "frames": np.array([dot.frame for dot in dots], int),
        "counts": np.array([len(each.strokes) for each in objects], int),
        "places": np.array([dot.places[0] for dot in dots], float).reshape(-1, 2),
    }


def united(masks: Sequence[Mask]) -> Mask:
    """Return the union (H, W) of masks over one frame, at the size of the largest; at least one mask."""
    largest = max(masks, key=lambda mask: mask.size)
    if all(mask.shape == largest.shape for mask in masks):
        return np.asarray(np.logical_or.reduce(masks))
    size = largest.shape[::-1]
    larger = (cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0 for mask in masks)
    return np.asarray(np.logical_or.reduce(list(larger)))


@dataclass(frozen=True)
class ObjectsOfClip:
    """The moving objects of a clip.

    Each is a group of neighbouring tracks that contradict a still scene, carried like a subject that the user
    marks from the frame in which the group is largest. Groups that are on it in other frames are the same
    object. Errors as of `ClipPictures.picture`.
    """

    tracks: Sequence[MovingTracks]
    """Tracks of moving objects in sampled frames, ascending."""
    carried: Callable[[tuple[Stroke, ...]], CarriedSubject]
    """Returns the subject that strokes mark."""
    people: Callable[[int], Mask]
    """Returns the people (h, w) in a frame, which are not objects."""

    def subjects(self) -> list[CarriedSubject]:
        """Return each object; none where the clip has no moving objects for sure."""
        if not moves(self.tracks):
            return []
        waiting = [(each.frame, group) for each in self.tracks for group in each.groups()]
        waiting = [each for each in waiting if _covered(self.people(each[0]), each[1]) < SAME_PERSON]
        found = list[CarriedSubject]()
        while waiting and len(found) < MOST_OBJECTS:
            first = waiting.pop(max(range(len(waiting)), key=lambda number: len(waiting[number][1])))
            frame, places = first
            subject = self.carried(tuple(Stroke(frame, ((x, y),)) for x, y in places.tolist()))
            others = [each for each in waiting if _covered(subject.mask(each[0]), each[1]) < SAME_PERSON]
            if len(others) < len(waiting):
                found.append(subject)
            waiting = others
        return found


def _covered(mask: Mask, places: Floats) -> float:
    """The share of places (n, 2), shares of the picture, that are on a mask (h, w)."""
    height, width = mask.shape
    column, row = np.floor(places * (width, height)).astype(int).T
    return float(mask[row.clip(0, height - 1), column.clip(0, width - 1)].mean())
