"""A solved clip with its depth, subjects and highlights, for product, benchmark and tests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import cv2
import numpy as np

from ..base.arrays import Floats, LinearRGBA, Map, Mask
from ..base.progress import stage
from ..base.reused_memory import ReusedMemory
from ..camera.canvas import Canvas
from ..camera.reconstruction import Reconstruction
from ..camera.steady_path import SteadyPath, steady_path
from ..depth.completed_depth import CompletedDepth
from ..depth.depth_store import DepthStore
from ..depth.flat_scene import EstimatedDepth
from ..depth.map_fusion import FusionOptions
from ..depth.matching import Matcher, winning_levels
from ..depth.multi_view_stereo import Moving, PlaneSweepStereo, StereoOptions
from ..depth.source import FAINTEST, DepthSource, FirstKnown, PixelDepth
from ..depth.sparse import DepthSamples
from ..depth.sparse_depth import SparseDepth
from ..depth.stereo_depth import NoDepth, StereoDepth
from ..depth.temporal_fusion import TemporalFusion
from ..focus.place import Place, PlaceFinder
from ..focus.subject import subject_place
from ..media.clip import to_linear
from ..media.noise import Noise, measured
from ..media.picture_file import Pixels
from ..subjects.carried import CarriedSubject
from ..subjects.clip_subjects import ClipSubject, ClipSubjects
from ..subjects.strokes import MarkedSubject
from ..warp.disocclusion_fill import DisocclusionFill, HiddenColours
from .highlights import RESTORED, ClipHighlights, HighlightSettings
from .moving_parts import MovingParts
from .own_lens import OwnLens, own_lens
from .quality import NORMAL, Quality

MIXED = 5
"""Pixels across the dilation of the soft edge of a matte, as `warp` takes it for mixed."""


@dataclass(frozen=True)
class ClipContext:
    """A solved clip; results from several frames are made once and kept.

    Pictures are (H, W, 4) float32, linear and premultiplied; lengths are in the reconstruction's unit.
    UserError where a frame, a map or a mask cannot be read.

    >>> clip = ClipContext(reconstruction, footage.read)
    >>> picture = clip.picture(2, HighlightSettings())
    >>> depth = clip.depth(2, clip.canvas(2), picture)
    >>> depth.inverse_depth.shape == picture.shape[:2]
    True
    """

    reconstruction: Reconstruction
    read: Callable[[int], Pixels]
    """A frame's picture (H, W, 3 or 4) as `Footage.read` gives it; it is asked for more than once."""
    given_depth: DepthSource | None = None
    """Depth that need not be found, such as the truth of a benchmark."""
    masks: Moving | None = None
    """Returns the opacity in [0, 1] of moving pixels (h, w) of a source frame, at any size, by the user's
    masks."""
    store: Callable[[Quality], DepthStore] | None = None
    """Where what does not depend on the lens is kept, by the quality that it is found in."""
    marked: tuple[MarkedSubject, ...] = ()
    """Subjects that the user has marked by strokes."""
    known_subjects: ClipSubjects | None = None
    """Those that another context of the clip and masks knows already."""
    highlight_store: DepthStore | None = None
    """Where highlights are kept, which depend on neither quality nor masks."""
    matcher: Matcher = winning_levels
    """Finds the depth levels of pixels: the processor, or a GPU."""
    maps: DepthSource | None = None
    """The user's depth maps, used where stereo is not sure."""
    from_rec_709: Floats | None = None
    """(3, 3) from the primaries of Rec.709, which integer pictures have, to those of the working space."""

    @cached_property
    def stereo(self) -> TemporalFusion:
        """Depth of every pixel from the clip itself, at the size that it is found at, of normal quality."""
        return self._stereo(NORMAL)

    def stereo_of(self, quality: Quality) -> TemporalFusion:
        """Return the depth from the clip itself of a quality; see `stereo`."""
        options = quality.stereo, quality.fusion
        if options == (NORMAL.stereo, NORMAL.fusion):
            return self.stereo
        if options not in self._others:
            self._others[options] = self._stereo(quality)
        return self._others[options]

    @cached_property
    def _others(self) -> dict[tuple[StereoOptions, FusionOptions], TemporalFusion]:
        return {}

    def _stereo(self, quality: Quality) -> TemporalFusion:
        if not quality.finds_subjects:
            alone = PlaneSweepStereo(
                self.reconstruction, self.read, quality.stereo, self.masks, matcher=self.matcher
            )
            return TemporalFusion(self.reconstruction, alone, options=quality.fusion)
        store = self._store_of(quality)
        single_frame = PlaneSweepStereo(
            self.reconstruction, self.read, quality.stereo, self.moving, self.masks or _nothing, self.matcher
        )
        return TemporalFusion(self.reconstruction, single_frame, store, quality.fusion, self._parts.placed)

    def moving(self, frame: int) -> Mask | None:
        """Return the moving pixels of a frame; see `MovingParts.mask`."""
        return self._parts.mask(frame)

    def subject(self, name: str, frame: int) -> Mask:
        """Return a subject (h, w) in a frame, over the source frame at any size.

        Raises:
            UserError: No subject has this name; else as of `MovingParts.mask`.
        """
        return self._parts.named(name).mask(frame)

    @property
    def every_subject(self) -> list[ClipSubject]:
        """The subjects that are marked, and the people and other moving objects that are not among them."""
        return self._parts.every_subject

    @property
    def people(self) -> list[ClipSubject]:
        """The people of the clip whom no marked subject covers."""
        return self._parts.people

    def carried(self, marked: MarkedSubject) -> CarriedSubject:
        """Return a marked subject in the frames of the clip; its result is remembered."""
        return self._subjects.carried(marked)

    def prepare_subject(self, frame: int) -> dict[str, Mask]:
        """Read and load ahead what a stroke in a frame needs.

        Returns:
            (h, w) the people in the frame, by name, over the source frame; none while they would have to be
            looked for.

        Raises:
            UserError: If a frame cannot be read.
        """
        self._subjects.prepare(frame)
        if not self._subjects.knows_people:
            return {}
        return {person.name: person.mask(frame) for person in self.people}

    @cached_property
    def _parts(self) -> MovingParts:
        return MovingParts(
            self.reconstruction, self.read, self._subjects, self.marked, self.masks, self.matcher
        )

    @cached_property
    def _subjects(self) -> ClipSubjects:
        return self.known_subjects or ClipSubjects(self.reconstruction, self.read)

    def _store_of(self, quality: Quality) -> DepthStore | None:
        """The one store of a quality: each counts what it writes."""
        if self.store is None:
            return None
        if quality not in self._stores:
            self._stores[quality] = self.store(quality)
        return self._stores[quality]

    @cached_property
    def _stores(self) -> dict[Quality, DepthStore]:
        return {}

    @cached_property
    def _clip_highlights(self) -> dict[float, ClipHighlights]:
        """By threshold, of which there is hardly more than one."""
        return {}

    @cached_property
    def _disocclusion(self) -> dict[HighlightSettings, DisocclusionFill]:
        """Hidden colours from other frames, without their moving pixels, by settings of highlights.

        Only the last settings are kept: pictures are large.
        """
        return {}

    def picture(self, frame: int, highlights: HighlightSettings) -> LinearRGBA:
        """A frame's picture (H, W, 4) in linear light, with the light of highlights that its integers clip.

        Floats hold what is over white already, and stay as they are. UserError where a frame cannot be read.
        """
        stored = self.read(frame)
        linear = to_linear(stored)
        if stored.dtype == np.float32:
            return linear
        if highlights.gain:
            linear = self._highlights_of(highlights.threshold).restored(frame, linear, highlights.gain)
        if self.from_rec_709 is not None:
            matrix = np.eye(4, dtype=np.float32)
            matrix[:3, :3] = self.from_rec_709
            linear = np.asarray(cv2.transform(linear, matrix), np.float32)
        return linear

    def knows_highlights(self, frame: int, highlights: HighlightSettings) -> bool:
        """Return whether a frame's highlights are remembered or kept, so that `picture` needs no search."""
        return not highlights.gain or self._highlights_of(highlights.threshold).knows(frame)

    def _highlights_of(self, threshold: float) -> ClipHighlights:
        if threshold not in self._clip_highlights:
            self._clip_highlights[threshold] = ClipHighlights(
                self.reconstruction, self.read, threshold, self.highlight_store
            )
        return self._clip_highlights[threshold]

    def steady_path(self, strength: float, fills: bool = False) -> SteadyPath:
        """The path of the camera smoothed by a strength in (0, 1]; UserError as the function raises it."""
        if (strength, fills) not in self._steady_paths:
            self._steady_paths.clear()
            self._steady_paths[strength, fills] = steady_path(self.reconstruction, strength, fills)
        return self._steady_paths[strength, fills]

    @cached_property
    def _steady_paths(self) -> dict[tuple[float, bool], SteadyPath]:
        """By what was asked for, the last one only: a path is found in a moment."""
        return {}

    def noise(self, frame: int, size: tuple[int, int]) -> Noise | None:
        """Return the clip's noise in pictures of a size (width, height).

        None if it is not visible, and for photos, which have no second frame of the same scene.

        Raises:
            UserError: A frame cannot be read.
        """
        if not self.reconstruction.is_ordered or self._noise is None or not self._noise.is_visible:
            return None
        camera = self.canvas(frame).camera
        if size not in self._noises:
            self._noises[size] = self._noise.at_scale(size[0] / camera.width)
        found = self._noises[size]
        return found if found.is_visible else None

    @cached_property
    def _noise(self) -> Noise | None:
        """The clip's noise at its own size."""
        frames = [int(frame) for frame in self.reconstruction.frames]
        with stage("Noise", 0.0, 0.0):
            return measured(self.read, frames)

    @cached_property
    def _noises(self) -> dict[tuple[int, int], Noise]:
        """By size."""
        return {}

    @cached_property
    def own_lens(self) -> OwnLens | None:
        """The lens that the clip was filmed through; None where it has no depth of field.

        UserError where a frame cannot be read.
        """
        return own_lens(self.reconstruction, self.read)

    def depth_source(self, quality: Quality = NORMAL) -> DepthSource:
        """Return the source of the depth of frames in a quality.

        It is given depth, stereo, or both, and feature points for coarse meshes. Picking, following and
        drawing use this source only.
        """
        sparse, maps = SparseDepth(self.reconstruction), self.maps
        given = [] if self.given_depth is None else [self.given_depth]
        if self.reconstruction.stays:
            return FirstKnown((*given, self._estimated if maps is None else maps, NoDepth(), sparse))
        better = self.stereo_of(quality.better) if quality.better else None
        stereo = StereoDepth(
            self.stereo_of(quality), better, self._parts.opacity if quality.finds_subjects else self._masked
        )
        return FirstKnown((*given, stereo if maps is None else CompletedDepth(stereo, maps), sparse))

    @cached_property
    def _estimated(self) -> EstimatedDepth:
        """Depth of a camera that stays in its place."""
        parts = self._parts
        return EstimatedDepth(self.reconstruction, lambda: parts.scene, parts.placed, parts.opacity)

    def has_depth(self, frame: int, quality: Quality) -> bool:
        """Whether the depth of a frame is given or kept, and need not be found; errors as of `depth`."""
        return self.depth_source(quality).kept(frame, self.canvas(frame)) is not None

    def canvas(self, frame: int) -> Canvas:
        """The canvas of a frame at the clip's own size."""
        image, _ = self.reconstruction.image_at(frame)
        return self.reconstruction.canvas(image)

    def places(self, frame: int) -> PlaceFinder:
        """Return the finder of focus at places of a registered frame."""
        return PlaceFinder(
            self.reconstruction, self.depth_source(), self.read, frame, partial(self._place_on_subject, frame)
        )

    @property
    def may_focus_on_subjects(self) -> bool:
        """Return whether a click may focus on a whole subject: its distance comes from the clip alone."""
        return self.given_depth is None and self.maps is None

    def subject_at(self, frame: int, x: float, y: float) -> ClipSubject | None:
        """Return the subject at fractions x, y of a frame's picture; None beside all subjects.

        Errors as of `places`.
        """
        return self._parts.at(frame, x, y) if self.may_focus_on_subjects else None

    def _place_on_subject(self, frame: int, x: float, y: float) -> Place | None:
        """The whole subject at a place of a frame, in focus; None beside all of them."""
        subject = self.subject_at(frame, x, y)
        return None if subject is None else replace(self._focus_on(subject, frame), xy=(x, y))

    def subject_place(self, name: str, frame: int) -> Place:
        """A subject as a place in focus, followed through the clip; errors as of `subject`."""
        return self._focus_on(self._parts.named(name), frame)

    def _focus_on(self, subject: ClipSubject, frame: int) -> Place:
        subject.mask(frame)
        source = self.reconstruction, self.depth_source(), subject.mask, frame, subject.name
        if self.given_depth is not None or self.maps is not None:
            return subject_place(*source)
        return subject_place(*source, self._parts.distance(subject).inverse_depth)

    def _masked(self, frame: int) -> Map | Mask | None:
        return self.masks(frame) if self.masks else None

    @cached_property
    def texture_memory(self) -> ReusedMemory:
        """Where the textures of frames lie, one after the other."""
        return ReusedMemory()

    def depth(self, frame: int, canvas: Canvas, picture: LinearRGBA, quality: Quality = NORMAL) -> PixelDepth:
        """Return the depth of all pixels of a canvas.

        Args:
            frame: Number of the frame.
            canvas: That of the frame.
            picture: (H, W, 4) shown by the canvas.
            quality: Quality of the depth.

        Raises:
            UserError: As of `TemporalFusion.at`; or the camera stays in its place, and no map has depth.
        """
        found = self.depth_source(quality).at(frame, canvas, picture)
        assert found is not None  # Stereo has a depth for every frame, or raises an error.
        return found

    def hidden_colours(
        self,
        frame: int,
        canvas: Canvas,
        picture: LinearRGBA,
        depth: PixelDepth,
        highlights: HighlightSettings = RESTORED,
    ) -> HiddenColours:
        """Return the colours of other frames for hidden places of a frame's canvas.

        Args:
            frame: Number of the frame.
            canvas: That of the frame.
            picture: (H, W, 4) shown by the canvas.
            depth: Its depth.
            highlights: Settings that the picture was read with.
        """
        if highlights not in self._disocclusion:
            self._disocclusion.clear()
            self._disocclusion[highlights] = DisocclusionFill(
                self.reconstruction, lambda other: self.picture(other, highlights), self.moving
            )
        fill = self._disocclusion[highlights]
        found = fill.reprojected(frame, canvas, picture, depth.inverse_depth, depth.moving, depth.past_border)
        if not self.reconstruction.stays or depth.opacity is None:
            return found.colours
        # A camera that seems to stay moves by a pixel or two: too much for taking mixed pixels apart.
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

    def samples(self, frame: int, canvas: Canvas) -> DepthSamples:
        """Return places of known depth for a coarse mesh: of given maps, else of feature points."""
        found = self.depth_source().samples(frame, canvas)
        assert found is not None  # Feature points come last.
        return found


def _nothing(frame: int) -> None:
    """A mask of which nothing is known."""


def no_picture(frame: int) -> Pixels:
    """`ClipContext.read` of a clip whose pictures nothing needs: an AssertionError if something does."""
    raise AssertionError(f"nothing needs the picture of frame {frame}")
