"""What a clip knows of its frames after the solve: product, benchmark and tests construct the same one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.arrays import LinearRGBA
from ..base.reused_memory import ReusedMemory
from ..camera.canvas import Canvas
from ..camera.reconstruction import Reconstruction
from ..depth.depth_store import DepthStore
from ..depth.multi_view_stereo import COARSE, Moving, PlaneSweepStereo, StereoOptions
from ..depth.source import DepthSource, FirstKnown, PixelDepth
from ..depth.sparse import DepthSamples
from ..depth.sparse_depth import SparseDepth
from ..depth.stereo_depth import StereoDepth
from ..depth.temporal_fusion import FusionOptions, TemporalFusion
from ..focus.place import PlaceFinder
from ..media.clip import to_linear
from ..media.picture_file import Pixels
from ..warp.disocclusion_fill import DisocclusionFill, HiddenColours
from .highlights import RESTORED, ClipHighlights, HighlightSettings
from .quality import NORMAL, Quality


@dataclass(frozen=True)
class ClipContext:
    """A solved clip, with what is computed from several of its frames made once and kept.

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
    """Depth that need not be found: the user's maps, or the truth of a benchmark."""
    masks: Moving | None = None
    """The opacity in [0, 1] of what is said to move by itself, (h, w) of a source frame at any size."""
    store: Callable[[Quality], DepthStore] | None = None
    """Where what does not depend on the lens is kept, by the quality that it is found in."""

    @cached_property
    def stereo(self) -> TemporalFusion:
        """Depth of every pixel from the clip itself, at the size that it is found at, of normal quality."""
        return self._stereo(NORMAL)

    def stereo_of(self, quality: Quality) -> TemporalFusion:
        """What is `stereo`, of a quality."""
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
        store = self.store(quality) if self.store else None
        single_frame = PlaneSweepStereo(self.reconstruction, self.read, quality.stereo, self.masks)
        return TemporalFusion(self.reconstruction, single_frame, store, quality.fusion)

    @cached_property
    def _motion(self) -> PlaneSweepStereo:
        """What moves by itself, found coarsely, and the same in every quality."""
        store = self.store(NORMAL) if self.store else None
        return PlaneSweepStereo(self.reconstruction, self.read, COARSE, self.masks, store)

    @cached_property
    def _clip_highlights(self) -> dict[float, ClipHighlights]:
        """By threshold, of which there is hardly more than one."""
        return {}

    @cached_property
    def _disocclusion(self) -> dict[HighlightSettings, DisocclusionFill]:
        """Other frames' colours for what a frame does not show, but for what moves in them; by highlights,
        the last ones only: pictures are large."""
        return {}

    def picture(self, frame: int, highlights: HighlightSettings) -> LinearRGBA:
        """A frame's picture (H, W, 4) in linear light, with the light of highlights that its integers clip.

        Floats hold what is over white already, and stay as they are. UserError where a frame cannot be read.
        """
        stored = self.read(frame)
        linear = to_linear(stored)
        if stored.dtype == np.float32 or not highlights.gain:
            return linear
        of_clip = self._clip_highlights.setdefault(
            highlights.threshold, ClipHighlights(self.reconstruction, self.read, highlights.threshold)
        )
        return of_clip.restored(frame, linear, highlights.gain)

    def knows_highlights(self, frame: int, highlights: HighlightSettings) -> bool:
        """Whether `picture` of a frame only reads it: what it takes from other frames is remembered."""
        of_clip = self._clip_highlights.get(highlights.threshold)
        return not highlights.gain or (of_clip is not None and of_clip.knows(frame))

    def depth_source(self, quality: Quality = NORMAL) -> DepthSource:
        """What tells the depth of frames in a quality: what is given, else stereo; for coarse meshes else the
        feature points. Picking, following and drawing ask it and nothing else."""
        given = () if self.given_depth is None else (self.given_depth,)
        better = self.stereo_of(quality.better) if quality.better else None
        stereo = StereoDepth(self.stereo_of(quality), better, self.masks)
        return FirstKnown((*given, stereo, SparseDepth(self.reconstruction)))

    def has_depth(self, frame: int, quality: Quality) -> bool:
        """Whether the depth of a frame is given or kept, and need not be found; errors as of `depth`."""
        return self.depth_source(quality).kept(frame, self.canvas(frame)) is not None

    def canvas(self, frame: int) -> Canvas:
        """The canvas of a frame at the clip's own size."""
        image, _ = self.reconstruction.image_at(frame)
        return Canvas(self.reconstruction.intrinsics(image))

    def places(self, frame: int) -> PlaceFinder:
        """What finds the focus at places of a registered frame; see `PlaceFinder`."""
        return PlaceFinder(self.reconstruction, self.depth_source(), self.read, frame)

    @cached_property
    def texture_memory(self) -> ReusedMemory:
        """Where the textures of frames lie, one after the other."""
        return ReusedMemory()

    def depth(self, frame: int, canvas: Canvas, picture: LinearRGBA, quality: Quality = NORMAL) -> PixelDepth:
        """The depth of all pixels of a canvas that shows `picture` (H, W, 4), as `depth_source` tells it.

        UserError as `TemporalFusion.at`.
        """
        found = self.depth_source(quality).at(frame, canvas, picture)
        assert found is not None  # Stereo knows every frame.
        return found

    def hidden_colours(
        self,
        frame: int,
        canvas: Canvas,
        picture: LinearRGBA,
        depth: PixelDepth,
        highlights: HighlightSettings = RESTORED,
    ) -> HiddenColours:
        """Other frames' colours for what a frame does not show, to be asked for places of its canvas.

        `picture` (H, W, 4) and `depth` are what the frame itself shows, `highlights` what it was read with.
        """
        if highlights not in self._disocclusion:
            self._disocclusion.clear()
            self._disocclusion[highlights] = DisocclusionFill(
                self.reconstruction, lambda other: self.picture(other, highlights), self._motion.moving
            )
        fill = self._disocclusion[highlights]
        found = fill.reprojected(frame, canvas, picture, depth.inverse_depth, depth.moving, depth.past_border)
        return found.colours

    def samples(self, frame: int, canvas: Canvas) -> DepthSamples:
        """Places of known depth for a coarse mesh: of what is given, else the frame's feature points."""
        found = self.depth_source().samples(frame, canvas)
        assert found is not None  # Feature points come last.
        return found


def no_picture(frame: int) -> Pixels:
    """`ClipContext.read` of a clip whose pictures nothing needs: an AssertionError if something does."""
    raise AssertionError(f"nothing needs the picture of frame {frame}")
