"""The moving parts of a clip's frames: subjects, detected or marked, and masks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import cv2
import numpy as np

from ..base.arrays import Floats, Map, Mask
from ..base.errors import UserError
from ..base.lru_cache import remembered
from ..base.store import NOT_KEPT, Store
from ..camera.reconstruction import Reconstruction
from ..depth.flat_scene import FlatScene, Outline, flat_scene, outline
from ..depth.matching import Matcher, winning_levels
from ..depth.matte import matte
from ..depth.multi_view_stereo import Moving
from ..depth.source import FAINTEST
from ..depth.subject_depth import Subject
from ..media.fixed_area import Fixed, nothing_fixed
from ..media.picture_file import Pixels
from ..subjects.clip_subjects import ClipSubject, ClipSubjects, pixel_at, united
from ..subjects.cut import UNRECOGNISED
from ..subjects.masked_objects import MaskedObjects
from ..subjects.people import feet_of, sampled
from ..subjects.pictures import displayed
from ..subjects.standing import Standing, SubjectDistance
from ..subjects.static_depth import StaticDepth
from ..subjects.strokes import MarkedSubject


@dataclass(frozen=True)
class MovingParts:
    """Moving pixels of each frame and their distance; methods raise UserError like `ClipPictures.picture`."""

    reconstruction: Reconstruction
    read: Callable[[int], Pixels]
    """Reads a frame (H, W, 3 or 4), as `Footage.read`."""
    subjects: ClipSubjects
    marked: tuple[MarkedSubject, ...]
    """Subjects that the user has marked by strokes."""
    masks: Moving | None
    """Returns opacity (h, w) in [0, 1] of moving pixels in a source frame, any size, by the user's masks."""
    matcher: Matcher = winning_levels
    """Finds the depth levels of pixels."""
    has_maps: bool = False
    """True if the user has given depth maps."""
    fixed: Fixed = nothing_fixed
    """The pixels that do not show the scene."""

    @cached_property
    def every_subject(self) -> list[ClipSubject]:
        """The marked subjects, and the people and other moving objects that are not among them."""
        marked = [self.subjects.marked(each) for each in self.marked]
        # Before a static camera without depth maps, objects have no distance.
        objects = self.subjects.objects if self.has_maps or not self.reconstruction.stays else []
        return [*marked, *self.people, *self.subjects.others(marked, objects)]

    @cached_property
    def people(self) -> list[ClipSubject]:
        """The people of the clip that no marked subject covers."""
        marked = [self.subjects.marked(each) for each in self.marked]
        return self.subjects.others(marked, self.subjects.people)

    def named(self, name: str) -> ClipSubject:
        """Return a subject by its name; raises UserError for an unknown one."""
        marked = next((each for each in self.marked if each.name == name), None)
        if marked is not None:
            return self.subjects.marked(marked)
        found = next((each for each in self.every_subject if each.name == name), None)
        if found is None:
            names = ", ".join(each.name for each in self.every_subject) or "none"
            raise UserError(f"there is no subject {name!r}; there are: {names}")
        return found

    def at(self, frame: int, x: float, y: float) -> ClipSubject | None:
        """Return the subject at fractions x, y of a frame's picture, (0, 0) top left, or None."""
        for each in self._one_by_one():
            if pixel_at(each.mask(frame), x, y):
                return each
        return None

    def _one_by_one(self) -> Iterator[ClipSubject]:
        """The subjects; people are known before objects are looked for."""
        yield from (self.subjects.marked(each) for each in self.marked)
        yield from self.people
        yield from self.every_subject

    @remembered()
    def mask(self, frame: int) -> Mask | None:
        """Return the moving pixels (h, w) of a source frame, at any size, for all qualities.

        They are those of subjects, detected or marked, and of masks; None without either.
        """
        subjects = [each.mask(frame) for each in self.every_subject]
        masked = self.masks(frame) if self.masks else None
        if not subjects:
            return None if masked is None else np.asarray(masked > FAINTEST)
        if masked is None:
            return united(subjects)
        whole = cv2.resize(
            united(subjects).astype(np.uint8), masked.shape[1::-1], interpolation=cv2.INTER_LINEAR
        )
        return np.asarray((masked > FAINTEST) | (whole > 0))

    def placed(self) -> list[Subject]:
        """Return every subject, and each object of the masks, with its distance."""
        found = [Subject(each.mask, self.distance(each).inverse_depth) for each in self.every_subject]
        return [*found, *self._masked]

    @remembered()
    def distance(self, subject: ClipSubject) -> SubjectDistance:
        """Return the distance of a subject through the clip."""

        def is_recognised(frame: int) -> bool:
            return subject.cut(frame).trust >= UNRECOGNISED

        name = f"moving-{subject.key}-sizes"
        return self._distance_of(subject.mask, self.subjects.store, name, is_recognised)

    def _distance_of(
        self,
        mask: Callable[[int], Mask],
        store: Store = NOT_KEPT,
        name: str = "",
        is_recognised: Callable[[int], bool] = lambda frame: False,
    ) -> SubjectDistance:
        pictures = self.subjects.pictures
        if self.reconstruction.stays:
            return SubjectDistance(
                pictures, mask, partial(self.inverse_depths, mask), store=store, name=name,
                is_recognised=is_recognised,
            )  # fmt: skip
        networks = self.subjects.networks

        def feet(frame: int, subject: Mask) -> Floats | None:
            return feet_of(networks, pictures.picture(frame), subject)

        ground = Standing(self.static, self._known, feet)
        return SubjectDistance(
            pictures, mask, partial(ground.inverse_depths, mask), partial(ground.bounds, mask), feet, store,
            name, is_recognised,
        )  # fmt: skip

    @cached_property
    def _masked(self) -> list[Subject]:
        """The objects of the masks; none in photos, which cannot be followed."""
        if self.masks is None or not self.reconstruction.is_ordered:
            return []
        pictures = self.subjects.pictures
        size = pictures.picture(pictures.frames[0]).shape[:2]
        objects = MaskedObjects(pictures.frames, self.masks, (size[0], size[1]))
        return [
            Subject(objects.whole(number), self._distance_of(partial(objects.small, number)).inverse_depth)
            for number in objects.numbers
        ]

    @cached_property
    def static(self) -> StaticDepth:
        """Coarse depth of the static scene."""
        return StaticDepth(
            self.reconstruction, self.read, self.masks, self.subjects.store, self.matcher, self.fixed
        )

    @cached_property
    def scene(self) -> FlatScene:
        """The scene of a static camera, by the people of the clip."""
        frames = sampled(self.subjects.pictures.frames)
        people = [list(self._outlines(each.mask, frames).values()) for each in self.subjects.people]
        return flat_scene(self.reconstruction, people)

    def _outlines(self, mask: Callable[[int], Mask], frames: Sequence[int]) -> dict[int, Outline]:
        """Return the outlines of a subject in the frames that show it."""
        found = dict[int, Outline]()
        for frame in frames:
            image, _ = self.reconstruction.image_at(frame)
            if (seen := outline(mask(frame), image, self.reconstruction.canvas(image))) is not None:
                found[frame] = seen
        return found

    def inverse_depths(self, mask: Callable[[int], Mask], frames: Sequence[int]) -> dict[int, float]:
        """Return inverse depths of a subject in `scene`; see `Standing.inverse_depths`."""
        return {frame: self.scene.standing(each) for frame, each in self._outlines(mask, frames).items()}

    def opacity(self, frame: int) -> Map | Mask | None:
        """Return the opacity (H, W) in [0, 1] of subjects and masks; None without either."""
        masked = self.masks(frame) if self.masks else None
        if not self.every_subject:
            return masked
        picture = displayed(self.read(frame))
        mattes = [matte(picture, each.share(frame)) for each in self.every_subject]
        if masked is not None:
            mattes.append(cv2.resize(np.asarray(masked, np.float32), picture.shape[1::-1]))
        return np.asarray(np.maximum.reduce(mattes))

    def _known(self, frame: int) -> Mask:
        """Return the (h, w) moving pixels of a frame, never None."""
        mask = self.mask(frame)
        return np.zeros((1, 1), bool) if mask is None else mask
