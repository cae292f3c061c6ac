"""The subjects of a clip: its people and other moving objects, and those that the user marks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import cv2
import numpy as np

from ..base.arrays import Bytes, Mask
from ..base.lru_cache import LRUCache
from ..camera.reconstruction import Reconstruction
from ..depth.depth_store import LONGEST_SIDE, DepthStore, decoded, encoded
from ..media.picture_file import Pixels
from .carried import SAME_PERSON, CarriedSubject, PeopleOfClip, Track, neighbours
from .cut import Cut
from .faces import face_of
from .gate import moving_tracks
from .networks import Networks
from .objects import ObjectsOfClip
from .people import overlap_of, sampled
from .pictures import ClipPictures, displayed
from .strokes import MarkedSubject, Stroke

PEOPLE = "moving-people"
"""Name of the kept file of the frames in which people are known, and their probability there."""
OBJECTS = "moving-objects"
"""Name of the kept file of the strokes that mark other moving objects."""
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
    store: DepthStore | None = None
    """Storage of its mattes."""
    kind: str = ""
    """"person" or "object"; empty of marked subjects, which users name."""

    def share(self, frame: int) -> Bytes:
        """Return its probability (h, w) in 255ths over a source frame."""
        if self.store is None:
            return self._found(frame)
        return self.store.made([frame], self._file, self._kept, self._made)[frame]

    def mask(self, frame: int) -> Mask:
        """Return the subject (h, w) over a source frame."""
        return np.asarray(self.share(frame) > 127)

    def _found(self, frame: int) -> Bytes:
        return np.rint(255 * self.cut(frame).share).astype(np.uint8)

    def _file(self, frame: int) -> str:
        return f"moving-{self.key}-{frame:06d}"

    def _kept(self, frame: int) -> Bytes | None:
        kept = self.store.read(self._file(frame), ("share",)) if self.store else None
        share = None if kept is None else decoded(kept["share"], LONGEST_SIDE)
        return None if share is None else np.asarray(share, np.uint8)

    def _made(self, frame: int) -> Bytes:
        share = self._found(frame)
        if self.store:
            self.store.write(self._file(frame), {"share": encoded(share)})
        return share


@dataclass(frozen=True)
class ClipSubjects:
    """The subjects of a clip, whatever is marked."""

    reconstruction: Reconstruction
    read: Callable[[int], Pixels]
    """A frame's picture (H, W, 3 or 4) as `Footage.read` gives it."""
    store: DepthStore | None = None
    """Storage of subjects."""
    networks: Networks = field(default_factory=Networks)
    _carried: LRUCache[CarriedSubject] = field(
        default_factory=lambda: LRUCache[CarriedSubject](KEPT_SUBJECTS), repr=False, compare=False
    )

    @cached_property
    def pictures(self) -> ClipPictures:
        """Small pictures of the registered frames."""
        frames = tuple(int(frame) for frame in self.reconstruction.frames)
        return ClipPictures(frames, self.read)

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
        return "people" in self.__dict__ or (self.store is not None and self.store.is_kept(PEOPLE))

    @cached_property
    def people(self) -> list[ClipSubject]:
        """The people that are subjects of the clip.

        There are none without networks, and in photos, whose order is not known.
        """
        if not self.reconstruction.is_ordered or not self.networks.exist:
            return []
        return self._once(PEOPLE, self._kept_people, self._found_people)

    def _found_people(self) -> list[ClipSubject]:
        """The people of the clip, kept in all frames."""
        tracks = PeopleOfClip(self.pictures, self.networks).tracks
        found = self._followed("person", [track.cut for track in tracks])
        self._keep_people(tracks)
        return found

    def _followed(
        self, kind: str, cuts: Sequence[Callable[[int], Cut]], keep: bool = True
    ) -> list[ClipSubject]:
        """Subjects of a kind; their shares of all frames are kept, as each process would carry them anew."""
        found = [
            ClipSubject(f"{kind} {number}", f"{kind}{number}", cut, self.store, kind)
            for number, cut in enumerate(cuts, 1)
        ]
        if keep and self.store is not None:
            for subject in found:
                for frame in self.pictures.frames:
                    subject.share(frame)
        return found

    def _once[R](self, name: str, read: Callable[[], R | None], make: Callable[[], R]) -> R:
        return make() if self.store is None else self.store.once(name, read, make)

    def _kept_people(self) -> list[ClipSubject] | None:
        """The people of the clip as they are kept; None where they are not."""
        kept = self.store and self.store.read(PEOPLE, ("frames", "trusts", "shares"))
        shares = decoded(kept["shares"], LONGEST_SIDE) if kept else None
        if not kept or shares is None:
            return None
        tracks = []
        for number, frame in enumerate(map(int, kept["frames"])):
            picture = self.pictures.picture(frame)
            rows = len(picture)
            share = shares[number * rows : (number + 1) * rows]
            if share.shape != picture.shape[:2]:
                return None
            share = np.asarray(share, np.float32) / np.float32(255)
            first = Cut.known(picture, np.asarray(share, np.float32), float(kept["trusts"][number]))
            tracks.append(Track(self.pictures, self.networks, frame, first))
        return self._followed("person", [track.cut for track in tracks], keep=False)

    def _keep_people(self, tracks: list[Track]) -> None:
        if self.store is not None:
            # There is no PNG without pixels.
            shares = [np.rint(255 * track.first.share).astype(np.uint8) for track in tracks]
            planes = np.vstack(shares or [np.zeros((1, 1), np.uint8)])
            frames = np.array([track.start for track in tracks], int)
            trusts = np.array([track.first.trust for track in tracks], float)
            self.store.write(PEOPLE, {"frames": frames, "trusts": trusts, "shares": encoded(planes)})

    @cached_property
    def objects(self) -> list[ClipSubject]:
        """The other moving objects of the clip.

        There are none in photos and in clips without certain motion.
        """
        return self._once(OBJECTS, self._kept_objects, self._found_objects)

    def _found_objects(self) -> list[ClipSubject]:
        """The other moving objects of the clip, kept in all frames."""
        tracks = list(moving_tracks(self.reconstruction, self.read))
        carried = ObjectsOfClip(tracks, self._object, self._people_in).subjects()
        found = self._followed("object", [each.cut for each in carried])
        self._keep_objects([each.strokes for each in carried])
        return found

    def _object(self, strokes: tuple[Stroke, ...]) -> CarriedSubject:
        return CarriedSubject(self.pictures, self.networks, strokes, corrects=False)

    def _people_in(self, frame: int) -> Mask:
        """(h, w) all people in a frame."""
        nobody = np.zeros(self.pictures.picture(frame).shape[:2], bool)
        return united([nobody, *(each.mask(frame) for each in self.people)])

    def _kept_objects(self) -> list[ClipSubject] | None:
        """The moving objects as they are kept, by their strokes; None where they are not."""
        kept = self.store and self.store.read(OBJECTS, ("frames", "counts", "places"))
        if not kept or kept["places"].shape != (len(kept["frames"]), 2):
            return None
        rows = zip(kept["frames"].tolist(), kept["places"].tolist(), strict=True)
        strokes = [Stroke(int(frame), ((float(x), float(y)),)) for frame, (x, y) in rows]
        ends = np.cumsum(kept["counts"].astype(int)).tolist()
        marks = [tuple(strokes[start:end]) for start, end in zip([0, *ends], ends, strict=False)]
        return self._followed("object", [self._object(each).cut for each in marks], keep=False)

    def _keep_objects(self, strokes: list[tuple[Stroke, ...]]) -> None:
        if self.store is not None:
            dots = [dot for each in strokes for dot in each]
            kept = {
                "frames": np.array([dot.frame for dot in dots], int),
                "counts": np.array([len(each) for each in strokes], int),
                "places": np.array([dot.places[0] for dot in dots], float).reshape(-1, 2),
            }
            self.store.write(OBJECTS, kept)

    def others(self, marked: Sequence[ClipSubject], found: Sequence[ClipSubject]) -> list[ClipSubject]:
        """Return the found subjects that no marked one covers in the frames that people are looked for in."""
        return [each for each in found if not any(self._is_same(each, other) for other in marked)]

    def _is_same(self, found: ClipSubject, marked: ClipSubject) -> bool:
        frames = sampled(self.pictures.frames)
        shown = [(mask, marked.mask(frame)) for frame in frames if (mask := found.mask(frame)).any()]
        return bool(shown) and float(np.median([overlap_of(*pair) for pair in shown])) >= SAME_PERSON


def united(masks: Sequence[Mask]) -> Mask:
    """Return the union (H, W) of masks over one frame, at the size of the largest; at least one mask."""
    largest = max(masks, key=lambda mask: mask.size)
    if all(mask.shape == largest.shape for mask in masks):
        return np.asarray(np.logical_or.reduce(masks))
    size = largest.shape[::-1]
    larger = (cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0 for mask in masks)
    return np.asarray(np.logical_or.reduce(list(larger)))
