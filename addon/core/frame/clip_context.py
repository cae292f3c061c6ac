"""A solved clip with its depth, subjects and highlights, for product, benchmark and tests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import cv2
import numpy as np

from ..base.arrays import Floats, LinearRGBA, Map, Mask
from ..base.lru_cache import remembered
from ..base.nearest_fill import nearest
from ..base.progress import stage
from ..base.store import NOT_KEPT, Store, numbers
from ..camera.canvas import Canvas
from ..camera.reconstruction import Reconstruction
from ..camera.steady_path import SteadyPath, steady_path
from ..depth.flat_scene import EstimatedDepth
from ..depth.matching import Matcher, winning_levels
from ..depth.multi_view_stereo import Moving, PlaneSweepStereo
from ..depth.source import FAINTEST, SURE, DepthSource, FirstKnown, PixelDepth, SparseDepth
from ..depth.sparse import DepthSamples
from ..depth.stereo_depth import NoDepth, StereoDepth
from ..depth.temporal_fusion import TemporalFusion
from ..focus.place import Place, PlaceFinder
from ..focus.subject import subject_place
from ..media.fixed_area import FixedArea, nothing_fixed
from ..media.light import to_linear
from ..media.noise import NUMBERS, Noise, measured
from ..media.picture_file import Pixels
from ..subjects.clip_subjects import ClipSubject, ClipSubjects
from ..subjects.strokes import MarkedSubject
from ..warp.disocclusion_fill import DisocclusionFill, HiddenColours
from .highlights import RESTORED, ClipHighlights, HighlightSettings
from .moving_parts import MovingParts
from .quality import NORMAL, Quality
from .repairs import CarriedPlaces

MIXED = 5
"""Width in pixels of the dilation of a matte's soft edge to its mixed pixels in `warp`."""


@dataclass(frozen=True)
class ClipContext:
    """A solved clip; results from several frames are made once and kept.

    Pictures are (H, W, 4) float32, linear and premultiplied; lengths are in the reconstruction's unit.
    Methods raise UserError if a frame, a map or a mask cannot be read.

    >>> clip = ClipContext(reconstruction, footage.read)
    >>> picture = clip.picture(2, HighlightSettings())
    >>> depth = clip.depth(2, clip.canvas(2), picture)
    >>> depth.inverse_depth.shape == picture.shape[:2]
    True
    """

    reconstruction: Reconstruction
    read: Callable[[int], Pixels]
    """Reads a frame (H, W, 3 or 4), as `Footage.read`; called more than once."""
    given_depth: DepthSource | None = None
    """Known depth, such as a benchmark's ground truth."""
    masks: Moving | None = None
    """Returns opacity (h, w) in [0, 1] of moving pixels in a source frame, any size, by the user's masks."""
    store: Callable[[Quality], Store] = lambda quality: NOT_KEPT
    """Storage by quality of results that do not depend on the lens."""
    marked: tuple[MarkedSubject, ...] = ()
    """Subjects that the user has marked by strokes."""
    known_subjects: ClipSubjects | None = None
    """Subjects from another context with the same clip and masks."""
    clip_store: Store = NOT_KEPT
    """Storage of highlights and noise, which depend on neither quality nor masks."""
    matcher: Matcher = winning_levels
    """Finds the depth levels of pixels on the processor or a GPU."""
    maps: DepthSource | None = None
    """The user's depth maps, used where stereo is uncertain."""
    from_rec_709: Floats | None = None
    """(3, 3) from the primaries of Rec.709, those of integer pictures, to those of the working space."""
    find_fixed: Callable[[], FixedArea | None] = nothing_fixed
    """Finds the pixels that do not show the scene, such as black bars: nothing is made from them."""

    @cached_property
    def fixed(self) -> FixedArea | None:
        """The result of `find_fixed`, which reads frames: only drawing and depth need it."""
        return self.find_fixed()

    def scene(self, frame: int) -> Pixels:
        """Return a frame as `read`, with the scene mirrored into the fixed area."""
        picture = self.read(frame)
        return picture if self.fixed is None else self.fixed.without(picture)

    def _fixed(self) -> Mask | None:
        return None if self.fixed is None else self.fixed.covered

    @cached_property
    def stereo(self) -> TemporalFusion:
        """Depth of every pixel by stereo in normal quality, at the size of the stereo pictures."""
        return self._stereo(NORMAL)

    def stereo_of(self, quality: Quality) -> TemporalFusion:
        """Return the depth by stereo in a quality; see `stereo`."""
        same = (quality.stereo_side, quality.fusion) == (NORMAL.stereo_side, NORMAL.fusion)
        return self.stereo if same else self._stereo(quality)

    @remembered()
    def _stereo(self, quality: Quality) -> TemporalFusion:
        if not quality.finds_subjects:
            alone = PlaneSweepStereo(
                self.reconstruction, self.scene, quality.stereo_side, self.masks, None, self.matcher,
                self._fixed,
            )  # fmt: skip
            return TemporalFusion(self.reconstruction, alone, options=quality.fusion)
        single_frame = PlaneSweepStereo(
            self.reconstruction, self.scene, quality.stereo_side, self.parts.mask,
            self.masks or (lambda frame: None), self.matcher, self._fixed,
        )  # fmt: skip
        return TemporalFusion(
            self.reconstruction, single_frame, self.store(quality), quality.fusion, self.parts.placed
        )

    def prepare_subject(self, frame: int) -> dict[str, Mask]:
        """Read and load the data for a stroke in a frame in advance.

        Returns the masks (h, w) of the people in the source frame by name; none before people are searched.
        Raises UserError if a frame cannot be read.
        """
        self._subjects.prepare(frame)
        if not self._subjects.knows_people:
            return {}
        return {person.name: person.mask(frame) for person in self.parts.people}

    @cached_property
    def carried_places(self) -> CarriedPlaces:
        """Places of painted repairs in other frames."""
        return CarriedPlaces(self._subjects.pictures)

    @cached_property
    def parts(self) -> MovingParts:
        """The moving parts of the clip: its subjects, and the objects of the masks."""
        return MovingParts(
            self.reconstruction, self.scene, self._subjects, self.marked, self.masks, self.matcher,
            self.maps is not None, self._fixed,
        )  # fmt: skip

    @cached_property
    def _subjects(self) -> ClipSubjects:
        return self.known_subjects or ClipSubjects(self.reconstruction, self.scene, fixed=self._fixed)

    def picture(self, frame: int, highlights: HighlightSettings) -> LinearRGBA:
        """Return a frame in linear light (H, W, 4), with restored highlights.

        Float pictures hold values above white, and are not restored. Raises UserError if a frame cannot be
        read.
        """
        stored = self.scene(frame)
        linear = to_linear(stored)
        if highlights.gain and stored.dtype != np.float32:
            linear = self._highlights_of(highlights.threshold).restored(frame, linear, highlights.gain)
        return self._in_working_space(linear, stored)

    def _in_working_space(self, linear: LinearRGBA, stored: Pixels) -> LinearRGBA:
        """Convert a picture (H, W, 4) in linear light of one as it is stored."""
        if self.from_rec_709 is None or stored.dtype == np.float32:
            return linear
        matrix = np.eye(4, dtype=np.float32)
        matrix[:3, :3] = self.from_rec_709
        return np.asarray(cv2.transform(linear, matrix), np.float32)

    def fixed_light(self, frame: int) -> LinearRGBA | None:
        """Return a picture (H, W, 4) of a frame's fixed pixels alone; None if there are none."""
        if self.fixed is None:
            return None
        stored = self.read(frame)
        light = self._in_working_space(to_linear(stored), stored)
        return np.where(self.fixed.mask[..., None], light, np.float32(0))

    def knows_highlights(self, frame: int, highlights: HighlightSettings) -> bool:
        """Return whether a frame's highlights are remembered or stored, so that `picture` is quick."""
        return not highlights.gain or self._highlights_of(highlights.threshold).knows(frame)

    @remembered()
    def _highlights_of(self, threshold: float) -> ClipHighlights:
        return ClipHighlights(self.reconstruction, self.scene, threshold, self.clip_store)

    @remembered(1)
    def steady_path(self, strength: float, fills: bool = False) -> SteadyPath:
        """Return the camera's path smoothed by a strength in (0, 1]; see `camera.steady_path`."""
        return steady_path(self.reconstruction, strength, fills)

    def noise(self, frame: int, size: tuple[int, int]) -> Noise | None:
        """Return the clip's noise in pictures of a size (width, height), or None if it is not visible.

        Photos have none, as there is no second frame of a scene. Raises UserError if a frame cannot be read.
        """
        if not self.reconstruction.is_ordered or self._noise is None or not self._noise.is_visible:
            return None
        camera = self.canvas(frame).camera
        found = self._noise.at_scale(size[0] / camera.width)
        return found if found.is_visible else None

    @cached_property
    def _noise(self) -> Noise | None:
        """The clip's noise at its own size."""
        frames = [int(frame) for frame in self.reconstruction.frames]

        def find() -> Floats:
            with stage("Noise", 0.0, 0.0):
                found = measured(self.scene, frames)
            return np.zeros(0) if found is None else found.numbers

        return Noise.of(self.clip_store.once(numbers("clip-noise", 0, NUMBERS), find))

    def depth_source(self, quality: Quality = NORMAL) -> DepthSource:
        """Return the source of depth in a quality, the only one for picking, following and drawing.

        It combines given depth, stereo and maps, with feature points for coarse meshes.
        """
        sparse, maps = SparseDepth(self.reconstruction), self.maps
        given = [] if self.given_depth is None else [self.given_depth]
        if self.reconstruction.stays:
            return FirstKnown((*given, self._estimated if maps is None else maps, NoDepth(), sparse))
        better = self.stereo_of(quality.better) if quality.better else None
        opacity = self.parts.opacity if quality.finds_subjects else self.masks
        stereo = StereoDepth(self.stereo_of(quality), better, opacity, maps)
        return FirstKnown((*given, stereo, sparse))

    @cached_property
    def _estimated(self) -> EstimatedDepth:
        """Depth of a static camera's scene."""
        parts = self.parts
        return EstimatedDepth(self.reconstruction, lambda: parts.scene, parts.placed, parts.opacity)

    def has_depth(self, frame: int, quality: Quality) -> bool:
        """Return whether the depth of a frame is given or stored; raises UserError like `depth`."""
        return self.depth_source(quality).kept(frame, self.canvas(frame)) is not None

    def canvas(self, frame: int) -> Canvas:
        """Return the canvas of a frame at the clip's size."""
        return self.reconstruction.canvas(frame)

    def places(
        self,
        frame: int,
        depth: DepthSource | None = None,
        is_repaired: Callable[[float, float], bool] = lambda x, y: False,
    ) -> PlaceFinder:
        """Return the finder of focus in a registered frame, by its own depth or a repaired one."""
        source, subject_at = depth or self.depth_source(), partial(self._place_on_subject, frame)
        return PlaceFinder(self.reconstruction, source, self.scene, frame, subject_at, is_repaired)

    @property
    def may_focus_on_subjects(self) -> bool:
        """Return whether a click may focus on a subject: its distance needs the depth of the clip alone."""
        return self.given_depth is None and self.maps is None

    def subject_at(self, frame: int, x: float, y: float) -> ClipSubject | None:
        """Return the subject at fractions x, y of a frame's picture, or None."""
        return self.parts.at(frame, x, y) if self.may_focus_on_subjects else None

    def _place_on_subject(self, frame: int, x: float, y: float) -> Place | None:
        """Focus on the whole subject at a position in a frame; None without one."""
        subject = self.subject_at(frame, x, y)
        if subject is None:
            return None
        place = replace(self._focus_on(subject, frame), xy=(x, y))
        face = self._subjects.face(subject, frame)
        is_face = face is not None and face[0] <= x <= face[2] and face[1] <= y <= face[3]
        return replace(place, subject="face") if is_face else place

    def boxes(self, frame: int) -> list[Floats]:
        """Return `ClipSubjects.boxes` of those subjects that were found for a frame before."""
        return self._subjects.boxes(vars(self.parts).get("every_subject", ()), frame)

    def subject_place(self, name: str, frame: int) -> Place:
        """Focus on a subject and follow it through the clip; raises UserError for an unknown name."""
        return self._focus_on(self.parts.named(name), frame)

    def _focus_on(self, subject: ClipSubject, frame: int) -> Place:
        subject.mask(frame)
        source = self.reconstruction, self.depth_source(), subject.mask, frame, subject.name
        is_given = self.given_depth is not None or self.maps is not None
        place = subject_place(*source, *(() if is_given else (self.parts.distance(subject).inverse_depth,)))
        return replace(place, subject=subject.kind or subject.name)

    def depth(self, frame: int, canvas: Canvas, picture: LinearRGBA, quality: Quality = NORMAL) -> PixelDepth:
        """Return the depth of all pixels of a frame's canvas, which shows the picture (H, W, 4).

        Raises UserError as `TemporalFusion.at` does, and for a static camera if no map has depth.
        """
        found = self.depth_source(quality).at(frame, canvas, picture)
        assert found is not None  # Stereo has a depth for every frame, or raises an error.
        if self.fixed is None or not picture.size:
            return found
        # Where other frames do not know what is behind, the scene beside it goes on.
        hidden = self.fixed.on_canvas(canvas)
        if found.confidence is not None and self.maps is None:
            hidden &= found.confidence <= SURE
        return replace(found, inverse_depth=nearest(found.inverse_depth, ~hidden))

    def hidden_colours(
        self,
        frame: int,
        canvas: Canvas,
        picture: LinearRGBA,
        depth: PixelDepth,
        highlights: HighlightSettings = RESTORED,
    ) -> HiddenColours:
        """Return the colours of other frames for hidden positions of a canvas with a picture (H, W, 4).

        `highlights` are the settings with which the picture was read.
        """
        fill = self._disocclusion(highlights)
        found = fill.reprojected(frame, canvas, picture, depth.inverse_depth, depth.moving, depth.past_border)
        if not self.reconstruction.stays or depth.opacity is None:
            return found.colours
        # A nearly static camera moves by a pixel or two: too much to separate mixed pixels.
        sheer = (depth.opacity > FAINTEST) & (depth.opacity < 1 - FAINTEST)
        mixed = cv2.dilate(sheer.astype(np.uint8), np.ones((MIXED, MIXED), np.uint8)) > 0

        def beyond_edges(places: Floats, inverse_depth: Floats) -> tuple[Map, Mask]:
            colour, known = found.colours(places, inverse_depth)
            column, row = np.floor(places).astype(int).T
            inside = (column >= 0) & (row >= 0) & (column < mixed.shape[1]) & (row < mixed.shape[0])
            known = known.copy()
            known[inside] &= ~mixed[row[inside], column[inside]]
            return colour, known

        return beyond_edges

    @remembered(1)
    def _disocclusion(self, highlights: HighlightSettings) -> DisocclusionFill:
        """Return the fill for settings of highlights; only the last, as pictures are large."""
        return DisocclusionFill(
            self.reconstruction, lambda other: self.picture(other, highlights), self._foreign
        )

    def _foreign(self, frame: int) -> Mask | None:
        """Return the pixels (h, w) of a source frame that do not show the static scene."""
        moving, fixed = self.parts.mask(frame), self._fixed()
        if moving is None or fixed is None:
            return fixed if moving is None else moving
        size = fixed.shape[1], fixed.shape[0]
        whole = cv2.resize(moving.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
        return np.asarray(fixed | (whole > 0))

    def samples(self, frame: int, canvas: Canvas) -> DepthSamples:
        """Return positions of known depth for a coarse mesh, from maps or feature points."""
        found = self.depth_source().samples(frame, canvas)
        assert found is not None  # Feature points come last.
        return found


def no_picture(frame: int) -> Pixels:
    """Raise AssertionError, as `ClipContext.read` of a clip without pictures."""
    raise AssertionError(f"nothing needs the picture of frame {frame}")
