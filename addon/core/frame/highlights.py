"""What was clipped in the frames of a clip, made as bright as it was: one light source is as bright in every
frame.

What one frame's rim tells of a light source depends on how the light source lies on the pixels. So a light
source is looked for in other frames, along its epipolar line, and what they tell is averaged, a frame's
weight falling linearly with its distance in time: then nothing flickers. The same frames are used as for
hidden colours, and remembered.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Floats, LinearRGBA
from ..base.lru_cache import LRUCache
from ..base.options import option
from ..camera.reconstruction import Image, Intrinsics, Reconstruction
from ..depth.view_selection import every_nth, relative_pose, stride
from ..media.clip import to_linear
from ..media.picture_file import Pixels
from ..warp.highlights import Highlight, colour_of, highlights

STEP, LEAST_FRAMES = 8, 8
"""Every so many-th registered frame is a source, of a short clip more, as for hidden colours
(`FillOptions`)."""
SPAN = 16
"""Registered frames before and after, up to which frames are sources. By eye."""
KEPT = 64 << 20
"""Bytes of frames' highlights that are kept: at 1920x1080 those of about as many frames as are sources."""
OBJECT = 200
"""Bytes of an array beside its values, about."""
NEAREST = 1.2
"""Of the largest inverse depth of a frame's features, what a light source may have. By eye."""
MOST_PARALLAX = 0.05
"""Of the long side, that a light source may move by, besides by the camera's turn, where no feature tells
depth."""
BESIDE = 0.004
"""Of the long side, that a light source may be beside its epipolar line: 2.6 of 640 pixels. By eye."""
ALIKE = 1.1
"""Logarithm of the ratio of two blobs' areas that may be one light source: a factor of three. By eye."""
UNLIKE = 4.0
"""Pixels beside the line that count as much as a ratio of areas of e. By eye."""

MOST_GAIN = 1000.0
"""Of the light that clipping took: a hundred times what was ever missing. By eye."""


@dataclass(frozen=True)
class HighlightSettings:
    """What the user asks of clipped highlights."""

    gain: float = option(
        1.0, "Highlights",
        "How much of the light that clipping took from point lights and reflections is given back, so that"
        " they become bright discs: 1 is all that is estimated, 0 leaves the clip as it is. Float pictures"
        " keep what they have",
        name="highlights", least=0.0, most=MOST_GAIN, soft_most=4.0, words={"off": 0.0}, precision=2,
    )  # fmt: skip
    """Of the light that clipping took, how much is given back; 0 leaves pictures as they are."""
    threshold: float = option(
        0.97, "Clipping Threshold",
        "Linear light, 1 being white, from which on a pixel of the clip counts as clipped. Lower it for a"
        " clip whose highlights were recorded as grey",
        name="highlight_threshold", least=0.1, most=1.0,
    )  # fmt: skip
    """Linear light, 1 being white, from which on a pixel of a picture of integers counts as clipped."""


RESTORED = HighlightSettings()
"""What is done by default."""


class ClipHighlights:
    """The highlights of a clip's frames, at one threshold."""

    def __init__(
        self, reconstruction: Reconstruction, read: Callable[[int], Pixels], threshold: float
    ) -> None:
        """`read` gives a frame's picture as `Footage.read` does."""
        self._rec, self._read, self._threshold = reconstruction, read, threshold
        self._found = LRUCache[list[Highlight]](KEPT, _bytes)

    def restored(self, frame: int, picture: LinearRGBA, gain: float) -> LinearRGBA:
        """A frame's picture (H, W, 4), linear, with `gain` of the light that clipping took.

        Only clipped channels of clipped pixels become brighter. UserError where another frame cannot be read.
        Passes checkpoints.
        """
        own = self._highlights(frame, picture)
        if not own:
            return picture
        estimates = self._estimates(frame, own)
        result = picture.copy()
        for one, (evidence, rim) in zip(own, estimates, strict=True):
            (row, column), (height, width) = one.corner, one.clipped.shape
            patch = result[row : row + height, column : column + width, :3]
            lost = np.maximum(one.light(evidence, colour_of(rim)) - patch, 0)
            lost[~one.clipped] = 0
            lost[patch < self._threshold] = 0
            patch += np.float32(gain * one.weight) * lost
        return result

    def knows(self, frame: int) -> bool:
        """Whether the highlights of a frame, and of its source frames, are remembered."""
        here, _ = self._rec.image_at(frame)
        return frame in self._found and all(other.frame in self._found for other, _ in self._neighbours(here))

    def _neighbours(self, here: Image) -> list[tuple[Image, float]]:
        """The frames around one that tell of its highlights, and how much each counts, more than zero."""
        step = stride(self._rec, STEP, LEAST_FRAMES)
        around = [
            (other, 1 - abs(other.frame - here.frame) / (1 + SPAN * _pace(self._rec)))
            for other in every_nth(self._rec, here.frame, step, SPAN)
        ]
        return [(other, weight) for other, weight in around if weight > 0]

    def _highlights(self, frame: int, picture: LinearRGBA | None = None) -> list[Highlight]:
        def make() -> list[Highlight]:
            seen = to_linear(self._read(frame)) if picture is None else picture
            return highlights(seen, self._threshold)

        return self._found.get(frame, make)

    def _estimates(self, frame: int, own: list[Highlight]) -> list[tuple[Floats, Floats]]:
        """Evidence (r,) and light of the rim (3,) of a frame's highlights, from all source frames."""
        here, _ = self._rec.image_at(frame)
        sums = [(np.zeros_like(one.evidence), np.zeros(3), 0.0) for one in own]
        for other, weight in self._neighbours(here):
            for mine, match in self._matches(here, own, other, self._highlights(other.frame)):
                evidence, rim, total = sums[mine]
                sums[mine] = (
                    evidence + weight * match.evidence,
                    rim + weight * match.rim / match.rim.max(initial=1e-3),
                    total + weight,
                )  # fmt: skip
        found = []
        for one, (evidence, rim, total) in zip(own, sums, strict=True):
            # The more others tell, the less the frame itself counts: what it alone says flickers.
            share = 1 / (1 + total)
            whole = total + share
            found.append((
                (evidence + share * one.evidence) / whole,
                (rim + share * one.rim / one.rim.max(initial=1e-3)) / whole,
            ))  # fmt: skip
        return found

    def _matches(
        self, here: Image, own: list[Highlight], other: Image, theirs: list[Highlight]
    ) -> list[tuple[int, Highlight]]:
        """Which of a frame's highlights, by number, are which of another's: both each other's best."""
        if not theirs:
            return []
        camera, there = self._rec.intrinsics(here), self._rec.intrinsics(other)
        far, near = self._segments(here, _pixels(own, camera), other)
        place = _pixels(theirs, there)
        along = near - far
        length = np.maximum((along**2).sum(axis=1), 1e-12)
        share = np.einsum("mtc,mc->mt", place[None] - far[:, None], along) / length[:, None]
        closest = far[:, None] + np.clip(share, 0, 1)[..., None] * along[:, None]
        beside = np.linalg.norm(place[None] - closest, axis=2)
        area = np.log([one.area for one in own])[:, None] - np.log([one.area for one in theirs])[None]
        area += 2 * np.log(there.fx / camera.fx)
        cost = beside + UNLIKE * np.abs(area)
        reach = BESIDE * max(there.width, there.height)
        cost[~((beside <= reach) & (np.abs(area) <= ALIKE))] = np.inf
        best, back = cost.argmin(axis=1), cost.argmin(axis=0)
        return [
            (mine, theirs[best[mine]])
            for mine in range(len(own))
            if back[best[mine]] == mine and np.isfinite(cost[mine, best[mine]])
        ]

    def _segments(self, here: Image, xy: Floats, other: Image) -> tuple[Floats, Floats]:
        """Where another frame sees places (n, 2) of a frame if they are at infinity, and if they are as near
        as anything: (n, 2) each, in its pixels; NaN where that is behind it."""
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
        """Inverse depth that nothing in a frame is nearer than."""
        seen = here.points[here.points >= 0]
        if len(seen):
            depth = self._rec.points.xyz[seen] @ here.rotation[2] + here.translation[2]
            nearest = float(np.percentile(depth, 2))
            if nearest > 0:
                return NEAREST / nearest
        # From one place everything is seen where it was, however near.
        return (
            MOST_PARALLAX * max(camera.width, camera.height) / (camera.fx * baseline) if baseline > 0 else 0.0
        )


def _pixels(found: list[Highlight], camera: Intrinsics) -> Floats:
    """(n, 2) where a lens sees highlights, in its pixels."""
    return np.array([one.centre for one in found]) * [camera.width, camera.height]


def _rays(camera: Intrinsics, xy: Floats) -> Floats:
    """(n, 2) x and y at unit depth of what a lens sees at pixels (n, 2)."""
    rays = (xy - camera.principal_point) / camera.focal
    return camera.undistort(rays) if camera.is_distorted else rays


def _pace(reconstruction: Reconstruction) -> float:
    """Frames from one registered frame to the next."""
    frames = reconstruction.frames
    return float(frames[-1] - frames[0]) / max(len(frames) - 1, 1)


def _bytes(found: list[Highlight]) -> int:
    parts = [(one.coverage, one.ground, one.clipped, one.likelihood) for one in found]
    return 1 + sum(array.nbytes + OBJECT for arrays in parts for array in arrays)
