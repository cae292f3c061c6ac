"""Restoration of a clip's clipped highlights, equal in every frame.

The rim of a light source gives its brightness, with an error that depends on its position on the pixels. So
the source is searched in other frames along its epipolar line, and all estimates are averaged with a weight
that falls linearly with distance in time, against flicker. The frames are those of hidden colours. Nothing
depends on the lens, so results are stored beside depth (`kept_highlights`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..base.arrays import Floats, Indices, LinearRGBA
from ..base.lru_cache import LRUCache
from ..base.options import option
from ..base.store import NOT_KEPT, Store
from ..camera.reconstruction import Image, Intrinsics, Reconstruction
from ..depth.view_selection import FEWEST_SOURCES, SOURCE_STEP, every_nth, relative_pose, stride
from ..media.light import to_linear
from ..media.picture_file import Pixels
from ..warp.clipped_blobs import Blobs, clipped_blobs
from ..warp.highlight_kinds import RADIANCES, Lamps, kinds_of
from ..warp.highlights import LostLight, Told, lamps, lost_light
from . import kept_highlights as kept

POOLED = 8
"""Frames, evenly spread, whose light sources give the clip's kinds of lamps. Chosen by inspection."""
SPAN = 16
"""Registered frames before and after that may be sources. Chosen by inspection."""
KEPT = 64 << 20
"""Most bytes of remembered highlights, and of their lost light."""
NEAREST = 1.2
"""Largest inverse depth of a light source, relative to that of the frame's features. Chosen by inspection."""
MOST_PARALLAX = 0.05
"""Largest parallax of a light source as a share of the long side, without features of known depth."""
BESIDE = 0.004
"""Largest distance from the epipolar line by the long side: 2.6 of 640 pixels. Chosen by inspection."""
ALIKE = 1.1
"""Largest log ratio of areas of one light source in two frames: a factor of 3. Chosen by inspection."""
UNLIKE = 4.0
"""Pixels from the line that count as much as a ratio of areas of e. Chosen by inspection."""
MOST_GAIN = 1000.0
"""Largest gain of restored light, a hundred times the need. Chosen by inspection."""


@dataclass(frozen=True)
class HighlightSettings:
    """The user's settings for clipped highlights."""

    gain: float = option(
        1.0, "Highlights",
        "How much of the clipped light of highlights is restored, so that they turn into bright bokeh"
        " discs: 1 restores the full estimate, 0 leaves the clip as it is. Float images are not changed",
        name="highlights", least=0.0, most=MOST_GAIN, soft_most=4.0, words={"off": 0.0}, precision=2,
    )  # fmt: skip
    threshold: float = option(
        0.97, "Clipping Threshold",
        "Brightness above which a pixel counts as clipped, in linear light where 1 is white. Lower it if"
        " the clip's highlights were recorded as light gray",
        name="highlight_threshold", least=0.1, most=1.0,
    )  # fmt: skip
    """Linear light, relative to white, from which on a pixel of an integer picture is clipped."""


RESTORED = HighlightSettings()


class ClipHighlights:
    """The highlights of a clip's frames at one threshold."""

    def __init__(
        self,
        reconstruction: Reconstruction,
        read: Callable[[int], Pixels],
        threshold: float,
        store: Store = NOT_KEPT,
    ) -> None:
        """Prepare for a clip that `read` reads like `Footage.read`, at a threshold in [0, 1]."""
        self._rec, self._read, self._threshold, self._store = reconstruction, read, threshold, store
        self._found = LRUCache[Lamps](KEPT, kept.size)
        self._lost = LRUCache[LostLight](KEPT, kept.size)
        self._known_kinds: tuple[list[int], Floats] = [], kinds_of([])

    def restored(self, frame: int, picture: LinearRGBA, gain: float) -> LinearRGBA:
        """Return a linear picture (H, W, 4) of a frame with `gain` of the light that clipping removed.

        Only clipped channels of clipped pixels become brighter. Raises UserError if another frame cannot be
        read. Passes checkpoints.
        """
        lost = self._lost.get(frame, lambda: self._lost_light(frame, picture))
        if not len(lost.pixel):
            return picture
        result = picture.copy()
        result.reshape(-1, 4)[lost.pixel, :3] += np.float32(gain) * lost.light
        return result

    def knows(self, frame: int) -> bool:
        """Return whether the clipped light of a frame is remembered or stored."""
        return frame in self._lost or self._store.is_kept(kept.lost_name(frame, self._threshold))

    def _lost_light(self, frame: int, picture: LinearRGBA) -> LostLight:
        """Return the clipped light of a frame's picture (H, W, 4), equal whether stored or computed."""

        def find() -> LostLight:
            blobs = clipped_blobs(picture, self._threshold)
            told = self._told(frame, blobs)
            kinds = self._kinds(frame) if len(blobs) else kinds_of([])
            return lost_light(blobs, self._threshold, told, kinds)

        return self._store.get(kept.lost_entry(frame, self._threshold, picture.shape[:2]), find)

    def _kinds(self, frame: int) -> Floats:
        """Return (a, r) `kinds_of` frames all over the clip, the same for each frame."""
        frames = self._rec.frames[:: stride(self._rec, SOURCE_STEP, FEWEST_SOURCES)]
        spread = np.linspace(0, len(frames) - 1, min(POOLED, len(frames))).round().astype(int)
        # Photos differ in exposure, so each is treated as a clip.
        pooled = [int(frames[each]) for each in spread] if self._rec.is_ordered else [frame]
        if self._known_kinds[0] != pooled:
            theirs = self._lamps(pooled)
            self._known_kinds = pooled, kinds_of([theirs[each] for each in pooled])
        return self._known_kinds[1]

    def _neighbours(self, here: Image) -> list[tuple[Image, float]]:
        """Return the frames around one that estimate its highlights, and their weights above zero."""
        if not self._rec.is_ordered:
            # Photos differ in exposure: a light source has the brightness in its own photo.
            return []
        step = stride(self._rec, SOURCE_STEP, FEWEST_SOURCES)
        frames = self._rec.frames
        # Mean number of frames between registered ones.
        pace = float(frames[-1] - frames[0]) / max(len(frames) - 1, 1)
        around = [
            (other, 1 - abs(other.frame - here.frame) / (1 + SPAN * pace))
            for other in every_nth(self._rec, here.frame, step, SPAN)
        ]
        return [(other, weight) for other, weight in around if weight > 0]

    def _lamps(self, frames: list[int]) -> dict[int, Lamps]:
        """Return the highlights of frames, remembered, stored or computed, by this or another process."""

        def find(frame: int) -> Lamps:
            return lamps(clipped_blobs(to_linear(self._read(frame)), self._threshold))

        known = {frame: one for frame in frames if (one := self._found.known(frame)) is not None}
        left = [frame for frame in frames if frame not in known]
        made = self._store.made({frame: kept.lamps_entry(frame, self._threshold) for frame in left}, find)
        for frame in left:
            self._found.get(frame, partial(made.__getitem__, frame))
        return known | made

    def _told(self, frame: int, own: Blobs) -> Told:
        """Sum the estimates of other frames for a frame's blobs."""
        total, evidence, tint = (
            np.zeros(len(own)),
            np.zeros((len(own), len(RADIANCES))),
            np.zeros((len(own), 3)),
        )
        if not len(own):
            return total, evidence, tint
        here, _ = self._rec.image_at(frame)
        around = self._neighbours(here)
        theirs = self._lamps([other.frame for other, _ in around])
        for other, weight in around:
            found = theirs[other.frame]
            mine, match = self._matches(here, own, other, found)
            total[mine] += weight
            evidence[mine] += weight * found.evidence[match]
            tint[mine] += weight * found.tint[match]
        return total, evidence, tint

    def _matches(self, here: Image, own: Blobs, other: Image, theirs: Lamps) -> tuple[Indices, Indices]:
        """Return indices (m,) of a frame's highlights and of another's that are mutual best matches."""
        camera, there = self._rec.intrinsics(here), self._rec.intrinsics(other)
        size = (np.array([each.width, each.height]) for each in (camera, there))
        xy, place = (each * pixels for each, pixels in zip((own.centre, theirs.centre), size, strict=True))
        far, near = self._segments(here, xy, other)
        reach = BESIDE * max(there.width, there.height)
        mine, match = _near_segments(far, near, place, reach)
        along, to = near[mine] - far[mine], place[match] - far[mine]
        share = np.clip((to * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-12), 0, 1)
        beside = np.linalg.norm(to - share[:, None] * along, axis=1)
        area = np.abs(np.log(own.area[mine] / theirs.area[match]) + 2 * np.log(there.fx / camera.fx))
        good = (beside <= reach) & (area <= ALIKE)
        mine, match, cost = mine[good], match[good], (beside + UNLIKE * area)[good]
        order = np.lexsort((match, mine, cost))
        best, back = (order[np.unique(each[order], return_index=True)[1]] for each in (mine, match))
        both = np.intersect1d(best, back)
        return mine[both], match[both]

    def _segments(self, here: Image, xy: Floats, other: Image) -> tuple[Floats, Floats]:
        """Ends (n, 2), in px of a frame, of epipolar segments, infinity first; NaN behind the camera."""
        camera, there = self._rec.intrinsics(here), self._rec.intrinsics(other)
        rotation, translation = relative_pose(here, other)
        rays = np.column_stack([_rays(camera, xy), np.ones(len(xy))]) @ rotation.T
        nearest = self._nearest(here, camera, float(np.linalg.norm(translation)))
        ends = []
        for inverse in (0.0, nearest):
            seen = rays + inverse * translation
            seen[seen[:, 2] <= 0] = np.nan
            ends.append(there.project(seen))
        return ends[0], ends[1]

    def _nearest(self, here: Image, camera: Intrinsics, baseline: float) -> float:
        """Return an upper bound of inverse depth in a frame."""
        seen = here.points[here.points >= 0]
        if len(seen):
            depth = self._rec.points.xyz[seen] @ here.rotation[2] + here.translation[2]
            nearest = float(np.percentile(depth, 2))
            if nearest > 0:
                return NEAREST / nearest
        # Without a baseline there is no parallax at any depth.
        return (
            MOST_PARALLAX * max(camera.width, camera.height) / (camera.fx * baseline) if baseline > 0 else 0.0
        )


def _near_segments(far: Floats, near: Floats, place: Floats, reach: float) -> tuple[Indices, Indices]:
    """Pairs (p,) of segments (n, 2) and positions (m, 2) within `reach` in x or y, whichever gives fewer."""
    low, high = np.minimum(far, near) - reach, np.maximum(far, near) + reach
    axis = int(np.argmin(np.nansum(high - low, axis=0)))
    order = np.argsort(place[:, axis], kind="stable")
    # Positions of NaN come last, and are in no pair.
    first, last = (np.searchsorted(place[order, axis], bound[:, axis]) for bound in (low, high))
    count = np.where(np.isnan(low + high).any(axis=1), 0, np.maximum(last - first, 0))
    mine = np.repeat(np.arange(len(far)), count)
    step = np.arange(len(mine)) - np.repeat(np.cumsum(count) - count, count)
    return mine, order[np.repeat(first, count) + step]


def _rays(camera: Intrinsics, xy: Floats) -> Floats:
    """Return (n, 2) x and y at unit depth of the rays through pixels (n, 2)."""
    rays = (xy - camera.principal_point) / camera.focal
    return camera.undistort(rays) if camera.is_distorted else rays
